"""ICC profiles of pictures: which are sRGB, and the way to sRGB through the others, by LittleCMS."""

from functools import lru_cache
from io import BytesIO
from typing import Any

import numpy as np
import OpenImageIO as oiio  # noqa: N813 - the name that its documentation uses

from lutforge.arrays import Codes, Pixels


def to_srgb(codes: Codes, profile: bytes) -> Codes:
    """Convert 8-bit codes (h, w, 3) from an ICC profile's space, relative to white; colours outside sRGB clip.

    Codes stay as they are where the profile is sRGB's, or cannot be read.
    """
    if is_srgb(profile):
        return codes
    from PIL import Image, ImageCms  # for pictures with a profile alone

    return np.array(ImageCms.applyTransform(Image.fromarray(codes), _transform(profile)), dtype=np.uint8)


def foreign_profile(spec: oiio.ImageSpec) -> bytes:
    """The ICC profile of a picture of three 8-bit channels in another space than sRGB; empty for all other images."""
    profile = stored_profile(spec)
    eight_bits = spec.nchannels == 3 and str(spec.format) == "uint8"
    return profile if eight_bits and profile and not is_srgb(profile) else b""


def stored_profile(spec: oiio.ImageSpec) -> bytes:
    """The bytes of a picture's ICC profile; empty where it has none, or something else under that name."""
    profile = spec.getattribute("ICCProfile")
    return profile.tobytes() if isinstance(profile, np.ndarray) and profile.dtype == np.uint8 else b""


def pixels_to_srgb(pixels: Pixels, profile: bytes) -> Pixels:
    """Convert the pixels (h, w, 3) of an 8-bit picture, in [0, 1], as `to_srgb`."""
    codes = np.rint(pixels * np.float32(255)).astype(np.uint8)
    return np.divide(to_srgb(codes, profile), 255, dtype=np.float32)


def is_srgb(profile: bytes) -> bool:
    """True where an ICC profile moves 8-bit codes by less than one on their way to sRGB, in the mean, or is broken.

    Its name does not tell: sRGB has many, and programs that save space give none.
    """
    return (codes_moved(profile) or 0.0) < 1


@lru_cache(maxsize=64)
def codes_moved(profile: bytes) -> float | None:
    """How many codes of 255 an ICC profile moves colours by on their way to sRGB, in the mean; None of a broken one."""
    from PIL import Image, ImageCms  # as above

    axis = np.arange(0, 256, 15, dtype=np.uint8)
    codes = np.stack(np.meshgrid(axis, axis, axis), axis=-1).reshape(1, -1, 3)
    try:
        moved = ImageCms.applyTransform(Image.fromarray(codes), _transform(profile))
    except ImageCms.PyCMSError:
        return None
    return float(np.abs(np.asarray(moved, dtype=np.float64) - codes).mean())


def profile_name(profile: bytes) -> str:
    """The description of an ICC profile in one line, "a space without a name" where it has none."""
    from PIL import ImageCms  # as above

    try:
        told = ImageCms.getProfileDescription(BytesIO(profile))
    except ImageCms.PyCMSError:
        told = ""
    return " ".join(told.split())[:80] or "a space without a name"


def _transform(profile: bytes) -> Any:
    from PIL import ImageCms  # as above

    relative = ImageCms.Intent.RELATIVE_COLORIMETRIC
    return ImageCms.buildTransform(BytesIO(profile), ImageCms.createProfile("sRGB"), "RGB", "RGB", relative)
