"""Image files, read by OpenImageIO: pixels in the encoding of the file, and its metadata."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import OpenImageIO as oiio  # noqa: N813 - the name that its documentation uses
import PIL.Image

from lutforge.arrays import Single
from lutforge.atomic_write import scratch_folder
from lutforge.boundary import MAX_SAMPLES, reading, require_file
from lutforge.errors import ImageError, one_line
from lutforge.images.heif import Heif, is_heif, read_heif
from lutforge.images.jpeg import read_header
from lutforge.images.packets import read_packets

_SHOT_TAGS = frozenset({"Make", "Model", "DateTime", "ExposureTime", "FNumber", "Software", "Artist", "Copyright"})
"""OpenImageIO's names of the tags of a picture's first directory that a graded picture keeps."""


def is_premultiplied(spec: oiio.ImageSpec) -> bool:
    """True where an image's colours are already multiplied by an alpha channel."""
    return bool(spec.alpha_channel >= 0 and not spec.get_int_attribute("oiio:UnassociatedAlpha", 0))


@dataclass(frozen=True)
class Region:
    """A rectangle of pixels, counted from the stored image's top left corner; the ends are not part of it."""

    left: int
    top: int
    right: int
    bottom: int

    @property
    def pixels(self) -> int:
        """The number of its pixels."""
        return (self.right - self.left) * (self.bottom - self.top)


@dataclass(frozen=True, eq=False)
class Image:
    """An image as its file stores it: colours are not converted, pixels not rotated, straight alpha stays straight.

    pixels: (h, w, c) float32; integers are scaled to [0, 1], half and float are as they are.
    spec: all metadata of the file (EXIF, IPTC, XMP, ICC profile, orientation, bit depth).
    format: OpenImageIO's name of the format ("jpeg", "tiff", "openexr", …); "" for an image not from a file.
    parts: how many images the file holds; `pixels` is the first.
    """

    pixels: Single
    spec: oiio.ImageSpec
    format: str = ""
    parts: int = 1

    def regions(self, pixels: int, rows_only: bool) -> list[Region]:
        """Bands of about so many pixels, as `ImageReader.regions`."""
        height, width = self.pixels.shape[:2]
        step = max(1, pixels // width)
        return [Region(0, top, width, min(top + step, height)) for top in range(0, height, step)]

    def read(self, region: Region) -> Single:
        """The pixels (h, w, c) of a band."""
        return self.pixels[region.top : region.bottom]


class ImageReader:
    """An open image file that is read region by region, so that memory does not grow with the image.

    Formats that cannot be decoded by rows (WebP, JPEG 2000, JPEG XL, GIF, PSD) are decoded whole inside OpenImageIO.
    """

    def __init__(self, path: Path) -> None:
        require_file(path, "an image", ImageError)
        if is_heif(path):
            raise ImageError(f"{path}: HEIF pictures are not read in regions; convert it to TIFF or JPEG")
        with reading(path, "an image", ImageError):
            config = oiio.ImageSpec()
            config.attribute("oiio:UnassociatedAlpha", 1)
            source = oiio.ImageInput.open(str(path), config)
            if source is None:
                reason = _reason(oiio.geterror())
                raise ImageError(f"{path}: cannot be read as an image ({reason}); copy it again, or convert it to TIFF")
            self._path, self._source = path, source
            spec = self.spec = source.spec()
            if spec.alpha_channel >= spec.nchannels:  # for a GIF, in OpenImageIO 3.2
                spec.alpha_channel = spec.nchannels - 1
            self.format: str = source.format_name()
            if self.format == "jpeg" and (quality := jpeg_quality(path)) is not None:
                spec.attribute("jpeg:quality", quality)
            if self.format == "jpeg2000":  # whose metadata OpenImageIO does not read
                _describe_exif(spec, read_packets(path).exif, _SHOT_TAGS | {"Orientation"})
            problem = ""
            if spec.deep or spec.depth > 1:
                problem = "a deep or volume image; flatten it first"
            elif min(spec.width, spec.height, spec.nchannels) < 1:
                problem = f"the file claims {spec.width} x {spec.height} pixels"
            elif max(spec.width, spec.height) > 300_000:  # pixels; longer sides are a sign of damage
                problem = f"claims {spec.width} x {spec.height} pixels, more than is believed"
            if problem:
                source.close()
                raise ImageError(f"{path}: {problem}")

    @property
    def whole(self) -> Region:
        """The region of the whole image."""
        return Region(0, 0, self.spec.width, self.spec.height)

    def regions(self, pixels: int, rows_only: bool) -> list[Region]:
        """Regions of about `pixels`, top to bottom, along strips or tiles; rows_only: all as wide as the image."""
        spec = self.spec
        width, height = spec.width, spec.height
        if spec.tile_width == 0:
            step = max(1, pixels // width)
            strip = spec.get_int_attribute("tiff:RowsPerStrip", 0)
            for multiple in (64, strip if 0 < strip <= step else 1):
                step = max(step // multiple * multiple, min(step, multiple))
            columns = width
        else:
            step = max(1, pixels // (width * spec.tile_height)) * spec.tile_height
            columns = width
            if not rows_only and width * spec.tile_height > pixels:
                columns = max(1, pixels // (spec.tile_width * spec.tile_height)) * spec.tile_width
        return [
            Region(left, top, min(left + columns, width), min(top + step, height))
            for top in range(0, height, step)
            for left in range(0, width, columns)
        ]

    def read(self, region: Region) -> Single:
        """The pixels (h, w, c) of one of `regions`, or of the whole image; float32, oriented as stored."""
        spec, source = self.spec, self._source
        top, bottom = spec.y + region.top, spec.y + region.bottom
        if region == self.whole:
            if spec.width * spec.height * spec.nchannels > MAX_SAMPLES:
                claim = f"{spec.width} x {spec.height} x {spec.nchannels} values"
                raise ImageError(f"{self._path}: claims {claim}, more than is read at once")
            pixels = source.read_image(0, 0, 0, spec.nchannels, oiio.FLOAT)
        elif spec.tile_width:
            left, right = spec.x + region.left, spec.x + region.right
            depth = (spec.z, spec.z + 1)
            pixels = source.read_tiles(0, 0, left, right, top, bottom, *depth, 0, spec.nchannels, oiio.FLOAT)
        else:
            pixels = source.read_scanlines(0, 0, top, bottom, spec.z, 0, spec.nchannels, oiio.FLOAT)
        with reading(self._path, "an image", ImageError):  # the message may not be text
            problem = source.geterror()
        if pixels is None or problem:
            raise ImageError(f"{self._path}: damaged or cut short ({_reason(problem)}); copy the file again")
        shape = (region.bottom - region.top, region.right - region.left, spec.nchannels)
        return np.ascontiguousarray(pixels, dtype=np.float32).reshape(shape)

    @property
    def parts(self) -> int:
        """The number of images in the file, up to 100. Nothing can be read afterwards."""
        return 1 + sum(1 for _ in self.later_parts())

    def later_parts(self) -> Iterator[oiio.ImageSpec]:
        """Describe the images of the file after the first, up to 99. Nothing can be read afterwards."""
        part = 1
        while part < 100 and self._source.seek_subimage(part, 0):
            yield self._source.spec()
            part += 1
        self._source.geterror()

    def __enter__(self) -> "ImageReader":
        return self

    def __exit__(self, *_: object) -> None:
        self._source.close()


def read_image(path: str | Path) -> Image:
    """Read the first image of a file, pixels (h, w, c) float32, oriented as stored. Raises ImageError, in one line."""
    path = Path(path)
    if is_heif(path):
        heif = read_heif(path)
        return Image(np.divide(heif.codes, 65535, dtype=np.float32), _heif_spec(heif), "heif", heif.parts)
    with ImageReader(path) as reader:
        return Image(reader.read(reader.whole), reader.spec, reader.format, reader.parts)


def _heif_spec(heif: Heif) -> oiio.ImageSpec:
    """Describe a HEIF picture, with its EXIF as OpenImageIO reads it from a JPEG, which holds at most 64 kB of it."""
    height, width, _ = heif.codes.shape
    spec = oiio.ImageSpec(width, height, 3, oiio.UINT8 if heif.bits == 8 else oiio.UINT16)
    _describe_exif(spec, heif.exif, _SHOT_TAGS)
    if heif.icc:
        spec.attribute("ICCProfile", oiio.TypeDesc(f"uint8[{len(heif.icc)}]"), heif.icc)
    return spec


def _describe_exif(spec: oiio.ImageSpec, exif: bytes, tags: frozenset[str]) -> None:
    """Add EXIF and GPS of a TIFF structure to a description, as OpenImageIO reads them from a JPEG: at most 64 kB.

    tags: OpenImageIO's names of other tags that are added.
    """
    if not 0 < len(exif) < 65_500:
        return
    with scratch_folder() as folder:
        PIL.Image.new("RGB", (8, 8)).save(folder / "exif.jpg", exif=b"Exif\0\0" + exif)
        with ImageReader(folder / "exif.jpg") as reader:
            for attribute in reader.spec.extra_attribs:
                if attribute.name.startswith(("Exif:", "GPS:")) or attribute.name in tags:
                    value = attribute.value
                    if isinstance(value, str):  # OpenImageIO refuses bytes that are not text, although it reads them
                        value = value.encode("utf-8", "replace").decode("utf-8")
                    if isinstance(value, int):  # which OpenImageIO drops where it is given as one of 16 bits
                        spec.attribute(attribute.name, value)
                    else:
                        spec.attribute(attribute.name, attribute.type, value)


def jpeg_quality(path: Path) -> int | None:
    """The libjpeg quality, 1 … 100, with the luminance table nearest to a JPEG file's; None where it has no table.

    libjpeg scales the table of ITU-T T.81, Annex K.1 (its entries sum to 3688) by 2 − quality / 50 from 50 upwards, and
    by 50 / quality below (jpeg_quality_scaling in its jcparam.c).
    """
    header = read_header(path.read_bytes())
    if header is None:
        return None
    scale = max(sum(header.tables[0]) / 3688, 1e-3)
    return int(np.clip(round(100 - 50 * scale if scale <= 1 else 50 / scale), 1, 100))


def _reason(text: str) -> str:
    """An OpenImageIO message as part of one line."""
    if "could not find a format reader" in text:
        return "OpenImageIO knows no such format"
    return one_line(text, 160).rstrip(".") or "unreadable"
