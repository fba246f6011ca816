"""The grey axis after a fit: it falls nowhere, and what was right is left alone."""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from lutforge.calibration.lattice.bake import with_rising_axis
from lutforge.interpolation import Interpolation, Levels, interpolate
from lutforge.model.lattice import grid, uniform_levels

AXIS = np.linspace(0.0, 1.0, 2049)[:, None].repeat(3, axis=1)


def fall(axis: NDArray[np.float64]) -> float:
    return float((np.maximum.accumulate(axis, axis=0) - axis).max())


def levels_of(seed: int, size: int) -> Levels:
    rng = np.random.default_rng(seed)
    r, g, b = (np.concatenate([[0.0], np.sort(rng.uniform(0.01, 0.99, size - 2)), [1.0]]) for _ in range(3))
    return r, g, b


@pytest.mark.parametrize("method", ["trilinear", "tetrahedral"])
def test_nearly_every_lattice_can_be_made_to_rise(method: Interpolation) -> None:
    unmoved = 0
    for seed in range(30):
        levels = levels_of(seed, 7)
        values = grid(levels) ** 0.6 * 1.1 + 0.01 * np.random.default_rng(seed).normal(size=(7, 7, 7, 3))
        values[0, 0, 0], values[-1, -1, -1] = 0.0, 1.05
        risen = with_rising_axis(values, levels, method)
        unmoved += fall(np.clip(interpolate(AXIS, levels, risen, method), 0.0, 1.0)) > 1e-3
    assert unmoved <= 1


@given(seed=st.integers(0, 10_000), size=st.integers(3, 12), noise=st.sampled_from([1e-4, 0.01, 0.05]))
@example(seed=30, size=9, noise=0.01)
@settings(max_examples=60, deadline=None)
@pytest.mark.parametrize("method", ["trilinear", "tetrahedral"])
def test_a_channel_falls_nowhere_or_is_left_as_it_is(method: Interpolation, seed: int, size: int, noise: float) -> None:
    levels = levels_of(seed, size)
    values = grid(levels) ** 0.6 * 1.1 + noise * np.random.default_rng(seed).normal(size=(size, size, size, 3))
    values[0, 0, 0], values[-1, -1, -1] = 0.0, 1.05
    risen = with_rising_axis(values, levels, method)
    before, after = (np.clip(interpolate(AXIS, levels, cube, method), 0.0, 1.0) for cube in (values, risen))
    for c in range(3):
        # Cubic pieces may dip between the points that are looked at, by next to nothing.
        rises = fall(after[:, c]) <= max(0.05 * fall(before), 1e-5)
        assert rises or np.array_equal(risen[..., c], values[..., c])
    assert np.array_equal(risen[0, 0, 0], values[0, 0, 0])
    assert np.array_equal(risen[-1, -1, -1], values[-1, -1, -1])
    assert risen.min() >= min(0.0, values.min())
    assert risen.max() <= max(1.0, values.max())


def test_what_rises_is_left_alone() -> None:
    levels = uniform_levels(9)
    values = grid(levels) ** 0.5
    np.testing.assert_array_equal(with_rising_axis(values, levels, "trilinear"), values)


def test_the_least_change_of_a_dip() -> None:
    """One node on the axis that is too low: it and its neighbours on the axis move, the others stay."""
    levels = uniform_levels(9)
    values = grid(levels).copy()
    values[4, 4, 4] -= 0.2
    risen = with_rising_axis(values, levels, "tetrahedral")
    moved = np.argwhere(np.any(risen != values, axis=-1))
    assert 0 < len(moved) <= 5
    assert np.all(moved == moved[:, :1])
    assert np.abs(risen - values).max() < 0.1
