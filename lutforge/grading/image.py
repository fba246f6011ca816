"""Grade one image: read, grade and write it region by region, so that memory does not grow with the image.

Whole in memory are images that must be rendered, turned or converted, and JPEG files that become JPEG files.
"""

import os
import shutil
import time
from collections.abc import Iterator
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from functools import cache
from itertools import zip_longest
from pathlib import Path
from threading import Semaphore

import numpy as np
import OpenImageIO as oiio  # noqa: N813 - the name that its documentation uses

from lutforge.arrays import Pixels
from lutforge.atomic_write import atomic_path
from lutforge.errors import ImageError
from lutforge.grading.grade import Grade
from lutforge.grading.image_colours import check_colours, colour_space, notes_on, notes_on_packets, other_space
from lutforge.grading.pixels import grade_floats
from lutforge.grading.whole_jpeg import grade_whole, jpeg_metadata
from lutforge.images.heif import is_heif
from lutforge.images.icc import foreign_profile, pixels_to_srgb, profile_name
from lutforge.images.jpeg import read_header
from lutforge.images.orientation import upright
from lutforge.images.packets import Packets, read_packets
from lutforge.images.read import Image, ImageReader, is_premultiplied, read_image
from lutforge.images.write import (
    IN_SRGB,
    ImageWriter,
    describe_output,
    format_of,
    image_writer,
    keeps_orientation,
    with_shape,
)
from lutforge.images.xmp import without_further_pictures
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
        return _copied(grade, source, target)

    count = workers or os.cpu_count() or 1
    with ExitStack() as stack:
        image, profile = stack.enter_context(_opened(source, target, grade))
        spec = image.spec
        if profile:
            converted = f"the picture is in {profile_name(profile)}: converted to sRGB"
            grade = replace(grade, attributes={**grade.attributes, "ICCProfile": None}, notes=(*grade.notes, converted))

        # What its header and its packets say of its colours.
        check_colours(source, spec)
        packets = Packets() if grade.raw else read_packets(source)
        if image.format == "openexr":  # whose attribute `image_writer` sets
            packets = replace(packets, xmp=spec.get_string_attribute("xmp").encode())
        if grade.for_srgb and packets.encoding:
            raise ImageError(
                f"{source}: says that its colours are in {packets.encoding}, and this grade is for sRGB; "
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

        # What the output holds: a further channel that marks what is clipped, in linear files.
        written = oiio.ImageSpec(spec)
        if grade.marks_clipped:
            names = (*spec.channelnames, "clipped")
            written.nchannels = len(names)
            written.channelnames = names
            written.channelformats = ()
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
            xmp, iptc = (b"", b"") if start is not None else (without_further_pictures(packets.xmp), packets.iptc)
            if packets.lossless and format_of(target) == "webp":
                output.attribute("compression", "lossless")
            writer = stack.enter_context(image_writer(target, output, start, xmp, iptc))
            broken = _grade_regions(grade, image, writer, threads, region_samples, count > 1)
        parts = image.parts

    notes = (
        *grade.notes,
        *notes_on(grade, image.format, spec, output, space, broken),
        *((f"the first of {parts} images in the file was used",) if parts != 1 else ()),
        *(() if jpeg is None else jpeg.notes),
        *notes_on_packets(packets, spec, image.format, format_of(target), jpeg is not None),
    )
    return GradedImage(source, target, spec.width, spec.height, notes)


def _copied(grade: Grade, source: Path, target: Path) -> GradedImage:
    """A picture that has the settings already: its file as it is."""
    with ImageReader(source) as reader:
        width = reader.spec.width
        height = reader.spec.height
    with atomic_path(target) as temporary:
        shutil.copyfile(source, temporary)
    return GradedImage(source, target, width, height, grade.notes)


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
