"""Lumix bodies: the camera's own LUT, as REAL TIME LUT loads it, from V-Log or from a base style to the look."""

from functools import partial
from pathlib import Path

import numpy as np

from lutforge.colour.srgb import delta_e_2000
from lutforge.errors import SettingsError, alternatives
from lutforge.kits.kit import Kit, Look, setting_of
from lutforge.luts.bake import bake
from lutforge.luts.reading import read_lut
from lutforge.model.camera_profile import CameraProfile, match
from lutforge.model.transform import Transform

FILES = ((".vlt", 17), (".cube", 33))
"""What bodies read: the older ones the first alone."""


def lumix_kit(camera: CameraProfile | None = None, base: str = "") -> Kit:
    """The kit of V-Log; or on a base style, with the camera's own profile.

    Raises SettingsError, which lists the styles, on a style that the camera does not have.
    """
    if camera is not None and base.lower() not in camera.styles:
        raise SettingsError(
            f'{camera.camera}: unknown style "{base}" for --base; {alternatives(base, sorted(camera.styles))}'
        )
    tried = "not run; the .vlt by a second parser"
    return Kit("lumix", "Lumix bodies", "any", tried, partial(_write, camera, base.lower()))


def _write(camera: CameraProfile | None, base: str, look: Look, folder: Path) -> list[str]:
    """Write a .vlt and a .cube, and tell their error under each white balance of the camera."""
    name = look.file_name + (f" on {base}" if base else " from V-Log")
    paths = [folder / f"{name}{suffix}" for suffix, _ in FILES]
    function = look.between("vlog", "srgb")
    if camera is not None:
        function = over_base(camera, setting_of(camera, base), look)
    for path, (_, size) in zip(paths, FILES, strict=True):
        bake(function, path, size=size, title=look.title)
    body = "" if camera is None else f" of the {camera.camera}"
    steps = [
        f"Copy {paths[0].name} or, for bodies that read it, {paths[1].name} to the memory card{body}. Some bodies take "
        "names of eight letters only: rename it.",
        f"Menu → Photo Style → REAL TIME LUT → load it, with the base {base or 'V-Log'}.",
    ]
    if camera is None:
        return steps
    # What the files, read back, make of colours that the base style shows, against the model.
    balanced = np.random.default_rng(0).random((20_000, 3)) ** 2  # as many dark colours as light ones
    rows = []
    for white_balance in camera.white_balances:
        setting = f"{base}/{white_balance}"
        jpeg = np.clip(camera.render_balanced(setting)(balanced), 0.0, 1.0)
        wanted = over_base(camera, setting, look)(jpeg)
        figures = []
        for path in paths:
            error = delta_e_2000(read_lut(path)(jpeg), wanted)
            figures.append(f"{path.suffix} {error.mean():.2f}, {np.quantile(error, 0.99):.2f}")
        rows.append(f" {white_balance}: {'; '.join(figures)}")
    heading = "One LUT serves all white balances. Its error, ΔE00, mean and 99 %:"
    return [*steps, f"{heading}{'.'.join(rows)}."]


def over_base(camera: CameraProfile, base: str, look: Look) -> Transform:
    """A camera's JPEG of a base setting → a look, of this camera or another, under the same white balance."""
    white_balance = str(camera.selector(base).white_balance)
    known = white_balance in look.profile.white_balances
    target = f"{look.style}/{white_balance if known else look.white_balance}"
    return match(camera, base, look.profile, target, neutral_highlights=False)  # the same for all white balances
