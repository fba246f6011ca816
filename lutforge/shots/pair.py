"""Pair two renderings of one frame as a shot: a developed picture, used instead of RAW, and the finished picture."""

import math
from pathlib import Path

import numpy as np

from lutforge.images.development import Development
from lutforge.images.raw import RawImage
from lutforge.images.read import read_image
from lutforge.shots.align import register_rotated
from lutforge.shots.metadata import read_metadata
from lutforge.shots.shot import Shot


def read_pair(picture: Path, development: Development) -> Shot:
    """Register a finished picture (sRGB) on a developed one, which stands in the place of the RAW.

    Raises ImageError where the picture cannot be read, ShotError where the two do not match.
    """
    ones = np.ones(3)
    left = RawImage(
        pixels=development.pixels,
        pixel_size=1.0,
        flip=0,
        multipliers=ones,
        preview=None,
        preview_note="a developed picture",
        exposure_s=math.nan,
        iso=math.nan,
        clip_level=ones,
    )
    codes = np.rint(np.clip(read_image(picture).pixels[..., :3], 0.0, 1.0) * 255).astype(np.uint8)
    turned, registration = register_rotated(left, codes)
    metadata = read_metadata(picture, left, None)
    return Shot(picture.stem, picture, left, turned, str(picture), metadata, registration, development).straightened()
