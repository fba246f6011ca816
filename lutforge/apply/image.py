"""Grade one image: read, grade and write it region by region, so that memory does not grow with the image."""

import shutil
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import dataclass, replace
from itertools import zip_longest
from os import cpu_count
from pathlib import Path

import numpy as np
import OpenImageIO as oiio  # noqa: N813 - the name that its documentation uses

from lutforge.apply.blocks import grade_floats, threads_of
from lutforge.apply.colours import (
    check_colours,
    check_space,
    colour_space,
    count_doubtful,
    doubts,
    layers,
    other_space,
    wrong_light,
)
from lutforge.apply.grade import Grade
from lutforge.apply.jpeg import Canvases, JpegSource, grade_whole, jpeg_source
from lutforge.apply.open_image import InMemoryImage, open_image
from lutforge.arrays import Index, Pixels
from lutforge.atomic_write import atomic_path
from lutforge.errors import ImageError
from lutforge.images.icc import profile_name
from lutforge.images.read import ImageReader, Region, is_premultiplied
from lutforge.images.write import ImageWriter, describe_output, image_writer
from lutforge.model.highlights import clipped

REGION_SAMPLES = 8_000_000
"""Values in memory per region of an image (32 MB); reading, grading and writing hold one each."""


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
    progress: Callable[[int, float], None] | None = None,
    quality: int | None = None,
    canvases: Canvases | None = None,
) -> GradedImage:
    """Grade an image file, with metadata, bit depth and extra channels kept.

    workers: threads, by default one per core. progress: called with the pixels that were graded since its last call,
    and their share of the image. quality: of a JPEG, 1 … 100, by default its source's. canvases: memory that the images
    of a batch share. Raises ImageError.
    """
    source, target = Path(source), Path(target)
    if target.exists() and source.exists() and target.samefile(source):
        raise ImageError(f"{source}: the output would replace the input; choose another folder or name")
    if grade.unchanged and quality is None and target.suffix.lower() == source.suffix.lower():
        return _copied(source, target, grade.notes)
    count = workers or cpu_count() or 1
    with ExitStack() as stack:
        image = stack.enter_context(open_image(source, target, grade))
        spec, profile = image.spec, image.profile if isinstance(image, InMemoryImage) else b""
        if profile:
            said = f"the picture is in {profile_name(profile)}: converted to sRGB"
            grade = replace(grade, attributes={**grade.attributes, "ICCProfile": None}, notes=(*grade.notes, said))
        check_colours(source, spec)
        jpeg = jpeg_source(source, target, image.format)
        attributes = _attributes(source, image, grade, jpeg)
        check_space(source, grade, spec, attributes)
        shown = _with_mask(spec) if grade.marks_clipped else spec
        output = describe_output(target, shown, image.format, grade.history, attributes, quality)
        if grade.marks_clipped:
            output.set_format(oiio.HALF)
        threads = stack.enter_context(threads_of(count))
        total = spec.width * spec.height

        def done(pixels: int) -> None:
            if progress is not None:
                progress(pixels, pixels / total)

        if jpeg is not None and jpeg.is_graded_whole and grade.codes is not None and not profile:
            whole = canvases or Canvases(1)
            doubtful = grade_whole(jpeg, grade, target, quality, threads, whole, done)
        else:
            start = None if jpeg is None else jpeg.metadata(grade, profile)
            writer = stack.enter_context(image_writer(target, output, start))
            doubtful = _grade_regions(grade, image, writer, threads, region_samples, count > 1, done)
        notes = (
            *_notes(grade, image, output, attributes, doubtful),
            *(() if jpeg is None else jpeg.notes),
        )
    return GradedImage(source, target, spec.width, spec.height, notes)


def _grade_regions(
    grade: Grade,
    image: ImageReader | InMemoryImage,
    writer: ImageWriter,
    threads: Executor | None,
    region_samples: int,
    overlap: bool,
    done: Callable[[int], None],
) -> Index:
    """Read, grade and write an image region by region; (3,) how many pixels are doubtful, as `count_doubtful`."""
    premultiplied = is_premultiplied(image.spec)
    doubtful = np.zeros(3, dtype=np.int64)

    def work(pixels: Pixels) -> Pixels:
        confidence = None
        clips = clipped(pixels[..., :3]) if grade.marks_clipped else None
        if grade.confidence is not None:
            confidence = np.empty_like(pixels)
            grade_floats(grade.confidence, pixels, confidence, premultiplied, threads)
        doubtful[:] += count_doubtful(pixels, confidence)
        grade_floats(grade.processor, pixels, pixels, premultiplied, threads)
        return pixels if clips is None else np.dstack([pixels, clips.astype(np.float32)])

    def write(region: Region, pixels: Pixels) -> None:
        writer.write(region, pixels)
        done(region.pixels)

    regions = image.regions(max(1, region_samples // image.spec.nchannels), not writer.tiled)
    _overlapped(regions, image.read, work, write, overlap)
    return doubtful


def _notes(
    grade: Grade,
    image: ImageReader | InMemoryImage,
    output: oiio.ImageSpec,
    attributes: Mapping[str, object],
    doubtful: Index,
) -> Iterator[str]:
    """What the user should know of a graded image. doubtful: as `count_doubtful` sums them."""
    source, parts = image.spec, image.count_parts()
    yield from grade.notes
    yield from wrong_light(grade, image.format, source, output)
    yield from other_space(grade, source, attributes)
    yield from layers(source)
    yield from doubts(doubtful, source.width * source.height)
    if parts != 1:
        yield f"the first of {parts} images in the file was used"


def _with_mask(spec: oiio.ImageSpec) -> oiio.ImageSpec:
    """A description with a channel more, "clipped"."""
    names = (*spec.channelnames, "clipped")
    spec = oiio.ImageSpec(spec)
    spec.nchannels, spec.channelnames, spec.channelformats = len(names), names, ()
    return spec


def _copied(source: Path, target: Path, notes: tuple[str, ...]) -> GradedImage:
    """Copy the image file as it is to another name."""
    with ImageReader(source) as reader:
        width, height = reader.spec.width, reader.spec.height
    with atomic_path(target) as temporary:
        shutil.copyfile(source, temporary)
    return GradedImage(source, target, width, height, notes)


def _attributes(
    source: Path, image: ImageReader | InMemoryImage, grade: Grade, jpeg: JpegSource | None
) -> dict[str, object]:
    """The metadata that a graded image gets, by OpenImageIO's names."""
    attributes = {
        **colour_space(source, image.spec, image.format, None if jpeg is None else jpeg.header),
        **grade.attributes,
    }
    if not image.spec.get_string_attribute("DateTime"):
        # Else OpenImageIO dates a TIFF with the moment, and no two runs give the same file.
        changed = time.gmtime(source.stat().st_mtime)
        attributes.setdefault("DateTime", time.strftime("%Y:%m:%d %H:%M:%S", changed))
    return attributes


def _overlapped(
    regions: Sequence[Region],
    read: Callable[[Region], Pixels],
    work: Callable[[Pixels], Pixels],
    write: Callable[[Region, Pixels], None],
    overlap: bool,
) -> None:
    """Read, work, write each region in order; with `overlap` the next is read and the last written meanwhile."""
    if not overlap or len(regions) == 1:
        for region in regions:
            write(region, work(read(region)))
        return
    with ThreadPoolExecutor(1) as reading, ThreadPoolExecutor(1) as writing:
        ahead = reading.submit(read, regions[0])
        behind: Future[None] | None = None
        for region, following in zip_longest(regions, regions[1:]):
            pixels = ahead.result()
            if following is not None:
                ahead = reading.submit(read, following)
            pixels = work(pixels)
            if behind is not None:
                behind.result()
            behind = writing.submit(write, region, pixels)
        if behind is not None:
            behind.result()
