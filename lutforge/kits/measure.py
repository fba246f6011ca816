"""The errors of a kit's files: each is read back, and compared with the look on colours such as its program has."""

from pathlib import Path

import numpy as np
import PyOpenColorIO as OCIO  # noqa: N814 - the name that its documentation uses

from lutforge.arrays import Array
from lutforge.colour.rgb_spaces import matrix_between, rgb_space
from lutforge.interpolation import Interpolation
from lutforge.kits.dcp import read_dcp
from lutforge.kits.icc import read_icc, scene_linear
from lutforge.kits.kit import Look
from lutforge.luts.ocio_transforms import evaluate
from lutforge.luts.reading import has_own_reader, read_lut, trusted_processor
from lutforge.luts.verification import FileError, compare
from lutforge.model.camera_profile import through_camera
from lutforge.model.transform import Transform
from lutforge.ocio.cameras import name_cameras
from lutforge.ocio.check import load_config
from lutforge.sobol import sobol

LOWEST = -0.1
"""The lowest scene-linear value of the comparison, such as colours outside a gamut have in a channel."""
HIGHEST = 4.0
"""The highest scene-linear value of the comparison, two stops above white."""


def error_of_profile(path: Path, look: Look, colours: bool = False) -> FileError:
    """The error of a camera profile (.icc, .dcp) after white balance. colours: the profile has no tone curve."""
    x = np.random.default_rng(0).random((1 << 14, 3))
    written = read_dcp(path)(x) if path.suffix.lower() == ".dcp" else read_icc(path)(x)
    exact = rgb_space("srgb").encode(scene_linear(look)(x)) if colours else look.render(x)
    return compare(x, written.astype(np.float32), np.clip(exact, 0.0, 1.0))


def error_of_lut(
    path: Path, jpeg: Transform, source: str, target: str = "srgb", interpolation: Interpolation = "tetrahedral"
) -> FileError:
    """The error of a LUT from colours of a space to those of the camera's JPEG in another.

    jpeg: the model, from the first space to encoded sRGB, in which the two are compared.
    """
    x = colours_of(source, jpeg)
    if not has_own_reader(path):
        y = evaluate(trusted_processor(path, interpolation), x).astype(np.float64)
    else:
        y = read_lut(path)(x)
    if target != "srgb":
        space = rgb_space(target)
        linear = space.linearize(y) @ matrix_between(space.linear.name, "linear-srgb").T
        y = rgb_space("srgb").encode(np.clip(linear, 0.0, 1.0))
    return compare(x, np.clip(y, 0.0, 1.0).astype(np.float32), jpeg(x))


def error_of_view(path: Path, look: Look, display: str) -> FileError:
    """The error of a style's view in an OpenColorIO config, on scene-linear colours (ACEScg) with its display."""
    (camera,) = name_cameras([look.profile])
    jpeg = through_camera(look.profile, f"{look.style}/{camera.reference_balance}", "acescg")
    x = colours_of("acescg", jpeg)

    # The camera's RAW has the same name in every config, while some configs have no space for ACEScg.
    to_raw = np.linalg.inv(camera.to_reference(None)) @ matrix_between("acescg", "aces2065-1")
    shown = np.ascontiguousarray(x @ to_raw.T, dtype=np.float32)
    view = (display, f"{camera.name} {camera.styles[look.style]}", OCIO.TRANSFORM_DIR_FORWARD)
    load_config(path).getProcessor(camera.raw(), *view).getDefaultCPUProcessor().applyRGB(shown)
    return compare(x, np.clip(shown, 0.0, 1.0), jpeg(x))


def colours_of(source: str, jpeg: Transform) -> Array:
    """Colours (n, 3) of a space: all over it, greys, and one channel at a time.

    Those of a linear space reach from below black to values that the camera clips.
    """
    low, high = (LOWEST, max(HIGHEST, jpeg.highest())) if rgb_space(source).is_linear else (0.0, 1.0)
    # Half of the colours are dark, as in photographs.
    spread = np.concatenate([sobol(1 << 14), sobol(1 << 14, seed=2) ** 3])
    ramp = np.linspace(0.0, 1.0, 513)[:, None]
    single = np.concatenate([ramp * np.eye(3)[channel] for channel in range(3)])
    black = -low / (high - low)
    single = np.where(single > 0, single, black)
    return low + (high - low) * np.concatenate([spread, np.repeat(ramp, 3, axis=1), single])
