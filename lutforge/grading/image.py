"""Grade one image: it is read, graded and written region by region, so that memory does not grow with the image.

Images that must be rendered, turned or converted are in memory as a whole, and so are JPEGs that are graded to JPEGs.
"""

import os
import shutil
import time
from collections.abc import Iterator, Mapping
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from functools import cache
from itertools import zip_longest
from pathlib import Path
from threading import Semaphore

import numpy as np
import OpenImageIO as oiio  # noqa: N813 - the name that its documentation uses

from lutforge.arrays import Single
from lutforge.atomic_write import atomic_path
from lutforge.errors import ImageError
from lutforge.grading.grade import Grade
from lutforge.grading.image_colours import check_colours, colour_space, foreign_space, notes_on, notes_on_packets
from lutforge.grading.pixels import grade_floats
from lutforge.grading.whole_jpeg import grade_whole, jpeg_metadata
from lutforge.images.heif import is_heif
from lutforge.images.icc import foreign_profile, pixels_to_srgb, profile_name
from lutforge.images.jpeg import JpegHeader, read_header
from lutforge.images.orientation import upright
from lutforge.images.output_spec import IN_SRGB, describe_output, format_of, keeps_orientation, with_shape
from lutforge.images.packets import Packets, read_packets
from lutforge.images.read import Image, ImageReader, is_premultiplied, read_image
from lutforge.images.stated_encoding import of_interchange_name
from lutforge.images.write import ImageWriter, image_writer
from lutforge.images.xmp import without_further_pictures
from lutforge.samples.clipping import clipped
from lutforge.shots.discover import RAW_SUFFIXES

REGION_SAMPLES = 8_000_000
"""Values in memory per region of an image (32 MB); reading, grading and writing hold one each."""
ROWS_AT_ONCE = 256
"""Rows of a RAW file whose vignetting is corrected at once."""


@dataclass(frozen=True)
class GradedImage:
    """A graded image. notes: for the user, such as on parts of a file that were left out."""

    source: Path
    target: Path
    width: int
    height: int
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class _Picture:
    """A picture that is open for its grade, with what its file states of its colours.

    image: its pixels; converted: whether they were converted to sRGB. packets: XMP, IPTC and others, empty for RAW
    files. jpeg: the header of a JPEG that becomes a JPEG, else None. further: notes on pictures behind that of a JPEG,
    which are left out. attributes: metadata to set in the output, by OpenImageIO's names. space: the name of the colour
    space where it is not sRGB and the grade sets no other, else "".
    """

    source: Path
    image: ImageReader | Image
    converted: bool
    packets: Packets
    jpeg: JpegHeader | None
    further: tuple[str, ...]
    attributes: Mapping[str, object]
    space: str


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
    _check_target(source, target)
    if grade.unchanged and target.suffix.lower() == source.suffix.lower():
        return _copied(grade, source, target)

    count = workers or os.cpu_count() or 1
    with ExitStack() as stack:
        image, profile = stack.enter_context(_opened(source, target, grade))
        if profile:
            grade = _with_conversion(grade, profile)
        picture = _read_picture(grade, source, target, image, converted=bool(profile))
        output = _described(grade, target, picture)
        threads = None if count == 1 else stack.enter_context(ThreadPoolExecutor(count))
        broken = _write_graded(grade, picture, target, output, threads, region_samples)
        notes = _notes(grade, picture, target, output, broken)
        return GradedImage(source, target, image.spec.width, image.spec.height, notes)


def _check_target(source: Path, target: Path) -> None:
    """Raise ImageError where the output is the input."""
    if target.exists() and source.exists() and target.samefile(source):
        raise ImageError(f"{source}: the output would replace the input; choose another folder or name")


def _with_conversion(grade: Grade, profile: bytes) -> Grade:
    """The grade of a picture that was converted to sRGB from the space of an ICC profile, which it loses."""
    converted = f"the picture is in {profile_name(profile)}: converted to sRGB"
    return replace(grade, attributes={**grade.attributes, "ICCProfile": None}, notes=(*grade.notes, converted))


def _read_picture(grade: Grade, source: Path, target: Path, image: ImageReader | Image, converted: bool) -> _Picture:
    """Read what the header and the packets of a picture state. Raises ImageError where its colours cannot be graded."""
    check_colours(source, image.spec)
    packets = Packets() if grade.raw else read_packets(source)
    if image.format == "openexr":  # where XMP is an attribute, which `image_writer` sets
        encoding = of_interchange_name(image.spec.get_string_attribute("colorInteropID"))
        packets = replace(packets, xmp=image.spec.get_string_attribute("xmp").encode(), encoding=encoding)
    if grade.for_srgb and packets.encoding:
        raise ImageError(
            f"{source}: says that its colours are in {packets.encoding}, and this grade is for sRGB; "
            "convert it to sRGB first"
        )

    header = read_header(source.read_bytes()) if image.format == "jpeg" else None
    jpeg = header if format_of(target) == "jpeg" else None
    attributes = _output_attributes(grade, source, image, jpeg)
    space = foreign_space(grade, image.spec, attributes)
    if grade.for_srgb and space:
        raise ImageError(f"{source}: the picture is in {space}, and this grade is for sRGB; convert it to sRGB first")
    further = () if header is None else header.notes
    return _Picture(source, image, converted, packets, jpeg, further, attributes, space)


def _output_attributes(
    grade: Grade, source: Path, image: ImageReader | Image, jpeg: JpegHeader | None
) -> dict[str, object]:
    """The metadata to set in the output, by OpenImageIO's names."""
    attributes = {**colour_space(source, image.spec, image.format, jpeg), **grade.attributes}
    if not image.spec.get_string_attribute("DateTime"):
        # Without a date OpenImageIO writes the present time to a TIFF, and two runs would give different files.
        changed = time.gmtime(source.stat().st_mtime)
        attributes.setdefault("DateTime", time.strftime("%Y:%m:%d %H:%M:%S", changed))
    return attributes


def _described(grade: Grade, target: Path, picture: _Picture) -> oiio.ImageSpec:
    """The description of the output, in half floats and with the channel "clipped" where the grade adds it."""
    spec = oiio.ImageSpec(picture.image.spec)
    if grade.marks_clipped:
        names = (*spec.channelnames, "clipped")
        spec.nchannels = len(names)
        spec.channelnames = names
        spec.channelformats = ()
    output = describe_output(target, spec, picture.image.format, grade.history, picture.attributes)
    if grade.marks_clipped:
        output.set_format(oiio.HALF)
    if picture.packets.lossless and format_of(target) == "webp":
        output.attribute("compression", "lossless")
    return output


def _write_graded(
    grade: Grade,
    picture: _Picture,
    target: Path,
    output: oiio.ImageSpec,
    threads: Executor | None,
    region_samples: int,
) -> int:
    """Grade a picture and write it, and count the pixels that are no finite numbers."""
    jpeg = picture.jpeg
    spec = picture.image.spec
    # A JPEG of at most 64 Mpixel is graded as a whole, in 8-bit codes; a larger one would take more than 256 MB.
    is_small = spec.width * spec.height <= 64_000_000
    if jpeg is not None and jpeg.plain and is_small and grade.codes is not None and not picture.converted:
        grade_whole(picture.source, jpeg, grade, target, threads)
        return 0

    packets = picture.packets
    start = None if jpeg is None else jpeg_metadata(jpeg, grade)  # which holds the XMP and IPTC of a JPEG
    xmp, iptc = (b"", b"") if start is not None else (without_further_pictures(packets.xmp), packets.iptc)
    with image_writer(target, output, start, xmp, iptc) as writer:
        return _grade_regions(grade, picture.image, writer, threads, region_samples)


def _notes(grade: Grade, picture: _Picture, target: Path, output: oiio.ImageSpec, broken: int) -> tuple[str, ...]:
    """The notes for the user on a graded picture. broken: how many pixels are no finite numbers."""
    image = picture.image
    of_parts = () if image.parts == 1 else (f"the first of {image.parts} images in the file was used",)
    return (
        *grade.notes,
        *notes_on(grade, image.format, image.spec, output, picture.space, broken),
        *of_parts,
        *picture.further,
        *notes_on_packets(picture.packets, image.spec, image.format, format_of(target), picture.jpeg is not None),
    )


def _copied(grade: Grade, source: Path, target: Path) -> GradedImage:
    """A picture that has the target settings already: its file is copied."""
    with ImageReader(source) as reader:
        width = reader.spec.width
        height = reader.spec.height
    with atomic_path(target) as temporary:
        shutil.copyfile(source, temporary)
    return GradedImage(source, target, width, height, grade.notes)


@contextmanager
def _opened(source: Path, target: Path, grade: Grade) -> Iterator[tuple[ImageReader | Image, bytes]]:
    """Open an image for its grade: a RAW file is demosaicked, and a picture turned upright where its target needs it.

    Yields the image, and the ICC profile of the space from which it was converted to sRGB; empty where it was not. A
    picture is turned where the format of the target has no tag for the orientation.
    """
    if grade.raw:
        from lutforge.images.raw import read_raw  # imported here: only RAW files need LibRaw and their metadata
        from lutforge.model.vignetting import vignetting_of
        from lutforge.shots.metadata import lens_of, raw_attributes

        with _limit_of_whole_images():
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
        with _limit_of_whole_images():
            yield _in_srgb(read_image(source), grade)
        return
    with ImageReader(source) as reader:
        orientation = reader.spec.get_int_attribute("Orientation", 1)
        turned = orientation != 1 and not keeps_orientation(target)
        if not turned and not (grade.for_srgb and foreign_profile(reader.spec)):
            yield reader, b""
            return
        with _limit_of_whole_images():
            pixels = reader.read(reader.whole)
            spec = reader.spec
            if turned:
                pixels = upright(pixels, orientation)
                spec = with_shape(spec, pixels.shape)
                spec.attribute("Orientation", 1)
            yield _in_srgb(Image(pixels, spec, reader.format, reader.parts), grade)


def _in_srgb(image: Image, grade: Grade) -> tuple[Image, bytes]:
    """The image, converted to sRGB where its grade is for sRGB, and the profile that it was converted from."""
    profile = foreign_profile(image.spec)
    if not grade.for_srgb or not profile:
        return image, b""
    spec = oiio.ImageSpec(image.spec)
    spec.erase_attribute("ICCProfile")
    spec.attribute("Exif:ColorSpace", IN_SRGB)
    return replace(image, pixels=pixels_to_srgb(image.pixels, profile), spec=spec), profile


@cache
def _limit_of_whole_images() -> Semaphore:
    """The limit of images that are in memory as a whole: a decoded RAW file takes up to about 2 GB."""
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") if hasattr(os, "sysconf") else 8_000_000_000
    return Semaphore(max(1, memory // 4_000_000_000))


def _grade_regions(
    grade: Grade,
    image: ImageReader | Image,
    writer: ImageWriter,
    threads: Executor | None,
    region_samples: int,
) -> int:
    """Read, grade and write an image region by region, and count the pixels that are no finite numbers.

    With threads, the next region is read and the last one written while a region is graded.
    """
    premultiplied = is_premultiplied(image.spec)
    broken = 0

    def work(pixels: Single) -> Single:
        nonlocal broken
        clips = clipped(pixels[..., :3]) if grade.marks_clipped else None
        with np.errstate(all="ignore"):
            total = np.sum(pixels)  # not finite if a pixel is not
        if not np.isfinite(total):
            broken += int(np.count_nonzero(~np.isfinite(pixels[..., :3]).all(axis=-1)))
        grade_floats(grade.processor, pixels, premultiplied, threads)
        return pixels if clips is None else np.dstack([pixels, clips.astype(np.float32)])

    regions = image.regions(max(1, region_samples // image.spec.nchannels), not writer.tiled)
    if threads is None or len(regions) == 1:
        for region in regions:
            writer.write(region, work(image.read(region)))
        return broken
    with ThreadPoolExecutor(1) as reading, ThreadPoolExecutor(1) as writing:
        being_read = reading.submit(image.read, regions[0])
        being_written: Future[None] | None = None
        for region, following in zip_longest(regions, regions[1:]):
            pixels = being_read.result()
            if following is not None:
                being_read = reading.submit(image.read, following)
            pixels = work(pixels)
            if being_written is not None:
                being_written.result()
            being_written = writing.submit(writer.write, region, pixels)
        if being_written is not None:
            being_written.result()
    return broken
