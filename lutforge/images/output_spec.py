"""Describe an output image: the source's metadata, and the pixel type and options that the format has."""

import re
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import OpenImageIO as oiio  # noqa: N813 - the name that its documentation uses

from lutforge.errors import ImageError

SOFTWARE = "LutForge"
IN_SRGB, IN_ANOTHER_SPACE = 1, 0xFFFF
"""Values of the Exif tag ColorSpace (Exif 2.32, 4.6.5)."""

_WIDEST: dict[str, str] = {  # the deepest pixel type that a format takes, where it is not float
    "jpeg": "uint8",
    "png": "uint16",
    "targa": "uint8",
    "bmp": "uint8",
    "webp": "uint8",
    "ico": "uint8",
    "dpx": "uint16",
    "jpeg2000": "uint16",
    "sgi": "uint16",
    "pnm": "uint16",
}
_NO_INTEGERS = frozenset({"openexr", "hdr"})
_DEPTHS = ("uint8", "uint16", "half", "float")
_KEEPS_ORIENTATION = frozenset({"jpeg", "tiff", "png", "openexr"})
_OWN_ATTRIBUTES = ("jpeg:", "png:", "tiff:", "openexr:", "dpx:", "targa:", "bmp:", "webp:", "gif:", "jpegxl:")


def describe_output(
    path: Path,
    spec: oiio.ImageSpec,
    format: str,
    note: str | None = None,
    attributes: Mapping[str, object] | None = None,
    quality: int | None = None,
) -> oiio.ImageSpec:
    """Describe the file that is written. Raises ImageError where the format cannot hold it.

    spec: the source's description with the size of the output; format: the source's, by OpenImageIO's name; note, and
    what is kept, as for `write_image`. attributes: metadata to set, by OpenImageIO's names; None erases one. quality:
    of a JPEG, where it should not be its source's.
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
    if quality is not None and format_of(path) == "jpeg":
        result.attribute("compression", f"jpeg:{quality}")
    if result.get_int_attribute("Exif:ColorSpace", IN_SRGB) != IN_SRGB:
        result.erase_attribute("oiio:ColorSpace")  # OpenImageIO else writes that it is in sRGB
    return result


def exif_date(text: str) -> str:
    """Return a date in the form of Exif 2.32, 4.6.4.

    XMP's "2020-02-18T08:56:13.29-07:00" becomes "2020:02:18 08:56:13"; what is no such date stays.
    """
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
            if attribute.name.lower().startswith(_OWN_ATTRIBUTES) or attribute.name in (
                "compression",
                "oiio:BitsPerSample",
                "planarconfig",
            ):
                spec.erase_attribute(attribute.name)
    for thumbnail in ("thumbnail_image", "thumbnail_width", "thumbnail_height", "thumbnail_nchannels"):
        spec.erase_attribute(thumbnail)
    if not _is_icc_profile(spec.getattribute("ICCProfile")):
        spec.erase_attribute("ICCProfile")  # a broken one makes the PNG writer fail
    if not target.supports("tiles"):
        spec.tile_width = spec.tile_height = spec.tile_depth = 0
    depth = _depth(name, str(source.format))
    if depth != str(source.format):
        spec.erase_attribute("oiio:BitsPerSample")
    spec.set_format(oiio.TypeDesc(depth))
    if name == "tiff" and spec.get_string_attribute("compression").startswith("jpeg"):
        spec.attribute("compression", "zip")
    if name == "tiff" and (iso := spec.get_int_attribute("Exif:PhotographicSensitivity", 0)):
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


def _is_icc_profile(profile: object) -> bool:
    """True where the bytes carry the signature and the length that ICC.1:2022, 7.2 asks for."""
    if not isinstance(profile, bytes | np.ndarray):
        return False
    data = bytes(profile)
    return len(data) >= 132 and data[36:40] == b"acsp" and int.from_bytes(data[:4], "big") == len(data)
