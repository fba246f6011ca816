"""The kinds of files that use cases tell apart, by their suffixes in lower case."""

from pathlib import Path

from lutforge.images.heif import HEIF_SUFFIXES
from lutforge.shots.discover import RAW_SUFFIXES

PROFILE_SUFFIXES = (".npz",)
TABLE_SUFFIXES = (".csv", ".npz")
"""Sample tables. A .npz is a table or a profile: its content says which."""
CONFIG_SUFFIXES = (".ocio", ".ocioz")
ICC_SUFFIXES = (".icc", ".icm")
CAMERA_PROFILE_SUFFIXES = (".dcp", *ICC_SUFFIXES)
PICTURE_SUFFIXES = frozenset(
    {".jpg", ".jpeg", ".jpe", ".png", ".tif", ".tiff", ".exr", ".webp", ".jp2", *HEIF_SUFFIXES}
)
"""Finished pictures that are inspected, and that a folder of a bracket holds."""
PHOTOGRAPH_SUFFIXES = (".jpg", ".jpeg", ".png", ".tif", ".tiff", *HEIF_SUFFIXES, *sorted(RAW_SUFFIXES))
"""Photographs that can be shown, finished or RAW; of several files of one photograph the first is shown."""
PAIRED_SUFFIXES = (".tif", ".tiff", ".exr", ".png", ".jpg", ".jpeg")
"""Pictures that are paired by their names, the preferred one first."""


def is_profile(path: Path) -> bool:
    """True of a profile, and of a sample table: the profile's reader then reports that it is none."""
    return path.suffix.lower() in TABLE_SUFFIXES


def is_config(path: Path) -> bool:
    """True of an OpenColorIO config."""
    return path.suffix.lower() in CONFIG_SUFFIXES


def is_lut_picture(path: Path) -> bool:
    """True of a picture that is a LUT by its size and content, such as a Hald image."""
    from lutforge.luts.picture import SUFFIXES, is_picture_of_lut  # imported here: few files need it

    return path.suffix.lower() in SUFFIXES and is_picture_of_lut(path)
