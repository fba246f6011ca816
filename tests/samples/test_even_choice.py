"""Balance: even coverage of colours, the flattest tiles, the same answer each time."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from lutforge.samples.even_choice import choose_evenly


def test_caps_and_preferences() -> None:
    codes = np.full((100, 3), 100.0)
    codes[99] = 20.0
    level = np.zeros(100, dtype=np.intp)
    level[:50] = 1
    roughness = np.linspace(1, 0, 100)
    places = np.zeros((100, 2))
    kept = choose_evenly(codes, places, level, roughness, per_bin=12)
    # the flattest strict tiles of the common colour, and the lone tile of the other
    assert kept.tolist() == [*range(99 - 12, 99), 99]
    assert len(choose_evenly(codes[:50], places[:50], level[:50], roughness[:50], per_bin_relaxed=3)) == 3


def test_all_parts_of_the_picture() -> None:
    codes, level = np.full((90, 3), 100.0), np.zeros(90, dtype=np.intp)
    places = np.zeros((90, 2))
    places[80:] = [0.7, 0.6]
    roughness = np.concatenate([np.linspace(0, 0.5, 80), np.linspace(0.5, 1, 10)])
    kept = choose_evenly(codes, places, level, roughness, per_bin=12)
    # six of the middle and six of the corner, although all of the middle are flatter
    assert kept.tolist() == [*range(6), *range(80, 86)]


@given(st.integers(0, 2**32), st.integers(1, 400), st.integers(1, 60))
def test_properties(seed: int, count: int, per_shot: int) -> None:
    rng = np.random.default_rng(seed)
    codes = rng.uniform(0, 255, (count, 3)) * rng.choice([0.1, 1.0])
    level, roughness = rng.integers(0, 3, count), rng.integers(0, 5, count) / 5
    places = rng.uniform(-1, 1, (count, 2))
    kept = choose_evenly(codes, places, level, roughness, per_shot)
    assert len(kept) == len(set(kept.tolist()))
    assert 1 <= len(kept) <= per_shot
    assert (np.diff(kept) > 0).all()
    np.testing.assert_array_equal(kept, choose_evenly(codes, places, level, roughness, per_shot))
    bins = {tuple(row) for row in (codes // 16).astype(int).tolist()}
    covered = {tuple(row) for row in (codes[kept] // 16).astype(int).tolist()}
    assert covered == bins or len(kept) == per_shot or per_shot < len(bins)


def test_no_tiles() -> None:
    nothing = choose_evenly(np.zeros((0, 3)), np.zeros((0, 2)), np.zeros(0, dtype=np.intp), np.zeros(0))
    assert nothing.shape == (0,)
