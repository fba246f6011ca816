"""Pictures that a program developed from RAW files: a calibration can use them in place of the RAW."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lutforge.arrays import Single
from lutforge.colour.rgb_spaces import rgb_space
from lutforge.errors import ShotError
from lutforge.images.read import read_image


@dataclass(frozen=True, eq=False)
class Development:
    """A white-balanced picture in any of the four orientations: linear RGB (h, w, 3) in a space's primaries.

    space: of `lutforge.colour.rgb_spaces`, in which the picture was encoded. developer: the source of the picture, in
    words.
    """

    pixels: Single
    space: str
    developer: str


def read_developed(path: Path, space: str) -> Development:
    """Read a picture that any program developed: 16-bit TIFF or EXR, encoded in `space`."""
    encoding = rgb_space(space)
    pixels = read_image(path).pixels
    if pixels.ndim != 3 or pixels.shape[2] < 3:
        raise ShotError(f"{path}: its development is not a colour picture")
    linear = encoding.linearize(pixels[..., :3]).astype(np.float32)
    return Development(linear, encoding.name, f"pictures in {encoding.name}")
