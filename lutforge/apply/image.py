"""Grade one image: read, grade and write it region by region, so that memory does not grow with the image."""

import os
import shutil
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from contextlib import AbstractContextManager, ExitStack, contextmanager, nullcontext
from dataclasses import dataclass
from functools import cache
from itertools import zip_longest
from os import cpu_count
from pathlib import Path
from threading import Semaphore

import numpy as np
import OpenImageIO as oiio  # noqa: N813 - the name that its documentation uses
import PyOpenColorIO as OCIO  # noqa: N814 - the name that its documentation uses

from lutforge.apply.colours import (
    check_colours,
    colour_space,
    count_doubtful,
    doubts,
    layers,
    other_space,
    wrong_light,
)
from lutforge.apply.grade import Grade
from lutforge.arrays import Index, Pixels
from lutforge.atomic_write import atomic_path
from lutforge.errors import ImageError
from lutforge.images.raw import read_raw
from lutforge.images.read import ImageReader, Region, is_premultiplied
from lutforge.images.write import image_writer, keeps_orientation, upright, with_shape
from lutforge.shots.discover import RAW_SUFFIXES
from lutforge.shots.metadata import raw_attributes

BLOCK = 64 * 1024
"""Pixels per call of OpenColorIO, which packs them into 1 MB of RGBA floats: what a core's cache holds."""

REGION_SAMPLES = 8_000_000
"""Values in memory per region of an image (32 MB); reading, grading and writing hold one each."""


@cache
def _in_memory() -> Semaphore:
    """How many images may be in memory as a whole at once: a decoded RAW file takes about 2 GB in the worst case."""
    pages = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") if hasattr(os, "sysconf") else 8_000_000_000
    return Semaphore(max(1, pages // 4_000_000_000))


@cache
def _keep_freed_memory() -> None:
    """Have the C library keep what it frees.

    OpenColorIO allocates a megabyte in each call. The C library fetches it from the system and gives it back, which
    takes longer than the LUT, until a larger piece was freed once: from then on it keeps pieces of up to that size.
    """
    np.empty(30_000_000, np.uint8)


_ORIENTATION_OF_FLIP = {3: 3, 5: 8, 6: 6}
"""LibRaw's flip → EXIF orientation."""


@dataclass(frozen=True)
class Applied:
    """A graded image. notes: what the user should know, such as parts of a file that were left out."""

    source: Path
    target: Path
    width: int
    height: int
    notes: tuple[str, ...] = ()
    mask: Path | None = None


@dataclass(frozen=True, eq=False)
class _InMemory:
    """An image that is needed as a whole: RAW files, and those that must be turned for a format without orientation."""

    pixels: Pixels
    spec: oiio.ImageSpec
    format: str = ""
    parts: int = 1

    def regions(self, pixels: int, rows_only: bool) -> list[Region]:
        height, width = self.pixels.shape[:2]
        step = max(1, pixels // width)
        return [Region(0, top, width, min(top + step, height)) for top in range(0, height, step)]

    def read(self, region: Region) -> Pixels:
        return self.pixels[region.top : region.bottom]

    def count_parts(self) -> int:
        return self.parts


def apply_to_pixels(
    processor: OCIO.CPUProcessor,
    pixels: Pixels,
    premultiplied: bool = False,
    workers: int | None = None,
    out: Pixels | None = None,
) -> Pixels:
    """Grade pixels (h, w, c ≥ 3), float32: the first three channels; the others are passed through.

    premultiplied: the colours are multiplied by the fourth channel; they are divided by it for the LUT and
    multiplied again. workers: threads, by default one per core (OpenColorIO works outside Python's lock). out: where
    the result goes, C-contiguous, which may be `pixels` itself; new memory costs more than the LUT.
    Raises ImageError on fewer than three channels.
    """
    if pixels.ndim != 3 or pixels.shape[2] < 3:
        raise ImageError(f"a LUT needs red, green and blue; this image has {pixels.shape[-1]} channel(s)")
    source = np.ascontiguousarray(pixels, dtype=np.float32)
    result = np.empty_like(source) if out is None else out
    with _threads(workers or cpu_count() or 1) as threads:
        _grade(processor, source, result, premultiplied, threads)
    return result


def apply_image(
    grade: Grade,
    source: str | Path,
    target: str | Path,
    workers: int | None = None,
    mask: Path | None = None,
    region_samples: int = REGION_SAMPLES,
    progress: Callable[[int, float], None] | None = None,
) -> Applied:
    """Grade an image file, with metadata, bit depth and extra channels kept.

    workers: threads, by default one per core. mask: where the confidence of the grade is written, 8 bit, from 0 to 1.
    progress: called with the pixels that were graded since its last call, and their share of the image.
    Raises ImageError.
    """
    source, target = Path(source), Path(target)
    if target.exists() and source.exists() and target.samefile(source):
        raise ImageError(f"{source}: the output would replace the input; choose another folder or name")
    if grade.unchanged and mask is None and target.suffix.lower() == source.suffix.lower():
        return _copied(source, target, grade.notes)
    count = workers or cpu_count() or 1
    with ExitStack() as stack:
        image = stack.enter_context(_open(source, target, grade.raw))
        spec = image.spec
        check_colours(source, spec)
        attributes = _attributes(source, image, grade)
        writer = stack.enter_context(image_writer(target, spec, image.format, grade.history, attributes))
        masking = None
        if mask is not None and grade.confidence is not None:
            masking = stack.enter_context(image_writer(mask, _mask_spec(writer.spec), ""))
        threads = stack.enter_context(_threads(count))
        premultiplied = is_premultiplied(spec)
        doubtful = np.zeros(3, dtype=np.int64)

        def work(pixels: Pixels) -> Pixels | None:
            confidence = None
            if grade.confidence is not None:
                confidence = np.empty_like(pixels)
                _grade(grade.confidence, pixels, confidence, premultiplied, threads)
            doubtful[:] += count_doubtful(pixels, confidence)
            if confidence is not None:
                confidence = np.ascontiguousarray(confidence[..., :1]) if masking is not None else None
            _grade(grade.processor, pixels, pixels, premultiplied, threads)
            return confidence

        def write(region: Region, pixels: Pixels, confidence: Pixels | None) -> None:
            writer.write(region, pixels)
            if masking is not None and confidence is not None:
                masking.write(region, confidence)
            if progress is not None:
                progress(region.pixels, region.pixels / (spec.width * spec.height))

        regions = image.regions(max(1, region_samples // spec.nchannels), not writer.tiled)
        _overlapped(regions, image.read, work, write, overlap=count > 1)
        parts = image.count_parts()
        notes = tuple(_notes(grade, spec, writer.spec, attributes, doubtful, parts))
    return Applied(source, target, spec.width, spec.height, notes, mask if masking is not None else None)


def _notes(
    grade: Grade,
    source: oiio.ImageSpec,
    output: oiio.ImageSpec,
    attributes: Mapping[str, object],
    doubtful: Index,
    parts: int,
) -> Iterator[str]:
    """What the user should know of a graded image. doubtful: as `count_doubtful` sums them."""
    yield from grade.notes
    yield from wrong_light(grade, source, output)
    yield from other_space(grade, source, attributes)
    yield from layers(source)
    yield from doubts(doubtful, source.width * source.height)
    if parts != 1:
        yield f"the first of {parts} images in the file was used"


def _copied(source: Path, target: Path, notes: tuple[str, ...]) -> Applied:
    """The image as it is, under another name."""
    with ImageReader(source) as reader:
        width, height = reader.spec.width, reader.spec.height
    with atomic_path(target) as temporary:
        shutil.copyfile(source, temporary)
    return Applied(source, target, width, height, notes)


def _attributes(source: Path, image: ImageReader | _InMemory, grade: Grade) -> dict[str, object]:
    """The metadata that a graded image gets, by OpenImageIO's names."""
    attributes = {**colour_space(source, image.spec, image.format), **grade.attributes}
    if not image.spec.get_string_attribute("DateTime"):
        # Else OpenImageIO dates a TIFF with the moment, and no two runs give the same file.
        changed = time.gmtime(source.stat().st_mtime)
        attributes.setdefault("DateTime", time.strftime("%Y:%m:%d %H:%M:%S", changed))
    return attributes


def _overlapped(
    regions: Sequence[Region],
    read: Callable[[Region], Pixels],
    work: Callable[[Pixels], Pixels | None],
    write: Callable[[Region, Pixels, Pixels | None], None],
    overlap: bool,
) -> None:
    """Read, work, write each region in order; with `overlap` the next is read and the last written meanwhile."""
    if not overlap or len(regions) == 1:
        for region in regions:
            pixels = read(region)
            write(region, pixels, work(pixels))
        return
    with ThreadPoolExecutor(1) as reading, ThreadPoolExecutor(1) as writing:
        ahead = reading.submit(read, regions[0])
        behind: Future[None] | None = None
        for region, following in zip_longest(regions, regions[1:]):
            pixels = ahead.result()
            if following is not None:
                ahead = reading.submit(read, following)
            confidence = work(pixels)
            if behind is not None:
                behind.result()
            behind = writing.submit(write, region, pixels, confidence)
        if behind is not None:
            behind.result()


def _threads(count: int) -> AbstractContextManager[Executor | None]:
    return nullcontext() if count == 1 else ThreadPoolExecutor(count)


def _grade(
    processor: OCIO.CPUProcessor, source: Pixels, result: Pixels, premultiplied: bool, threads: Executor | None
) -> None:
    """Grade `source` into `result`, which may be the same array; both C-contiguous, (h, w, c ≥ 3)."""
    _keep_freed_memory()
    channels = source.shape[2]
    before, after = source.reshape(-1, channels), result.reshape(-1, channels)

    def grade(start: int) -> None:
        for at in range(start, min(start + 2 * BLOCK, len(before)), BLOCK):
            block = after[at : at + BLOCK]
            if result is not source:
                block[:] = before[at : at + BLOCK]
            _grade_block(processor, block, premultiplied)

    starts = range(0, len(before), 2 * BLOCK)
    for _ in map(grade, starts) if threads is None or len(starts) == 1 else threads.map(grade, starts):
        pass


def _grade_block(processor: OCIO.CPUProcessor, block: Pixels, premultiplied: bool) -> None:
    if block.shape[1] == 3:
        processor.applyRGB(block)
        return
    colours = np.ascontiguousarray(block[:, :3])
    if premultiplied:
        alpha = block[:, 3:4]
        covered = np.where(alpha > 0, alpha, np.float32(1))
        colours /= covered
        processor.applyRGB(colours)
        block[:, :3] = np.where(alpha > 0, colours * covered, block[:, :3])
        return
    processor.applyRGB(colours)
    block[:, :3] = colours


@contextmanager
def _open(source: Path, target: Path, raw: bool) -> Iterator[ImageReader | _InMemory]:
    if raw:
        with _in_memory():
            image = read_raw(source)
            pixels = upright(image.pixels, _ORIENTATION_OF_FLIP.get(image.flip, 1))
            spec = oiio.ImageSpec(pixels.shape[1], pixels.shape[0], 3, "uint16")
            for name, value in raw_attributes(source, image).items():
                spec[name] = value
            yield _InMemory(pixels, spec)
        return
    if source.suffix.lower() in RAW_SUFFIXES:
        raise ImageError(f"{source}: a RAW file; what renders it is a camera's profile (.npz)")
    with ImageReader(source) as reader:
        orientation = reader.spec.get_int_attribute("Orientation", 1)
        if orientation == 1 or keeps_orientation(target):
            yield reader
            return
        with _in_memory():
            pixels = upright(reader.read(reader.whole), orientation)
            spec = with_shape(reader.spec, pixels.shape)
            spec.attribute("Orientation", 1)
            yield _InMemory(pixels, spec, reader.format, reader.count_parts())


def _mask_spec(output: oiio.ImageSpec) -> oiio.ImageSpec:
    """One 8-bit channel with the size, place, tiles and orientation of the graded image."""
    spec = oiio.ImageSpec(output)
    spec.nchannels = 1
    spec.channelnames = ("Y",)
    spec.channelformats = ()
    spec.alpha_channel = spec.z_channel = -1
    spec.set_format(oiio.UINT8)
    kept = {name: output.getattribute(name) for name in ("Orientation", "DateTime")}
    for attribute in list(spec.extra_attribs):
        spec.erase_attribute(attribute.name)
    for name, value in kept.items():
        if value is not None:
            spec.attribute(name, value)
    return spec
