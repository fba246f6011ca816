"""The description of an image file that is to be written: the source's metadata, changed as the format requires."""

import re
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import OpenImageIO as oiio  # noqa: N813 - the name that its documentation uses

from lutforge.errors import ImageError

SOFTWARE_NAME = "LutForge"
IN_SRGB, IN_ANOTHER_SPACE = 1, 0xFFFF
"""Values of the Exif tag ColorSpace (Exif 2.32, 4.6.5)."""

_DEEPEST = {
    **dict.fromkeys(("jpeg", "targa", "bmp", "webp", "ico"), "uint8"),
    **dict.fromkeys(("png", "dpx", "jpeg2000", "sgi", "pnm"), "uint16"),
}
"""The deepest pixel type of a format, by OpenImageIO's name, where it is not float."""
_NO_INTEGERS = frozenset({"openexr", "hdr"})
"""Formats without integers."""
_DEPTHS = ("uint8", "uint16", "half", "float")
"""Pixel types by increasing depth."""
_KEEPS_ORIENTATION = frozenset({"jpeg", "tiff", "png", "openexr"})
"""Formats with a tag for the orientation."""
_FORMAT_ATTRIBUTES = ("compression", "oiio:BitsPerSample", "planarconfig")
"""Attributes that hold for one format only, and are not copied to a file of another format."""
_FORMAT_PREFIXES = ("jpeg:", "png:", "tiff:", "openexr:", "dpx:", "targa:", "bmp:", "webp:", "gif:", "jpegxl:")
"""Prefixes of other such attributes."""


def describe_output(
    path: Path,
    spec: oiio.ImageSpec,
    format: str,
    note: str | None = None,
    attributes: Mapping[str, object] | None = None,
) -> oiio.ImageSpec:
    """The description of the file to write: the source's metadata, as far as the format holds them.

    spec: the source's description with the size of the output; format: the source's, by OpenImageIO's name; note: as
    for `write_image`. attributes: metadata to set, by OpenImageIO's names; None erases one.
    """
    result = _output_spec(path, create_output(path), spec, format)
    if note is not None:
        result.attribute("Software", SOFTWARE_NAME)
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
        result.erase_attribute("oiio:ColorSpace")  # from which OpenImageIO would write that the picture is in sRGB
    return result


def exif_date(text: str) -> str:
    """XMP's "2020-02-18T08:56:13.29-07:00" as "2020:02:18 08:56:13" (Exif 2.32, 4.6.4); any other text as it is."""
    date = re.match(r"(\d{4})-(\d\d)-(\d\d)[T ](\d\d:\d\d)(:\d\d)?", text)
    return f"{date[1]}:{date[2]}:{date[3]} {date[4]}{date[5] or ':00'}" if date else text


def create_output(path: Path) -> oiio.ImageOutput:
    """Create the writer of the format that a suffix names. Raises ImageError where there is none."""
    output = oiio.ImageOutput.create(path.name)
    if output is None or path.suffix.lower() in (".pfm", ".gif"):
        oiio.geterror()
        reason = f'cannot write "{path.suffix}" images' if path.suffix else "its name needs a suffix"
        raise ImageError(f"{path}: {reason}; use .tif, .exr, .png, .jpg or .dpx")
    return output


def format_of(path: Path) -> str:
    """OpenImageIO's name of the format that a suffix names. Raises ImageError where it cannot be written."""
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
    """The source's description, changed where the format of the output requires it."""
    name = target.format_name()
    spec = oiio.ImageSpec(source)
    if format != name:
        for attribute in list(spec.extra_attribs):
            if attribute.name.lower().startswith(_FORMAT_PREFIXES) or attribute.name in _FORMAT_ATTRIBUTES:
                spec.erase_attribute(attribute.name)
    for thumbnail in ("thumbnail_image", "thumbnail_width", "thumbnail_height", "thumbnail_nchannels"):
        spec.erase_attribute(thumbnail)

    # The PNG writer fails on a profile without the signature and the length that ICC.1:2022, 7.2 requires.
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
    index = spec.get_int_attribute("Exif:RecommendedExposureIndex", 0)
    if name == "tiff" and not index and (iso := spec.get_int_attribute("Exif:PhotographicSensitivity", 0)):
        spec.attribute("Exif:RecommendedExposureIndex", iso)  # OpenImageIO's TIFF writer has no other tag for the ISO
    if name == "pnm":
        spec.attribute("pnm:pfmflip", 0)  # without this OpenImageIO 3.2 writes them upside down
    if name == "jpeg":
        if spec.nchannels not in (1, 3):
            raise ImageError(f"{path}: JPEG holds no alpha or extra channels; write .tif, .png or .exr")
        spec.attribute("compression", f"jpeg:{spec.get_int_attribute('jpeg:quality', 97)}")
        if format != name:
            spec.attribute("jpeg:subsampling", "4:4:4")
    return spec


def _depth(name: str, source: str) -> str:
    """The pixel type to write: the source's if the format has it, else the one that loses least."""
    if name in _NO_INTEGERS:
        return {"uint8": "half", "half": "half"}.get(source, "float") if name == "openexr" else "float"
    preferred = {"int8": "uint8", "int16": "uint16"}.get(source, source)
    if preferred not in _DEPTHS:
        preferred = "float"  # for 32-bit integers and doubles
    deepest = _DEEPEST.get(name, "float")
    return preferred if _DEPTHS.index(preferred) <= _DEPTHS.index(deepest) else deepest
