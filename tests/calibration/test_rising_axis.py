"""The grey axis after a fit: it falls nowhere, and what was right is left alone."""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from lutforge.calibration.lattice.bake import with_rising_axis
from lutforge.calibration.lattice.output_curve import OutputCurve, output_curve
from lutforge.interpolation import Interpolation, Levels, interpolate
from lutforge.model.lattice import grid, uniform_levels
from lutforge.model.response import Response

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


# --- The curve behind a cube: a bijection of [0, 1] that runs on straight outside -------------------------------------


CODES = np.linspace(0.0, 1.0, 33)
SRGB = np.where(CODES <= 0.04045, CODES / 12.92, ((CODES + 0.055) / 1.055) ** 2.4)
STEEP = CODES**8


@pytest.fixture(params=[SRGB, CODES, STEEP, 0.01 + 0.7 * SRGB], ids=["sRGB", "line", "steep foot", "offset and gain"])
def curve(request: pytest.FixtureRequest) -> OutputCurve:
    return output_curve(Response(np.repeat(request.param[:, None], 3, axis=1)))


def test_there_and_back(curve: OutputCurve) -> None:
    encoded = np.random.default_rng(0).random((1000, 3))
    np.testing.assert_allclose(curve.to_encoded(curve.to_values(encoded)), encoded, atol=1e-12)
    ends = np.array([[0.0] * 3, [1.0] * 3])
    np.testing.assert_array_equal(curve.to_values(ends), ends)
    np.testing.assert_array_equal(curve.to_encoded(np.array([[-0.5] * 3, [1.7] * 3])), ends)


def test_slope_is_the_derivative_and_bounded(curve: OutputCurve) -> None:
    encoded = np.random.default_rng(1).random((200, 3))
    low, high = np.clip(encoded - 1 / 255, 0, 1), np.clip(encoded + 1 / 255, 0, 1)
    np.testing.assert_allclose(
        curve.slope(encoded) * (curve.to_values(high) - curve.to_values(low)), high - low, atol=1e-12
    )
    assert np.all(curve.slope(encoded) <= 9)  # 1 + the bound of 8 on f'


def test_linear_light_runs_on_across_the_clipping(curve: OutputCurve) -> None:
    linear = np.linspace(-0.5, 1.5, 2001)[:, None].repeat(3, axis=1)
    values = curve.continued(linear)
    assert np.all(np.diff(values, axis=0) > 0)
    below, above = linear[:, 0] < curve.linear[0, 0], linear[:, 0] > curve.linear[-1, 0]
    assert np.all(values[below] < 0) and np.all(values[above] > 1)
    for part in (values[below], values[above]):
        np.testing.assert_allclose(np.diff(part, 2, axis=0), 0, atol=1e-9)


def test_it_is_the_response_between_the_ends() -> None:
    curve = output_curve(Response(np.repeat(SRGB[:, None], 3, axis=1)))
    linear = np.random.default_rng(2).random((500, 3))
    wanted = np.interp(linear, SRGB, CODES)
    np.testing.assert_allclose(curve.to_encoded(curve.continued(linear)), wanted, atol=4e-3)  # PCHIP between 33 knots
