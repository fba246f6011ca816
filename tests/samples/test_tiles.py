"""Flat tiles: structure in the JPEG, in RAW or around a cell, but not noise; and an even choice of tiles."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from lutforge.arrays import Array
from lutforge.samples import tiles
from lutforge.samples.clipping import clipping
from lutforge.samples.tiles import cell_size, choose_evenly, flatness
from lutforge.shots.cells import CellStatistics
from lutforge.shots.geometry import Registration

CELL = 8


def cells(picture: Array | NDArray[np.uint8]) -> CellStatistics:
    """Statistics of a JPEG, or of RAW that lies pixel on pixel on it."""
    rows, columns = (CELL * np.arange(side // CELL + 1.0) for side in picture.shape[:2])
    return CellStatistics.of(picture.astype(np.float32), rows, columns)


def encoded(raw: Array) -> NDArray[np.uint8]:
    return np.rint(255 * np.clip(raw, 0, 1) ** (1 / 2.2)).astype(np.uint8)


def levels(raw: Array, jpeg: NDArray[np.uint8]) -> NDArray[np.intp]:
    seen = cells(jpeg)
    return flatness(seen, cells(raw), CELL, np.ones(3), np.ones(seen.mean.shape[:2], dtype=np.bool_))[0]


@pytest.mark.parametrize(
    ("scale", "cell"), [(3.55, 8), (2.0, 8), (1.99, 8), (1.5, 16), (1.0, 16), (0.95, 16), (0.5, 32), (14, 8)]
)
def test_cell_size_spans_enough_raw_pixels(scale: float, cell: int) -> None:
    assert cell_size(Registration(scale, 0, 0, 1)) == cell


def test_texture_in_either_picture_rejects() -> None:
    flat = np.full((160, 160, 3), 0.2)
    y, x = np.mgrid[:160, :160]
    textured = flat * np.where((x // 2 + y // 2) % 2, 1.5, 0.5)[..., None]
    half = flat.copy()
    half[:, 80:] = textured[:, 80:]
    for raw, jpeg in ((half, encoded(flat)), (flat, encoded(half)), (half, encoded(half))):
        found = levels(raw, jpeg)
        assert (found[:, :9] == 0).all()
        assert (found[:, 11:] == len(tiles.FLATNESS_LIMITS)).all()


def test_clipping_counts_each_area_once() -> None:
    shape = np.ones((4, 3))
    jpeg = CellStatistics(100 * shape, shape, 9 * shape, 200 * shape)
    jpeg.minimum[0, 0], jpeg.maximum[0, 2] = 0.0, 254.0
    raw = CellStatistics(0.3 * shape, shape, 0.1 * shape, 0.5 * shape)
    raw.maximum[1, 0], raw.minimum[2, 1] = 0.99, 0.0
    result = clipping(jpeg, raw)
    counts = {reason: int(mask.sum()) for reason, mask in result.items()}
    assert counts == {"JPEG white": 1, "JPEG black": 0, "RAW saturated": 1, "RAW black": 1}
    assert np.any(list(result.values()), axis=0).tolist() == [True, True, True, False]


def test_a_common_colour_keeps_its_flattest_tiles_and_a_rare_one_all() -> None:
    codes = np.full((100, 3), 100.0)
    codes[99] = 20.0
    level = np.zeros(100, dtype=np.intp)
    level[:50] = 1
    roughness, places = np.linspace(1, 0, 100), np.zeros((100, 2))
    assert choose_evenly(codes, places, level, roughness).tolist() == [*range(99 - tiles.PER_BIN, 99), 99]
    assert len(choose_evenly(codes[:50], places[:50], level[:50], roughness[:50])) == tiles.PER_BIN_RELAXED
    assert choose_evenly(codes[:0], places[:0], level[:0], roughness[:0]).shape == (0,)


def test_all_parts_of_the_picture_are_sampled() -> None:
    codes, level, places = np.full((90, 3), 100.0), np.zeros(90, dtype=np.intp), np.zeros((90, 2))
    places[80:] = [0.7, 0.6]
    roughness = np.concatenate([np.linspace(0, 0.5, 80), np.linspace(0.5, 1, 10)])
    # six of the middle and six of the corner, although all of the middle are flatter
    assert choose_evenly(codes, places, level, roughness).tolist() == [*range(6), *range(80, 86)]


@pytest.mark.slow
@given(st.integers(0, 2**32), st.sampled_from([1, 60, 20_000]))
def test_a_choice_covers_the_colours_and_never_depends_on_chance(seed: int, count: int) -> None:
    rng = np.random.default_rng(seed)
    codes = rng.uniform(0, 255, (count, 3)) * rng.choice([0.1, 1.0])
    level, roughness = rng.integers(0, 3, count), rng.integers(0, 5, count) / 5
    places = rng.uniform(-1, 1, (count, 2))
    chosen = choose_evenly(codes, places, level, roughness)
    assert 1 <= len(chosen) <= tiles.PER_SHOT
    assert (np.diff(chosen) > 0).all()
    np.testing.assert_array_equal(chosen, choose_evenly(codes, places, level, roughness))
    bins = {tuple(row) for row in (codes // 16).astype(int).tolist()}
    covered = {tuple(row) for row in (codes[chosen] // 16).astype(int).tolist()}
    assert covered == bins or len(chosen) == tiles.PER_SHOT
