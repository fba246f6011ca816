"""Node levels: the histogram, equal shares of the error, and the grid of a sampled shaper."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lutforge.calibration.lattice.node_levels import BINS, EVEN_DENSITY, equidistributed_levels
from lutforge.errors import LutError
from lutforge.model.lattice import equidistribute, snap_levels, uniform_levels
from lutforge.thesis.lattice import blended_levels, error_histogram


@st.composite
def axes(draw: st.DrawFn) -> tuple[np.ndarray, int]:
    """Levels from 0 to 1, often bunched, and a shaper that has room for them."""
    count = draw(st.integers(2, 65))
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    gaps = rng.random(count - 1) ** draw(st.sampled_from([1, 4, 20])) + 1e-12
    levels = np.concatenate([[0.0], np.cumsum(gaps) / gaps.sum()])
    levels[-1] = 1.0
    return levels, draw(st.integers(count, 5000))


@given(axes())
def test_snapping(case: tuple[np.ndarray, int]) -> None:
    levels, shaper = case
    snapped = snap_levels(levels, shaper)
    steps = snapped * (shaper - 1)
    np.testing.assert_allclose(steps, np.rint(steps), atol=1e-9)
    assert np.all(np.diff(steps) > 0.5)  # a grid point each
    assert snapped[0] == 0.0 and snapped[-1] == 1.0
    np.testing.assert_array_equal(snap_levels(snapped, shaper), snapped)
    if np.diff(levels).min() * (shaper - 1) > 1.0:  # with room between them, each to its nearest
        np.testing.assert_array_equal(np.rint(steps), np.rint(levels * (shaper - 1)))


def test_a_shaper_that_is_too_small_is_refused() -> None:
    with pytest.raises(LutError, match="33 node levels"):
        snap_levels(np.linspace(0, 1, 33), 32)


def test_alpha_blends_from_uniform_to_the_histogram() -> None:
    x = np.random.default_rng(0).random((1000, 3)) * 0.2
    histograms = error_histogram(x, np.ones(1000))
    for axis in blended_levels(histograms, 0.0, 17):
        np.testing.assert_allclose(axis, np.linspace(0, 1, 17), atol=1e-12)
    median = [blended_levels(histograms, alpha, 17)[0][8] for alpha in (0.0, 0.5, 0.9, 1.0)]
    assert np.all(np.diff(median) < 0)
    assert median[-1] == pytest.approx(0.1, abs=0.01)


@given(st.integers(0, 2**32), st.integers(2, 65))
def test_equidistribution_gives_equal_mass(seed: int, size: int) -> None:
    density = np.random.default_rng(seed).random(200) + 1e-6
    levels = equidistribute(density, size)
    assert levels[0] == 0.0 and levels[-1] == 1.0 and np.all(np.diff(levels) > 0)
    mass = np.interp(levels, np.linspace(0, 1, 201), np.concatenate([[0], np.cumsum(density)]))
    np.testing.assert_allclose(np.diff(mass), density.sum() / (size - 1), rtol=1e-9)


@settings(max_examples=5)
@given(st.integers(0, 2**32))
def test_rounds_find_the_best_levels_of_a_known_curve(seed: int) -> None:
    """x^0.4 along r: its curvature asks for a spacing ∝ κ^(−2/5); rounds of piecewise-linear fits must find it."""
    rng = np.random.default_rng(seed)
    x = rng.random((20_000, 3))

    def squared_error(levels: np.ndarray) -> np.ndarray:
        return np.asarray((np.interp(x[:, 0], levels, levels**0.4) - x[:, 0] ** 0.4) ** 2)

    levels = uniform_levels(17)
    first = squared_error(levels[0]).mean()
    for _ in range(6):
        levels = equidistributed_levels(x, squared_error(levels[0]), levels)
    assert squared_error(levels[0]).mean() < first / 30
    assert np.diff(levels[0]).max() < 0.25  # and no stretch is left without nodes


def test_a_share_of_the_levels_lies_where_it_is_wanted_whatever_the_errors() -> None:
    """Errors of bright samples draw the levels away from the darks, but for those that stay there."""
    x = np.random.default_rng(0).uniform(0.5, 1.0, (2000, 3))
    more_in_the_darks = EVEN_DENSITY + 0.2 * np.where(np.arange(BINS) < BINS // 10, 10.0 / BINS, 0.0)
    drawn, kept = (
        equidistributed_levels(x, np.ones(len(x)), uniform_levels(33), floor=floor)
        for floor in (EVEN_DENSITY, more_in_the_darks)
    )
    for few, more in zip(drawn, kept, strict=True):
        assert np.count_nonzero(few < 0.1) <= 3
        assert np.count_nonzero(more < 0.1) >= 7
        assert more[0] == 0 and more[-1] == 1
