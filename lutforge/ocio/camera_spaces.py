"""The colour spaces of a camera: its RAW, and its JPEGs per style and white balance.

RAW → JPEG is the render of the profile, JPEG → RAW its inverse, and one JPEG space → another a refinish (thesis,
equation 6.1).
"""

from collections.abc import Mapping, Sequence

import numpy as np
import PyOpenColorIO as OCIO  # noqa: N814 - the name that its documentation uses

from lutforge.arrays import Array
from lutforge.luts.ocio_transforms import matrix_transform
from lutforge.model.provenance import ReferenceRaw, ResponseOnly
from lutforge.ocio.cameras import Camera, file_stem
from lutforge.ocio.renderings import Rendering


def file_transform(name: str) -> OCIO.FileTransform:
    """A LUT file of the config."""
    return OCIO.FileTransform(src=name, interpolation=OCIO.INTERP_BEST)


class EqualityGroups:
    """The equality groups of a config: colour spaces with equal conversions, between which programs convert nothing.

    A group bears the alias of its first colour space.
    """

    def __init__(self) -> None:
        self._names: dict[tuple[str, bytes], str] = {}

    def of(self, space: str, files: str, to_reference: Array) -> str:
        """The group of a colour space, which the LUT files and the matrix (3, 3) of its conversion decide."""
        return self._names.setdefault((files, to_reference.tobytes()), file_stem(space))


def add_raw(config: OCIO.Config, camera: Camera, groups: EqualityGroups) -> None:
    """Add the camera's RAW before white balance, and after each."""
    for balance in (None, *camera.profile.white_balances):
        name = camera.raw(balance)
        matrix = camera.to_reference(balance)
        of_jpegs = isinstance(camera.profile.provenance, ReferenceRaw | ResponseOnly)
        kind = "values of the JPEGs" if of_jpegs else "RAW"
        description = f"Linear {kind} of the {camera.profile.camera}, black 0, saturation 1, "
        if balance is None:
            description += f"before white balance. Neutral in the reference under {camera.reference_balance}"
        else:
            setting = camera.profile.white_balances[balance]
            kelvin = f", about {setting.kelvin:.0f} K" if setting.kelvin is not None else ""
            r, g, b = setting.multipliers
            description += f"after white balance {balance}{kelvin}: multipliers {r:.4f}, {g:.4f}, {b:.4f}"
        group = groups.of(name, "", matrix)
        properties = {"equalityGroup": group, "toReference": matrix_transform(matrix)}
        config.addColorSpace(_space_of_files(name, camera.family, description, "scene-linear", properties))


def _space_of_files(
    name: str, family: str, description: str, encoding: str, properties: Mapping[str, object]
) -> OCIO.ColorSpace:
    """A colour space of pictures in files. properties: more arguments of OpenColorIO's ColorSpace, by their names."""
    return OCIO.ColorSpace(
        name=name, aliases=[file_stem(name)], family=family, encoding=encoding, categories=["file-io", "texture"],
        description=description, bitDepth=OCIO.BIT_DEPTH_F32, **properties,
    )  # fmt: skip


def jpeg_to_reference(rendering: Rendering, balance: str) -> OCIO.GroupTransform:
    """JPEG → ACES2065-1."""
    matrix = rendering.camera.to_reference(balance)
    return OCIO.GroupTransform([file_transform(rendering.file("linearize")), matrix_transform(matrix)])


def reference_to_jpeg(rendering: Rendering, balance: str) -> OCIO.GroupTransform:
    """ACES2065-1 → JPEG."""
    to_raw = np.asarray(np.linalg.inv(rendering.camera.to_reference(balance)), dtype=np.float64)
    return OCIO.GroupTransform([matrix_transform(to_raw), file_transform(rendering.file("render"))])


DESCRIBED_ERRORS = ("render_mean", "render_max", "render_de00_mean", "linearize_mean", "linearize_max")
"""The held-out errors of a style that the description of a colour space states."""


def add_jpegs(config: OCIO.Config, rendering: Rendering, groups: EqualityGroups, errors: Sequence[str]) -> None:
    """Add the JPEGs of a rendering under each white balance. errors: lines on the errors of its LUTs."""
    camera = rendering.camera
    style = camera.profile.styles[rendering.style]
    named = {name.replace("de00_mean", "mean_CIEDE2000").replace("_", " "): name for name in DESCRIBED_ERRORS}
    held_out = "; ".join(f"{words} {style.errors[name]:.3g}" for words, name in named.items() if name in style.errors)
    for balance in rendering.white_balances:
        name = camera.jpeg(rendering.style, balance)
        setting = f"JPEG of the {camera.profile.camera}, picture style {rendering.style}, white balance {balance}"
        description = "\n".join((setting, f"held-out error of the profile: {held_out or 'not measured'}", *errors))
        properties: dict[str, object] = {"equalityGroup": groups.of(name, rendering.stem, camera.to_reference(balance))}
        if rendering.linearize is not None:
            properties["toReference"] = jpeg_to_reference(rendering, balance)
        if rendering.render is not None:
            properties["fromReference"] = reference_to_jpeg(rendering, balance)
        config.addColorSpace(_space_of_files(name, camera.family, description, "sdr-video", properties))
