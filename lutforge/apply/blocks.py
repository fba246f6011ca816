"""Pixels through a processor: in blocks that stay in a core's cache, on several threads."""

from collections.abc import Callable
from concurrent.futures import Executor, ThreadPoolExecutor
from contextlib import AbstractContextManager, nullcontext
from functools import cache

import numpy as np
import PyOpenColorIO as OCIO  # noqa: N814 - the name that its documentation uses

from lutforge.arrays import Codes, Pixels

BLOCK = 64 * 1024
"""Pixels per call of OpenColorIO, which packs them into 1 MB of RGBA floats: what a core's cache holds."""


def threads_of(count: int) -> AbstractContextManager[Executor | None]:
    """A pool of so many threads; none for one, which needs no pool."""
    return nullcontext() if count == 1 else ThreadPoolExecutor(count)


def grade_floats(
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

    _in_pieces(grade, range(0, len(before), 2 * BLOCK), threads)


def grade_codes(
    processor: OCIO.CPUProcessor, canvas: Codes, threads: Executor | None, done: Callable[[int], None] | None = None
) -> None:
    """Grade 8-bit codes (h, w, 4), C-contiguous, in place. The fourth channel is ignored.

    processor: takes and gives 8-bit codes. done: called with the number of pixels after each piece.
    """
    _keep_freed_memory()
    flat = canvas.reshape(-1, 4)
    # As codes, a quarter of a block fills the same cache together with its floats.
    block, piece = BLOCK // 4, 8 * BLOCK

    def grade(start: int) -> None:
        for at in range(start, min(start + piece, len(flat)), block):
            processor.applyRGBA(flat[at : at + block])
        if done is not None:
            done(min(piece, len(flat) - start))

    _in_pieces(grade, range(0, len(flat), piece), threads)


def _in_pieces(grade: Callable[[int], None], starts: range, threads: Executor | None) -> None:
    for _ in map(grade, starts) if threads is None or len(starts) == 1 else threads.map(grade, starts):
        pass


@cache
def _keep_freed_memory() -> None:
    """Have the C library keep what it frees.

    OpenColorIO allocates a megabyte in each call. The C library fetches it from the system and gives it back, which
    takes longer than the LUT, until a larger piece was freed once: from then on it keeps pieces of up to that size.
    """
    np.empty(30_000_000, np.uint8)
