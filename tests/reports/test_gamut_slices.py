"""Slices of the gamut map: their grid covers the colours of the sRGB cube with one luminance."""

import numpy as np
import pytest

from lutforge.model.gamut_map import GamutMap
from lutforge.reports.drawing import Arrows, Dots
from lutforge.reports.figures import LUMINANCE, gamut_figure, slice_grid


@pytest.mark.parametrize("luminance", [0.02, 0.0722, 0.25, 0.5, 0.7152, 0.9])
def test_the_grid_covers_the_slice_of_the_cube(luminance: float) -> None:
    grid = slice_grid(luminance)
    assert np.allclose(grid @ LUMINANCE, luminance) and grid.min() > -1e-12 and grid.max() < 1 + 1e-12
    assert np.allclose(grid[0], luminance)
    assert np.allclose(np.minimum(grid[-1], 1 - grid[-1]).min(axis=1), 0, atol=1e-12)  # on a face of the cube
    assert np.allclose(grid[-1, 0], grid[-1, -1])
    # Its cells make up the area of all colours of this luminance, seen along G.
    rng = np.random.default_rng(0).random((200_000, 2))
    green = (luminance - rng @ LUMINANCE[[0, 2]]) / LUMINANCE[1]
    red, blue = grid[-1, :, 0], grid[-1, :, 2]
    area = 0.5 * abs(np.sum(red[:-1] * blue[1:] - red[1:] * blue[:-1]))
    assert area == pytest.approx(((green >= 0) & (green <= 1)).mean(), abs=0.005)


def test_arrows_lead_where_the_map_takes_colours() -> None:
    polynomial = np.vstack([np.zeros(3), np.diag([0.5, 1.0, 1.0])])  # half of red; a control point at a grey of 0.25
    halved = GamutMap(np.full((1, 3), 0.25), np.zeros((1, 3)), polynomial)
    (panel,) = gamut_figure({"halved": halved}, [0.25]).panels
    arrows = next(mark for mark in panel.marks if isinstance(mark, Arrows))
    red = arrows.values / 0.5
    moved = 0.5 * np.stack([red * (LUMINANCE[0] - 1), red * LUMINANCE[0]], 1)
    assert np.allclose(arrows.end - arrows.start, moved)
    centres = next(mark for mark in panel.marks if isinstance(mark, Dots))
    assert np.allclose(centres.points, [[0.0, 0.0]])
