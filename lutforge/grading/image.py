"""Grade one image: read, grade and write it region by region, so that memory does not grow with the image.

Whole in memory are images that must be rendered, turned or converted, and JPEG files that become JPEG files.
"""

import os
import shutil
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from functools import cache
from io import FileIO
from itertools import zip_longest
from pathlib import Path
from threading import Semaphore

import numpy as np
import OpenImageIO as oiio  # noqa: N813 - the name that its documentation uses
import PyOpenColorIO as OCIO  # noqa: N814 - the name that its documentation uses

from lutforge.arrays import Codes, Pixels
from lutforge.atomic_write import atomic_path
from lutforge.colour.rgb_spaces import adobe_rgb_profile
from lutforge.errors import ImageError
from lutforge.grading.grade import Grade
from lutforge.images.heif import is_heif
from lutforge.images.icc import codes_moved, foreign_profile, is_srgb, pixels_to_srgb, profile_name, stored_profile
from lutforge.images.jpeg import APP1, APP2, JpegHeader, decode, encode, read_header, stored_metadata, with_colours
from lutforge.images.orientation import upright
from lutforge.images.packets import XMP_SEGMENT, Packets, declares_film, read_packets, without_further_pictures
from lutforge.images.read import Image, ImageReader, is_premultiplied, read_image
from lutforge.images.write import (
    IN_ANOTHER_SPACE,
    IN_SRGB,
    SOFTWARE,
    ImageWriter,
    describe_output,
    format_of,
    image_writer,
    keeps_orientation,
    with_shape,
)
from lutforge.model.highlights import clipped
from lutforge.shots.discover import RAW_SUFFIXES

REGION_SAMPLES = 8_000_000
"""Values in memory per region of an image (32 MB); reading, grading and writing hold one each."""
ROWS_AT_ONCE = 256
"""Rows of a RAW file whose vignetting is corrected at once."""


@dataclass(frozen=True)
class GradedImage:
    """A graded image. notes: what the user should know, such as parts of a file that were left out."""

    source: Path
    target: Path
    width: int
    height: int
    notes: tuple[str, ...] = ()


def apply_image(
    grade: Grade,
    source: str | Path,
    target: str | Path,
    workers: int | None = None,
    region_samples: int = REGION_SAMPLES,
) -> GradedImage:
    """Grade an image file, with metadata, bit depth and extra channels kept.

    workers: threads, by default one per core. Raises ImageError.
    """
    source, target = Path(source), Path(target)
    if target.exists() and source.exists() and target.samefile(source):
        raise ImageError(f"{source}: the output would replace the input; choose another folder or name")
    if grade.unchanged and target.suffix.lower() == source.suffix.lower():
        with ImageReader(source) as reader:
            width, height = reader.spec.width, reader.spec.height
        with atomic_path(target) as temporary:
            shutil.copyfile(source, temporary)
        return GradedImage(source, target, width, height, grade.notes)
    count = workers or os.cpu_count() or 1
    with ExitStack() as stack:
        image, profile = stack.enter_context(_opened(source, target, grade))
        spec = image.spec
        if profile:
            converted = f"the picture is in {profile_name(profile)}: converted to sRGB"
            grade = replace(grade, attributes={**grade.attributes, "ICCProfile": None}, notes=(*grade.notes, converted))
        check_colours(source, spec)
        packets = Packets() if grade.raw or is_heif(source) else read_packets(source)
        if grade.for_srgb and packets.encoding:
            raise ImageError(
                f"{source}: says that it is encoded as {packets.encoding}, and this grade is for sRGB; "
                "convert it to sRGB first"
            )
        jpeg = read_header(source.read_bytes()) if image.format == format_of(target) == "jpeg" else None
        attributes = {**colour_space(source, spec, image.format, jpeg), **grade.attributes}
        if not spec.get_string_attribute("DateTime"):
            # Else OpenImageIO dates a TIFF with the moment, and no two runs give the same file.
            changed = time.gmtime(source.stat().st_mtime)
            attributes.setdefault("DateTime", time.strftime("%Y:%m:%d %H:%M:%S", changed))
        space = other_space(grade, spec, attributes)
        if grade.for_srgb and space:
            raise ImageError(
                f"{source}: the picture is in {space}, and this grade is for sRGB; convert it to sRGB first"
            )
        written = oiio.ImageSpec(spec)
        if grade.marks_clipped:
            names = (*spec.channelnames, "clipped")
            written.nchannels, written.channelnames, written.channelformats = len(names), names, ()
        output = describe_output(target, written, image.format, grade.history, attributes)
        if grade.marks_clipped:
            output.set_format(oiio.HALF)
        threads = None if count == 1 else stack.enter_context(ThreadPoolExecutor(count))
        total = spec.width * spec.height

        # Whole, as codes, pictures of more than 64 Mpixel would take more than 256 MB each.
        if jpeg is not None and jpeg.plain and total <= 64_000_000 and grade.codes is not None and not profile:
            broken = 0
            grade_whole(source, jpeg, grade, target, threads)
        else:
            start = None if jpeg is None else jpeg_metadata(jpeg, grade)
            xmp = b"" if start is not None else without_further_pictures(packets.xmp)
            if packets.lossless and format_of(target) == "webp":
                output.attribute("compression", "lossless")
            writer = stack.enter_context(image_writer(target, output, start, xmp))
            broken = _grade_regions(grade, image, writer, threads, region_samples, count > 1)
        parts = image.parts
    notes = (
        *grade.notes,
        *notes_on(grade, image.format, spec, output, space, broken),
        *((f"the first of {parts} images in the file was used",) if parts != 1 else ()),
        *(() if jpeg is None else jpeg.notes),
        *notes_on_packets(packets, spec, image.format, format_of(target)),
    )
    return GradedImage(source, target, spec.width, spec.height, notes)


@contextmanager
def _opened(source: Path, target: Path, grade: Grade) -> Iterator[tuple[ImageReader | Image, bytes]]:
    """Open an image for its grade: RAW files rendered linear, pictures turned where the target's format cannot tell so.

    With it the ICC profile of the space that it was converted from, to sRGB; empty where it was not.
    """
    if grade.raw:
        from lutforge.images.raw import read_raw  # LibRaw, and what reads metadata, for RAW files alone
        from lutforge.model.vignetting import vignetting_of
        from lutforge.shots.metadata import lens_of, raw_attributes

        with _in_memory():
            image = read_raw(source)
            vignetting = vignetting_of(grade.vignettings, lens_of(source, image), image.focal_mm, image.aperture)
            if vignetting is not None:
                height, width = image.pixels.shape[:2]
                for first in range(0, height, ROWS_AT_ONCE):
                    rows = slice(first, first + ROWS_AT_ONCE)
                    image.pixels[rows] *= vignetting.gain(height, width, rows)
            pixels = upright(image.pixels, image.orientation)
            spec = oiio.ImageSpec(pixels.shape[1], pixels.shape[0], 3, "uint16")
            for name, value in raw_attributes(source, image).items():
                spec[name] = value
            yield Image(pixels, spec), b""
        return
    if source.suffix.lower() in RAW_SUFFIXES:
        raise ImageError(f"{source}: a RAW file; what renders it is a camera's profile (.npz)")
    if is_heif(source):
        with _in_memory():
            yield _in_srgb(read_image(source), grade)
        return
    with ImageReader(source) as reader:
        orientation = reader.spec.get_int_attribute("Orientation", 1)
        turned = orientation != 1 and not keeps_orientation(target)
        if not turned and not (grade.for_srgb and foreign_profile(reader.spec)):
            yield reader, b""
            return
        with _in_memory():
            pixels, spec = reader.read(reader.whole), reader.spec
            if turned:
                pixels = upright(pixels, orientation)
                spec = with_shape(spec, pixels.shape)
                spec.attribute("Orientation", 1)
            yield _in_srgb(Image(pixels, spec, reader.format, reader.parts), grade)


def _in_srgb(image: Image, grade: Grade) -> tuple[Image, bytes]:
    """The image, converted to sRGB where its grade wants that, and the profile that it had."""
    profile, spec = foreign_profile(image.spec), oiio.ImageSpec(image.spec)
    if not grade.for_srgb or not profile:
        return image, b""
    spec.erase_attribute("ICCProfile")
    spec.attribute("Exif:ColorSpace", IN_SRGB)
    return replace(image, pixels=pixels_to_srgb(image.pixels, profile), spec=spec), profile


@cache
def _in_memory() -> Semaphore:
    """How many images may be in memory as a whole at once: a decoded RAW file takes about 2 GB in the worst case."""
    pages = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") if hasattr(os, "sysconf") else 8_000_000_000
    return Semaphore(max(1, pages // 4_000_000_000))


def _grade_regions(
    grade: Grade,
    image: ImageReader | Image,
    writer: ImageWriter,
    threads: Executor | None,
    region_samples: int,
    overlap: bool,
) -> int:
    """Read, grade and write an image region by region, and count the pixels that are no finite numbers.

    overlap: the next region is read, and the last one written, meanwhile.
    """
    premultiplied = is_premultiplied(image.spec)
    broken = 0

    def work(pixels: Pixels) -> Pixels:
        nonlocal broken
        clips = clipped(pixels[..., :3]) if grade.marks_clipped else None
        with np.errstate(all="ignore"):
            total = np.sum(pixels)  # NaN and infinity stay what they are
        if not np.isfinite(total):
            broken += int(np.count_nonzero(~np.isfinite(pixels[..., :3]).all(axis=-1)))
        grade_floats(grade.processor, pixels, premultiplied, threads)
        return pixels if clips is None else np.dstack([pixels, clips.astype(np.float32)])

    regions = image.regions(max(1, region_samples // image.spec.nchannels), not writer.tiled)
    if not overlap or len(regions) == 1:
        for region in regions:
            writer.write(region, work(image.read(region)))
        return broken
    with ThreadPoolExecutor(1) as reading, ThreadPoolExecutor(1) as writing:
        ahead = reading.submit(image.read, regions[0])
        behind: Future[None] | None = None
        for region, following in zip_longest(regions, regions[1:]):
            pixels = ahead.result()
            if following is not None:
                ahead = reading.submit(image.read, following)
            pixels = work(pixels)
            if behind is not None:
                behind.result()
            behind = writing.submit(writer.write, region, pixels)
        if behind is not None:
            behind.result()
    return broken


# --- A JPEG to a JPEG: as 8-bit codes, with the source's quality and all of its metadata ------------------------------


def jpeg_metadata(header: JpegHeader, grade: Grade) -> bytes:
    """What stands in front of the graded pixels: the source's segments, with a comment on what was done.

    The thumbnail is of the old colours and left out; where the colours get another space, ICC profile and ColorSpace
    change.
    """
    segments, attributes = header.segments, grade.attributes
    if "ICCProfile" in attributes:
        new = attributes["ICCProfile"]
        adobe_rgb = attributes.get("Exif:ColorSpace") == IN_ANOTHER_SPACE
        segments = with_colours(segments, new if isinstance(new, bytes) else None, adobe_rgb)
    comment = f"{attributes.get('Software', SOFTWARE)}\n{' '.join(grade.history.split())}"
    # What follows the picture, a gain map or a film, is left out, and XMP does not declare it.
    kept = []
    for segment in segments:
        if segment.holds((APP1, XMP_SEGMENT)):
            body = XMP_SEGMENT + without_further_pictures(segment.body[len(XMP_SEGMENT) :])
            segment = replace(segment, body=body)
        if not segment.holds((APP2, b"urn:iso:std:iso:ts:21496:-1")):
            kept.append(segment)
    return stored_metadata(kept, header.plain, comment)


def grade_whole(
    source: Path,
    header: JpegHeader,
    grade: Grade,
    target: Path,
    threads: Executor | None,
) -> None:
    """Grade a picture whole."""
    assert grade.codes is not None
    start = jpeg_metadata(header, grade)
    canvas = np.empty((header.height, header.width, 4), np.uint8)
    decode(source, source.read_bytes(), canvas)
    grade_codes(grade.codes, canvas, threads)
    with atomic_path(target) as temporary, FileIO(temporary, "r+") as file:
        encode(file, canvas, start, header)


# --- Whether a grade can take the colours of an image, what tells their space, and notes on them ----------------------


_RGB = (("r", "g", "b"), ("red", "green", "blue"))

_NOT_RGB = {
    "CMYK": "CMYK", "YCbCrK": "CMYK", "color separated": "CMYK",
    "CIELAB": "CIELAB", "ICCLAB": "CIELAB", "ITULAB": "CIELAB",
}  # fmt: skip
"""What OpenImageIO says of files whose colours it gives as RGB all the same, and what they are."""

TELL_ADOBE_RGB: Mapping[str, object] = {"ICCProfile": adobe_rgb_profile(), "Exif:ColorSpace": IN_ANOTHER_SPACE}
"""Metadata, by OpenImageIO's names, of a picture in Adobe RGB."""


def check_colours(path: Path, spec: oiio.ImageSpec) -> None:
    """Raise ImageError where the first three channels are not RGB colours, or their alpha is not the fourth."""
    if spec.nchannels < 3:
        grey = " (greyscale); convert it to RGB first" if spec.nchannels <= 2 else ""
        raise ImageError(f"{path}: a LUT needs red, green and blue; this image has {spec.nchannels} channel(s){grey}")
    for name in ("jpeg:ColorSpace", "tiff:ColorSpace"):
        if (stored := spec.get_string_attribute(name)) in _NOT_RGB:
            raise ImageError(f"{path}: its colours are {_NOT_RGB[stored]}, not RGB; convert it to RGB first")
    if set(_last_words(spec.channelnames[:3])) == {"y", "ry", "by"}:
        raise ImageError(f"{path}: its colours are luminance and chroma, not RGB; convert it to RGB first")
    alpha = spec.alpha_channel
    if 0 <= alpha < 3 or (alpha > 3 and is_premultiplied(spec)):
        raise ImageError(f"{path}: channels are {', '.join(spec.channelnames)}; put R, G, B, A first")


def _last_words(names: Sequence[str]) -> Iterator[str]:
    """Channel names in lower case, without their layer."""
    return (name.rpartition(".")[2].lower() for name in names)


def colour_space(source: Path, spec: oiio.ImageSpec, format: str, jpeg: JpegHeader | None) -> Mapping[str, object]:
    """What tells that a picture is in Adobe RGB, where only a tag said it that OpenImageIO does not keep."""
    if jpeg is not None:
        return TELL_ADOBE_RGB if jpeg.says_adobe_rgb and spec.getattribute("ICCProfile") is None else {}
    if format != "jpeg" or spec.getattribute("ICCProfile") is not None:
        return {}
    from lutforge.shots.maker_settings import in_adobe_rgb  # loads what reads metadata
    from lutforge.shots.tags import tags

    return TELL_ADOBE_RGB if in_adobe_rgb(tags(source)) else {}


def other_space(grade: Grade, source: oiio.ImageSpec, attributes: Mapping[str, object]) -> str:
    """The name of a space other than sRGB that neither the grade nor an output with these attributes tells, else ""."""
    if "ICCProfile" in grade.attributes:
        return ""
    if "ICCProfile" in attributes:
        return "Adobe RGB"
    profile = stored_profile(source)
    if not profile or is_srgb(profile):
        return ""
    return source.get_string_attribute("ICCProfile:profile_description").strip() or "a space without a name"


def notes_on_packets(packets: Packets, source: oiio.ImageSpec, format: str, written: str) -> Iterator[str]:
    """Yield what of a file besides its picture is not in the graded one. format, written: of source and result."""
    if packets.encoding:
        yield f"the picture says that it is encoded as {packets.encoding}, and was graded as it is"
    if packets.animated and format == "png":
        yield "an animation: its first frame was graded, the others were left out"
    if declares_film(packets.xmp):
        yield "the film of the motion photo was left out"
    names = [attribute.name for attribute in source.extra_attribs]
    lost = ["EXIF"] if any(name.startswith("Exif:") for name in names) and written not in _HOLDS_EXIF else []
    lost += ["GPS"] if any(name.startswith("GPS:") for name in names) and written not in _HOLDS_EXIF else []
    lost += ["XMP"] if packets.xmp and written not in _HOLDS_XMP else []
    # Of other formats, OpenImageIO calls a part of XMP by IPTC's names.
    iptc = format in ("jpeg", "tiff") and any(name.startswith("IPTC:") for name in names)
    lost += ["IPTC"] if iptc and written not in _HOLDS_IPTC else []
    lost += list(packets.unread)
    lost += ["ICC profile"] if "ICCProfile" in names and written not in _HOLDS_ICC else []
    if lost:
        yield f"metadata that the graded file does not hold were left out: {', '.join(dict.fromkeys(lost))}"


_HOLDS_EXIF = frozenset({"jpeg", "tiff", "png", "webp", "jpeg2000", "openexr", "jpegxl"})
_HOLDS_XMP = frozenset({"jpeg", "tiff", "png", "webp", "jpeg2000", "openexr"})
_HOLDS_IPTC = frozenset({"jpeg", "openexr"})
_HOLDS_ICC = frozenset({"jpeg", "tiff", "png", "webp", "jpeg2000", "openexr", "jpegxl"})
"""Formats, by OpenImageIO's names, that a graded picture's metadata are written to."""


def notes_on(
    grade: Grade, format: str, source: oiio.ImageSpec, output: oiio.ImageSpec, space: str, broken: int
) -> Iterator[str]:
    """Yield what the user should know of the colours of a graded image.

    format: of the source, as `Image.format`; space: as `other_space` names it; broken: how many pixels are no finite
    numbers.
    """
    # Scene-linear light in 8-bit files, which hardly ever hold it, and in formats that are made for it
    if grade.for_srgb and not grade.raw and format in ("openexr", "hdr"):
        yield "such a file holds scene-linear light, as a rule, and this grade takes encoded sRGB: encode it first"
    if grade.takes_linear and not grade.raw and str(source.format) == "uint8":
        yield "scene-linear light is what this grade takes, and 8-bit pictures are encoded: linearize them first"
    if grade.gives_linear and str(output.format) == "uint8":
        yield "scene-linear light in 8 bits shows bands: keep it in half or float, with --suffix .exr"
    if space:
        yield f"the picture is in {space}, and was graded as it is: what is made for sRGB wants it converted"
    profile = stored_profile(source)
    if profile and codes_moved(profile) is None:
        yield "the picture's ICC profile is broken: its colours were taken as they are"
    # Graded channels with unusual names, and further layers
    graded, others = ", ".join(source.channelnames[:3]), source.channelnames[3:]
    if tuple(_last_words(source.channelnames[:3])) not in _RGB:
        yield f"the channels {graded} were graded as red, green and blue"
    layers = dict.fromkeys(name.rpartition(".")[0] for name in others if name.lower().endswith((".r", ".red")))
    if layers:
        yield f"{graded} were graded; the layers {', '.join(layers)} are as they were"
    if broken:
        are = "pixels are not finite numbers" if broken > 1 else "pixel is not a finite number"
        yield f"{broken} {are}; what became of them means nothing"


# --- Pixels through a processor: in blocks that stay in a core's cache, on several threads ----------------------------


BLOCK = 64 * 1024
"""Pixels per call of OpenColorIO, which packs them into 1 MB of RGBA floats: what a core's cache holds."""


def grade_floats(processor: OCIO.CPUProcessor, pixels: Pixels, premultiplied: bool, threads: Executor | None) -> None:
    """Grade pixels (h, w, c ≥ 3), C-contiguous, in place."""
    channels = pixels.shape[2]
    flat = pixels.reshape(-1, channels)

    def grade(start: int) -> None:
        for at in range(start, min(start + 2 * BLOCK, len(flat)), BLOCK):
            block = flat[at : at + BLOCK]
            if channels == 3:
                processor.applyRGB(block)
                continue
            colours = np.ascontiguousarray(block[:, :3])
            if premultiplied:
                alpha = block[:, 3:4]
                covered = np.where(alpha > 0, alpha, np.float32(1))
                colours /= covered
                processor.applyRGB(colours)
                block[:, :3] = np.where(alpha > 0, colours * covered, block[:, :3])
            else:
                processor.applyRGB(colours)
                block[:, :3] = colours

    _in_pieces(grade, range(0, len(flat), 2 * BLOCK), threads)


def grade_codes(processor: OCIO.CPUProcessor, canvas: Codes, threads: Executor | None) -> None:
    """Grade 8-bit codes (h, w, 4), C-contiguous, in place."""
    flat = canvas.reshape(-1, 4)
    # OpenColorIO makes floats of the codes: a quarter of a block fills a core's cache together with them.
    block, piece = BLOCK // 4, 8 * BLOCK

    def grade(start: int) -> None:
        for at in range(start, min(start + piece, len(flat)), block):
            processor.applyRGBA(flat[at : at + block])

    _in_pieces(grade, range(0, len(flat), piece), threads)


def _in_pieces(grade: Callable[[int], None], starts: range, threads: Executor | None) -> None:
    for _ in map(grade, starts) if threads is None or len(starts) == 1 else threads.map(grade, starts):
        pass
