"""Checks of an image's colours before its grade, the metadata that state their space, and notes on them."""

import shlex
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import OpenImageIO as oiio  # noqa: N813 - the name that its documentation uses

from lutforge.colour.icc_profile import adobe_rgb_profile
from lutforge.errors import ImageError
from lutforge.grading.grade import Grade
from lutforge.images.heif import is_heif
from lutforge.images.icc import is_srgb, mean_code_change, stored_profile
from lutforge.images.jpeg import JpegHeader
from lutforge.images.output_spec import IN_ANOTHER_SPACE
from lutforge.images.packet_writer import LARGEST_JPEG_PACKET, holds_packets
from lutforge.images.packets import Packets
from lutforge.images.read import ImageReader, is_premultiplied
from lutforge.images.xmp import declares_film

_RGB = (("r", "g", "b"), ("red", "green", "blue"))

_NOT_RGB = {
    "CMYK": "CMYK", "YCbCrK": "CMYK", "color separated": "CMYK",
    "CIELAB": "CIELAB", "ICCLAB": "CIELAB", "ITULAB": "CIELAB",
}  # fmt: skip
"""The colours of files whose channels OpenImageIO names R, G and B although they are not, by its words for them."""

ADOBE_RGB_METADATA: Mapping[str, object] = {"ICCProfile": adobe_rgb_profile(), "Exif:ColorSpace": IN_ANOTHER_SPACE}
"""Metadata, by OpenImageIO's names, of a picture in Adobe RGB."""


def check_colours(path: Path, spec: oiio.ImageSpec) -> None:
    """Raise ImageError where the first three channels are not RGB colours, or their alpha is not the fourth."""
    if spec.nchannels < 3:
        part = part_with_colours(path)
        if part is not None:
            names = ", ".join(spec.channelnames)
            command = shlex.join(["oiiotool", str(path), "--subimage", str(part), "-o", f"colours{path.suffix}"])
            raise ImageError(f"{path}: its first part holds {names} alone; grade the part with colours: {command}")
        raise ImageError(
            f"{path}: a LUT needs red, green and blue; this image has {spec.nchannels} channel(s) (greyscale); convert "
            "it to RGB first"
        )
    for name in ("jpeg:ColorSpace", "tiff:ColorSpace"):
        if (stored := spec.get_string_attribute(name)) in _NOT_RGB:
            raise ImageError(f"{path}: its colours are {_NOT_RGB[stored]}, not RGB; convert it to RGB first")
    if set(_last_words(spec.channelnames[:3])) == {"y", "ry", "by"}:
        raise ImageError(f"{path}: its colours are luminance and chroma, not RGB; convert it to RGB first")
    alpha = spec.alpha_channel
    if 0 <= alpha < 3 or (alpha > 3 and is_premultiplied(spec)):
        raise ImageError(f"{path}: channels are {', '.join(spec.channelnames)}; put R, G, B, A first")


def part_with_colours(path: Path) -> int | None:
    """The index of the first part of a file, after part 0, with red, green and blue; None where there is none."""
    if is_heif(path):
        return None
    with ImageReader(path) as reader:
        parts = enumerate(reader.later_parts(), 1)
        return next((index for index, part in parts if {*_last_words(part.channelnames)} >= {"r", "g", "b"}), None)


def _last_words(names: Sequence[str]) -> Iterator[str]:
    """Channel names in lower case, without their layer."""
    return (name.rpartition(".")[2].lower() for name in names)


def colour_space(source: Path, spec: oiio.ImageSpec, file_format: str, jpeg: JpegHeader | None) -> Mapping[str, object]:
    """The metadata of Adobe RGB, where the source states this space only in a tag that OpenImageIO does not keep."""
    if jpeg is not None:
        return ADOBE_RGB_METADATA if jpeg.is_adobe_rgb and spec.getattribute("ICCProfile") is None else {}
    if file_format != "jpeg" or spec.getattribute("ICCProfile") is not None:
        return {}
    from lutforge.shots.maker_settings import in_adobe_rgb  # imported here: few pictures need it
    from lutforge.shots.tags import tags

    return ADOBE_RGB_METADATA if in_adobe_rgb(tags(source)) else {}


def foreign_space(grade: Grade, source: oiio.ImageSpec, attributes: Mapping[str, object]) -> str:
    """The name of the picture's space where it is not sRGB and the grade does not set a profile itself, else ""."""
    if "ICCProfile" in grade.attributes:
        return ""
    if "ICCProfile" in attributes:
        return "Adobe RGB"
    profile = stored_profile(source)
    if not profile or is_srgb(profile):
        return ""
    return source.get_string_attribute("ICCProfile:profile_description").strip() or "a space without a name"


def notes_on_packets(
    packets: Packets, source: oiio.ImageSpec, file_format: str, written: str, segments_stay: bool
) -> Iterator[str]:
    """Yield notes on parts of the source file that the graded file does not have.

    file_format, written: the formats of source and graded file; segments_stay: both are JPEG, and all segments of
    metadata are copied.
    """
    if packets.encoding:
        yield f"the picture says that its colours are in {packets.encoding}, and was graded as it is"
    if packets.animated and file_format == "png":
        yield "an animation: its first frame was graded, the others were left out"
    if declares_film(packets.xmp):
        yield "the film of the motion photo was left out"

    names = [attribute.name for attribute in source.extra_attribs]
    lost = ["EXIF"] if any(name.startswith("Exif:") for name in names) and written not in _HOLDS_EXIF else []
    lost += ["GPS"] if any(name.startswith("GPS:") for name in names) and written not in _HOLDS_EXIF else []
    kinds = set(holds_packets(written))
    # OpenEXR gets IPTC as attributes, which OpenImageIO reads from JPEG and TIFF only, PNG from PNG as a text.
    if (written == "openexr" and file_format in ("jpeg", "tiff")) or written == file_format == "png":
        kinds.add("IPTC")
    for kind, packet in (("XMP", packets.xmp), ("IPTC", packets.iptc)):
        if not packet or segments_stay:
            continue
        if kind not in kinds:
            lost.append(kind)
        elif written == "jpeg" and kind == "IPTC" and len(packet) >= LARGEST_JPEG_PACKET:
            lost.append(f"IPTC of {len(packet):,} bytes, more than a JPEG holds")
    if packets.extended and not segments_stay:
        lost.append("the part of XMP beyond 64 kB")
    lost += [] if segments_stay else packets.not_described
    if packets.exif and len(packets.exif) >= 65_500:
        lost.append("EXIF of more than 64 kB")
    lost += ["ICC profile"] if "ICCProfile" in names and written not in _HOLDS_ICC else []
    if lost:
        yield f"metadata that the graded file does not hold were left out: {', '.join(dict.fromkeys(lost))}"


_HOLDS_EXIF = frozenset({"jpeg", "tiff", "png", "webp", "jpeg2000", "openexr", "jpegxl"})
"""Formats, by OpenImageIO's names, to which EXIF is written."""
_HOLDS_ICC = frozenset({"jpeg", "tiff", "png", "webp", "jpeg2000", "jpegxl"})
"""Formats, by OpenImageIO's names, to which an ICC profile is written."""


def notes_on(
    grade: Grade, file_format: str, source: oiio.ImageSpec, output: oiio.ImageSpec, space: str, broken: int
) -> Iterator[str]:
    """Yield notes for the user on the colours of a graded image.

    file_format: of the source, as `Image.format`; space: as in `foreign_space`; broken: the number of pixels that are
    no finite numbers.
    """
    # Formats that usually hold scene-linear values, and 8 bits, which hardly ever do.
    if grade.for_srgb and not grade.raw and file_format in ("openexr", "hdr"):
        yield "such a file holds scene-linear light, as a rule, and this grade takes encoded sRGB: encode it first"
    if grade.takes_linear and not grade.raw and str(source.format) == "uint8":
        yield "scene-linear light is what this grade takes, and 8-bit pictures are encoded: linearize them first"
    if grade.gives_linear and str(output.format) == "uint8":
        yield "scene-linear light in 8 bits shows bands: keep it in half or float, with --suffix .exr"
    if space:
        yield f"the picture is in {space}, and was graded as it is: a look made for sRGB needs it converted to sRGB"
    profile = stored_profile(source)
    if profile and mean_code_change(profile) is None:
        yield "the picture's ICC profile is broken: its colours were taken as they are"

    # Channels with unusual names, and layers that were not graded.
    graded = ", ".join(source.channelnames[:3])
    if tuple(_last_words(source.channelnames[:3])) not in _RGB:
        yield f"the channels {graded} were graded as red, green and blue"
    reds = [name for name in source.channelnames[3:] if name.lower().endswith((".r", ".red"))]
    layers = dict.fromkeys(name.rpartition(".")[0] for name in reds)
    if layers:
        yield f"{graded} were graded; the layers {', '.join(layers)} are as they were"
    if broken:
        are = "pixels are not finite numbers" if broken > 1 else "pixel is not a finite number"
        yield f"{broken} {are}; what became of them means nothing"
