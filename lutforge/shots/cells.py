"""RAW statistics over the area of JPEG pixels: each RAW pixel counts by as much of it as a cell covers."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from lutforge.images.raw import RawImage
from lutforge.shots.shot import Registration, Shot

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class CellStatistics:
    """RAW statistics over the areas of cell×cell JPEG pixels: each (hc, wc, 3) float64; NaN where RAW has no
    pixels.

    minimum and maximum are over every RAW pixel that the cell touches.
    """

    mean: Array
    std: Array
    minimum: Array
    maximum: Array


def raw_on_jpeg_cells(shot: Shot, cell: int) -> CellStatistics:
    """RAW statistics over the grid of non-overlapping cell×cell blocks of JPEG pixels (a rest at the border
    is left out).

    The mean and standard deviation weigh each RAW pixel by the area of it that the cell covers, exactly.
    """
    height, width = shot.jpeg.shape[0] // cell, shot.jpeg.shape[1] // cell
    return raw_on_grid(shot.raw, shot.registration, height, width, cell)


def raw_on_grid(raw: RawImage, registration: Registration, height: int, width: int, cell: int) -> CellStatistics:
    """As `raw_on_jpeg_cells`, for a grid of height × width cells."""
    pixels = raw.pixels
    rows = cell_edges(registration.scale, registration.offset_y, height, cell, raw.pixel_size)
    columns = cell_edges(registration.scale, registration.offset_x, width, cell, raw.pixel_size)
    weigh_rows = area_weights(rows, pixels.shape[0])
    weigh_columns = area_weights(columns, pixels.shape[1])
    covered_rows = (rows[:-1] >= -1e-9) & (rows[1:] <= pixels.shape[0] + 1e-9)
    covered_columns = (columns[:-1] >= -1e-9) & (columns[1:] <= pixels.shape[1] + 1e-9)
    outside = ~(covered_rows[:, None] & covered_columns[None, :])
    result = np.full((4, height, width, 3), np.nan)
    for channel in range(3):
        plane = pixels[..., channel].astype(np.float64)
        mean = weigh_rows @ plane @ weigh_columns.T
        square = weigh_rows @ (plane * plane) @ weigh_columns.T
        result[0, ..., channel] = mean
        result[1, ..., channel] = np.sqrt(np.maximum(0, square - mean * mean))
        result[2, ..., channel] = _touched(np.minimum, plane, rows, columns)
        result[3, ..., channel] = _touched(np.maximum, plane, rows, columns)
    result[:, outside] = np.nan
    return CellStatistics(*result)


def cell_edges(scale: float, offset: float, count: int, cell: int, pixel_size: float) -> Array:
    """Borders of `count` cells in units of array pixels, where array pixel i covers [i, i + 1]."""
    return np.asarray((scale * (np.arange(count + 1) * float(cell)) + offset) / pixel_size, dtype=np.float64)


def area_weights(edges: Array, size: int) -> sparse.csr_array:
    """(cells, size) share of each array pixel in the mean over each cell; rows of cells outside are cut off
    or empty."""
    low, high = np.clip(edges[:-1], 0, size), np.clip(edges[1:], 0, size)
    first, last = np.floor(low).astype(int), np.ceil(high).astype(int)
    lengths = np.maximum(0, last - first)
    starts = np.concatenate([[0], np.cumsum(lengths)])
    cell = np.repeat(np.arange(len(low)), lengths)
    pixel = np.arange(starts[-1]) - starts[cell] + first[cell]
    overlap = np.minimum(pixel + 1, high[cell]) - np.maximum(pixel, low[cell])
    share = overlap / (high - low)[cell]
    return sparse.csr_array((share, pixel, starts), shape=(len(low), size))


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
