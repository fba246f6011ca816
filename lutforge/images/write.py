"""Image files, written by OpenImageIO with the metadata of their source, atomically."""

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import OpenImageIO as oiio  # noqa: N813 - the name that its documentation uses
from numpy.typing import ArrayLike, NDArray

from lutforge.arrays import Single
from lutforge.atomic_write import atomic_path
from lutforge.errors import ImageError
from lutforge.images.jpeg import metadata_end
from lutforge.images.orientation import upright
from lutforge.images.output_spec import create_output, describe_output, format_of, keeps_orientation, with_shape
from lutforge.images.packet_writer import add_packets
from lutforge.images.read import Image, ImageReader, Region

_REPORT_FAILURES = frozenset({"openexr", "dpx", "hdr", "pnm", "jpegxl"})
"""Formats, by OpenImageIO's names, whose writers report every failed write."""
_NOT_SAFE_ON_DISK = frozenset({"jpeg", "webp"})
"""Formats whose writers end the program, or never end, on a full disk."""


def write_image(path: str | Path, pixels: ArrayLike, spec_like: Image, note: str | None = None) -> None:
    """Write `pixels` (h, w, c) with the metadata of `spec_like`, atomically; the suffix picks the format.

    Pixels are in the encoding of the file: integers from [0, 1] (clipped), half and float as they are. The bit depth is
    the source's if the format has it, else the one that loses least. A JPEG from a JPEG has the quality and the chroma
    subsampling of its source, any other JPEG quality 97 and no subsampling. EXIF, IPTC, XMP, ICC profile and
    orientation are kept, thumbnails are dropped. note: on what was done, for Software and ImageHistory. Raises
    ImageError.
    """
    path = Path(path)
    array = np.ascontiguousarray(pixels, dtype=np.float32)
    if array.ndim != 3 or array.shape[2] < 1 or array.size == 0:
        raise ImageError(f"{path}: an image has shape (height, width, channels), not {array.shape}")
    spec = with_shape(spec_like.spec, array.shape)
    orientation = spec.get_int_attribute("Orientation", 1)
    if orientation != 1 and not keeps_orientation(path):
        array = upright(array, orientation)
        spec = with_shape(spec, array.shape)
        spec.attribute("Orientation", 1)
    with image_writer(path, describe_output(path, spec, spec_like.format, note)) as writer:
        writer.write(Region(0, 0, array.shape[1], array.shape[0]), array)


@dataclass(frozen=True, eq=False)
class ImageWriter:
    """An open output, written region by region from top to bottom. spec: the description of the file."""

    path: Path
    spec: oiio.ImageSpec
    target: oiio.ImageOutput

    @property
    def tiled(self) -> bool:
        """True where the file is made of the source's tiles and takes regions of whole tiles, not only whole rows."""
        return bool(self.spec.tile_width > 0)

    def write(self, region: Region, pixels: Single | NDArray[np.uint16]) -> None:
        """Write the pixels (h, w, c) of a region, floats or codes of 16 bits. Raises ImageError."""
        spec = self.spec
        top, bottom = spec.y + region.top, spec.y + region.bottom
        if region == Region(0, 0, spec.width, spec.height):
            written = self.target.write_image(pixels)
        elif self.tiled:
            left, right = spec.x + region.left, spec.x + region.right
            written = self.target.write_tiles(left, right, top, bottom, spec.z, spec.z + 1, pixels)
        else:
            written = self.target.write_scanlines(top, bottom, spec.z, pixels)
        if not written:
            raise _cut_short(self.path)


def _cut_short(path: Path) -> ImageError:
    """The error for a file that was not written as a whole."""
    return ImageError(f"{path}: it was not written as a whole; is the disk full?")


@contextmanager
def image_writer(
    path: Path, described: oiio.ImageSpec, start: bytes | None = None, xmp: bytes = b"", iptc: bytes = b""
) -> Iterator[ImageWriter]:
    """Open an output under a temporary name; the file appears, whole, when the block ends without an error.

    described: the description of the file, by `describe_output`. start: SOI and the metadata segments of a JPEG, in
    place of those that OpenImageIO writes. xmp, iptc: the source's packets; WebP and JPEG 2000 get EXIF here, too.
    """
    if xmp and format_of(path) == "openexr":
        described.attribute("xmp", xmp.decode("utf-8", "replace"))  # OpenEXR has attributes of any name
    with atomic_path(path) as temporary:
        with _opened(path, temporary, described, start) as writer:
            yield writer
        add_packets(temporary, format_of(path), described, xmp, iptc)


@contextmanager
def _opened(path: Path, temporary: Path, described: oiio.ImageSpec, start: bytes | None) -> Iterator[ImageWriter]:
    """Open OpenImageIO's writer of a file that becomes `temporary`."""
    with _safe_place(path, temporary, described, start) as place:
        target = create_output(path)
        if not target.open(str(place), described):
            raise ImageError(f"{path}: {target.geterror() or 'cannot be written'}")
        try:
            yield ImageWriter(path, described, target)
        except BaseException:
            target.close()
            raise
        if not target.close():
            raise _cut_short(path)


@contextmanager
def _safe_place(path: Path, temporary: Path, spec: oiio.ImageSpec, start: bytes | None) -> Iterator[Path]:
    """Yield the path where OpenImageIO writes a file that becomes `temporary`, such that a full disk raises an error.

    Of OpenImageIO 3.2's writers, those of OpenEXR, DPX, Radiance, PNM and JPEG XL report a failed write. libjpeg ends
    the program, and libwebp tries forever: these two write into memory. The others lose data without an error (TIFF
    only its directory, which follows the pixels), so that their files are checked.
    """
    name = format_of(path)
    if name not in _NOT_SAFE_ON_DISK or not hasattr(os, "memfd_create"):
        yield temporary
        if start is not None:
            data = temporary.read_bytes()
            temporary.write_bytes(start + data[metadata_end(data) :])
        if name not in _REPORT_FAILURES and not _is_whole(temporary, name):
            raise _cut_short(path)
        return
    import resource  # imported here: Windows has none; Linux, which has memory files, has it

    limit = resource.getrlimit(resource.RLIMIT_FSIZE)[0]
    most = spec.width * spec.height * spec.nchannels * 2
    if limit != resource.RLIM_INFINITY and limit < most:
        raise ImageError(f"{path}: might get larger than the {limit} bytes that `ulimit -f` allows a file")
    handle = os.memfd_create("image")
    try:
        yield Path(f"/proc/self/fd/{handle}")
        with temporary.open("wb") as file, os.fdopen(os.dup(handle), "rb") as encoded:
            encoded.seek(0)
            if start is not None:
                file.write(start)
                encoded.seek(metadata_end(encoded.read(1 << 24)))
            shutil.copyfileobj(encoded, file, 1 << 20)
    finally:
        os.close(handle)


def _is_whole(path: Path, name: str) -> bool:
    """True where a file that was just written is not cut short."""
    if name == "png":
        with path.open("rb") as file:
            file.seek(0, os.SEEK_END)
            file.seek(max(0, file.tell() - 8))
            return file.read(4) == b"IEND"
    try:
        with ImageReader(path) as reader:
            for region in () if name == "tiff" else reader.regions(1 << 20, rows_only=True):
                reader.read(region)
    except ImageError:
        return False
    return True
