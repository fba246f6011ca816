"""ICC profiles of pictures: which of them are sRGB, and the conversion of others to sRGB, by Little CMS."""

from functools import lru_cache
from io import BytesIO
from typing import Any

import numpy as np
import OpenImageIO as oiio  # noqa: N813 - the name that its documentation uses

from lutforge.arrays import Codes, Single


def to_srgb(codes: Codes, profile: bytes) -> Codes:
    """Convert 8-bit codes (h, w, 3) from an ICC profile's space, relative to white; colours outside sRGB clip.

    Codes stay as they are where the profile is sRGB's, or cannot be read.
    """
    if is_srgb(profile):
        return codes
    from PIL import Image, ImageCms  # imported here: only pictures with a profile need it

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


def pixels_to_srgb(pixels: Single, profile: bytes) -> Single:
    """Convert the pixels (h, w, 3) of an 8-bit picture, in [0, 1], as `to_srgb`."""
    codes = np.rint(pixels * np.float32(255)).astype(np.uint8)
    return np.divide(to_srgb(codes, profile), 255, dtype=np.float32)


def is_srgb(profile: bytes) -> bool:
    """True where the conversion to sRGB changes 8-bit codes by less than one, on average, or the profile is broken.

    The name of a profile does not show it: sRGB profiles have many names, and short ones have none.
    """
    return (mean_code_change(profile) or 0.0) < 1


@lru_cache(maxsize=64)
def mean_code_change(profile: bytes) -> float | None:
    """The mean change of 8-bit codes by the conversion from an ICC profile to sRGB; None for a broken profile."""
    from PIL import Image, ImageCms  # as above

    axis = np.arange(0, 256, 15, dtype=np.uint8)
    codes = np.stack(np.meshgrid(axis, axis, axis), axis=-1).reshape(1, -1, 3)
    try:
        converted = ImageCms.applyTransform(Image.fromarray(codes), _transform(profile))
    except ImageCms.PyCMSError:
        return None
    return float(np.abs(np.asarray(converted, dtype=np.float64) - codes).mean())


def profile_name(profile: bytes) -> str:
    """The description of an ICC profile in one line, "a space without a name" where it has none."""
    from PIL import ImageCms  # as above

    try:
        description = ImageCms.getProfileDescription(BytesIO(profile))
    except ImageCms.PyCMSError:
        description = ""
    return " ".join(description.split())[:80] or "a space without a name"


def _transform(profile: bytes) -> Any:
    """Little CMS's transform from a profile to sRGB, relative to white."""
    from PIL import ImageCms  # as above

    relative = ImageCms.Intent.RELATIVE_COLORIMETRIC
    return ImageCms.buildTransform(BytesIO(profile), ImageCms.createProfile("sRGB"), "RGB", "RGB", relative)
