"""Ever smaller copies of a RAW and of a JPEG: each step of a registration works on as few pixels as it needs."""

import math
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from lutforge.arrays import Array, Codes, Single
from lutforge.errors import ShotError
from lutforge.images.raw import RawImage
from lutforge.shots.cells import greatest
from lutforge.shots.geometry import Distortion, Registration
from lutforge.shots.registration.area_means import block_mean, cell_means

SHORTEST_SIDE = 200
"""A JPEG whose longer side is shorter than this is a thumbnail: its pixels average too much of the scene."""
MOST_PIXELS = 1e6
"""Pixels of a JPEG's finest copy: enough to register below a tenth of a pixel."""
COARSE_SIDE = 192
"""Pixels of the longer side of the copy that is searched."""
LUMA = np.array([0.299, 0.587, 0.114], dtype=np.float32)  # ITU-R BT.601, as in JPEG
UNCLIPPED = (4, 252)
"""Codes of 255 between which a copy's pixels lie that count: of the others some may be clipped."""


@dataclass(frozen=True, eq=False)
class RawLevel:
    """RAW of one size: linear pixels (h, w, 3), a side in full-resolution pixels, and gains (3,) to a grey world."""

    pixels: Single
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
    def no_distortion(self) -> Distortion:
        """A distortion about the middle that changes nothing."""
        x, y = self.pixel_size * np.array(self.pixels.shape[1::-1]) / 2
        return Distortion(float(x), float(y), math.hypot(x, y))

    def straightened(self, registration: Registration, jpeg: "ReducedJpeg") -> tuple["RawLevel", Registration]:
        """The copy with the distortion of a registration removed, and the registration of the JPEG on that."""
        pixels, local = registration.straightened(self.pixels, self.pixel_size, jpeg.weight.shape)
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
        if max(height, width) < SHORTEST_SIDE or min(height, width) < SHORTEST_SIDE // 2:
            raise ShotError(f"only {width}×{height} pixels: a thumbnail, too small to register")
        factor = reduction(raw, jpeg)
        small = block_mean(jpeg, factor)
        brightest = greatest(small)
        unclipped = (brightest > UNCLIPPED[0]) & (brightest < UNCLIPPED[1])
        weight = np.where(unclipped, _inside_bars(brightest), np.float32(0.0))
        return cls(small / np.float32(255), weight, factor)

    @cached_property
    def luma(self) -> Single:
        """The luma (h, w), 0 … 1."""
        return np.asarray(self.codes @ LUMA)

    def halved(self, times: int) -> "ReducedJpeg":
        """The copy, smaller by another 2^times."""
        if times == 0:
            return self
        weight = (block_mean(self.weight, 2**times) > 0.99).astype(np.float32)
        return ReducedJpeg(block_mean(self.codes, 2**times), weight, self.factor * 2**times)

    @property
    def upside_down(self) -> "ReducedJpeg":
        """The copy turned by half a turn."""
        return ReducedJpeg(self.codes[::-1, ::-1], self.weight[::-1, ::-1], self.factor)

    @property
    def halvings(self) -> int:
        """The number of halvings that make it about as small as the coarse search needs."""
        return max(0, round(math.log2(max(self.luma.shape) / COARSE_SIDE)))

    @cached_property
    def coarsest(self) -> "ReducedJpeg":
        """The copy of about COARSE_SIDE."""
        return self.halved(self.halvings)


def reduction(raw: RawImage, jpeg: Codes) -> int:
    """Factor by which a JPEG is reduced: to MOST_PIXELS, and not finer than RAW, whose blocks would be compared."""
    height, width = jpeg.shape[:2]
    factor: int = max(
        math.ceil(math.sqrt(height * width / MOST_PIXELS)),
        math.ceil(max(height, width) / max(raw.pixels.shape)),
    )
    return factor


def _inside_bars(brightest: Single) -> Single:
    """(h, w) 0 on the black bars that some cameras put around a preview of another aspect ratio, else 1."""
    dark = brightest < 16  # codes; JPEG's ringing at a bar's border stays below
    mask = np.ones(dark.shape, dtype=np.float32)
    for axis in (0, 1):
        lines = np.asarray(dark.mean(axis=1 - axis) > 0.99)
        inside = np.flatnonzero(~lines)
        if not inside.size or len(lines) - inside.size >= 0.4 * len(lines):
            continue

        # Two more lines of the picture go with each bar: JPEG mixed them with it.
        low, high = int(inside[0]), int(inside[-1]) + 1
        index = np.arange(len(lines))
        bar = (index < low + (2 if low else 0)) | (index >= high - (2 if high < len(lines) else 0))
        mask *= (~bar)[:, None] if axis == 0 else (~bar)[None, :]
    return mask


def cells_of_jpeg(
    registration: Registration, shape: tuple[int, int], raw: tuple[int, ...], pixel_size: float
) -> tuple[tuple[Array, Array], Single]:
    """The borders of a JPEG's rows (h + 1,) and columns (w + 1,) in RAW pixels, and which pixels RAW covers, 0 or 1."""
    borders = registration.borders(shape, 1, pixel_size)
    covers = [(edges[:-1] >= 0) & (edges[1:] <= size) for edges, size in zip(borders, raw[:2], strict=True)]
    return borders, np.outer(*covers).astype(np.float32)


def on_jpeg_pixels(
    plane: Single, pixel_size: float, registration: Registration, shape: tuple[int, int]
) -> tuple[Single, Single]:
    """RAW values averaged over each JPEG pixel (h, w), and whether RAW covers it, 0 or 1."""
    borders, covers = cells_of_jpeg(registration, shape, plane.shape, pixel_size)
    return cell_means(plane, *borders), covers
