"""Coarse search of a JPEG's place on its RAW: normalized cross-correlation at all plausible scales, all offsets.

The structure of a small copy of the JPEG is a masked template, whose correlation with that of the RAW is computed in
the frequency domain (Padfield 2012, https://doi.org/10.1109/TIP.2011.2181402), with the energy of the RAW's part only.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from lutforge.arrays import Array, Single
from lutforge.shots.geometry import Registration
from lutforge.shots.registration.area_means import block_mean
from lutforge.shots.registration.colour_prediction import quadratic
from lutforge.shots.registration.local_structure import local_weight, structure
from lutforge.shots.registration.reduced_copies import COARSE_SIDE, LUMA, RawLevel, ReducedJpeg, on_jpeg_pixels

OVERLAP = 0.8
"""The share of a JPEG that must lie on the RAW."""
SCALES = np.exp(0.0075 * np.arange(-8, 6))
"""Steps of 0.75 % about the scale at which the JPEG is as wide or as high as the RAW: from 6 % less, since cameras trim
the borders and enlarge what distortion was removed from, to 3 % more."""
LEAST_ENERGY = 0.2
"""Energy of a part of the RAW, as a share of the template's, below which its correlation is damped.

Else a flat part of the RAW would correlate by its noise.
"""


def search(raw: RawLevel, jpeg: ReducedJpeg) -> list[Registration]:
    """The best place at all plausible scales with all offsets, and the second best of that scale.

    In coordinates of the whole JPEG. Empty where there is nothing to compare.
    """
    template = _Template.of(jpeg)
    if not template.mask.any():
        return []
    size = [side * raw.pixel_size for side in raw.pixels.shape[:2]]
    return _best_places(raw, template, _plausible_scales(size, template.mask))


def search_at_scale(raw: RawLevel, jpeg: ReducedJpeg, scale: float) -> list[Registration]:
    """Search the places of a JPEG in a RAW at one known scale, in RAW pixels per pixel of the whole JPEG."""
    template = _Template.of(jpeg)
    return _best_places(raw, template, np.array([scale * template.factor]))


@dataclass(frozen=True, eq=False)
class _Template:
    """A small copy of a JPEG to search: local structure (h, w), mask (h, w) 0 or 1, pixels of the JPEG along one."""

    structure: Single
    mask: Single
    factor: int

    @classmethod
    def of(cls, jpeg: ReducedJpeg) -> "_Template":
        factor = max(1, round(max(jpeg.luma.shape) / COARSE_SIDE))
        mask = (block_mean(jpeg.weight, factor) > 0.5).astype(np.float32)
        detail = structure(block_mean(jpeg.luma, factor), mask, local_weight(mask))
        return cls(detail, mask, factor * jpeg.factor)

    @property
    def energy(self) -> float:
        return float((self.structure**2).sum())

    @property
    def area(self) -> float:
        return float(self.mask.sum())


def _plausible_scales(size: Sequence[float], mask: Single) -> Array:
    """Scales (n,), rising, at which the part of the mask is about as high or as wide as a RAW of this size."""
    inside = [np.flatnonzero(mask.max(axis=1 - axis)) for axis in (0, 1)]
    ratios = [side / (lines[-1] - lines[0] + 1) for side, lines in zip(size, inside, strict=True)]
    scales = np.sort(np.concatenate([ratio * SCALES for ratio in ratios]))
    different = np.concatenate([[True], np.diff(np.log(scales)) > 1e-9])
    return np.asarray(scales[different])


def _best_places(raw: RawLevel, template: _Template, scales: Array) -> list[Registration]:
    """The best place of all scales (n,) and the second best of the same scale, in coordinates of the whole JPEG."""
    shape = _transform_shape(raw, template, scales)
    matched, covering = (np.conj(scipy.fft.rfft2(plane, shape)) for plane in (template.structure, template.mask))
    level = raw.for_scale(scales.min())
    luma_alone = np.concatenate([[0], LUMA, np.zeros(6)]).astype(np.float32)
    luma = quadratic(level.pixels, level.gains, luma_alone)

    best: list[Registration] = []
    for scale in scales.tolist():
        rows, columns = (math.ceil(side * level.pixel_size / scale) for side in luma.shape)
        plane, cover = on_jpeg_pixels(luma, level.pixel_size, Registration(scale, 0.0, 0.0, 0.0), (rows, columns))
        field = structure(plane, cover, local_weight(cover))
        product, energy, overlap = (
            scipy.fft.irfft2(scipy.fft.rfft2(picture, shape) * pattern, shape)
            for picture, pattern in ((field, matched), (field * field, covering), (cover, covering))
        )
        floor = LEAST_ENERGY * template.energy
        correlation = product / np.sqrt(np.maximum(energy, floor) * template.energy + 1e-12)
        correlation[overlap < OVERLAP * template.area - 0.5] = -1.0
        if not best or correlation.max() > best[0].correlation:
            best = _two_highest(correlation, scale, (rows, columns), template.mask.shape)
    return [registration.reduced(1 / template.factor) for registration in best]


def _transform_shape(raw: RawLevel, template: _Template, scales: Array) -> list[int]:
    """The shape of a Fourier transform that holds the RAW at each scale, and shifts that leave OVERLAP on it.

    Shifts beyond these may fall on one another: they do not count.
    """
    most_outside = (1 - OVERLAP) * template.area
    shape = []
    for side, lines in zip(raw.pixels.shape[:2], (template.mask.sum(axis=1), template.mask.sum(axis=0)), strict=True):
        from_ends = [np.cumsum(lines[::way], dtype=np.float64) for way in (1, -1)]
        reach = int(max(np.searchsorted(sums, most_outside, side="right") for sums in from_ends))
        longest = math.ceil(side * raw.pixel_size / scales.min())
        shape.append(scipy.fft.next_fast_len(longest + reach + 1, real=True))
    return shape


def _two_highest(
    correlation: Array, scale: float, size: tuple[int, int], template: tuple[int, ...]
) -> list[Registration]:
    """The places of the highest correlation, and of the next, a tenth of the picture or more away; it is overwritten.

    size: rows and columns of the RAW; shifts from there on are negative ones.
    """
    height, width = correlation.shape
    best: list[Registration] = []
    for _ in range(2):
        y, x = np.unravel_index(int(np.argmax(correlation)), correlation.shape)
        highest = float(correlation[y, x])
        if best and highest < 0.5 * best[0].correlation:
            break
        down = int(y) - (height if y >= size[0] else 0)
        across = int(x) - (width if x >= size[1] else 0)
        best.append(Registration(scale, scale * across, scale * down, highest))

        near_y, near_x = (np.arange(-round(side / 10), round(side / 10) + 1) for side in template)
        correlation[np.ix_((y + near_y) % height, (x + near_x) % width)] = -1.0
    return best
