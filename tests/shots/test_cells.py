"""RAW statistics over the cells of a JPEG, counted on a finer grid, and at the borders."""

import numpy as np
import pytest

from lutforge.arrays import Array
from lutforge.shots.cells import CellStatistics
from lutforge.shots.geometry import Registration


def raw_on_grid(
    pixels: Array, place: Registration, shape: tuple[int, int], cell: int, pixel_size: float = 1.0
) -> CellStatistics:
    return CellStatistics.of(pixels.astype(np.float32), *place.borders(shape, cell, pixel_size))


@pytest.mark.parametrize("pixel_size", [1.0, 2.0])
def test_cell_statistics_weigh_fractional_borders(pixel_size: float) -> None:
    rng = np.random.default_rng(0)
    pixels = rng.uniform(0, 1, (40, 50, 3))
    found = Registration(1.3, 2.6, 1.1, 1.0)
    cells = raw_on_grid(pixels, found, (3, 4), 6, pixel_size=pixel_size)
    # by counting on a grid so fine that every border lies on it: 1/20 of a full-resolution pixel
    fine = np.repeat(np.repeat(pixels, round(20 * pixel_size), axis=0), round(20 * pixel_size), axis=1)
    for row in range(3):
        for column in range(4):
            top, left = (1.3 * 6 * row + 1.1) * 20, (1.3 * 6 * column + 2.6) * 20
            block = fine[round(top) : round(top + 156), round(left) : round(left + 156)]
            np.testing.assert_allclose(cells.mean[row, column], block.mean(axis=(0, 1)), atol=1e-6)
            np.testing.assert_allclose(cells.std[row, column], block.std(axis=(0, 1)), atol=1e-5)
            mean, reach = block.mean(axis=(0, 1)), 2.4 * block.std(axis=(0, 1))
            low, high = (
                np.maximum(block.min(axis=(0, 1)), mean - reach),
                np.minimum(block.max(axis=(0, 1)), mean + reach),
            )
            np.testing.assert_allclose(cells.minimum[row, column], low, atol=2e-5)
            np.testing.assert_allclose(cells.maximum[row, column], high, atol=2e-5)


def test_cells_outside_the_raw_are_nan() -> None:
    cells = raw_on_grid(np.ones((10, 10, 3)), Registration(1.0, -1.0, 0.0, 1.0), (6, 6), 2)
    assert np.isnan(cells.mean[:, 0]).all()
    assert np.isnan(cells.mean[5]).all()
    np.testing.assert_allclose(cells.mean[:5, 1:5], 1)
    np.testing.assert_allclose(cells.std[:5, 1:5], 0, atol=1e-9)


@pytest.mark.parametrize("offset", [0.0, 0.5])
def test_single_outliers_are_no_part_of_a_cell_but_many_are(offset: float) -> None:
    pixels = 0.2 + 0.001 * np.random.default_rng(2).standard_normal((33, 33, 3))
    pixels[4, 4, 1], pixels[20:23, 20:23, 1] = 1.0, 1.0
    cells = raw_on_grid(pixels, Registration(1.0, offset, offset, 1.0), (4, 4), 8)
    assert cells.maximum[0, 0, 1] < 0.21
    assert cells.maximum[2, 2, 1] > 0.5
