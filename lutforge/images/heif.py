"""HEIF pictures (.heic, .heif, .hif) of cameras and phones, read by libheif: 8 to 12 bits a channel, upright.

pillow-heif, an optional package, brings libheif. A picture is decoded to RGB in its own encoding; nothing is converted.
"""

import importlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lutforge.boundary import MAX_SAMPLES, reading, require_file
from lutforge.errors import ImageError

HEIF_SUFFIXES = (".heic", ".heif", ".hif")


@dataclass(frozen=True, eq=False)
class Heif:
    """A decoded picture. codes: (h, w, 3), 0 … 65535 whatever the bits; exif: its TIFF structure; icc: the profile.

    exif and icc are empty where there are none. parts: how many pictures the file holds.
    """

    codes: NDArray[np.uint16]
    bits: int
    exif: bytes
    icc: bytes
    parts: int = 1

    @property
    def codes8(self) -> NDArray[np.uint8]:
        """The picture rounded to 8 bits."""
        return np.asarray((self.codes.astype(np.uint32) + 128) // 257, dtype=np.uint8)


def is_heif(path: Path) -> bool:
    """True where a file's suffix is one of HEIF."""
    return path.suffix.lower() in HEIF_SUFFIXES


def read_heif(path: Path) -> Heif:
    """Read the main picture of a file. Raises ImageError: pillow-heif is missing, the file is damaged or too large."""
    opened = _opened(path)
    with reading(path, "a HEIF picture", ImageError):
        width, height = opened.size
        if width * height * 3 > MAX_SAMPLES:
            raise ImageError(f"{path}: claims {width} x {height} pixels, more than is read at once")
        if not opened.mode.startswith("RGB"):
            raise ImageError(f"{path}: its colours are {opened.mode[:20]}, not RGB")
        pixels = np.asarray(opened)[..., :3]
        bits = int(opened.info.get("bit_depth", 8))
        if pixels.dtype == np.uint16:  # libheif puts values of fewer bits into the upper ones
            steps = 2**bits - 1
            wide = ((pixels >> (16 - bits)).astype(np.uint32) * 65535 + steps // 2) // steps
        else:
            wide = pixels.astype(np.uint32) * 257
        return Heif(
            np.ascontiguousarray(wide.astype(np.uint16)),
            bits,
            _exif_of(opened.info),
            bytes(opened.info.get("icc_profile") or b""),
            len(opened),
        )


@dataclass(frozen=True)
class HeifDescription:
    """The metadata of a picture, without its pixels.

    exif: its TIFF structure; primaries, transfer: code points of ITU-T H.273, 0 where the file states none.
    """

    exif: bytes
    xmp: bytes
    icc: bytes
    primaries: int
    transfer: int


def read_heif_description(path: Path) -> HeifDescription:
    """Read the metadata of a picture. Raises ImageError as `read_heif`."""
    info = _opened(path).info
    codes = info.get("nclx_profile") or {}
    return HeifDescription(
        _exif_of(info),
        bytes(info.get("xmp") or b""),
        bytes(info.get("icc_profile") or b""),
        int(codes.get("color_primaries", 0)),
        int(codes.get("transfer_characteristics", 0)),
    )


def _exif_of(info: dict[str, Any]) -> bytes:
    """The TIFF structure of EXIF in pillow-heif's information on a picture."""
    block = bytes(info.get("exif") or b"")
    return block[6:] if block.startswith(b"Exif\0\0") else block


def _opened(path: Path) -> Any:
    require_file(path, "an image", ImageError)
    try:
        package = importlib.import_module("pillow_heif")
    except ImportError:
        raise ImageError(f"{path}: HEIF pictures are read by libheif: pip install 'lutforge[heif]'") from None
    with reading(path, "a HEIF picture", ImageError):
        return package.open_heif(str(path), convert_hdr_to_8bit=False)
