"""The coarse search of a registration: all plausible scales, and all offsets at once by FFT.

The small JPEG's structure is a masked template. Its normalized cross-correlation with that of the RAW is computed in
the frequency domain (Padfield 2012, https://doi.org/10.1109/TIP.2011.2181402), with the energy of the RAW's part only.
"""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy
from numpy.typing import NDArray

from lutforge.arrays import Array, Single
from lutforge.shots.area_means import block_mean, on_jpeg_pixels
from lutforge.shots.geometry import Registration
from lutforge.shots.local_structure import share, structure
from lutforge.shots.pyramid import COARSE_SIDE, RawLevel, RawPyramid, ReducedJpeg

OVERLAP = 0.8
"""The share of a JPEG that must lie on the RAW."""


def search(raw: RawPyramid, jpeg: ReducedJpeg, scale: float | None = None) -> list[Registration]:
    """The best place at all plausible scales (or at the one given) with all offsets, and the second best of that scale.

    Searched on a small copy; in coordinates of the whole JPEG. Empty where there is nothing to compare.
    """
    factor = max(1, round(max(jpeg.luma.shape) / COARSE_SIDE))
    mask = (block_mean(jpeg.weight, factor) > 0.5).astype(np.float32)
    template = structure(block_mean(jpeg.luma, factor), mask, share(mask))
    whole = factor * jpeg.factor
    size = [side * raw.finest.pixel_size for side in raw.finest.pixels.shape[:2]]
    scales = _plausible_scales(size, mask) if scale is None else np.array([scale * whole])
    if not scales.size:
        return []
    sides = [math.ceil(side / scales.min()) for side in size]
    # Shifts that leave enough of the mask on the picture are told apart; others may fall on one another.
    reach = [max(_rows_to_spare(mask.sum(axis=axis)[::way]) for way in (1, -1)) for axis in (1, 0)]
    shape = [scipy.fft.next_fast_len(side + most, real=True) for side, most in zip(sides, reach, strict=True)]
    spectra = [np.conj(scipy.fft.rfft2(plane, shape)) for plane in (template, mask)]
    pattern = _Pattern(template, mask, spectra[0], spectra[1], shape)
    level = raw.for_scale(scales.min())
    found = [_match(level, pattern, float(scale)) for scale in scales]
    best = max(found, key=lambda places: places[0].correlation)
    return [place.reduced(1 / whole) for place in best]


def _rows_to_spare(mask: Single) -> int:
    """How many of the first rows, whose masks add up to these sums (n,), may lie beside the picture."""
    return int(np.searchsorted(np.cumsum(mask, dtype=np.float64), (1 - OVERLAP) * float(mask.sum()), side="right"))


@dataclass(frozen=True, eq=False)
class _Pattern:
    """What is looked for: the small JPEG's structure, its mask, and their transforms' conjugates at a shape.

    All is of single precision: what is found is refined.
    """

    template: Single
    mask: Single
    matched: NDArray[np.complex64]
    covering: NDArray[np.complex64]
    shape: list[int]

    @cached_property
    def area(self) -> Array:
        """(h + 1, w + 1) the mask's sum above and left of each corner."""
        return np.pad(self.mask.cumsum(axis=0, dtype=np.float64).cumsum(axis=1), ((1, 0), (1, 0)))

    def overlap(self, rows: int, columns: int) -> Array:
        """The mask's sum on a picture of rows × columns, at each shift of the transforms' shape."""
        ends = []
        for size, own, most in zip((rows, columns), self.mask.shape, self.shape, strict=True):
            shift = np.arange(most)
            shift = np.where(shift < size, shift, shift - most)
            ends.append((np.clip(-shift, 0, own), np.clip(size - shift, 0, own)))
        (top, bottom), (left, right) = ends
        across = self.area[:, right] - self.area[:, left]
        return np.asarray(across[bottom] - across[top])


def _plausible_scales(size: list[float], mask: Single) -> Array:
    """Scales at which the picture (without bars) is as wide or as high as the RAW, 6 % less to 3 % more.

    Cameras trim the borders before they make the JPEG. size: height and width of the RAW.
    """
    inside = np.flatnonzero(mask.max(axis=1)), np.flatnonzero(mask.max(axis=0))
    if not inside[0].size or not inside[1].size:
        return np.zeros(0)
    ratios = [size[axis] / (inside[axis][-1] - inside[axis][0] + 1) for axis in (0, 1)]
    steps = np.arange(-8, 6) * 0.0075
    scales = np.sort(np.concatenate([ratio * np.exp(steps) for ratio in ratios]))
    keep = np.concatenate([[True], np.diff(np.log(scales)) > 1e-9])
    return np.asarray(scales[keep])


def _match(raw: RawLevel, pattern: _Pattern, scale: float) -> list[Registration]:
    """Return the best offset at one scale, and the best a tenth of the picture or more away from it."""
    (height, width), shape = pattern.template.shape, pattern.shape
    rows, columns = (math.ceil(side * raw.pixel_size / scale) for side in raw.luma.shape)
    plane, cover = on_jpeg_pixels(raw.luma, raw.pixel_size, Registration(scale, 0.0, 0.0, 0.0), (rows, columns))
    field = structure(plane, cover, share(cover))
    matched = scipy.fft.irfft2(scipy.fft.rfft2(field, shape) * pattern.matched, shape)
    energy = scipy.fft.irfft2(scipy.fft.rfft2(field * field, shape) * pattern.covering, shape)
    overlap = pattern.overlap(*(int(side.sum()) for side in (cover.max(axis=1), cover.max(axis=0))))
    total = float((pattern.template**2).sum())
    score = matched / np.sqrt(np.maximum(energy, 0.2 * total) * total + 1e-12)
    score[overlap < OVERLAP * pattern.mask.sum()] = -1.0
    places: list[Registration] = []
    for _ in range(2):
        y, x = np.unravel_index(int(np.argmax(score)), score.shape)
        if places and score[y, x] < 0.5 * places[0].correlation:
            break
        shift_y = int(y) if y < rows else int(y) - shape[0]
        shift_x = int(x) if x < columns else int(x) - shape[1]
        places.append(Registration(scale, scale * shift_x, scale * shift_y, float(score[y, x])))
        near_y, near_x = (np.arange(-round(size / 10), round(size / 10) + 1) for size in (height, width))
        score[np.ix_((y + near_y) % shape[0], (x + near_x) % shape[1])] = -1.0
    return places
