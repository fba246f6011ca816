"""Statistics of RAW and JPEG over the cells of one grid: each pixel counts by the share of it that a cell covers."""

from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from lutforge.arrays import Array, Codes, Single
from lutforge.compiled import REASSOCIATED, compiled

Number = TypeVar("Number", Array, Single)
NOISE_REACH = 2.4
"""The largest deviation of noise among 64 pixels, on average, in standard deviations.

Where no more pixels are clipped than lie beyond it, 0.8 %, the mean changes by less than 0.003 standard deviations.
"""


@dataclass(frozen=True, eq=False)
class CellStatistics:
    """Statistics over the cells of a grid on a picture, each (H, W, 3) float64; NaN where the picture has no pixels.

    The weight of a pixel is exactly the share of it that the cell covers. minimum and maximum are over every pixel that
    the cell touches, but no further from the mean than NOISE_REACH standard deviations.
    """

    mean: Array
    std: Array
    minimum: Array
    maximum: Array

    @classmethod
    def of(cls, image: Single | Codes | NDArray[np.uint16], rows: Array, columns: Array) -> "CellStatistics":
        """The statistics of an image (h, w, 3); 16-bit values 0 … 65535 stand for codes 0 … 255.

        rows (H + 1,), columns (W + 1,): borders of the grid, in pixels. What lies over four standard deviations from
        its cell's mean (hot pixels, dust) is replaced by that mean, up to three times. A cell of which that would be
        more than a sixteenth stays as it is: it shows something.
        """
        statistics = np.zeros((4, len(rows) - 1, len(columns) - 1, 3))
        if statistics.size:
            _statistics_under(image, rows, columns, statistics)
        if image.dtype == np.uint16:
            statistics /= 257.0
        mean, std, low, high = statistics
        low[:] = np.maximum(low, mean - NOISE_REACH * std)
        high[:] = np.minimum(high, mean + NOISE_REACH * std)

        # NaN where the picture has no pixels.
        sides = zip((rows, columns), image.shape[:2], strict=True)
        covered = [(edges[:-1] >= -1e-9) & (edges[1:] <= size + 1e-9) for edges, size in sides]
        statistics[:, ~np.outer(*covered)] = np.nan
        return cls(*statistics)


def greatest(values: Number) -> Number:
    """Return the greatest of three channels, (…); NumPy's own maximum over so short an axis takes ten times as long."""
    return np.maximum(np.maximum(values[..., 0], values[..., 1]), values[..., 2])


@compiled()
def _touched(edges: Array, cell: int, size: int) -> tuple[int, int]:
    """The first array pixel that a cell touches, and the one after the last."""
    first = max(0, int(np.floor(edges[cell] + 1e-9)))
    last = min(size, int(np.ceil(edges[cell + 1] - 1e-9)))
    return first, last


@compiled(fastmath=REASSOCIATED)
def _statistics_under(
    image: Single | Codes | NDArray[np.uint16], rows: Array, columns: Array, statistics: Array
) -> None:
    """Fill mean, standard deviation, least and greatest value, (4, H, W, 3)."""
    height, width = image.shape[:2]
    begin, end = _touched(columns, 0, width)[0], _touched(columns, len(columns) - 2, width)[1]
    size = max(0, 3 * (end - begin))
    total, square, low, high = np.empty(size), np.empty(size), np.empty(size, np.float32), np.empty(size, np.float32)
    for i in range(len(rows) - 1):
        first, last = _touched(rows, i, height)
        tall = _add_rows(image[first:last, begin:end], rows[i] - first, rows[i + 1] - first, total, square, low, high)
        for j in range(len(columns) - 1):
            left, right = _touched(columns, j, width)
            for channel in range(3):
                wide, mean, squares, least, greatest = 0.0, 0.0, 0.0, np.float32(np.inf), np.float32(-np.inf)
                for x in range(left, right):
                    share = min(columns[j + 1], x + 1.0) - max(columns[j], float(x))
                    at = 3 * (x - begin) + channel
                    wide, mean, squares = wide + share, mean + share * total[at], squares + share * square[at]
                    least, greatest = min(least, low[at]), max(greatest, high[at])
                area = tall * wide
                if area <= 0.0:
                    continue

                mean /= area
                std = np.sqrt(max(0.0, squares / area - mean * mean))
                of_cell = statistics[:, i, j, channel]
                of_cell[0], of_cell[1], of_cell[2], of_cell[3] = mean, std, least, greatest
                if max(greatest - mean, mean - least) > 4 * std + 1e-9:
                    _without_outliers(
                        image[first:last, left:right, channel], rows[i] - first, rows[i + 1] - first,
                        columns[j] - left, columns[j + 1] - left, of_cell,
                    )  # fmt: skip


@compiled(fastmath=REASSOCIATED)
def _add_rows(
    image: Single | Codes | NDArray[np.uint16],
    top: float,
    bottom: float,
    total: Array,
    square: Array,
    low: Single,
    high: Single,
) -> float:
    """Fill sums, sums of squares, least and greatest values of columns between two heights; return what they span."""
    total[:], square[:], low[:], high[:], height = 0.0, 0.0, np.inf, -np.inf, 0.0
    for y in range(len(image)):
        line, tall = image[y].ravel(), min(bottom, y + 1.0) - max(top, float(y))
        height += tall
        for x in range(len(total)):
            value = float(line[x])
            total[x] += tall * value
            square[x] += tall * value * value
        for x in range(len(total)):
            low[x], high[x] = min(low[x], np.float32(line[x])), max(high[x], np.float32(line[x]))
    return height


@compiled(fastmath=REASSOCIATED)
def _without_outliers(
    cell: Single | Codes | NDArray[np.uint16],
    top: float,
    bottom: float,
    left: float,
    right: float,
    statistics: Array,
) -> None:
    """Fill the statistics (4,) of one channel of a cell, (h, w), between these borders, without its outliers."""
    values, areas, marks = np.empty(cell.size), np.empty(cell.size), np.zeros(cell.size, np.uint8)
    replaced = np.uint8(1)
    outlier = np.uint8(2)
    at = 0
    area = 0.0
    for y in range(cell.shape[0]):
        tall = min(bottom, y + 1.0) - max(top, float(y))
        for x in range(cell.shape[1]):
            values[at], areas[at] = cell[y, x], tall * (min(right, x + 1.0) - max(left, float(x)))
            area += areas[at]
            at += 1

    for _ in range(3):
        centre, limit = statistics[0], 4 * statistics[1] + 1e-9
        doubtful, far = 0.0, False
        for at in range(len(values)):
            if abs(values[at] - centre) > limit:
                marks[at] |= outlier
                far = True
            doubtful += areas[at] if marks[at] else 0.0
        if not far or doubtful > area / 16:
            break
        mean = squares = 0.0
        for at in range(len(values)):
            if marks[at] & outlier:
                values[at], marks[at] = centre, replaced
            mean += areas[at] * values[at]
            squares += areas[at] * values[at] * values[at]

        mean /= area
        statistics[0] = mean
        statistics[1] = np.sqrt(max(0.0, squares / area - mean * mean))
        statistics[2] = values.min()
        statistics[3] = values.max()
