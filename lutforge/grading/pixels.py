"""The evaluation of pixels by a processor, in blocks that stay in a core's cache, on several threads."""

from collections.abc import Callable
from concurrent.futures import Executor

import numpy as np
import PyOpenColorIO as OCIO  # noqa: N814 - the name that its documentation uses

from lutforge.arrays import Codes, Single

BLOCK_PIXELS = 64 * 1024
"""Pixels per call of OpenColorIO: 1 MB of RGBA floats, which fit into the cache of a core."""


def grade_floats(processor: OCIO.CPUProcessor, pixels: Single, premultiplied: bool, threads: Executor | None) -> None:
    """Grade pixels (h, w, c ≥ 3), C-contiguous, in place."""
    channels = pixels.shape[2]
    flat = pixels.reshape(-1, channels)

    def grade(start: int) -> None:
        for at in range(start, min(start + 2 * BLOCK_PIXELS, len(flat)), BLOCK_PIXELS):
            block = flat[at : at + BLOCK_PIXELS]
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

    _in_pieces(grade, range(0, len(flat), 2 * BLOCK_PIXELS), threads)


def grade_codes(processor: OCIO.CPUProcessor, canvas: Codes, threads: Executor | None) -> None:
    """Grade 8-bit codes (h, w, 4), C-contiguous, in place."""
    flat = canvas.reshape(-1, 4)
    # OpenColorIO converts the codes to floats, so that a quarter of the pixels fills a core's cache.
    block = BLOCK_PIXELS // 4
    piece = 8 * BLOCK_PIXELS

    def grade(start: int) -> None:
        for at in range(start, min(start + piece, len(flat)), block):
            processor.applyRGBA(flat[at : at + block])

    _in_pieces(grade, range(0, len(flat), piece), threads)


def _in_pieces(grade: Callable[[int], None], starts: range, threads: Executor | None) -> None:
    """Call a function for each start, on threads where there are several starts."""
    for _ in map(grade, starts) if threads is None or len(starts) == 1 else threads.map(grade, starts):
        pass
