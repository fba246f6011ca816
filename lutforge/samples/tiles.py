"""Flat tiles of any scene: cells where the JPEG's mean says what the camera makes of the RAW's mean.

A mean of encoded values is the encoding of the mean only where the scene is flat, and the camera's sharpening
and JPEG's chroma subsampling (blocks of up to 16 pixels) carry colour over from around. So RAW and JPEG must
be flat in the cell itself and nearly so in the eight cells around it. What is judged is structure: variance
less the noise that the picture itself shows in its flattest cells, so that a high ISO does not hide a flat
wall.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from lutforge.samples.clipping import Extremes
from lutforge.shots.cells import CellStatistics
from lutforge.shots.shot import Registration

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

BLOCK = 8
"""JPEG pixels: the side of a DCT block. Cells are whole blocks, whose mean compression hardly changes."""
RAW_SPAN = 16
"""Full-resolution RAW pixels that a cell's side spans at least: 64 Bayer blocks, an eighth of a pixel's
noise."""


@dataclass(frozen=True)
class Limits:
    """How much structure a tile may have.

    jpeg: standard deviation in the cell, codes. raw: the same, relative to the mean; the bias of the mean
    through the curvature of a 1/2.2 power is 0.12 · raw² of the value. step: difference to a cell around,
    codes, of which sharpening and chroma bleeding carry some 5 % into the cell.
    """

    jpeg: float
    raw: float
    step: float


LEVELS = (Limits(3, 0.06, 12), Limits(6, 0.12, 24), Limits(9, 0.2, 40))
"""From strict to the hard bound. Beyond the last a cell is never a tile."""
_AROUND = 2.5  # times the limit for the structure inside the cells around
_MAX_NOISE_CODES = 5.0
_MAX_NOISE_RAW = 0.25
_NOISE_SPREAD = 2.0  # variance of 64 correlated pixels: from its 10th percentile to its highest
_GAMMA = 1 / 2.2


@dataclass(frozen=True, eq=False)
class JpegCells:
    """Statistics of cell × cell JPEG pixels, each (hc, wc, 3), in codes 0–255."""

    mean: Array
    std: Array
    extremes: Extremes


@dataclass(frozen=True, eq=False)
class Flatness:
    """(hc, wc) of each cell: level, the index of the first of LEVELS that it meets (len(LEVELS): none), and
    roughness, its structure as a share of the strict limits."""

    level: NDArray[np.intp]
    roughness: Array


def cell_size(registration: Registration) -> int:
    """Side of a cell in JPEG pixels: the fewest whole DCT blocks that span RAW_SPAN RAW pixels."""
    return BLOCK * max(1, math.ceil(RAW_SPAN / (BLOCK * registration.scale) - 0.05))


def jpeg_cells(jpeg: NDArray[np.uint8], cell: int) -> JpegCells:
    """Statistics over the grid of cells of a JPEG (h, w, 3); a rest at the right and bottom is left out."""
    h, w = jpeg.shape[0] // cell, jpeg.shape[1] // cell
    blocks = jpeg[: h * cell, : w * cell].reshape(h, cell, w, cell, 3)
    mean = blocks.mean(axis=(1, 3), dtype=np.float64)
    square = np.square(blocks, dtype=np.float32).mean(axis=(1, 3), dtype=np.float64)
    std = np.sqrt(np.maximum(0.0, square - mean * mean))
    low, high = blocks.min(axis=(1, 3)), blocks.max(axis=(1, 3))
    return JpegCells(mean, std, Extremes(low.astype(np.float64), high.astype(np.float64)))


def flatness(jpeg: JpegCells, raw: CellStatistics, multipliers: Array | None, usable: Mask) -> Flatness:
    """Judge every cell; those not usable (clipped, outside the RAW) do not show the noise and have no level.

    multipliers: (3,) white balance, so that steps in RAW count like steps in a JPEG; None: grey world.
    """
    level = np.full(usable.shape, len(LEVELS), dtype=np.intp)
    if not usable.any():
        return Flatness(level, np.full(usable.shape, np.inf))
    jpeg_structure = _structure(jpeg.mean, jpeg.std, usable, _MAX_NOISE_CODES, relative=False).max(axis=-1)
    mean = np.maximum(np.nan_to_num(raw.mean), 1e-6)
    raw_structure = _structure(mean, np.nan_to_num(raw.std), usable, _MAX_NOISE_RAW, relative=True)
    raw_structure = (raw_structure / mean).max(axis=-1)
    if multipliers is None:
        multipliers = mean[usable].mean() / mean[usable].mean(axis=0)
    # RAW on the scale of codes: cell means brought to the brightness of the JPEG's by one gain.
    encoded = np.power(mean * multipliers, _GAMMA)
    encoded *= jpeg.mean[usable].mean() / encoded[usable].mean()
    step = np.maximum(_step(jpeg.mean), _step(encoded))
    around = ndimage.maximum_filter(jpeg_structure, 3)
    for index in reversed(range(len(LEVELS))):
        limits = LEVELS[index]
        flat = (jpeg_structure <= limits.jpeg) & (raw_structure <= limits.raw) & (step <= limits.step)
        flat &= around <= _AROUND * limits.jpeg
        level[usable & flat] = index
    strict = LEVELS[0]
    shares = np.stack([jpeg_structure / strict.jpeg, raw_structure / strict.raw, step / strict.step])
    return Flatness(level, np.where(usable, shares.max(axis=0), np.inf))


def agreement(jpeg: JpegCells, raw: CellStatistics) -> Mask:
    """(hc, wc): whether JPEG and RAW vary alike over each cell and the eight around.

    Judged in the channel that varies most in the JPEG, where it varies by more than noise does (3 codes);
    where they do not correlate by 0.3, the JPEG shows something else there than the RAW: corrected
    distortion, a retouched or printed-in mark.
    """
    shape = jpeg.mean.shape[:2]
    windows = np.stack([_around(jpeg.mean), _around(np.nan_to_num(raw.mean))])  # (2, 9, hc, wc, 3)
    windows = windows - windows.mean(axis=1, keepdims=True)
    norms = np.sqrt((windows**2).sum(axis=1))
    correlation = (windows[0] * windows[1]).sum(axis=0) / np.maximum(norms[0] * norms[1], 1e-12)
    strongest = norms[0].argmax(axis=-1)[..., None]
    varies = np.take_along_axis(norms[0], strongest, axis=-1).reshape(shape) > 3 * 3
    agree = np.take_along_axis(correlation, strongest, axis=-1).reshape(shape) > 0.3
    return ~varies | agree


def _structure(mean: Array, std: Array, usable: Mask, ceiling: float, relative: bool) -> Array:
    """Standard deviation less noise. Noise against brightness is the lower envelope (10th percentile) over
    the usable cells of like mean: a picture's flattest tenth shows its noise. It is believed up to
    `ceiling`."""
    result = np.empty_like(std)
    for channel in range(3):
        x, variance = mean[..., channel], std[..., channel] ** 2
        order = np.argsort(x[usable], kind="stable")
        groups = np.array_split(order, max(1, min(12, len(order) // 50)))
        centres = np.array([np.median(x[usable][group]) for group in groups])
        envelope = np.array([np.quantile(variance[usable][group], 0.1) for group in groups])
        if relative:
            # Photon noise has variance a + b·x: it never falls with x, and variance / x never rises.
            # So one flat group tells the others, whose flattest tenth may be textured.
            envelope = np.minimum.accumulate(envelope / centres) * centres
            envelope = np.minimum.accumulate(envelope[::-1])[::-1]
        noise = _NOISE_SPREAD * np.interp(x, centres, envelope)
        bound = (ceiling * x) ** 2 if relative else np.full_like(x, ceiling**2)
        result[..., channel] = np.sqrt(np.maximum(0.0, variance - np.minimum(noise, _NOISE_SPREAD * bound)))
    return result


def _step(mean: Array) -> Array:
    """(hc, wc): the largest difference of a cell's mean to the eight around, over the channels."""
    high = ndimage.maximum_filter(mean, (3, 3, 1)) - mean
    low = mean - ndimage.minimum_filter(mean, (3, 3, 1))
    result: Array = np.maximum(high, low).max(axis=-1)
    return result


def _around(mean: Array) -> Array:
    """(9, hc, wc, 3): each cell and the eight around it; the border repeats."""
    h, w = mean.shape[:2]
    padded = np.pad(mean, ((1, 1), (1, 1), (0, 0)), mode="edge")
    return np.stack([padded[y : y + h, x : x + w] for y in range(3) for x in range(3)])
