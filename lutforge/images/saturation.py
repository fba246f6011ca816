"""The level at which the pixels of a RAW file saturate: clipping leaves a spike in the histogram."""

import math

import numpy as np
import rawpy
from numpy.typing import NDArray

from lutforge.arrays import Array, Index
from lutforge.compiled import compiled


def clip_levels(raw: rawpy.RawPy, colours: NDArray[np.uint8]) -> Array:
    """Return the level (3,) at which each channel of a file saturates, 1 = LibRaw's nominal maximum.

    It is 1 where the file shows no other level. colours: indices (n, n) of the pattern that repeats over the visible
    mosaic, (0, 0) where there is none.
    """
    levels = np.ones(3)
    if not colours.size:
        return levels
    counts = np.zeros((4, 65536), np.intp)
    _count(raw.raw_image_visible, colours, counts)
    black, white = raw.black_level_per_channel, int(raw.white_level)
    for index in range(4):
        channel = 1 if index == 3 else index
        offset = int(black[min(index, len(black) - 1)])
        if white > offset:
            level = saturation_spike(counts[index, offset:], white - offset)
            levels[channel] = min(levels[channel], level)
    return levels


@compiled()
def _count(mosaic: NDArray[np.uint16], colours: NDArray[np.uint8], counts: Index) -> None:
    """Add to counts (4, 65536) how often each colour of a mosaic (h, w) has each value."""
    period = len(colours)
    for y in range(len(mosaic)):
        for start in range(period):
            counts_of_colour = counts[colours[y % period, start]]
            for value in mosaic[y, start::period]:
                counts_of_colour[value] += 1


def saturation_spike(histogram: NDArray[np.intp], white: int) -> float:
    """The level in (0, 1], 1 = `white`, at which the spike of clipped values begins; 1 where there is no spike.

    histogram: counts of the values 0, 1, 2 … above black. The values of saturated pixels have a standard deviation of
    at most about 0.2 % of white, and there is next to nothing above them; the photon noise of an evenly lit surface of
    that brightness is wider (0.35 % at 80,000 electrons).
    """
    bins = min(1000, white)
    edges = np.linspace(0, white, bins + 1).astype(int)
    counts = np.concatenate([histogram, np.zeros(max(0, white + 1 - len(histogram)), histogram.dtype)])
    density = np.add.reduceat(counts, edges[:-1]).astype(np.float64)  # the last bin also counts all higher values

    # The highest bin with 50 pixels in and above it: higher ones hold only hot pixels.
    reached = np.flatnonzero(np.cumsum(density[::-1]) >= 50)
    top = bins - 1 - int(reached[0]) if reached.size else 0
    if top < 0.7 * bins:
        return 1.0

    # The spike near that bin: its mean, its standard deviation, and the counts below and above it.
    peak = top - 15 + int(np.argmax(density[top - 15 : top + 1]))
    near = np.arange(max(0, peak - 10), min(bins, peak + 11))
    spike = density[near].sum()
    if spike < 200 or peak >= bins - 2:
        return 1.0
    centre = float(near @ density[near] / spike)
    spread = math.sqrt(float(((near - centre) ** 2) @ density[near] / spike)) / bins
    below = len(near) * density[max(0, peak - 40) : max(1, peak - 12)].mean()
    above = density[peak + 11 :].sum()
    if spread > 0.0028 or spike < 4 * below or above > 0.005 * spike:
        return 1.0
    return max(0.0, centre / bins - max(3 * spread, 1.5 / bins))
