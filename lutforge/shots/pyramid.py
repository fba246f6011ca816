"""Ever smaller copies of a RAW and of a JPEG: each step of a registration works on as few pixels as it needs.

They are means over blocks of pixels, and the RAW's over the pixels of the JPEG that lies on it.
"""

import math
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from lutforge.arrays import Array, Codes, Index, Pixels, Single
from lutforge.compiled import compiled
from lutforge.errors import ShotError
from lutforge.images.raw import RawImage
from lutforge.shots.cells import greatest
from lutforge.shots.geometry import Distortion, Registration

MIN_SIDE = 200
"""A JPEG whose longer side is shorter than this is a thumbnail: its pixels average too much of the scene."""
COARSE_SIDE = 192
"""Pixels of the longer side of the copy that is searched."""
LUMA = np.array([0.299, 0.587, 0.114], dtype=np.float32)  # ITU-R BT.601, as in JPEG


@dataclass(frozen=True, eq=False)
class RawLevel:
    """RAW of one size. pixels: (h, w, 3), linear; pixel_size: a pixel's side in full-resolution pixels.

    gains: (3,) bring the channels to equal brightness (a grey-world white balance).
    """

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
    """The borders of a JPEG's rows (h + 1,) and columns (w + 1,) in RAW pixels, and which pixels RAW covers, 0 or 1.

    shape, raw: of the two pictures, (h, w, …).
    """
    borders = place.borders(shape, 1, pixel_size)
    covers = [(edges[:-1] >= 0) & (edges[1:] <= size) for edges, size in zip(borders, raw[:2], strict=True)]
    return borders, np.outer(*covers).astype(np.float32)


def on_jpeg_pixels(
    plane: Single, pixel_size: float, place: Registration, shape: tuple[int, int]
) -> tuple[Single, Single]:
    """RAW values averaged over each JPEG pixel (h, w), and whether RAW covers it, 0 or 1."""
    borders, covers = cells_of_jpeg(place, shape, plane.shape, pixel_size)
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
    """Fill the means (H, W) of a plane (h, w) over cells with borders at rows (H + 1,) and columns (W + 1,).

    Borders count in the plane's pixels. What lies outside of it does not count; a cell without pixels has 0.
    """
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
    """Share of the variance of the JPEG's colours that a quadratic of the RAW's channels explains at a place.

    At a wrong place the layout may agree by chance or symmetry; the colours hardly do.
    """
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


def usual_luma(raw: RawLevel) -> Single:
    """RAW (h, w) as the luma of its compressed channels as they are."""
    return quadratic(raw.pixels, raw.gains, np.concatenate([[0], LUMA, np.zeros(6)]).astype(np.float32))


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
    """Return a quadratic (h, w) of the roots of RAW (h, w, 3) times gains (3,).

    weights: (10,) of 1, r, g, b, r², g², b², rg, gb, br.
    """
    values = np.empty(raw.shape[:2], np.float32)
    _quadratic(np.ascontiguousarray(raw), np.tile(gains, raw.shape[1]), weights, values)
    return values


@compiled(fastmath={"contract"})
def _quadratic(raw: Pixels, gains: Single, weights: Single, values: Single) -> None:
    """Fill values (h, w). gains: (3 w,) of the values of a row."""
    constant, in_r, in_g, in_b, rr, gg, bb, rg, gb, br = weights
    roots = np.empty(len(gains), np.float32)
    for y in range(values.shape[0]):
        line, to = raw[y].ravel(), values[y]
        for x in range(len(roots)):
            roots[x] = np.sqrt(max(line[x], np.float32(0)) * gains[x])
        for x in range(len(to)):
            r, g, b = roots[3 * x], roots[3 * x + 1], roots[3 * x + 2]
            to[x] = (
                r * (in_r + rr * r + rg * g + br * b) + g * (in_g + gg * g + gb * b) + b * (in_b + bb * b) + constant
            )


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
