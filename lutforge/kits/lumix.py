"""The kit of Lumix bodies: LUTs as REAL TIME LUT loads them, from V-Log or from a picture style to a look."""

import re
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from lutforge.arrays import ColourFunction
from lutforge.colour.srgb import delta_e_2000
from lutforge.errors import SettingsError, alternatives
from lutforge.kits.kit import Kit, KitFiles, Look, setting_of
from lutforge.kits.luts import baked, described
from lutforge.kits.measure import colours_of
from lutforge.luts.input_and_output import ENCODED, InputAndOutput, input_and_output_of
from lutforge.luts.lut_metadata import LutMetadata
from lutforge.luts.reading import read_lut
from lutforge.luts.verification import FileError, compare
from lutforge.model.camera_profile import CameraProfile, match
from lutforge.model.transform import Transform

FILES = ((".vlt", 17), (".cube", 33))
"""Suffixes and nodes per axis of the files that bodies read; older bodies read only the first."""

PHOTO_STYLES = {
    "v-log": "VLOG",
    "standard": "STD",
    "cinelike v2": "CINEV2",
    "cinelike d2": "CINED2",
}
"""The words by which files name the picture style that a LUT is for, as far as public files show them."""

MOST_LETTERS = 8
"""Most letters in the name of a file on the memory card."""


def v_log_kit() -> Kit:
    """The kit of LUTs that a body applies after V-Log."""
    return _kit(_write_after_v_log)


def base_style_kit(camera: CameraProfile, base: str) -> Kit:
    """The kit of LUTs that a body applies after one of its styles, the base. Raises SettingsError on an unknown one."""
    base = base.lower()
    if base not in camera.styles:
        raise SettingsError(
            f'{camera.camera}: unknown style "{base}" for --base; {alternatives(base, sorted(camera.styles))}'
        )
    return _kit(partial(_write_after_style, camera, base))


def _kit(write: Callable[[Look, Path], KitFiles]) -> Kit:
    return Kit("lumix", "Lumix bodies", "any", "not run; the .vlt by a second parser", write)


def _write_after_v_log(look: Look, folder: Path) -> KitFiles:
    """Write a .vlt and a .cube from V-Log to a look, with their errors."""
    name = card_name(look, {path.stem for path in folder.iterdir()})
    stated = InputAndOutput(input_and_output_of("render", "vlog").input, ENCODED)
    model = look.seen_from("vlog")
    luts = _write_luts(look, model, stated, folder, name, PHOTO_STYLES["v-log"])
    x = colours_of("vlog", model)
    errors = {path.name: error_of(path, x, model) for path in luts}
    return KitFiles(_steps(look, name, "V-Log", ""), errors)


def _write_after_style(camera: CameraProfile, base: str, look: Look, folder: Path) -> KitFiles:
    """Write a .vlt and a .cube from a base style to a look, with their errors under each white balance."""
    name = card_name(look, {path.stem for path in folder.iterdir()})
    setting = setting_of(camera, base)
    model = over_base(camera, setting, look)
    luts = _write_luts(look, model, InputAndOutput(ENCODED, ENCODED), folder, name, PHOTO_STYLES.get(base))
    x = colours_of_style(camera, setting)
    errors = {path.name: error_of(path, x, model) for path in luts}

    steps = _steps(look, name, base, f" of the {camera.camera}")
    if base not in PHOTO_STYLES:
        steps.append(
            f"The files do not name their base, since no public file shows how {base} is named in them: see that the "
            "body takes it, and not V-Log."
        )
    figures = ".".join(
        f" {balance}: {_errors_under(camera, f'{base}/{balance}', look, luts)}" for balance in camera.white_balances
    )
    steps.append(f"One LUT serves all white balances. Its error, ΔE00, mean and 99 %:{figures}.")
    return KitFiles(steps, errors)


def _steps(look: Look, name: str, base: str, of_camera: str) -> list[str]:
    """The steps of the user with the files of a look. of_camera: " of the CAMERA" of the memory card, or ""."""
    return [
        f"Copy {name}.vlt or, for bodies that read it, {name}.cube to the memory card{of_camera}: {look.title}, from "
        f"{base}.",
        f"Menu → Photo Style → REAL TIME LUT → load it, with the base {base}.",
    ]


def _write_luts(
    look: Look, model: ColourFunction, stated: InputAndOutput, folder: Path, name: str, photo_style: str | None
) -> list[Path]:
    """Write the LUT files of a model; return their paths. photo_style: the word for the base in files, if known."""
    paths = []
    for suffix, size in FILES:
        path = folder / f"{name}{suffix}"
        lut = described(look, baked(model, path, size), stated)
        replace(lut, metadata=LutMetadata(photo_style=photo_style)).write(path)
        paths.append(path)
    return paths


def _errors_under(camera: CameraProfile, setting: str, look: Look, luts: Sequence[Path]) -> str:
    """The errors of LUT files on JPEGs of a base setting, in words."""
    x = colours_of_style(camera, setting)
    exact = over_base(camera, setting, look)(x)
    figures = []
    for path in luts:
        difference = delta_e_2000(read_lut(path)(x), exact)
        figures.append(f"{path.suffix} {difference.mean():.2f}, {np.quantile(difference, 0.99):.2f}")
    return "; ".join(figures)


def card_name(look: Look, taken: set[str]) -> str:
    """A new name of at most eight letters and digits for a look. taken: names in use."""
    words = re.findall(r"[a-z0-9]+", look.style.lower()) or ["look"]
    name = "".join(words)[:MOST_LETTERS].upper()
    number = 1
    while name in taken:
        number += 1
        name = f"{name[: MOST_LETTERS - len(str(number))]}{number}"
    return name


def colours_of_style(camera: CameraProfile, setting: str) -> np.ndarray:
    """Colours (n, 3) of JPEGs of a setting, rendered from balanced RAW with many dark colours."""
    balanced = np.random.default_rng(0).random((20_000, 3)) ** 2
    return np.clip(camera.render_balanced(setting)(balanced), 0.0, 1.0)


def error_of(path: Path, x: np.ndarray, model: Callable[[np.ndarray], np.ndarray]) -> FileError:
    """The error of a file against a model, read back, on colours (n, 3)."""
    return compare(x, read_lut(path)(x).astype(np.float32), model(x))


def over_base(camera: CameraProfile, base: str, look: Look) -> Transform:
    """A camera's JPEG of a base setting → a look, of this camera or another, under the same white balance."""
    white_balance = str(camera.selector(base).white_balance)
    is_shared = white_balance in look.profile.white_balances
    target = f"{look.style}/{white_balance if is_shared else look.white_balance}"
    # One LUT serves all white balances, so highlights are not made neutral under one of them.
    return match(camera, base, look.profile, target, neutral_highlights=False)
