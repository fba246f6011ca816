"""RAW statistics over the area of JPEG pixels: each RAW pixel counts by as much of it as a cell covers."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from lutforge.arrays import Array, Index, Mask
from lutforge.compiled import REASSOCIATED, compiled
from lutforge.images.raw import RawImage
from lutforge.shots.shot import Registration, Shot

Mark = NDArray[np.uint8]
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
    for channel in range(3):
        plane = _Plane(raw.pixels[..., channel].astype(np.float64), rows, columns)
        result[4, ..., channel] = plane.without_outliers(hot)
        mean, std, low, high = plane.statistics()
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

    def statistics(self) -> Array:
        """(4, H, W): mean and standard deviation by area, least and greatest value that each cell touches."""
        found = np.empty((4, len(self.rows) - 1, len(self.columns) - 1))
        _statistics(self.pixels, self.rows, self.columns, found)
        return found

    def without_outliers(self, hot: bool) -> Array:
        """Replace outliers in place, as `without_outliers` says; hot: by medians. Returns each cell's share of them."""
        owners = [
            np.clip(np.searchsorted(edges, np.arange(size) + 0.5) - 1, 0, len(edges) - 2)
            for edges, size in zip((self.rows, self.columns), self.pixels.shape, strict=True)
        ]
        row_begins, column_begins = (
            np.searchsorted(owner, np.arange(len(edges)))
            for owner, edges in zip(owners, (self.rows, self.columns), strict=True)
        )
        replaced = np.zeros(self.pixels.shape, dtype=np.uint8)
        share = np.zeros((len(self.rows) - 1, len(self.columns) - 1))
        for _ in range(3):
            mean, std, low, high = self.statistics()
            centre, limit = self._medians(owners) if hot else (mean, 4 * std + 1e-9)
            doubtful = np.maximum(high - centre, centre - low) > limit
            if not _replace(
                self.pixels, replaced, self.rows, self.columns, row_begins, column_begins,
                centre, limit, doubtful, 1 / 4 if hot else 1 / 16, share,
            ):  # fmt: skip
                break
        _add_up(replaced, self.rows, self.columns, np.ones(share.shape, dtype=np.bool_), share)
        return share

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


def cell_edges(scale: float, offset: float, count: int, cell: int, pixel_size: float) -> Array:
    """Borders of `count` cells in units of array pixels, where array pixel i covers [i, i + 1]."""
    return np.asarray((scale * (np.arange(count + 1) * float(cell)) + offset) / pixel_size, dtype=np.float64)


def area_weights(edges: Array, size: int) -> "scipy.sparse.csr_array":
    """(cells, size) share of each array pixel in the mean over each cell; rows of cells outside are cut or empty."""
    low, high = np.clip(edges[:-1], 0, size), np.clip(edges[1:], 0, size)
    first, last = np.floor(low).astype(int), np.ceil(high).astype(int)
    lengths = np.maximum(0, last - first)
    starts = np.concatenate([[0], np.cumsum(lengths)])
    cell = np.repeat(np.arange(len(low)), lengths)
    pixel = np.arange(starts[-1]) - starts[cell] + first[cell]
    overlap = np.minimum(pixel + 1, high[cell]) - np.maximum(pixel, low[cell])
    share = overlap / (high - low)[cell]
    return scipy.sparse.csr_array((share, pixel, starts), shape=(len(low), size))


@compiled()
def _touched(edges: Array, cell: int, size: int) -> tuple[int, int]:
    """The first array pixel that a cell touches, and the one after the last."""
    first = max(0, int(np.floor(edges[cell] + 1e-9)))
    last = min(size, int(np.ceil(edges[cell + 1] - 1e-9)))
    return first, last


@compiled(fastmath=REASSOCIATED)
def _statistics(plane: Array, rows: Array, columns: Array, found: Array) -> None:
    """Fill mean, standard deviation, least and greatest value, (4, H, W), of the pixels under each cell."""
    for i in range(len(rows) - 1):
        first, last = _touched(rows, i, plane.shape[0])
        for j in range(len(columns) - 1):
            left, right = _touched(columns, j, plane.shape[1])
            area, total, square, low, high = 0.0, 0.0, 0.0, np.inf, -np.inf
            for y in range(first, last):
                tall = min(rows[i + 1], y + 1.0) - max(rows[i], float(y))
                line = plane[y]
                for x in range(left, right):
                    value, covered = line[x], tall * (min(columns[j + 1], x + 1.0) - max(columns[j], float(x)))
                    area += covered
                    total += covered * value
                    square += covered * value * value
                    low, high = min(low, value), max(high, value)
            mean = total / area if area > 0.0 else np.nan
            found[0, i, j], found[1, i, j] = mean, np.sqrt(max(0.0, square / area - mean * mean)) if area > 0.0 else 0.0
            found[2, i, j], found[3, i, j] = low, high


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
) -> bool:
    """Replace the outliers of doubtful cells by their centres, unless they are more than a share of the cell.

    replaced: (h, w) 1 where that was done; row_begins, column_begins: of the pixels whose middles lie in each cell.
    Returns whether any was replaced.
    """
    outlier, done = np.uint8(2), False
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
                                plane[y, x], replaced[y, x], done = centre[i, j], np.uint8(1), True
        if act == 0:
            _add_up(replaced, rows, columns, doubtful, share)
    return done
