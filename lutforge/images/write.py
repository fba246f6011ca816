"""Write an image file with OpenImageIO, keeping what the source file said about itself."""

import os
import re
import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import OpenImageIO as oiio  # noqa: N813 - the name that its documentation uses
from numpy.typing import ArrayLike, NDArray

from lutforge.arrays import Pixels
from lutforge.atomic_write import atomic_path
from lutforge.errors import ImageError
from lutforge.images.jpeg import metadata_end
from lutforge.images.orientation import upright
from lutforge.images.packets import add_packets
from lutforge.images.read import Image, ImageReader, Region

SOFTWARE = "LutForge"
IN_SRGB, IN_ANOTHER_SPACE = 1, 0xFFFF
"""Values of the Exif tag ColorSpace (Exif 2.32, 4.6.5)."""

_WIDEST = {  # the deepest pixel type that a format takes, where it is not float
    **dict.fromkeys(("jpeg", "targa", "bmp", "webp", "ico"), "uint8"),
    **dict.fromkeys(("png", "dpx", "jpeg2000", "sgi", "pnm"), "uint16"),
}
_NO_INTEGERS = frozenset({"openexr", "hdr"})
_DEPTHS = ("uint8", "uint16", "half", "float")
_KEEPS_ORIENTATION = frozenset({"jpeg", "tiff", "png", "openexr"})
_OF_THE_FORMAT = ("compression", "oiio:BitsPerSample", "planarconfig")
_OWN_ATTRIBUTES = ("jpeg:", "png:", "tiff:", "openexr:", "dpx:", "targa:", "bmp:", "webp:", "gif:", "jpegxl:")


def describe_output(
    path: Path,
    spec: oiio.ImageSpec,
    format: str,
    note: str | None = None,
    attributes: Mapping[str, object] | None = None,
) -> oiio.ImageSpec:
    """Describe the file that is written; note, and what is kept, as for `write_image`.

    spec: the source's description with the size of the output; format: the source's, by OpenImageIO's name. attributes:
    metadata to set, by OpenImageIO's names; None erases one.
    """
    result = _output_spec(path, create_output(path), spec, format)
    if note is not None:
        result.attribute("Software", SOFTWARE)
        history = result.get_string_attribute("Exif:ImageHistory")
        line = " ".join(note.split())
        result.attribute("Exif:ImageHistory", f"{history}\n{line}" if history else line)
    for name, value in (attributes or {}).items():
        if value is None:
            result.erase_attribute(name)
        elif isinstance(value, bytes):
            result.attribute(name, oiio.TypeDesc(f"uint8[{len(value)}]"), value)
        elif isinstance(value, tuple):
            result.attribute(name, oiio.TypeDesc(f"float[{len(value)}]"), value)
        else:
            result[name] = value
    for name in ("DateTime", "Exif:DateTimeOriginal", "Exif:DateTimeDigitized"):
        if (date := result.get_string_attribute(name)) != exif_date(date):
            result.attribute(name, exif_date(date))
    if result.get_int_attribute("Exif:ColorSpace", IN_SRGB) != IN_SRGB:
        result.erase_attribute("oiio:ColorSpace")  # OpenImageIO else writes that it is in sRGB
    return result


def exif_date(text: str) -> str:
    """XMP's "2020-02-18T08:56:13.29-07:00" as Exif 2.32, 4.6.4 has it: "2020:02:18 08:56:13"; all else stays."""
    found = re.match(r"(\d{4})-(\d\d)-(\d\d)[T ](\d\d:\d\d)(:\d\d)?", text)
    return f"{found[1]}:{found[2]}:{found[3]} {found[4]}{found[5] or ':00'}" if found else text


def create_output(path: Path) -> oiio.ImageOutput:
    """Create the writer of the format that a suffix stands for. Raises ImageError where there is none."""
    probe = oiio.ImageOutput.create(path.name)
    if probe is None or path.suffix.lower() in (".pfm", ".gif"):
        oiio.geterror()
        asked = f'cannot write "{path.suffix}" images' if path.suffix else "its name needs a suffix"
        raise ImageError(f"{path}: {asked}; use .tif, .exr, .png, .jpg or .dpx")
    return probe


def format_of(path: Path) -> str:
    """OpenImageIO's name of the format that a suffix stands for. Raises ImageError where it cannot be written."""
    return str(create_output(path).format_name())


def keeps_orientation(path: Path) -> bool:
    """True where the format has an orientation tag. Raises ImageError for a format that cannot be written."""
    return format_of(path) in _KEEPS_ORIENTATION


def with_shape(spec: oiio.ImageSpec, shape: tuple[int, ...]) -> oiio.ImageSpec:
    """A copy of a description for pixels of another height, width or number of channels."""
    spec = oiio.ImageSpec(spec)
    height, width, channels = shape
    if shape != (spec.height, spec.width, spec.nchannels):
        if channels != spec.nchannels:
            spec.nchannels = channels
            spec.default_channel_names()
        spec.x = spec.y = spec.full_x = spec.full_y = 0
        spec.width = spec.full_width = width
        spec.height = spec.full_height = height
    return spec


def _output_spec(path: Path, target: oiio.ImageOutput, source: oiio.ImageSpec, format: str) -> oiio.ImageSpec:
    """The source's description, changed where the format asks for it."""
    name = target.format_name()
    spec = oiio.ImageSpec(source)
    if format != name:
        for attribute in list(spec.extra_attribs):
            if attribute.name.lower().startswith(_OWN_ATTRIBUTES) or attribute.name in _OF_THE_FORMAT:
                spec.erase_attribute(attribute.name)
    for thumbnail in ("thumbnail_image", "thumbnail_width", "thumbnail_height", "thumbnail_nchannels"):
        spec.erase_attribute(thumbnail)
    # A profile without the signature and the length that ICC.1:2022, 7.2 asks for makes the PNG writer fail.
    stored = spec.getattribute("ICCProfile")
    profile = bytes(stored) if isinstance(stored, bytes | np.ndarray) else b""
    if len(profile) < 132 or profile[36:40] != b"acsp" or int.from_bytes(profile[:4], "big") != len(profile):
        spec.erase_attribute("ICCProfile")
    if not target.supports("tiles"):
        spec.tile_width = spec.tile_height = spec.tile_depth = 0
    depth = _depth(name, str(source.format))
    if depth != str(source.format):
        spec.erase_attribute("oiio:BitsPerSample")
    spec.set_format(oiio.TypeDesc(depth))
    if name == "tiff" and spec.get_string_attribute("compression").startswith("jpeg"):
        spec.attribute("compression", "zip")
    known = spec.get_int_attribute("Exif:RecommendedExposureIndex", 0)
    if name == "tiff" and not known and (iso := spec.get_int_attribute("Exif:PhotographicSensitivity", 0)):
        spec.attribute("Exif:RecommendedExposureIndex", iso)  # OpenImageIO's TIFF writer knows no other tag for it
    if name == "pnm":
        spec.attribute("pnm:pfmflip", 0)  # OpenImageIO 3.2 else writes them upside down
    if name == "jpeg":
        if spec.nchannels not in (1, 3):
            raise ImageError(f"{path}: JPEG holds no alpha or extra channels; write .tif, .png or .exr")
        spec.attribute("compression", f"jpeg:{spec.get_int_attribute('jpeg:quality', 97)}")
        if format != name:
            spec.attribute("jpeg:subsampling", "4:4:4")
    return spec


def _depth(name: str, source: str) -> str:
    """The pixel type to write: the source's, else the nearest that the format has and that loses least."""
    if name in _NO_INTEGERS:
        return {"uint8": "half", "half": "half"}.get(source, "float") if name == "openexr" else "float"
    wanted = {"int8": "uint8", "int16": "uint16"}.get(source, source)
    if wanted not in _DEPTHS:
        wanted = "float"  # 32-bit integers, doubles
    widest = _WIDEST.get(name, "float")
    return wanted if _DEPTHS.index(wanted) <= _DEPTHS.index(widest) else widest


# --- The file --------------------------------------------------------------------------------------------------------


_TELL_OF_FAILURES = frozenset({"openexr", "dpx", "hdr", "pnm", "jpegxl"})
_NOT_SAFE_ON_DISK = frozenset({"jpeg", "webp"})


def write_image(path: str | Path, pixels: ArrayLike, spec_like: Image, note: str | None = None) -> None:
    """Write `pixels` (h, w, c) with the metadata of `spec_like`, atomically; the suffix picks the format.

    Pixels are in the encoding of the file: integers from [0, 1] (clipped), half and float as they are. Bit depth is the
    source's where the format has it, else the nearest that loses least. A JPEG of a JPEG has its source's quality and
    chroma subsampling, any other quality 97 and none. EXIF, IPTC, XMP, ICC profile and orientation are kept, thumbnails
    of the old pixels dropped. `note` says what was done, for Software and ImageHistory. Raises ImageError.
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
    """An open output, written region by region from top to bottom; spec describes the file as it is written."""

    path: Path
    spec: oiio.ImageSpec
    target: oiio.ImageOutput

    @property
    def tiled(self) -> bool:
        """True where the file is made of the source's tiles and takes regions of whole tiles, not only whole rows."""
        return bool(self.spec.tile_width > 0)

    def write(self, region: Region, pixels: Pixels | NDArray[np.uint16]) -> None:
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
    return ImageError(f"{path}: it was not written as a whole; is the disk full?")


@contextmanager
def image_writer(
    path: Path, described: oiio.ImageSpec, start: bytes | None = None, xmp: bytes = b"", iptc: bytes = b""
) -> Iterator[ImageWriter]:
    """Open an output under a temporary name; the file appears, whole, when the block ends without an error.

    described: what is written, as `describe_output` gives it. start: SOI and the metadata segments of a JPEG, in place
    of those that OpenImageIO makes. xmp, iptc: packets as the source has them; WebP and JPEG 2000 get EXIF here, too.
    """
    if xmp and format_of(path) == "openexr":
        described.attribute("xmp", xmp.decode("utf-8", "replace"))  # OpenEXR has attributes of any name
    with atomic_path(path) as temporary:
        with _opened(path, temporary, described, start) as writer:
            yield writer
        add_packets(temporary, format_of(path), described, xmp, iptc)


@contextmanager
def _opened(path: Path, temporary: Path, described: oiio.ImageSpec, start: bytes | None) -> Iterator[ImageWriter]:
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
    """Where OpenImageIO may write a file that becomes `temporary`, so that a full disk is noticed, and ends nothing.

    Of OpenImageIO 3.2's writers, those of OpenEXR, DPX, Radiance, PNM and JPEG XL tell of a failed write, that of TIFF
    tells of pixels and not of the directory behind them; libjpeg ends the program, libwebp tries for ever: those encode
    into memory; the others lose data in silence, so that their files are checked.
    """
    name = format_of(path)
    if name not in _NOT_SAFE_ON_DISK or not hasattr(os, "memfd_create"):
        yield temporary
        if start is not None:
            data = temporary.read_bytes()
            temporary.write_bytes(start + data[metadata_end(data) :])
        if name not in _TELL_OF_FAILURES and not _is_whole(temporary, name):
            raise _cut_short(path)
        return
    import resource  # where there are memory files (Linux), there are limits too; Windows has neither

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
