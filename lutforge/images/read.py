"""Read an image file with OpenImageIO: pixels in the file's own encoding, and all of its metadata."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import OpenImageIO as oiio  # noqa: N813 - the name that its documentation uses
from numpy.typing import NDArray

from lutforge.errors import ImageError

MAX_SAMPLES = 1_200_000_000
"""Largest width × height × channels that is read (400 Mpixel of RGB); larger claims are not allocated."""

MAX_SIDE = 300_000
"""Longest side, in pixels, that is believed."""


@dataclass(frozen=True, eq=False)
class Image:
    """An image as it is stored: no colour conversion, no rotation, straight alpha left straight.

    pixels: (h, w, c) float32; integers are scaled to [0, 1], half and float are as they are.
    spec: everything else that the file says (EXIF, IPTC, XMP, ICC profile, orientation, bit depth).
    format: OpenImageIO's name of the format ("jpeg", "tiff", "openexr", …); "" for an image not from a file.
    parts: how many images the file holds; `pixels` is the first.
    """

    pixels: NDArray[np.float32]
    spec: oiio.ImageSpec
    format: str = ""
    parts: int = 1

    @property
    def alpha_is_premultiplied(self) -> bool:
        """True where the colours are already multiplied by an alpha channel."""
        return self.spec.alpha_channel >= 0 and not self.spec.get_int_attribute("oiio:UnassociatedAlpha", 0)


def read_image(path: str | Path) -> Image:
    """Read the first image of a file, pixels (h, w, c) float32, oriented as stored.

    Raises ImageError, in one line, for a file that is missing, empty, truncated, absurdly large, or no image.
    """
    path = Path(path)
    _check_file(path)
    config = oiio.ImageSpec()
    config.attribute("oiio:UnassociatedAlpha", 1)
    source = oiio.ImageInput.open(str(path), config)
    if source is None:
        raise ImageError(f"{path}: {_reason(oiio.geterror())}")
    try:
        spec = source.spec()
        _check_size(path, spec)
        pixels = source.read_image(0, 0, 0, spec.nchannels, oiio.FLOAT)
        problem = source.geterror()
        name, parts = source.format_name(), 1
        while parts < 100 and source.seek_subimage(parts, 0):
            parts += 1
        source.geterror()
    finally:
        source.close()
    if pixels is None or problem:
        raise ImageError(f"{path}: damaged or cut short ({_reason(problem)}); copy the file again")
    array = np.ascontiguousarray(pixels, dtype=np.float32)
    return Image(array.reshape(spec.height, spec.width, spec.nchannels), spec, name, parts)


def _check_file(path: Path) -> None:
    try:
        if path.is_dir():
            raise ImageError(f"{path}: a folder, not an image")
        size = path.stat().st_size
        with path.open("rb") as file:
            file.read(1)
    except FileNotFoundError:
        raise ImageError(f"{path}: no such file") from None
    except (OSError, ValueError) as error:
        raise ImageError(f"{path}: cannot be opened ({getattr(error, 'strerror', None) or error})") from error
    if size == 0:
        raise ImageError(f"{path}: the file is empty")


def _check_size(path: Path, spec: oiio.ImageSpec) -> None:
    if spec.deep or spec.depth > 1:
        raise ImageError(f"{path}: a deep or volume image; flatten it first")
    if min(spec.width, spec.height, spec.nchannels) < 1:
        raise ImageError(f"{path}: the file claims {spec.width} x {spec.height} pixels")
    samples = spec.width * spec.height * spec.nchannels
    if samples > MAX_SAMPLES or max(spec.width, spec.height) > MAX_SIDE:
        raise ImageError(f"{path}: claims {spec.width} x {spec.height} x {spec.nchannels} values, more than is read")


def _reason(text: str) -> str:
    """An OpenImageIO message as part of one line."""
    line = " ".join(text.split()).rstrip(".")
    if "could not find a format reader" in line:
        return "not an image that OpenImageIO knows"
    return line or "unreadable"
