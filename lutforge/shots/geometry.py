"""The place of a JPEG on its RAW: a scale, an offset, and the distortion of the lens that the camera removed."""

from dataclasses import dataclass, replace
from enum import IntEnum

import numpy as np

from lutforge.arrays import Array, Single
from lutforge.compiled import compiled


@dataclass(frozen=True)
class Distortion:
    """Radial distortion of a lens, which the JPEG shows corrected (Brown 1971, "Close-range camera calibration").

    A place q of the straight picture lies at c + (q − c)(1 + k1 r² + k2 r⁴) on the RAW, r = |q − c| / radius. x, y: the
    centre c; radius: half the diagonal of the RAW's visible area; all in full-resolution RAW pixels. red, blue: by what
    share these channels are larger than green (lateral chromatic aberration), where the JPEG shows them of one size.
    """

    x: float
    y: float
    radius: float
    k1: float = 0.0
    k2: float = 0.0
    red: float = 0.0
    blue: float = 0.0

    def distorted(self, straight: Array) -> Array:
        """Places (n, 2) of the RAW's green for these places of the straight picture."""
        away = straight - (self.x, self.y)
        square = np.square(away).sum(axis=-1, keepdims=True) / self.radius**2
        return np.asarray((self.x, self.y) + away * (1 + square * (self.k1 + square * self.k2)))


class Unknowns(IntEnum):
    """The parameters of a registration that a fit moves; the value is their number."""

    PLACE = 3
    """The scale, and the offset in x and y."""
    DISTORTION = 5
    """The place, and k1 and k2 of the distortion."""
    CENTRE = 7
    """The place, k1 and k2, and the distortion's centre in x and y."""


@dataclass(frozen=True)
class Registration:
    """x_raw = scale * x_jpeg + offset_x, and the same for y; where there is a distortion, that is the straight place.

    Both count from the picture's top left corner: pixel i covers [i, i + 1], its centre is i + 0.5. RAW
    coordinates are full-resolution pixels of the visible area, whatever the size of the decoded array.
    correlation: of the two pictures' local structure, after registration, in [−1, 1]. non_rigid: JPEG pixels by which
    parts of the picture deviate from their place as no lens moves them, in the mean; 0 where that may be chance.
    """

    scale: float
    offset_x: float
    offset_y: float
    correlation: float
    distortion: Distortion | None = None
    non_rigid: float = 0.0

    def reduced(self, factor: float) -> "Registration":
        """Convert to coordinates of the JPEG reduced by `factor`; 1 / factor goes the other way."""
        return replace(self, scale=self.scale * factor)

    def straight(self, places: Array) -> Array:
        """Places (n, 2) of the JPEG as places of the RAW, were it straight."""
        return np.asarray(self.scale * places + (self.offset_x, self.offset_y))

    def borders(self, shape: tuple[int, int], cell: int, pixel_size: float) -> tuple[Array, Array]:
        """Borders of a grid of `shape` cells of cell × cell JPEG pixels, in pixels of an array of RAW."""
        rows, columns = (
            np.asarray((self.scale * (np.arange(count + 1) * float(cell)) + offset) / pixel_size, dtype=np.float64)
            for count, offset in zip(shape, (self.offset_y, self.offset_x), strict=True)
        )
        return rows, columns

    def on_raw(self, places: Array) -> Array:
        """Places (n, 2) of the JPEG as places of the RAW, as the lens distorted it."""
        straight = self.straight(places)
        return straight if self.distortion is None else self.distortion.distorted(straight)

    def moved(self, step: Array) -> "Registration":
        """Add a step to the first parameters of scale, offset in x and y, k1, k2, and the centre in x and y."""
        lens = self.distortion
        if lens is not None and len(step) > Unknowns.PLACE:
            k1, k2, x, y = (float(change) for change in (*step[3:], 0.0, 0.0)[:4])
            lens = replace(lens, k1=lens.k1 + k1, k2=lens.k2 + k2, x=lens.x + x, y=lens.y + y)
        scale, x, y = (float(change) for change in step[:3])
        return replace(
            self, scale=self.scale + scale, offset_x=self.offset_x + x, offset_y=self.offset_y + y, distortion=lens
        )

    def shifts(self, places: Array, unknowns: Unknowns) -> Array:
        """How far places (n, 2) of the JPEG move by a unit of each parameter, (n, 2, unknowns)."""
        on_raw = self.on_raw(places)
        small = 1e-3
        (a, c), (b, d) = ((self.on_raw(places + small * unit) - on_raw).T / small for unit in np.eye(2))
        inverse = np.stack([d, -b, -c, a], axis=-1).reshape(-1, 2, 2) / (a * d - b * c)[:, None, None]
        steps = small * np.array([1e-3, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0])[:unknowns]
        changes = [(self.moved(step).on_raw(places) - on_raw) / step.sum() for step in np.diag(steps)]
        return np.asarray(inverse @ np.stack(changes, axis=-1))

    def straightened(self, pixels: Single, pixel_size: float, shape: tuple[int, ...]) -> tuple[Single, "Registration"]:
        """RAW (h, w, 3) in the frame of its JPEG of this shape, 0 where it has none, and the place on that."""
        lens = self.distortion
        if lens is None or not any((lens.k1, lens.k2, lens.red, lens.blue)):
            return pixels, replace(self, distortion=None)
        size = [int(np.ceil(side * self.scale / pixel_size)) for side in shape[:2]]
        straight = np.zeros((*size, 3), np.float32)
        start = np.array([self.offset_x - lens.x, self.offset_y - lens.y, lens.x, lens.y]) / pixel_size
        powers = np.array([1.0, lens.k1, lens.k2]) / (lens.radius / pixel_size) ** np.array([0, 2, 4])
        _straighten(pixels, start, powers, np.array([1 + lens.red, 1.0, 1 + lens.blue]), straight)
        return straight, Registration(self.scale, 0.0, 0.0, self.correlation)


@dataclass(frozen=True)
class Placement:
    """The place of JPEGs (h, w) on RAW arrays (h, w, size of a pixel), the same in all shots of a camera."""

    raw: tuple[int, int, float]
    jpeg: tuple[int, int]
    registration: Registration


@compiled()
def _straighten(pixels: Single, start: Array, powers: Array, larger: Array, straight: Single) -> None:
    """Fill a picture (H, W, 3), whose corner is at start[:2] from the centre start[2:], from pixels (h, w, 3)."""
    height, width = pixels.shape[:2]
    for i in range(straight.shape[0]):
        y = i + 0.5 + start[1]
        for j in range(straight.shape[1]):
            x = j + 0.5 + start[0]
            square = x * x + y * y
            factor = powers[0] + square * (powers[1] + square * powers[2])
            for channel in range(3):
                down, right = start[3] + factor * larger[channel] * y, start[2] + factor * larger[channel] * x
                if not (0 <= down < height and 0 <= right < width):
                    continue
                value = pixels[int(down), int(right), channel]
                if 0.0 < value < 1.0:
                    down, right = min(max(down - 0.5, 0.0), height - 1.0), min(max(right - 0.5, 0.0), width - 1.0)
                    row, column = min(int(down), height - 2), min(int(right), width - 2)
                    down, right = np.float32(down - row), np.float32(right - column)
                    a, b = pixels[row, column, channel], pixels[row, column + 1, channel]
                    c, d = pixels[row + 1, column, channel], pixels[row + 1, column + 1, channel]
                    above = a + right * (b - a)
                    value = above + down * (c + right * (d - c) - above)
                straight[i, j, channel] = value
