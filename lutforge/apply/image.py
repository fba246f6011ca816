"""Grade one image, as fast as memory allows."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from os import cpu_count
from pathlib import Path

import numpy as np
import PyOpenColorIO as OCIO  # noqa: N814 - the name that its documentation uses
from numpy.typing import NDArray

from lutforge.apply.grade import Grade
from lutforge.errors import ImageError
from lutforge.images.read import Image, read_image
from lutforge.images.write import write_image

BLOCK = 128 * 1024
"""Pixels per call of OpenColorIO: 1.5 MB, which stays in the cache of a core."""


@dataclass(frozen=True)
class Applied:
    """A graded image. notes: what the user should know, such as parts of a file that were left out."""

    source: Path
    target: Path
    width: int
    height: int
    notes: tuple[str, ...] = ()


def apply_to_pixels(
    processor: OCIO.CPUProcessor,
    pixels: NDArray[np.float32],
    premultiplied: bool = False,
    workers: int | None = None,
) -> NDArray[np.float32]:
    """Grade pixels (h, w, c ≥ 3), float32: the first three channels; the others are passed through.

    premultiplied: the colours are multiplied by the fourth channel; they are divided by it for the LUT and
    multiplied again. workers: threads, by default one per core (OpenColorIO works outside Python's lock).
    Raises ImageError on fewer than three channels.
    """
    if pixels.ndim != 3 or pixels.shape[2] < 3:
        raise ImageError(f"a LUT needs red, green and blue; this image has {pixels.shape[-1]} channel(s)")
    result = np.array(pixels, dtype=np.float32, order="C")
    flat = result.reshape(-1, result.shape[2])

    def grade(start: int) -> None:
        block = flat[start : start + BLOCK]
        if flat.shape[1] == 3:
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

    starts = range(0, len(flat), BLOCK)
    count = max(1, min(workers or cpu_count() or 1, len(starts)))
    if count == 1:
        for start in starts:
            grade(start)
    else:
        with ThreadPoolExecutor(count) as threads:
            for _ in threads.map(grade, starts):
                pass
    return result


def apply_image(
    grade: Grade,
    source: str | Path,
    target: str | Path,
    workers: int | None = None,
) -> Applied:
    """Grade an image file: read, LUT, write, with metadata, bit depth and extra channels kept. Raises ImageError."""
    source, target = Path(source), Path(target)
    if target.exists() and source.exists() and target.samefile(source):
        raise ImageError(f"{source}: the output would replace the input; choose another folder or name")
    image = read_image(source)
    _check_channels(source, image)
    graded = apply_to_pixels(grade.processor, image.pixels, image.alpha_is_premultiplied, workers)
    write_image(target, graded, image, grade.history)
    notes = grade.notes
    if image.parts > 1:
        notes = (*notes, f"{source}: the first of {image.parts} images in the file was used")
    return Applied(source, target, image.spec.width, image.spec.height, notes)


def _check_channels(path: Path, image: Image) -> None:
    if image.pixels.shape[2] < 3:
        raise ImageError(f"{path}: a LUT needs red, green and blue; this image has {image.pixels.shape[2]} channel(s)")
    alpha = image.spec.alpha_channel
    if 0 <= alpha < 3 or (alpha > 3 and image.alpha_is_premultiplied):
        raise ImageError(f"{path}: channels are {', '.join(image.spec.channelnames)}; put R, G, B, A first")
