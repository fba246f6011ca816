"""RAW statistics over the area of JPEG pixels: each RAW pixel counts by as much of it as a cell covers."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
import scipy
from numpy.typing import NDArray

from lutforge.arrays import Array, Index, Mask, Single
from lutforge.compiled import REASSOCIATED, compiled
from lutforge.images.raw import RawImage
from lutforge.shots.shot import Registration, Shot

Mark = NDArray[np.uint8]
Number = TypeVar("Number", Array, Single)
REACH = 2.4
"""How far, in standard deviations, noise is taken to reach: 64 pixels of it do on average. Where no more than these
0.8 % are clipped, the mean moves by less than 0.003 standard deviations."""


@dataclass(frozen=True, eq=False)
class CellStatistics:
    """RAW statistics over the areas of cell×cell JPEG pixels: each (hc, wc, 3) float64; NaN where RAW has no pixels.

    Outliers do not count, see `without_outliers`. minimum and maximum are over every RAW pixel that the cell touches,
    but no further from the mean than REACH standard deviations. outliers: the share of each cell that does not count.
    """

    mean: Array
    std: Array
    minimum: Array
    maximum: Array
    outliers: Array

    @property
    def hot(self) -> bool:
        """True where most cells hold outliers: the picture is strewn with hot pixels."""
        return bool(np.nanmedian(self.outliers.max(axis=-1)) > 0) if np.isfinite(self.mean).any() else False


def raw_on_jpeg_cells(shot: Shot, cell: int, hot: bool = False) -> CellStatistics:
    """RAW statistics over the grid of non-overlapping cell×cell blocks of JPEG pixels.

    A rest at the border is left out.

    The mean and standard deviation weigh each RAW pixel by the area of it that the cell covers, exactly.
    hot: judge outliers by medians, which takes longer.
    """
    height, width = shot.jpeg.shape[0] // cell, shot.jpeg.shape[1] // cell
    return raw_on_grid(shot.raw, shot.registration, height, width, cell, hot)


def raw_on_grid(
    raw: RawImage, registration: Registration, height: int, width: int, cell: int, hot: bool = False
) -> CellStatistics:
    """RAW statistics as `raw_on_jpeg_cells`, for a grid of height × width cells."""
    rows = cell_edges(registration.scale, registration.offset_y, height, cell, raw.pixel_size)
    columns = cell_edges(registration.scale, registration.offset_x, width, cell, raw.pixel_size)
    covered = [
        (edges[:-1] >= -1e-9) & (edges[1:] <= size + 1e-9)
        for edges, size in ((rows, raw.pixels.shape[0]), (columns, raw.pixels.shape[1]))
    ]
    result = np.full((5, height, width, 3), np.nan)
    plane = _Plane(np.empty(raw.pixels.shape[:2]), rows, columns)
    for channel in range(3):
        plane.pixels[:] = raw.pixels[..., channel]
        (mean, std, low, high), result[4, ..., channel] = plane.statistics(hot)
        result[0, ..., channel], result[1, ..., channel] = mean, std
        result[2, ..., channel] = np.maximum(low, mean - REACH * std)
        result[3, ..., channel] = np.minimum(high, mean + REACH * std)
    result[:, ~np.outer(*covered)] = np.nan
    return CellStatistics(*result)


@dataclass(frozen=True, eq=False)
class _Plane:
    """One channel (h, w) under a grid of cells with borders at rows (H + 1,) and columns (W + 1,)."""

    pixels: Array
    rows: Array
    columns: Array

    def statistics(self, hot: bool) -> tuple[Array, Array]:
        """Mean and standard deviation by area, least and greatest value that each cell touches, (4, H, W).

        Outliers are replaced in place, as `without_outliers` says; hot: by medians. Returns each cell's share of them,
        too, (H, W).
        """
        owners = [
            np.clip(np.searchsorted(edges, np.arange(size) + 0.5) - 1, 0, len(edges) - 2)
            for edges, size in zip((self.rows, self.columns), self.pixels.shape, strict=True)
        ]
        row_begins, column_begins = (
            np.searchsorted(owner, np.arange(len(edges)))
            for owner, edges in zip(owners, (self.rows, self.columns), strict=True)
        )
        share = np.zeros((len(self.rows) - 1, len(self.columns) - 1))
        found, replaced = np.empty((4, *share.shape)), np.zeros(self.pixels.shape, dtype=np.uint8)
        changed, ever = np.ones(share.shape, dtype=np.bool_), np.zeros(share.shape, dtype=np.bool_)
        for round_ in range(4):
            _statistics(self.pixels, self.rows, self.columns, changed, found)
            mean, std, low, high = found
            centre, limit = self._medians(owners) if hot and round_ < 3 else (mean, 4 * std + 1e-9)
            doubtful = changed & (np.maximum(high - centre, centre - low) > limit)
            changed[:] = False
            if round_ == 3 or not _replace(
                self.pixels, replaced, self.rows, self.columns, row_begins, column_begins,
                centre, limit, doubtful, 1 / 4 if hot else 1 / 16, share, changed,
            ):  # fmt: skip
                break
            changed = scipy.ndimage.binary_dilation(changed, np.ones((3, 3)))  # cells share the pixels at borders
            ever |= changed
        share[:] = 0
        _add_up(replaced, self.rows, self.columns, ever, share)
        return found, share

    def _medians(self, owners: list[NDArray[np.intp]]) -> tuple[Array, Array]:
        """Medians of the cells, and four standard deviations by the median deviation, (H, W) each."""
        shape = (len(self.rows) - 1, len(self.columns) - 1)
        label = owners[0][:, None] * shape[1] + owners[1][None, :]
        median = medians(self.pixels, label, shape[0] * shape[1])
        deviation = medians(np.abs(self.pixels - median[label]), label, shape[0] * shape[1])
        return median.reshape(shape), 4 * 1.4826 * deviation.reshape(shape) + 1e-9


def medians(values: Array, label: NDArray[np.intp], count: int) -> Array:
    """Return the medians (count,) of the values of each label 0 … count − 1; 0 where a label has no value.

    One sort finds them all: each value is scaled to [0, 1) and its label added.
    """
    sizes = np.bincount(label.ravel(), minlength=count)
    low = float(values.min())
    span = (float(values.max()) - low) * 1.001 or 1.0
    ranked = np.sort((label + (values - low) / span).ravel())
    first, filled = np.cumsum(sizes) - sizes, np.flatnonzero(sizes)
    middle = ranked[(first + (sizes - 1) // 2)[filled]] + ranked[(first + sizes // 2)[filled]]
    found = np.zeros(count)
    found[filled] = (0.5 * middle - filled) * span + low
    return found


def without_outliers(
    values: Array,
    average: Callable[[Array], Array],
    spread: Callable[[Array], Array],
    median: Callable[[Array], Array] | None = None,
) -> tuple[Array, Array]:
    """Replace what lies over four standard deviations from its cell's mean (hot pixels, dust) by that mean, repeatedly.

    average: the means over the cells of such an array. spread: brings numbers of the cells back to its shape. A cell
    of which that would be more than a sixteenth stays as it is: it shows something. median: the medians over the
    cells; where given, they and the median deviation take the place of mean and standard deviation, and a quarter of
    a cell may be outliers. Returns the array, and the share of each cell that was replaced.
    """
    replaced = np.zeros(values.shape, dtype=np.bool_)
    for _ in range(3):
        if median is None:
            mean = average(values)
            std = np.sqrt(np.maximum(0, average(values * values) - mean * mean))
        else:
            mean = median(values)
            std = 1.4826 * median(np.abs(values - spread(mean)))
        centre = spread(mean)
        outlier = np.abs(values - centre) > spread(4 * std + 1e-9)
        share = average((outlier | replaced).astype(np.float64))
        outlier &= spread(share) <= (1 / 16 if median is None else 1 / 4)
        if not outlier.any():
            break
        values = np.where(outlier, centre, values)
        replaced |= outlier
    return values, average(replaced.astype(np.float64))


def greatest(values: Number) -> Number:
    """Return the greatest of three channels, (…); NumPy's own maximum over so short an axis takes ten times as long."""
    return np.maximum(np.maximum(values[..., 0], values[..., 1]), values[..., 2])


def cell_edges(scale: float, offset: float, count: int, cell: int, pixel_size: float) -> Array:
    """Borders of `count` cells in units of array pixels, where array pixel i covers [i, i + 1]."""
    return np.asarray((scale * (np.arange(count + 1) * float(cell)) + offset) / pixel_size, dtype=np.float64)


@compiled()
def _touched(edges: Array, cell: int, size: int) -> tuple[int, int]:
    """The first array pixel that a cell touches, and the one after the last."""
    first = max(0, int(np.floor(edges[cell] + 1e-9)))
    last = min(size, int(np.ceil(edges[cell + 1] - 1e-9)))
    return first, last


@compiled(fastmath=REASSOCIATED)
def _statistics(plane: Array, rows: Array, columns: Array, wanted: Mask, found: Array) -> None:
    """Fill mean, standard deviation, least and greatest value, (4, H, W), of the pixels under each wanted cell."""
    width = plane.shape[1]
    total, square, low, high = np.empty(width), np.empty(width), np.empty(width), np.empty(width)
    for i in range(len(rows) - 1):
        first, last = _touched(rows, i, plane.shape[0])
        begin = end = 0
        for j in range(len(columns) - 1):
            if not wanted[i, j]:
                continue
            if j >= end:  # the columns of pixels under a run of wanted cells are added up first
                begin = end = j
                while end < len(columns) - 1 and wanted[i, end]:
                    end += 1
                left, right = _touched(columns, begin, width)[0], _touched(columns, end - 1, width)[1]
                height = _add_rows(
                    plane[first:last, left:right], rows[i] - first, rows[i + 1] - first,
                    total[left:right], square[left:right], low[left:right], high[left:right],
                )  # fmt: skip
            left, right = _touched(columns, j, width)
            area, mean, squares, least, greatest = 0.0, 0.0, 0.0, np.inf, -np.inf
            for x in range(left, right):
                wide = min(columns[j + 1], x + 1.0) - max(columns[j], float(x))
                area += height * wide
                mean += wide * total[x]
                squares += wide * square[x]
                least, greatest = min(least, low[x]), max(greatest, high[x])
            mean = mean / area if area > 0.0 else np.nan
            found[0, i, j] = mean
            found[1, i, j] = np.sqrt(max(0.0, squares / area - mean * mean)) if area > 0.0 else 0.0
            found[2, i, j], found[3, i, j] = least, greatest


@compiled(fastmath=REASSOCIATED)
def _add_rows(plane: Array, top: float, bottom: float, total: Array, square: Array, low: Array, high: Array) -> float:
    """Fill sums, sums of squares, least and greatest values of columns between two heights; return what they span."""
    total[:], square[:], low[:], high[:], height = 0.0, 0.0, np.inf, -np.inf, 0.0
    for y in range(len(plane)):
        line, tall = plane[y], min(bottom, y + 1.0) - max(top, float(y))
        height += tall
        for x in range(len(line)):
            total[x] += tall * line[x]
            square[x] += tall * line[x] * line[x]
            low[x], high[x] = min(low[x], line[x]), max(high[x], line[x])
    return height


@compiled(fastmath=REASSOCIATED)
def _add_up(marked: Mark, rows: Array, columns: Array, wanted: Mask, share: Array) -> None:
    """Fill the share of the area of each wanted cell, (H, W), whose pixels are marked."""
    for i in range(len(rows) - 1):
        first, last = _touched(rows, i, marked.shape[0])
        for j in range(len(columns) - 1):
            if wanted[i, j]:
                left, right = _touched(columns, j, marked.shape[1])
                area, total = 0.0, 0.0
                for y in range(first, last):
                    tall = min(rows[i + 1], y + 1.0) - max(rows[i], float(y))
                    for x in range(left, right):
                        covered = tall * (min(columns[j + 1], x + 1.0) - max(columns[j], float(x)))
                        area += covered
                        if marked[y, x]:
                            total += covered
                share[i, j] = total / area if area > 0.0 else 0.0


@compiled()
def _replace(
    plane: Array,
    replaced: Mark,
    rows: Array,
    columns: Array,
    row_begins: Index,
    column_begins: Index,
    centre: Array,
    limit: Array,
    doubtful: Mask,
    most: float,
    share: Array,
    changed: Mask,
) -> bool:
    """Replace the outliers of doubtful cells by their centres, unless they are more than a share of the cell.

    replaced: (h, w) 1 where that was done; row_begins, column_begins: of the pixels whose middles lie in each cell;
    changed: is set where a cell holds a replaced one. Returns whether any was replaced.
    """
    outlier = np.uint8(2)
    for act in range(2):
        for i in range(len(rows) - 1):
            for j in range(len(columns) - 1):
                if not doubtful[i, j]:
                    continue
                for y in range(row_begins[i], row_begins[i + 1]):
                    for x in range(column_begins[j], column_begins[j + 1]):
                        if act == 0 and abs(plane[y, x] - centre[i, j]) > limit[i, j]:
                            replaced[y, x] |= outlier
                        elif act == 1 and replaced[y, x] & outlier:
                            replaced[y, x] &= np.uint8(1)
                            if share[i, j] <= most:
                                plane[y, x], replaced[y, x], changed[i, j] = centre[i, j], np.uint8(1), True
        if act == 0:
            _add_up(replaced, rows, columns, doubtful, share)
    return bool(changed.any())
