"""The kit of Lumix bodies: LUTs as REAL TIME LUT loads them, from V-Log or from a picture style to a look."""

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

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
    "": "VLOG",
    "v-log": "VLOG",
    "standard": "STD",
    "cinelike v2": "CINEV2",
    "cinelike d2": "CINED2",
}
"""The words by which files name the picture style that a LUT is for, as far as public files show them."""

MOST_LETTERS = 8
"""Most letters in the name of a file on the memory card."""


def lumix_kit(camera: CameraProfile | None = None, base: str = "") -> Kit:
    """The kit of LUTs for V-Log, or for a base style of a camera. Raises SettingsError on an unknown style."""
    base = base.lower()
    if camera is not None and base not in camera.styles:
        raise SettingsError(
            f'{camera.camera}: unknown style "{base}" for --base; {alternatives(base, sorted(camera.styles))}'
        )

    def write(look: Look, folder: Path) -> KitFiles:
        """Write a .vlt and a .cube, with their errors: on a base style, under each white balance of the camera."""
        name = card_name(look, {path.stem for path in folder.iterdir()})
        steps = [
            f"Copy {name}.vlt or, for bodies that read it, {name}.cube to the memory card"
            f"{'' if camera is None else f' of the {camera.camera}'}: {look.title}, from {base or 'V-Log'}.",
            f"Menu → Photo Style → REAL TIME LUT → load it, with the base {base or 'V-Log'}.",
        ]
        if base not in PHOTO_STYLES:
            steps.append(
                f"The files do not name their base, since no public file shows how {base} is named in them: see that "
                "the body takes it, and not V-Log."
            )

        if camera is None:
            stated = InputAndOutput(input_and_output_of("render", "vlog").input, ENCODED)
            model = look.seen_from("vlog")
            x = colours_of("vlog", model)
        else:
            stated = InputAndOutput(ENCODED, ENCODED)
            model = over_base(camera, setting_of(camera, base), look)
            x = colours_of_style(camera, setting_of(camera, base))
        errors = {}
        for suffix, size in FILES:
            path = folder / f"{name}{suffix}"
            lut = described(look, baked(model, path, size), stated)
            if base in PHOTO_STYLES:
                lut = replace(lut, metadata=LutMetadata(photo_style=PHOTO_STYLES[base]))
            lut.write(path)
            errors[path.name] = error_of(path, x, model)
        if camera is None:
            return KitFiles(steps, errors)

        rows = []
        for white_balance in camera.white_balances:
            setting = f"{base}/{white_balance}"
            x = colours_of_style(camera, setting)
            exact = over_base(camera, setting, look)(x)
            figures = []
            for suffix, _ in FILES:
                difference = delta_e_2000(read_lut(folder / f"{name}{suffix}")(x), exact)
                figures.append(f"{suffix} {difference.mean():.2f}, {np.quantile(difference, 0.99):.2f}")
            rows.append(f" {white_balance}: {'; '.join(figures)}")
        heading = "One LUT serves all white balances. Its error, ΔE00, mean and 99 %:"
        return KitFiles([*steps, f"{heading}{'.'.join(rows)}."], errors)

    return Kit("lumix", "Lumix bodies", "any", "not run; the .vlt by a second parser", write)


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
