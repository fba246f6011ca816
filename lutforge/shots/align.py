"""Registration of a camera's JPEG on its RAW: one scale and an offset, and what the camera straightened.

The two pictures differ by a tone curve and a colour matrix, so what is compared is their local structure:
luma, gamma-compressed, band-passed, and divided by its local contrast. A coarse search proposes places. The one where
the RAW's colours explain the JPEG's best is taken, if no other does nearly as well, and refined below a tenth of a
pixel, coarse to fine, with how the lens bent what the JPEG shows straight (`geometry`), where that is beyond chance.
Each step works on the coarsest copies that serve it; the RAW is always averaged over exactly a JPEG pixel's area.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
import scipy

from lutforge.arrays import Array, Codes, Index, Pixels, Single
from lutforge.compiled import REASSOCIATED, compiled
from lutforge.errors import ShotError
from lutforge.images.raw import RawImage
from lutforge.shots.cells import greatest
from lutforge.shots.geometry import Distortion, Placement, Registration

MIN_SIDE = 200
"""A JPEG whose longer side is shorter than this is a thumbnail: its pixels average too much of the scene."""
COARSE_SIDE = 192
"""Pixels of the longer side of the copy that is searched."""
LUMA = np.array([0.299, 0.587, 0.114], dtype=np.float32)  # ITU-R BT.601, as in JPEG


@dataclass(frozen=True, eq=False)
class RawLevel:
    """RAW of one size: linear pixels (h, w, 3), a side in full-resolution pixels, and gains (3,) to a grey world."""

    pixels: Pixels
    gains: Single
    pixel_size: float
    _coarser: dict[int, "RawLevel"] = field(default_factory=dict)

    @classmethod
    def of(cls, raw: RawImage, jpeg: Codes) -> "RawLevel":
        """The RAW, not finer than a registration of this JPEG (h, w, 3) needs."""
        scale = max(raw.pixels.shape[:2]) * raw.pixel_size / max(jpeg.shape[:2]) * reduction(raw, jpeg)
        means = raw.pixels[::16, ::16].mean(axis=(0, 1), dtype=np.float64)
        gains = (0.25 / np.maximum(means, 1e-6)).astype(np.float32)
        return cls(raw.pixels, gains, raw.pixel_size).for_scale(scale)

    def for_scale(self, scale: float) -> "RawLevel":
        """The coarsest copy for a JPEG whose pixels are `scale` full-resolution pixels wide, made once.

        Its pixels are means over squares of 2ⁿ pixels a side; a rest at the right and bottom is left out. At least two
        of them lie along a JPEG's pixel: then errors against known geometry are those of RAW as it is, mean 0.0462 of a
        JPEG's pixel; with one and a quarter, a picture of 24 million pixels was placed 0.05 of a pixel worse.
        """
        halvings = max(0, math.floor(math.log2(scale / self.pixel_size / 2)))
        if halvings == 0:
            return self
        if halvings not in self._coarser:
            side = 2**halvings
            self._coarser[halvings] = RawLevel(block_mean(self.pixels, side), self.gains, self.pixel_size * side)
        return self._coarser[halvings]

    @property
    def flat(self) -> Distortion:
        """No distortion, about the middle."""
        x, y = self.pixel_size * np.array(self.pixels.shape[1::-1]) / 2
        return Distortion(float(x), float(y), math.hypot(x, y))

    def straightened(self, place: Registration, jpeg: "ReducedJpeg") -> tuple["RawLevel", Registration]:
        """It, as straight as a JPEG that lies at a place, and where the JPEG lies on that."""
        pixels, local = place.straightened(self.pixels, self.pixel_size, jpeg.weight.shape)
        return RawLevel(pixels, self.gains, self.pixel_size), local


@dataclass(frozen=True, eq=False)
class ReducedJpeg:
    """A JPEG's codes (h, w, 3) / 255, means of factor² pixels, and weights: 0 where clipped or in a black bar."""

    codes: Single
    weight: Single
    factor: int

    @classmethod
    def of(cls, raw: RawImage, jpeg: Codes) -> "ReducedJpeg":
        """Reduce a JPEG as far as `reduction` says. Raises ShotError for a thumbnail."""
        height, width = jpeg.shape[:2]
        if max(height, width) < MIN_SIDE or min(height, width) < MIN_SIDE // 2:
            raise ShotError(f"only {width}×{height} pixels: a thumbnail, too small to register")
        factor = reduction(raw, jpeg)
        small = block_mean(jpeg, factor)
        brightest = greatest(small)
        weight = np.where((brightest < 252) & (brightest > 4), _inside_bars(brightest), np.float32(0.0))
        return cls(small / np.float32(255), weight, factor)

    @cached_property
    def luma(self) -> Single:
        """The luma (h, w), 0 … 1."""
        return np.asarray(self.codes @ LUMA)

    def halved(self, times: int) -> "ReducedJpeg":
        """Reduced by 2^times more."""
        if times == 0:
            return self
        weight = (block_mean(self.weight, 2**times) > 0.99).astype(np.float32)
        return ReducedJpeg(block_mean(self.codes, 2**times), weight, self.factor * 2**times)

    @property
    def halvings(self) -> int:
        """How often it is halved to become about as small as for the coarse search."""
        return max(0, round(math.log2(max(self.luma.shape) / COARSE_SIDE)))

    @cached_property
    def coarsest(self) -> "ReducedJpeg":
        """It, about as small as for the coarse search."""
        return self.halved(self.halvings)


def reduction(raw: RawImage, jpeg: Codes) -> int:
    """By what a JPEG is reduced: to at most a million pixels, not finer than RAW, whose blocks would be compared."""
    height, width = jpeg.shape[:2]
    factor: int = max(math.ceil(math.sqrt(height * width / 1e6)), math.ceil(max(height, width) / max(raw.pixels.shape)))
    return factor


def _inside_bars(brightest: Single) -> Single:
    """(h, w) 0 on the black bars that some cameras put around a preview of another aspect ratio, else 1."""
    dark = brightest < 16
    mask = np.ones(dark.shape, dtype=np.float32)
    for axis in (0, 1):
        lines = np.asarray(dark.mean(axis=1 - axis) > 0.99)
        inside = np.flatnonzero(~lines)
        if inside.size and len(lines) - inside.size < 0.4 * len(lines):
            low, high = int(inside[0]), int(inside[-1]) + 1
            index = np.arange(len(lines))
            bar = (index < low + (2 if low else 0)) | (index >= high - (2 if high < len(lines) else 0))
            mask *= (~bar)[:, None] if axis == 0 else (~bar)[None, :]
    return mask


def cells_of_jpeg(
    place: Registration, shape: tuple[int, int], raw: tuple[int, ...], pixel_size: float
) -> tuple[tuple[Array, Array], Single]:
    """The borders of a JPEG's rows (h + 1,) and columns (w + 1,) in RAW pixels, and which pixels RAW covers, 0 or 1."""
    borders = place.borders(shape, 1, pixel_size)
    covers = [(edges[:-1] >= 0) & (edges[1:] <= size) for edges, size in zip(borders, raw[:2], strict=True)]
    return borders, np.outer(*covers).astype(np.float32)


def on_jpeg_pixels(plane: Single, side: float, place: Registration, shape: tuple[int, int]) -> tuple[Single, Single]:
    """RAW values averaged over each JPEG pixel (h, w), and whether RAW covers it, 0 or 1."""
    borders, covers = cells_of_jpeg(place, shape, plane.shape, side)
    sampled = np.empty(shape, np.float32)
    _area_means(plane, *borders, sampled)
    return sampled, covers


def block_mean(image: Single | Codes, factor: int) -> Pixels:
    """Means over blocks of factor × factor pixels of an image (h, w, …); a rest at the right and bottom is left out."""
    if factor == 1:
        return image.astype(np.float32)
    layers: Any = np.ascontiguousarray(image)
    layers = layers[..., None] if image.ndim == 2 else layers
    means = np.empty((image.shape[0] // factor, image.shape[1] // factor, layers.shape[2]), np.float32)
    _block_means(layers, factor, means)
    return means.reshape(means.shape[: image.ndim])


@compiled()
def _area_means(plane: Single, rows: Array, columns: Array, means: Single) -> None:
    """Fill the means (H, W) of a plane over cells with borders (H + 1,), (W + 1,) in its pixels; 0 outside of it."""
    height, width = plane.shape
    line = np.empty(width, np.float32)
    for i in range(len(rows) - 1):
        low, high = min(max(rows[i], 0.0), height), min(max(rows[i + 1], 0.0), height)
        line[:] = 0
        for y in range(int(np.floor(low)), int(np.ceil(high))):
            share, own = np.float32((min(y + 1.0, high) - max(float(y), low)) / (high - low)), plane[y]
            for x in range(width):
                line[x] += share * own[x]
        for j in range(len(columns) - 1):
            left, right = min(max(columns[j], 0.0), width), min(max(columns[j + 1], 0.0), width)
            mean = np.float32(0)
            for x in range(int(np.floor(left)), int(np.ceil(right))):
                mean += np.float32((min(x + 1.0, right) - max(float(x), left)) / (right - left)) * line[x]
            means[i, j] = mean


@compiled()
def _block_means(layers: Single | Codes, factor: int, means: Single) -> None:
    """Fill the means (H, W, n) over blocks of factor × factor pixels of an image (h, w, n)."""
    width, depth = means.shape[1], means.shape[2]
    line = np.empty(width * factor * depth, np.float32)
    for i in range(means.shape[0]):
        line[:] = 0
        for y in range(i * factor, (i + 1) * factor):
            row = layers[y].ravel()
            for x in range(len(line)):
                line[x] += np.float32(row[x])
        for j in range(width):
            for layer in range(depth):
                total = np.float32(0)
                for x in range(j * factor, (j + 1) * factor):
                    total += line[x * depth + layer]
                means[i, j, layer] = total / np.float32(factor * factor)


# --- What a camera's JPEG would be of a RAW at a place ----------------------------------------------------------------
# A quadratic of the channels, fitted where the two overlap: the colour matrix and the tone curve are unknown; a fixed
# luma would invert the contrast of many edges between saturated colours. RAW is compressed like a picture, by square
# roots, only where a step of a registration looks at it: roots make the noise of photons alike at all brightnesses
# (Anscombe 1948, https://doi.org/10.1093/biomet/35.3-4.246), and come near enough to a camera's tone curve for a
# quadratic of them to tell its luma.


ENOUGH = 4_000
"""Pixels, about, that tell the ten weights of the quadratic."""


def explained(raw: RawLevel, jpeg: ReducedJpeg, place: Registration) -> float:
    """Share of the variance of the JPEG's colours that a quadratic of the RAW's channels explains at a place."""
    # At a wrong place the layout may agree by chance or symmetry; the colours hardly do.
    roots, use = _roots_at(raw, jpeg, place)
    codes = jpeg.codes.reshape(-1, 3)[use].astype(np.float64)
    if len(codes) < 200:
        return 0.0
    terms = quadratic_terms(roots)
    residual = codes - terms @ least_squares(terms, codes)
    total = float(np.square(codes - codes.mean(axis=0)).sum())
    return 1 - float(np.square(residual).sum()) / max(total, 1e-9)


def predicted_luma(raw: RawLevel, jpeg: ReducedJpeg, place: Registration) -> Single:
    """RAW (h, w) as the luma that the camera would make of it."""
    roots, use = _roots_at(raw, jpeg, place)
    weights = least_squares(quadratic_terms(roots), jpeg.luma.ravel()[use].astype(np.float64))
    return quadratic(raw.pixels, raw.gains, weights.astype(np.float32))


def roots(raw: RawLevel, jpeg: ReducedJpeg, place: Registration) -> tuple[list[Single], list[Single]]:
    """The roots of each channel of the RAW, and, (h, w) each, what the JPEG tells of them: a quadratic of its codes."""
    known, use = _roots_at(raw, jpeg, place)
    weights = least_squares(quadratic_terms(jpeg.codes.reshape(-1, 3)[use].astype(np.float64)), known)
    ones, squares = np.ones(3, np.float32), np.square(jpeg.codes)
    own = [np.sqrt(np.maximum(raw.pixels[..., channel], 0) * raw.gains[channel]) for channel in range(3)]
    return own, [quadratic(squares, ones, each) for each in weights.T.astype(np.float32)]


def _roots_at(raw: RawLevel, jpeg: ReducedJpeg, place: Registration) -> tuple[Array, Index]:
    """The roots (n, 3) of the RAW under about ENOUGH of the JPEG's pixels, and which these are (n,)."""
    borders, covers = cells_of_jpeg(place, jpeg.weight.shape, raw.pixels.shape, raw.pixel_size)
    use = np.flatnonzero((jpeg.weight * covers).ravel() > 0.5)
    use = use[:: max(1, len(use) // ENOUGH)]
    means = np.zeros((len(use), 3))
    _means_of_roots(raw.pixels, raw.gains, *borders, use, means)
    return means, use


def least_squares(terms: Array, values: Array) -> Array:
    """Weights (10, …) of quadratic terms (n, 10) for values (n, …)."""
    normal = terms.T @ terms
    normal += 1e-6 * (np.trace(normal) / len(normal) + 1e-12) * np.eye(len(normal))
    return np.asarray(np.linalg.solve(normal, terms.T @ values))


def quadratic_terms(channels: Array) -> Array:
    """The terms (n, 10) of a quadratic of three channels (n, 3): 1, r, g, b, r², g², b², rg, gb, br."""
    ones, others = np.ones_like(channels[:, :1]), np.roll(channels, -1, axis=1)
    return np.concatenate([ones, channels, channels * channels, channels * others], axis=1)


def quadratic(raw: Pixels, gains: Single, weights: Single) -> Single:
    """A quadratic (h, w) of the roots of RAW (h, w, 3) times gains (3,), with weights (10,) of `quadratic_terms`."""
    values = np.empty(raw.shape[:2], np.float32)
    _quadratic(np.ascontiguousarray(raw), np.tile(gains, raw.shape[1]), weights, values)
    return values


@compiled(fastmath={"contract"})
def _quadratic(raw: Pixels, gains: Single, weights: Single, values: Single) -> None:
    """Fill values (h, w). gains: (3 w,) of the values of a row."""
    start, in_r, in_g, in_b, rr, gg, bb, rg, gb, br = weights
    roots = np.empty(len(gains), np.float32)
    for y in range(values.shape[0]):
        line, to = raw[y].ravel(), values[y]
        for x in range(len(roots)):
            roots[x] = np.sqrt(max(line[x], np.float32(0)) * gains[x])
        for x in range(len(to)):
            r, g, b = roots[3 * x], roots[3 * x + 1], roots[3 * x + 2]
            to[x] = r * (in_r + rr * r + rg * g + br * b) + g * (in_g + gg * g + gb * b) + b * (in_b + bb * b) + start


@compiled()
def _means_of_roots(raw: Pixels, gains: Single, rows: Array, columns: Array, cells: Index, means: Array) -> None:
    """Add to means (n, 3) of the roots of RAW times gains over some cells, row by row, of a grid with these borders."""
    width = len(columns) - 1
    for index in range(len(cells)):
        top, bottom = rows[cells[index] // width], rows[cells[index] // width + 1]
        left, right = columns[cells[index] % width], columns[cells[index] % width + 1]
        for y in range(int(np.floor(top)), int(np.ceil(bottom))):
            tall = min(y + 1.0, bottom) - max(float(y), top)
            for x in range(int(np.floor(left)), int(np.ceil(right))):
                share = tall * (min(x + 1.0, right) - max(float(x), left)) / ((bottom - top) * (right - left))
                for channel in range(3):
                    means[index, channel] += share * np.sqrt(max(raw[y, x, channel], np.float32(0)) * gains[channel])


# --- Ever smaller copies of a RAW and of a JPEG: each step of a registration works on as few pixels as it needs -------


SIGNIFICANT = 30.0
"""Evidence for a distortion from which on it is believed: the 17 pictures of six cameras without one show up to 18."""
WARPED = 0.18
"""Pixels of the coarsest copy by which parts of a warped picture lie beside their place, in the mean: 0.28 or more with
a keystone of 2 % of the width, 0.12 at most in pictures without one, 0.05 in photographs."""
MIN_CORRELATION = 0.5
"""Below this, structure does not agree: another scene, or a picture too blurred or noisy to register."""
HOPELESS = 0.3
"""A place that correlates less after three steps is none to be near of: where the JPEG lies, two steps suffice."""
OVERLAP = 0.8
"""The share of a JPEG that must lie on the RAW."""
DEVIATION = 6.0
"""Standard deviation, in pixels, of what is taken for shading and tone: structure much coarser does not count."""
BLOCKS = 32
"""Blocks along the longer side, over which gradients are summed up: a displacement is the same all over one."""
PARTS = 6
"""Parts a side of the picture whose pulls tell how sure a fit is: structure of one part is hardly that of another."""
_NO_MATCH = "the JPEG does not match the RAW ({}): another scene, cropped, retouched, or too little structure"
IS_WARPED = (
    "parts of the JPEG lie beside their place in the RAW, by {:.1f} pixels in the mean (a straightened perspective, "
    "strong sharpening, or an unknown correction); switch that off, or use the camera's own JPEG"
)


def register_rotated(
    raw: RawImage, jpeg: Codes, turns: Sequence[int] = (0, 1, 2, 3), expected: Placement | None = None
) -> tuple[Codes, Registration]:
    """Turn the JPEG (h, w, 3) to the sensor's orientation, and register it.

    turns: quarter turns (numpy.rot90) that may do it, the likeliest first; the first to match clearly is taken, else
    the one that explains the JPEG's colours best. expected: of another shot of the camera; where this one clearly lies
    there, too, no other place is searched. Raises ShotError.
    """
    pyramid = RawLevel.of(raw, jpeg)
    for turn in turns if expected is not None else ():
        turned = np.rot90(jpeg, turn)
        if expected is not None and (registration := _as_expected(raw, pyramid, turned, expected)) is not None:
            return np.ascontiguousarray(turned), registration
    found: list[_Candidate] = []
    for turn in turns:
        reduced = ReducedJpeg.of(raw, np.rot90(jpeg, turn))
        candidates = [_judged(pyramid, reduced, place, turn) for place in search(pyramid, reduced)]
        found += candidates
        if candidates and candidates[0].is_clear:
            if any(other.turn % 4 == (turn + 2) % 4 for other in found):
                break
            # A scene may look alike upside down; the same scale serves there.
            over = ReducedJpeg.of(raw, np.rot90(jpeg, turn + 2))
            places = search(pyramid, over, scale=candidates[0].searched)
            found += [_judged(pyramid, over, place, turn + 2) for place in places]
            break
    found.sort(key=lambda candidate: candidate.explained, reverse=True)
    if not found or found[0].explained < 0.5 or found[0].fit.place.correlation < HOPELESS:
        correlation = max(found[0].fit.place.correlation, 0.0) if found else 0.0
        if correlation < MIN_CORRELATION:
            raise ShotError(_NO_MATCH.format(f"correlation {correlation:.2f}, needed {MIN_CORRELATION}"))
        share = f"{max(found[0].explained, 0.0):.0%} of its colours explained, needed 50%"
        raise ShotError(_NO_MATCH.format(share))
    if len(found) > 1 and 1 - found[1].explained < 1.5 * (1 - found[0].explained):
        twice = "the JPEG lies on the RAW nearly as well at a second place, or turned"
        raise ShotError(f"{twice}; register it by a picture with more structure, as the camera wrote it")
    registration = _with_lens(pyramid, found[0], _refined(pyramid, found[0].jpeg, found[0].fit.place).place)
    if not registration.correlation >= MIN_CORRELATION:
        low = _NO_MATCH.format(f"correlation {registration.correlation:.2f}, needed {MIN_CORRELATION}")
        raise ShotError(IS_WARPED.format(registration.warp) if registration.warp else low)
    return np.ascontiguousarray(np.rot90(jpeg, found[0].turn)), registration


def _as_expected(raw: RawImage, pyramid: RawLevel, jpeg: Codes, expected: Placement) -> Registration | None:
    """Refine an expected place; None where sizes are others, or the JPEG does not clearly lie there, this side up."""
    height, width = raw.pixels.shape[:2]
    if (height, width, raw.pixel_size) != expected.raw or jpeg.shape[:2] != expected.jpeg:
        return None
    reduced, start = ReducedJpeg.of(raw, jpeg), expected.registration
    level = reduced.coarsest
    turned = ReducedJpeg(level.codes[::-1, ::-1], level.weight[::-1, ::-1], level.factor)
    found, over = (_judged(pyramid, reduced, start, 0, one) for one in (level, turned))
    if not found.is_clear or 1 - over.explained < 1.5 * (1 - found.explained):
        return None
    corners = np.array([[0, 0], jpeg.shape[1::-1]])
    moved = (found.fit.place.straight(corners) - start.straight(corners)) / start.scale
    near = np.abs(moved).max() < level.factor / 2  # within reach of the finest copy
    fit = _fit(pyramid, reduced, start) if near else _refined(pyramid, reduced, found.fit.place)
    registration = _with_lens(pyramid, found, fit.place)
    return registration if registration.correlation >= MIN_CORRELATION else None


@dataclass(frozen=True, eq=False)
class _Candidate:
    """A place of the reduced JPEG, fitted on a coarse copy. searched: its scale before; explained: see there."""

    jpeg: ReducedJpeg
    fit: "_Fit"
    turn: int
    searched: float
    explained: float

    @property
    def is_clear(self) -> bool:
        return self.fit.place.correlation > 0.55 and self.explained > 0.9


def _judged(
    pyramid: RawLevel, jpeg: ReducedJpeg, start: Registration, turn: int, level: ReducedJpeg | None = None
) -> _Candidate:
    """A place that the coarse search found, moved to where it fits best on a coarse copy, and how well it does."""
    level = level or jpeg.coarsest
    fit = _fit(pyramid, level, start)
    scaled = fit.place.reduced(level.factor)
    raw, local = pyramid.for_scale(scaled.scale).straightened(scaled, level)
    return _Candidate(jpeg, fit, turn, start.scale, explained(raw, level, local))


def _refined(pyramid: RawLevel, jpeg: ReducedJpeg, start: Registration, count: int = 3) -> "_Fit":
    """Refine on ever finer copies of the JPEG."""
    fit = _fit(pyramid, jpeg.coarsest, start, count)
    for times in range(jpeg.halvings - 1, -1, -1):
        fit = _fit(pyramid, jpeg.halved(times), fit.place, count)
    return fit


def _with_lens(pyramid: RawLevel, candidate: _Candidate, place: Registration) -> Registration:
    """Add how the lens bent what the camera straightened, and the fringes that it took away: what is beyond chance."""
    jpeg, bent = candidate.jpeg, candidate.fit.evidence(3) > SIGNIFICANT
    if bent:
        fit = _refined(pyramid, jpeg, candidate.fit.place, 5)
        bent = fit.evidence(3) > SIGNIFICANT
        place = fit.place if bent else place
    _, evidence, off = _fringes(pyramid, jpeg.coarsest, place)
    coloured = evidence > SIGNIFICANT
    for _ in range(2 if coloured else 0):
        place = _fringes(pyramid, jpeg.halved(max(jpeg.halvings - 1, 0)), place)[0]
    if bent or coloured:
        fits = [_fit(pyramid, jpeg, place, count) for count in ((5, 7) if bent else (3,))]
        centred = bent and fits[-1].evidence(5) > SIGNIFICANT
        place = fits[-1 if centred else 0].place
        off = _fringes(pyramid, jpeg.coarsest, place)[2]
    return replace(place, warp=off * jpeg.coarsest.factor if off > WARPED else 0.0)


def search(raw: RawLevel, jpeg: ReducedJpeg, scale: float | None = None) -> list[Registration]:
    """The best place at all plausible scales (or at the one given) with all offsets, and the second best of that scale.

    Searched on a small copy, whose structure is a masked template: its normalized cross-correlation with that of the
    RAW is computed in the frequency domain (Padfield 2012, https://doi.org/10.1109/TIP.2011.2181402), with the energy
    of the RAW's part only. In coordinates of the whole JPEG. Empty where there is nothing to compare.
    """
    factor = max(1, round(max(jpeg.luma.shape) / COARSE_SIDE))
    mask = (block_mean(jpeg.weight, factor) > 0.5).astype(np.float32)
    template, area = structure(block_mean(jpeg.luma, factor), mask, share(mask)), float(mask.sum())
    whole = factor * jpeg.factor
    size = [side * raw.pixel_size for side in raw.pixels.shape[:2]]
    scales = np.array([]) if scale is None else np.array([scale * whole])
    if scale is None and mask.any():
        # The JPEG without bars is as wide or as high as the RAW, 6 % less to 3 % more: cameras trim the borders.
        inside = [np.flatnonzero(mask.max(axis=1 - axis)) for axis in (0, 1)]
        ratios = [side / (lines[-1] - lines[0] + 1) for side, lines in zip(size, inside, strict=True)]
        scales = np.sort(np.concatenate([ratio * np.exp(np.arange(-8, 6) * 0.0075) for ratio in ratios]))
        scales = scales[np.concatenate([[True], np.diff(np.log(scales)) > 1e-9])]
    if not scales.size:
        return []
    sides = [math.ceil(side / scales.min()) for side in size]
    # Shifts that leave enough of the mask on the picture are told apart; others may fall on one another.
    reach = []
    for lines in (mask.sum(axis=1), mask.sum(axis=0)):
        first = [np.cumsum(lines[::way], dtype=np.float64) for way in (1, -1)]
        reach.append(int(max(np.searchsorted(sums, (1 - OVERLAP) * area, side="right") for sums in first)))
    shape = [scipy.fft.next_fast_len(side + most + 1, real=True) for side, most in zip(sides, reach, strict=True)]
    matched, covering = (np.conj(scipy.fft.rfft2(plane, shape)) for plane in (template, mask))
    level, total, best = raw.for_scale(scales.min()), float((template**2).sum()), list[Registration]()
    of_channels = np.concatenate([[0], LUMA, np.zeros(6)]).astype(np.float32)  # luma of the channels as they are
    luma = quadratic(level.pixels, level.gains, of_channels)
    for each in scales.tolist():
        rows, columns = (math.ceil(side * level.pixel_size / each) for side in luma.shape)
        plane, cover = on_jpeg_pixels(luma, level.pixel_size, Registration(each, 0.0, 0.0, 0.0), (rows, columns))
        field = structure(plane, cover, share(cover))
        product, energy, overlap = (
            scipy.fft.irfft2(scipy.fft.rfft2(picture, shape) * pattern, shape)
            for picture, pattern in ((field, matched), (field * field, covering), (cover, covering))
        )
        score = product / np.sqrt(np.maximum(energy, 0.2 * total) * total + 1e-12)
        score[overlap < OVERLAP * area - 0.5] = -1.0
        if best and score.max() <= best[0].correlation:
            continue
        best = []
        for _ in range(2):
            y, x = np.unravel_index(int(np.argmax(score)), score.shape)
            if best and score[y, x] < 0.5 * best[0].correlation:
                break
            down = int(y) - (shape[0] if y >= rows else 0)
            across = int(x) - (shape[1] if x >= columns else 0)
            best.append(Registration(each, each * across, each * down, float(score[y, x])))
            # The second is a tenth of the picture or more away from the first.
            near_y, near_x = (np.arange(-round(side / 10), round(side / 10) + 1) for side in template.shape)
            score[np.ix_((y + near_y) % shape[0], (x + near_x) % shape[1])] = -1.0
    return [place.reduced(1 / whole) for place in best]


@dataclass(frozen=True, eq=False)
class _Fit:
    """A registration after an iteration of its fit.

    values: how far its parameters from k1 on are from those of a straight picture, or would move, where they were not
    fitted; covariance: of the parameters, estimated from how much the parts of the picture disagree; off: by how many
    pixels these lie beside their place, in the mean weighted by structure.
    """

    place: Registration
    values: Array
    covariance: Array
    off: float

    def evidence(self, first: int) -> float:
        """How much two values, of the parameters from `first` on, are beyond chance: of chance alone, 2 on average.

        Wald's statistic, of a covariance that the parts of the picture tell (White 1980,
        https://doi.org/10.2307/1912934).
        """
        two = slice(first, first + 2)
        return float(self.values[two] @ np.linalg.solve(self.covariance[two, two], self.values[two]))


def _fit(pyramid: RawLevel, level: ReducedJpeg, start: Registration, count: int = 3) -> _Fit:
    """Move a place to where it fits best on one copy of the JPEG; in coordinates of the whole JPEG, as `start`."""
    scaled = start.reduced(level.factor)
    fit = _moved_to_fit(pyramid.for_scale(scaled.scale), level, scaled, count)
    return replace(fit, place=fit.place.reduced(1 / level.factor))


def _moved_to_fit(
    raw: RawLevel,
    jpeg: ReducedJpeg,
    start: Registration,
    count: int = 3,
    tested: int = 5,
    planes: tuple[Single, Single] | None = None,
) -> _Fit:
    """Move to the place near `start` where the structures of RAW and JPEG agree best; in the JPEG's coordinates.

    Gauss–Newton steps minimize the squared difference of the structures (Lucas & Kanade 1981,
    https://www.ijcai.org/Proceedings/81-2/Papers/017.pdf). count: how many parameters of `Registration.moved` are
    fitted: 3, 5 or 7. The values and the covariance that are returned are of as many, or of more, `tested`: of k1 and
    k2 as they would be, were they fitted. planes: of the RAW and of the JPEG, compared instead of their lumas.
    """
    weight, size = jpeg.weight, max(count, tested)
    lens = start.distortion or raw.flat
    place = replace(start, distortion=lens)
    # A gradient is of the picture alone where none of the pixels around is masked.
    whole, within = share(weight), scipy.ndimage.minimum_filter(weight, 3)
    target = structure(jpeg.luma if planes is None else planes[1], weight, whole)
    block = max(8, max(weight.shape) // BLOCKS)
    down, across = (np.arange(side // block) * block + block / 2 for side in weight.shape)
    centres = np.stack(np.meshgrid(across, down), axis=-1).reshape(-1, 2)
    part = (PARTS * centres / weight.shape[::-1]).astype(np.intp) @ np.array([1, PARTS])
    shifts = place.shifts(centres, size)
    spread = np.array([np.inf, np.inf, np.inf, 0.3, 0.3, 0.02 * lens.radius, 0.02 * lens.radius])[:size]
    for index in range(8):
        if index == 0 or count > 3:
            straight, local = raw.straightened(place, jpeg)
            luma = predicted_luma(straight, jpeg, local) if planes is None else planes[0]
            corner = place.offset_x - local.offset_x, place.offset_y - local.offset_y
        local = Registration(place.scale, place.offset_x - corner[0], place.offset_y - corner[1], 0.0)
        plane, cover = on_jpeg_pixels(luma, raw.pixel_size, local, (weight.shape[0], weight.shape[1]))
        inside = bool(cover.all())
        mask = weight if inside else weight * cover
        moving = structure(plane, mask, whole if inside else share(mask))
        seen = target * mask
        own, product, square = (float(np.vdot(*pair)) for pair in ((seen, target), (seen, moving), (moving, moving)))
        place = replace(place, correlation=product / (math.sqrt(square * own) + 1e-12))
        sums = np.zeros((len(down), len(across), 5))
        like = product / (own + 1e-12)
        alone = within if inside else scipy.ndimage.minimum_filter(mask, 3)
        _add_products(moving, np.float32(like) * target, alone, block, sums)
        gradients = sums[..., [0, 1, 1, 2]].reshape(-1, 2, 2) @ shifts
        normal, pull = np.zeros((PARTS**2, size, size)), np.zeros((PARTS**2, size))
        np.add.at(normal, part, shifts.swapaxes(1, 2) @ gradients)
        np.add.at(pull, part, (shifts.swapaxes(1, 2) @ sums[..., 3:].reshape(-1, 2, 1))[..., 0])
        prior = DEVIATION**2 * max(square - like * product, 0.0) / (float(mask.sum()) + 1e-12) / spread**2
        lens = place.distortion or lens
        away = np.array([0.0, 0.0, 0.0, lens.k1, lens.k2, lens.x - raw.flat.x, lens.y - raw.flat.y])[:size]
        step, covariance = _solved(normal[:, :count, :count], pull[:, :count], prior[:count], away[:count])
        change = np.abs(shifts[..., :count] @ step).max()
        if not np.isfinite(change) or change > 12:
            break
        place = place.moved(step)
        if change < 5e-3 or (index > 1 and place.correlation < HOPELESS):
            break
    total = np.zeros((PARTS**2, 5))
    np.add.at(total, part, sums.reshape(-1, 5))
    strength = total[:, [0, 2]].sum(axis=1) + 1e-12
    matrix = total[:, [0, 1, 1, 2]].reshape(-1, 2, 2) + 0.01 * strength.mean() * np.eye(2)
    apart = np.square(np.linalg.solve(matrix, total[:, 3:, None])).sum(axis=(1, 2))
    off = math.sqrt(np.average(apart, weights=strength))
    if count > 3:
        return _Fit(place, away + step, covariance, off)
    return _Fit(replace(place, distortion=start.distortion), *_solved(normal, pull, prior, away), off)


def _fringes(pyramid: RawLevel, level: ReducedJpeg, place: Registration) -> tuple[Registration, float, float]:
    """A place with red and blue drawn larger than green, where the JPEG shows them of one size, and the evidence of it.

    Last is by how many pixels of the copy parts of green lie beside their place. Each of the RAW's channels is
    registered by itself, on what the JPEG's colours tell of it.
    """
    scaled = place.reduced(level.factor)
    raw, local = pyramid.for_scale(scaled.scale).straightened(scaled, level)
    pairs = zip(*roots(raw, level, local), strict=True)
    fits = [_moved_to_fit(raw, level, local, tested=3, planes=pair) for pair in pairs]
    red, green, blue = (fit.place.scale for fit in fits)
    # Equal pictures leave no residual, so the estimated error is 0; a scale is known to a millionth at best.
    errors = [1e-12 + fit.covariance[0, 0] + fits[1].covariance[0, 0] for fit in fits]
    lens = place.distortion or raw.flat
    lens = replace(lens, red=lens.red + red / green - 1, blue=lens.blue + blue / green - 1)
    evidence = (red - green) ** 2 / errors[0] + (blue - green) ** 2 / errors[2]
    return replace(place, distortion=lens), evidence, fits[1].off


def _solved(normal: Array, pull: Array, prior: Array, away: Array) -> tuple[Array, Array]:
    """A Gauss–Newton step (n,), and its covariance by the parts of the picture (White 1980, a sandwich).

    normal: (parts, n, n) normal matrices; pull: (parts, n) right sides; prior, away: (n,) weight of a prior of the
    parameters, and how far they are from it.
    """
    total = normal.sum(axis=0) + np.diag(prior)
    unit = 1 / np.sqrt(np.diag(total) + 1e-30)
    inverse = unit[:, None] * np.linalg.pinv(total * np.outer(unit, unit)) * unit
    step = inverse @ (pull.sum(axis=0) - prior * away)
    scores = pull - normal @ step
    return step, inverse @ (scores.T @ scores) @ inverse * len(pull) / (len(pull) - len(step))


@compiled(fastmath=REASSOCIATED)
def _add_products(moving: Single, target: Single, weight: Single, side: int, sums: Array) -> None:
    """Fill the products (H, W, 5) of the gradient with itself, xx, xy, yy, and with what is to change, x, y, by blocks.

    The gradient is of the mean of both pictures (h, w): an unbiased, faster converging step (Benhimane & Malis 2004,
    https://doi.org/10.1109/IROS.2004.1389474).
    """
    down, across = sums.shape[:2]
    width = across * side
    terms, quarter = np.zeros((3, width), np.float32), np.float32(0.25)
    for row in range(1, min(down * side, moving.shape[0] - 1)):
        above, here, below = moving[row - 1], moving[row], moving[row + 1]
        over, wanted, under = target[row - 1], target[row], target[row + 1]
        for x in range(1, min(width, moving.shape[1] - 1)):
            share = quarter * weight[row, x]
            terms[0, x] = share * (here[x + 1] - here[x - 1] + wanted[x + 1] - wanted[x - 1])
            terms[1, x] = share * (below[x] - above[x] + under[x] - over[x])
            terms[2, x] = weight[row, x] * (wanted[x] - here[x])
        for block in range(across):
            xx = xy = yy = by_x = by_y = np.float32(0)
            for x in range(block * side, (block + 1) * side):
                xx += terms[0, x] * terms[0, x]
                xy += terms[0, x] * terms[1, x]
                yy += terms[1, x] * terms[1, x]
                by_x += terms[0, x] * terms[2, x]
                by_y += terms[1, x] * terms[2, x]
            own = sums[row // side, block]
            own[0], own[1], own[2], own[3], own[4] = own[0] + xx, own[1] + xy, own[2] + yy, own[3] + by_x, own[4] + by_y


def share(weight: Single) -> Single:
    """How much of the weight around each pixel there is, (h, w)."""
    return np.asarray(np.maximum(blurred(weight), np.float32(1e-6)))


def structure(luma: Single, weight: Single, around: Single) -> Single:
    """Return the local structure of luma (h, w): detail over its local deviation, times the weight.

    weight: (h, w) of the pixels; around: `share` of the weight. Detail below the noise of rounding to 8 bits is none.
    """
    detail = luma - blurred(luma * weight) / around
    energy = blurred(detail * detail * weight) / around
    floor = 0.5 * float(np.vdot(energy, weight)) / (float(weight.sum()) + 1e-12)
    energy += np.float32(floor + (0.3 / 255) ** 2)
    return np.asarray(detail / np.sqrt(energy) * weight)


def blurred(image: Single) -> Single:
    """Return the image (h, w) filtered by a Gaussian of DEVIATION, mirrored at its borders."""
    taps = np.exp(-0.5 * (np.arange(4 * DEVIATION + 1) / DEVIATION) ** 2)
    taps /= 2 * taps.sum() - taps[0]
    out = np.empty_like(image)
    _blur(np.ascontiguousarray(image), taps.astype(np.float32), out)
    return out


@compiled()
def _mirrored(place: int, size: int) -> int:
    """The place within 0 … size − 1 that lies there when the image is mirrored at both ends, again and again."""
    inside = place % (2 * size)
    return inside if inside < size else 2 * size - 1 - inside


@compiled(fastmath={"contract"})
def _blur(image: Single, taps: Single, out: Single) -> None:
    """Fill `out` with the image, filtered by symmetric taps, of which the middle one is the first, along both axes."""
    rows, columns = image.shape
    reach = len(taps) - 1
    line = np.empty(columns + 2 * reach, dtype=np.float32)
    for y in range(rows):
        middle, own, to = line[reach : reach + columns], image[y], out[y]
        for x in range(columns):
            middle[x] = taps[0] * own[x]
        for k in range(1, reach + 1):
            above, below = image[_mirrored(y - k, rows)], image[_mirrored(y + k, rows)]
            for x in range(columns):
                middle[x] += taps[k] * (above[x] + below[x])
        for k in range(reach):
            line[reach - 1 - k] = middle[_mirrored(-1 - k, columns)]
            line[reach + columns + k] = middle[_mirrored(columns + k, columns)]
        for x in range(columns):
            to[x] = taps[0] * middle[x]
        for k in range(1, reach + 1):
            before, after = line[reach - k : reach - k + columns], line[reach + k : reach + k + columns]
            for x in range(columns):
                to[x] += taps[k] * (before[x] + after[x])
