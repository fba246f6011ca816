"""Flat tiles: structure in JPEG, RAW or around a cell counts; noise does not."""

import numpy as np
import pytest
from numpy.typing import NDArray

from lutforge.samples.clipping import Extremes, clipping, saturation_levels
from lutforge.samples.tiles import LEVELS, agreement, cell_size, flatness, jpeg_cells
from lutforge.shots.cells import CellStatistics
from lutforge.shots.geometry import Registration

Array = NDArray[np.float64]
CELL = 8


def raw_cells(raw: Array) -> CellStatistics:
    """Statistics of a RAW array that lies pixel on pixel on the JPEG."""
    h, w = raw.shape[0] // CELL, raw.shape[1] // CELL
    blocks = raw[: h * CELL, : w * CELL].reshape(h, CELL, w, CELL, 3)
    over = (1, 3)
    return CellStatistics(blocks.mean(over), blocks.std(over), blocks.min(over), blocks.max(over), 0 * blocks.min(over))


def render(raw: Array) -> NDArray[np.uint8]:
    return np.rint(255 * np.clip(raw, 0, 1) ** (1 / 2.2)).astype(np.uint8)


def levels(raw: Array, jpeg: NDArray[np.uint8]) -> NDArray[np.intp]:
    cells = jpeg_cells(jpeg, CELL)
    usable = np.ones(cells.mean.shape[:2], dtype=np.bool_)
    return flatness(cells, raw_cells(raw), np.ones(3), usable).level


@pytest.mark.parametrize(
    ("scale", "cell"), [(3.55, 8), (2.0, 8), (1.99, 8), (1.5, 16), (1.0, 16), (0.95, 16), (0.5, 32), (14, 8)]
)
def test_cell_size_spans_enough_raw_pixels(scale: float, cell: int) -> None:
    assert cell_size(Registration(scale, 0, 0, 1)) == cell


def test_statistics_match_numpy() -> None:
    jpeg = np.random.default_rng(1).integers(0, 256, (35, 50, 3), dtype=np.uint8)
    cells = jpeg_cells(jpeg, CELL)
    assert cells.mean.shape == (4, 6, 3)
    block = jpeg[8:16, 40:48].reshape(-1, 3)
    np.testing.assert_allclose(cells.mean[1, 5], block.mean(axis=0))
    np.testing.assert_allclose(cells.std[1, 5], block.std(axis=0), rtol=1e-4)
    np.testing.assert_array_equal(cells.extremes.minimum[1, 5], block.min(axis=0))
    np.testing.assert_array_equal(cells.extremes.maximum[1, 5], block.max(axis=0))


def test_noise_is_not_structure_but_an_edge_is() -> None:
    rng = np.random.default_rng(2)
    raw = np.full((160, 160, 3), 0.2)
    raw[:, 80:] = 0.05
    # photon noise: 8 % and 16 %, where the strict limit for structure is 6 %
    raw += 0.08 * np.sqrt(0.2 * raw) * rng.standard_normal(raw.shape)
    found = levels(raw, render(raw))
    flat = found == 0
    # the columns of cells on both sides of the edge are out, all others are in
    assert not flat[:, 9:11].any()
    assert flat[:, :9].mean() > 0.95
    assert flat[:, 11:].mean() > 0.9


def test_texture_in_either_picture_rejects() -> None:
    flat = np.full((160, 160, 3), 0.2)
    y, x = np.mgrid[:160, :160]
    textured = flat * np.where((x // 2 + y // 2) % 2, 1.5, 0.5)[..., None]
    half = flat.copy()
    half[:, 80:] = textured[:, 80:]
    for raw, jpeg in ((half, render(flat)), (flat, render(half)), (half, render(half))):
        found = levels(raw, jpeg)
        assert (found[:, :9] == 0).all()
        assert (found[:, 11:] == len(LEVELS)).all()


def test_gradients_relax_in_steps() -> None:
    found = []
    for slope in (0.001, 0.02, 0.05, 0.2):
        ramp = 0.02 * np.exp(slope * np.abs(np.arange(160) % 32 - 16.0))
        raw = np.broadcast_to(ramp[None, :, None], (160, 160, 3))
        flat = np.full((160, 160, 3), 0.02)  # as much of it shows that there is no noise
        both = np.concatenate([flat, raw, flat * 2, flat * 4, flat * 8, flat * 20], axis=1)
        found.append(int(np.median(levels(both, render(both))[:, 22:38])))
    assert found[0] == 0
    assert found == sorted(found)
    assert found[-1] == len(LEVELS)


def test_nothing_usable() -> None:
    cells = jpeg_cells(np.zeros((32, 32, 3), dtype=np.uint8), CELL)
    result = flatness(cells, raw_cells(np.zeros((32, 32, 3))), None, np.zeros((4, 4), dtype=np.bool_))
    assert (result.level == len(LEVELS)).all()


def test_agreement_notices_what_only_the_jpeg_shows() -> None:
    x = np.mgrid[:160, :160][1]
    raw = np.broadcast_to((0.05 + 0.005 * x)[..., None], (160, 160, 3)).copy()
    jpeg = render(raw)
    assert agreement(jpeg_cells(jpeg, CELL), raw_cells(raw)).all()
    mirrored = np.ascontiguousarray(jpeg[:, ::-1])
    assert agreement(jpeg_cells(mirrored, CELL), raw_cells(raw)).mean() < 0.2


def test_clipping_counts_each_area_once() -> None:
    jpeg = Extremes(np.array([[0.0, 9, 9], [9, 9, 9], [9, 9, 9], [9, 9, 9]]), np.full((4, 3), 200.0))
    jpeg.maximum[0, 2] = 254.0
    raw = Extremes(np.full((4, 3), 0.1), np.full((4, 3), 0.5))
    raw.maximum[1, 0] = 0.79
    raw.minimum[2, 1] = 0.0
    result = clipping(jpeg, raw, np.array([0.8, 1, 1]))
    assert result.any.tolist() == [True, True, True, False]
    assert result.counts() == {"JPEG white": 1, "JPEG black": 0, "RAW saturated": 1, "RAW black": 1}


def test_saturation_below_nominal_white_is_seen() -> None:
    rng = np.random.default_rng(3)
    scene = rng.lognormal(-1.5, 0.8, (300, 300, 3)).astype(np.float32)
    clipped = np.minimum(scene, np.array([0.7, 0.85, 5], dtype=np.float32))
    clipped[..., 2] = np.minimum(clipped[..., 2] * 0.05, 0.9)  # never reaches its ceiling
    clipped[..., :2] *= 1 - 0.001 * rng.random((300, 300, 1)).astype(np.float32)
    levels_found = saturation_levels(clipped)
    np.testing.assert_allclose(levels_found, [0.7, 0.85, 1], atol=0.002)
    assert saturation_levels(np.zeros((4, 4, 3), dtype=np.float32)).tolist() == [1, 1, 1]
