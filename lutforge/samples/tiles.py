"""Flat tiles of any scene: cells where the JPEG's mean is the rendering of the RAW's mean.

The mean of encoded values equals the encoding of the mean only where the scene is flat. Besides, the camera's
sharpening and the JPEG's chroma subsampling (blocks of up to 16 pixels) mix a cell with its surroundings. So RAW and
JPEG must be flat in the cell itself, and nearly flat in the eight cells around it. Flatness is judged by structure,
which is the variance less the noise. The noise is estimated from the flattest cells of the picture, so that a flat wall
at a high ISO is found, too.
"""

import math

import numpy as np
from numpy.typing import NDArray

from lutforge.arrays import Array, Mask
from lutforge.shots.cells import CellStatistics, greatest
from lutforge.shots.geometry import Registration

FLATNESS_LIMITS = ((3, 0.06, 12), (6, 0.12, 24), (9, 0.2, 40))
"""The limits of a tile's structure, from the strictest to the widest: a cell beyond the last is never a tile.

Each has three numbers. The first is the standard deviation of the JPEG in the cell, in codes. The second is that of
RAW, relative to the mean: the curvature of a 1/2.2 power biases the mean by 0.12 times its square. The third is the
difference to a cell around, in codes, of which sharpening and chroma bleeding bring some 5 % into the cell.
"""


def cell_size(registration: Registration) -> int:
    """Side of a cell in JPEG pixels: the fewest whole DCT blocks of 8 that span about 16 full-resolution RAW pixels.

    Compression hardly changes the mean of whole blocks, and the mean of 64 Bayer blocks has an eighth of a pixel's
    noise. 14 pixels are enough: trimmed borders and pincushion distortion take some of the 16, and larger cells seldom
    have one colour.
    """
    return 8 * max(1, math.ceil(14 / (8 * registration.scale)))


def flatness(
    jpeg: CellStatistics,
    raw: CellStatistics,
    cell: int,
    multipliers: Array | None,
    usable: Mask,
    judged: Mask | None = None,
) -> tuple[NDArray[np.intp], Array]:
    """The flatness of each cell: the index of the first of FLATNESS_LIMITS that it meets, and its roughness.

    Both are (hc, wc). The index is len(FLATNESS_LIMITS) where a cell meets none; roughness is the structure as a share
    of the strictest limits. cell: its side in JPEG pixels. judged: cells to judge, all usable ones by default; those
    that are not usable (clipped) do not show the noise. multipliers: (3,) white balance, so that steps in RAW have the
    weight of steps in a JPEG; None: grey world.
    """
    judged = usable if judged is None else judged
    level = np.full(usable.shape, len(FLATNESS_LIMITS), dtype=np.intp)
    if not usable.any():
        return level, np.full(usable.shape, np.inf)

    # Structure of RAW, relative to the mean, and of the JPEG, in codes: both less their noise.
    mean = np.maximum(np.nan_to_num(raw.mean), 1e-6)
    raw_std = np.nan_to_num(raw.std)
    raw_noise = np.minimum(_noise(mean, raw_std, usable, photons=True), (0.25 * mean) ** 2)
    raw_structure = greatest(_structure(raw_std, raw_noise) / mean)

    # The JPEG's noise is believed up to 5 codes, or the RAW's through a power of 1/2.2, which white balance,
    # colour matrix and demosaicking may double. More of it is texture.
    explained = 2 / 2.2 * jpeg.mean * greatest(np.sqrt(raw_noise) / mean)[..., None]
    jpeg_noise = np.minimum(_noise(jpeg.mean, jpeg.std, usable, photons=False), np.maximum(5, explained) ** 2)
    jpeg_structure = greatest(_structure(jpeg.std, jpeg_noise))

    if multipliers is None:
        multipliers = mean[usable].mean() / mean[usable].mean(axis=0)

    # RAW on the scale of codes: cell means brought to the brightness of the JPEG's by one gain.
    encoded = np.power(mean * multipliers, 1 / 2.2)
    encoded *= jpeg.mean[usable].mean() / encoded[usable].mean()

    # The means of two cells differ by their noise, too: by up to four standard deviations of their difference. The
    # deviation of a mean is taken twice as large as if pixels were independent.
    by_chance = 4 * math.sqrt(2) * 2 * np.sqrt(_NOISE_SPREAD * greatest(jpeg_noise) / cell**2)
    step = np.sqrt(np.maximum(0, np.maximum(_step(jpeg.mean), _step(encoded)) ** 2 - by_chance**2))

    # The strictest of FLATNESS_LIMITS that all three meet, with a cell around that is nearly as flat.
    around = _over_neighbours(np.maximum, jpeg_structure)
    structure = np.stack([jpeg_structure, raw_structure, step], axis=-1)
    for index in reversed(range(len(FLATNESS_LIMITS))):
        flat = np.all(structure <= FLATNESS_LIMITS[index], axis=-1) & (around <= 2.5 * FLATNESS_LIMITS[index][0])
        level[judged & flat] = index
    return level, np.where(judged, (structure / FLATNESS_LIMITS[0]).max(axis=-1), np.inf)


def agreement(jpeg: CellStatistics, raw: CellStatistics) -> Mask:
    """Mask (hc, wc) of the cells over which, with the eight around, JPEG and RAW vary together.

    It is judged in the channel that varies most in the JPEG, where it varies by more than noise does (3 codes). Where
    they do not correlate by 0.3, the JPEG shows something else: corrected distortion, a retouched or printed-in mark.
    """
    codes = jpeg.mean
    linear = np.nan_to_num(raw.mean)
    mean_code = _over_neighbours(np.add, codes) / 9
    mean_linear = _over_neighbours(np.add, linear) / 9

    # Sums of squares and products about the means of the nine cells.
    norm = _over_neighbours(np.add, codes * codes) - 9 * mean_code * mean_code
    raw_norm = _over_neighbours(np.add, linear * linear) - 9 * mean_linear * mean_linear
    product = _over_neighbours(np.add, codes * linear) - 9 * mean_code * mean_linear

    correlation = product / np.sqrt(np.maximum(norm * raw_norm, 1e-24))
    strongest = norm.argmax(axis=-1)[..., None]
    varies = np.take_along_axis(norm, strongest, axis=-1)[..., 0] > (3 * 3) ** 2
    agree = np.take_along_axis(correlation, strongest, axis=-1)[..., 0] > 0.3
    return ~varies | agree


_NOISE_SPREAD = 2.0
"""Ratio of the largest variance of 64 correlated pixels of noise to the 10th percentile."""


def _structure(std: Array, noise: Array) -> Array:
    """Standard deviation less that of noise, whose variance is given."""
    return np.sqrt(np.maximum(0.0, std**2 - _NOISE_SPREAD * noise))


def _noise(mean: Array, std: Array, usable: Mask, photons: bool) -> Array:
    """The variance of noise by brightness: the 10th percentile of the variance of usable cells of similar mean.

    The flattest tenth of a picture shows its noise. photons: the noise has the variance a + b·x, which never falls with
    x, and divided by x never rises. So a group of flat cells limits the noise of other groups, which may be textured.
    """
    result = np.empty_like(std)
    for channel in range(3):
        x, variance = mean[..., channel][usable], std[..., channel][usable] ** 2
        group_limits = np.linspace(0, len(x), max(1, min(12, len(x) // 50)) + 1).astype(np.intp)[1:-1]
        groups = np.split(np.argpartition(x, group_limits), group_limits)
        centres = np.array([np.median(x[group]) for group in groups])
        envelope = np.array([np.quantile(variance[group], 0.1) for group in groups])
        if photons:
            envelope = np.minimum.accumulate(envelope / centres) * centres
            envelope = np.minimum.accumulate(envelope[::-1])[::-1]
        result[..., channel] = np.interp(mean[..., channel], centres, envelope)
    return result


def _step(mean: Array) -> Array:
    """The largest difference (hc, wc) of a cell's mean to those of the eight around, over the channels."""
    high = _over_neighbours(np.maximum, mean) - mean
    low = mean - _over_neighbours(np.minimum, mean)
    return greatest(np.maximum(high, low))


def _over_neighbours(combine: np.ufunc, values: Array) -> Array:
    """Combine each cell (h, w, …) with the eight around it, first down, then across; the border repeats."""
    for axis in (0, 1):
        size = values.shape[axis]
        before, after = (np.take(values, np.clip(np.arange(size) + step, 0, size - 1), axis) for step in (-1, 1))
        values = combine(combine(before, values), after)
    return values


PER_SHOT = 3000
"""Tiles of a shot that `choose_evenly` keeps at most."""
PER_BIN = 12
"""Tiles of a colour that it keeps at most."""
PER_BIN_RELAXED = 3
"""Tiles of a colour that it keeps at most, of which few are flat."""


def choose_evenly(codes: Array, places: Array, level: NDArray[np.intp], roughness: Array) -> NDArray[np.intp]:
    """The indices, ascending, of the tiles to keep: at most so many of each colour, from all parts of the picture.

    A sky does therefore not outweigh a flower, nor the middle the corners, where a lens gives less light. codes: (n, 3)
    JPEG 0–255; places: (n, 2) in the picture, −1 … 1; level: (n,) 0 = strictly flat, higher = relaxed; roughness: (n,).

    In each colour bin of 16 codes a side, in which encoded values are roughly perceptually uniform, PER_BIN are kept:
    enough to average their noise away. They are the flattest of each part of the picture in turn, of six by six parts.
    Relaxed ones only fill up bins of fewer than PER_BIN_RELAXED. The cap per bin is lowered until the shot keeps at
    most PER_SHOT. Deterministic: ties go by position.
    """
    cells = np.clip(codes // 16, 0, 15).astype(np.intp)
    colour_bins = (cells[:, 0] * 256 + cells[:, 1]) * 256 + cells[:, 2]
    parts = np.clip(3.0 * (places + 1.0), 0, 5).astype(np.intp)
    bin_and_part = 36 * colour_bins + 6 * parts[:, 0] + parts[:, 1]

    # The flattest of each part in turn, in each bin.
    turn = _ranks(np.lexsort((roughness, level, bin_and_part)), bin_and_part)
    order = np.lexsort((roughness, turn, level, colour_bins))
    rank = _ranks(order, colour_bins)[order]
    candidates = (level[order] == 0) | (rank < PER_BIN_RELAXED)

    cap = PER_BIN
    while cap > 1 and np.count_nonzero(candidates & (rank < cap)) > PER_SHOT:
        cap -= 1
    chosen = order[candidates & (rank < cap)]
    if len(chosen) > PER_SHOT:
        chosen = chosen[np.lexsort((roughness[chosen], level[chosen]))[:PER_SHOT]]
    return np.sort(chosen)


def _ranks(order: NDArray[np.intp], keys: NDArray[np.intp]) -> NDArray[np.intp]:
    """The rank (n,) of each tile in its group of equal keys (n,), whose tiles are one after the other in `order`."""
    ranked = keys[order]
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order)) - np.searchsorted(ranked, ranked, side="left")
    return rank
