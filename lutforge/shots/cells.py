"""RAW statistics over the area of JPEG pixels: each RAW pixel counts by as much of it as a cell covers."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from lutforge.arrays import Array
from lutforge.images.raw import RawImage
from lutforge.shots.shot import Registration, Shot

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
    pixels = raw.pixels
    rows = cell_edges(registration.scale, registration.offset_y, height, cell, raw.pixel_size)
    columns = cell_edges(registration.scale, registration.offset_x, width, cell, raw.pixel_size)
    weigh_rows = area_weights(rows, pixels.shape[0])
    weigh_columns = area_weights(columns, pixels.shape[1])
    covered_rows = (rows[:-1] >= -1e-9) & (rows[1:] <= pixels.shape[0] + 1e-9)
    covered_columns = (columns[:-1] >= -1e-9) & (columns[1:] <= pixels.shape[1] + 1e-9)
    in_row, in_column = (
        np.clip(np.searchsorted(edges, np.arange(size) + 0.5) - 1, 0, len(edges) - 2)
        for edges, size in ((rows, pixels.shape[0]), (columns, pixels.shape[1]))
    )
    label = in_row[:, None] * width + in_column[None, :]

    def median(values: Array) -> Array:
        return medians(values, label, height * width).reshape(height, width)

    outside = ~(covered_rows[:, None] & covered_columns[None, :])
    result = np.full((5, height, width, 3), np.nan)
    for channel in range(3):
        plane, result[4, ..., channel] = without_outliers(
            pixels[..., channel].astype(np.float64),
            lambda values: np.asarray(weigh_rows @ values @ weigh_columns.T),
            lambda cells: cells[np.ix_(in_row, in_column)],
            median if hot else None,
        )
        mean = weigh_rows @ plane @ weigh_columns.T
        square = weigh_rows @ (plane * plane) @ weigh_columns.T
        std = np.sqrt(np.maximum(0, square - mean * mean))
        result[0, ..., channel], result[1, ..., channel] = mean, std
        result[2, ..., channel] = np.maximum(_touched(np.minimum, plane, rows, columns), mean - REACH * std)
        result[3, ..., channel] = np.minimum(_touched(np.maximum, plane, rows, columns), mean + REACH * std)
    result[:, outside] = np.nan
    return CellStatistics(*result)


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


def _touched(reduce: np.ufunc, plane: Array, rows: Array, columns: Array) -> Array:
    """Minimum or maximum over the array pixels that each cell touches."""
    for axis, edges in ((0, rows), (1, columns)):
        size = plane.shape[axis]
        first = np.clip(np.floor(edges[:-1] + 1e-9).astype(int), 0, size - 1)
        last = np.clip(np.ceil(edges[1:] - 1e-9).astype(int), first + 1, size)
        pairs = np.stack([first, last], axis=1).ravel()
        # reduceat wants indices inside the array: a repeated border row changes no extremum
        padded = np.concatenate([plane, np.take(plane, [size - 1], axis=axis)], axis=axis)
        plane = np.take(reduce.reduceat(padded, pairs, axis=axis), np.arange(0, len(pairs), 2), axis=axis)
    return plane
