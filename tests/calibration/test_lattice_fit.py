"""Lattices baked of fitted models: a simulated camera, whose truth is known, and samples that say too little."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from threadpoolctl import threadpool_limits  # type: ignore[import-untyped]  # it has no type information

from lutforge import threads as shared
from lutforge.arrays import Array
from lutforge.calibration.lattice.fit import node_coverage
from lutforge.calibration.lattice.node_levels import BINS, EVEN, equidistributed_levels
from lutforge.calibration.lattice.output_curve import OutputCurve, output_curve
from lutforge.calibration.options import CalibrationOptions
from lutforge.calibration.style import fit_lattices
from lutforge.colour.srgb import delta_e_2000
from lutforge.errors import LutError
from lutforge.interpolation import apply_curve
from lutforge.model.lattice import Lattice, equidistribute, snap_levels, uniform_levels
from lutforge.model.response import Response
from lutforge.simulate.camera import nikon_d5100
from lutforge.solvers import normal_equations
from lutforge.thesis.lattice import blended_levels, error_histogram
from tests.cases.samples import style_of

CAMERA = nikon_d5100()
GAIN = CAMERA.multipliers("daylight")
AXIS = np.linspace(0.0, 1.0, 513)[:, None].repeat(3, axis=1)


def render(balanced: Array) -> Array:
    return np.asarray(CAMERA.render(balanced / GAIN, "standard", "daylight"))


def colours_in_gamut(count: int, seed: int) -> tuple[Array, Array]:
    """White-balanced RAW of encoded colours spread evenly over all that the camera can make, and those."""
    encoded = np.random.default_rng(seed).uniform(0.01, 0.99, (4 * count, 3))
    x = CAMERA.linearize(encoded, "standard", "daylight") * GAIN
    x = x[np.all((x > 0) & (x < 1), axis=1)][:count]
    return x, render(x)


def fit(x: Array, y: Array, size: int, *, shots: int = 10) -> Lattice:
    return fit_lattices(style_of(x, y, shots), CalibrationOptions(size=size)).render


@pytest.mark.slow
def test_unseen_colours_of_the_simulated_camera() -> None:
    x, y = colours_in_gamut(5000, 1)
    unseen, wanted = colours_in_gamut(10_000, 2)
    lattice = fit(x, y, 33)
    difference = delta_e_2000(np.clip(lattice(unseen), 0, 1), wanted)
    assert difference.mean() <= 0.35
    assert np.quantile(difference, 0.95) <= 0.8
    assert difference.max() <= 4.0


def test_there_and_back() -> None:
    """A quarter of what matrix and response alone are off."""
    x, y = colours_in_gamut(5000, 3)
    unseen, encoded = colours_in_gamut(3000, 4)
    style = style_of(x, y)
    back, plain = fit_lattices(style, CalibrationOptions()).linearize, style.base.linearize
    error, without = (np.linalg.norm(each(encoded) - unseen, axis=1) for each in (back, plain))
    assert error.mean() < without.mean() / 4 and np.quantile(error, 0.95) < np.quantile(without, 0.95) / 4


def test_small_lattices_are_near_the_camera() -> None:
    """9³ nodes each way: a quarter of what matrix and response alone are off."""
    style = style_of(*colours_in_gamut(800, 6))
    unseen, encoded = colours_in_gamut(2000, 7)
    small = fit_lattices(style, CalibrationOptions(size=9))
    assert small.render.size == small.linearize.size == (9, 9, 9)

    shown, shown_by_base = (np.clip(way(unseen), 0.0, 1.0) for way in (small.render, style.base.render))
    assert delta_e_2000(shown, encoded).mean() < delta_e_2000(shown_by_base, encoded).mean() / 4
    error, error_of_base = (
        np.linalg.norm(way(encoded) - unseen, axis=1) for way in (small.linearize, style.base.linearize)
    )
    assert error.mean() < error_of_base.mean() / 4


def test_ends_and_grey_axis() -> None:
    x, y = colours_in_gamut(3000, 5)
    x[:300] = np.random.default_rng(0).uniform(0.005, 0.9, (300, 1))
    y[:300] = render(x[:300])
    lattice = fit(x, y, 33)
    grey = lattice(AXIS)
    np.testing.assert_allclose(grey[[0, -1]], [[0.0] * 3, [1.0] * 3], atol=1e-12)
    assert np.ptp(grey, axis=1).max() < 0.02
    assert np.diff(grey, axis=0).min() >= -1e-6
    everywhere = lattice(np.random.default_rng(1).random((20_000, 3)))
    assert everywhere.min() >= 0.0 and everywhere.max() <= 1.0 + 1e-15  # weights sum to 1 within rounding
    assert np.abs(grey - render(AXIS))[10:470].max() < 0.02


def test_coverage_is_where_the_samples_are() -> None:
    x, y = colours_in_gamut(1000, 6)
    coverage = node_coverage(fit(x, y, 9), x)
    assert coverage.shape == (9, 9, 9)
    assert coverage.sum() == pytest.approx(1000)
    assert np.all(coverage >= 0)


def test_outliers_do_not_bend_the_lattice() -> None:
    x, y = colours_in_gamut(2000, 7)
    unseen, wanted = colours_in_gamut(2000, 8)
    strays = np.random.default_rng(0).permutation(2000)[:20]
    bad = y.copy()
    bad[strays] = np.random.default_rng(1).random((20, 3))
    clean, strayed = (np.linalg.norm(fit(x, values, 17)(unseen) - wanted, axis=1).mean() for values in (y, bad))
    assert strayed < 2.0 * clean


RNG = np.random.default_rng(9)
GREY = np.linspace(0.01, 0.85, 60)[:, None].repeat(3, axis=1)
WEAK = {
    "grey axis": GREY,
    "noisy grey axis": GREY * (1 + 0.002 * RNG.normal(size=GREY.shape)),
    "ten samples": RNG.uniform(0.1, 0.5, (10, 3)),
    "duplicates": RNG.uniform(0.1, 0.5, (12, 3)).repeat(20, axis=0),
    "one colour": np.tile([0.3, 0.15, 0.12], (50, 1)),
    "one grey": np.full((40, 3), 0.2),
    "one plane": RNG.uniform(0.1, 0.6, (200, 2)) @ np.array([[1.0, 0.5, 0.0], [0.0, 0.5, 1.0]]),
    "only dark": RNG.uniform(0.002, 0.03, (300, 3)),
}


@pytest.mark.parametrize("size", [9, 17, pytest.param(33, marks=pytest.mark.slow)])
@pytest.mark.parametrize("name", WEAK)
def test_weak_samples_give_a_sane_smooth_lattice(name: str, size: int) -> None:
    x = WEAK[name]
    y = np.round(render(x) * 255) / 255
    lattice = fit(x, y, size, shots=3)
    assert np.linalg.norm(lattice(x) - y, axis=1).max() < 0.04
    grey = np.clip(lattice(AXIS), 0, 1)
    assert np.diff(grey, axis=0).min() > -2e-3  # between the points that the fit is held at
    assert np.ptp(grey, axis=1).max() < 0.15
    everywhere = lattice(RNG.random((2000, 3)))
    assert np.all((everywhere >= 0) & (everywhere <= 1))
    np.testing.assert_allclose(grey[[0, -1]], [[0.0] * 3, [1.0] * 3], atol=1e-12)


@pytest.mark.slow
def test_threads_do_not_change_a_bit(monkeypatch: pytest.MonkeyPatch) -> None:
    """So many samples that the sums over them, too, are shared between threads."""
    x, y = colours_in_gamut(45_000, 12)
    fitted = []
    for threads in (1, 2):
        for module in (normal_equations, shared):
            monkeypatch.setattr(module, "cores", lambda threads=threads: threads)
        with threadpool_limits(threads, user_api="blas"):
            fitted.append(fit_lattices(style_of(x, y), CalibrationOptions()))
    for one, other in zip(*fitted, strict=True):
        np.testing.assert_array_equal(one.values, other.values)
        for levels, others in zip(one.levels, other.levels, strict=True):
            np.testing.assert_array_equal(levels, others)


# --- The curve behind a cube: a bijection of [0, 1] that runs on straight outside -------------------------------------


CODES = np.linspace(0.0, 1.0, 33)
SRGB = np.where(CODES <= 0.04045, CODES / 12.92, ((CODES + 0.055) / 1.055) ** 2.4)
STEEP = CODES**8


@pytest.fixture(params=[SRGB, CODES, STEEP, 0.01 + 0.7 * SRGB], ids=["sRGB", "line", "steep foot", "offset and gain"])
def curve(request: pytest.FixtureRequest) -> OutputCurve:
    return output_curve(Response(np.repeat(request.param[:, None], 3, axis=1)))


def test_a_curve_there_and_back(curve: OutputCurve) -> None:
    encoded = np.random.default_rng(0).random((1000, 3))
    np.testing.assert_allclose(apply_curve(curve.table, curve.to_values(encoded)), encoded, atol=1e-12)
    ends = np.array([[0.0] * 3, [1.0] * 3])
    np.testing.assert_array_equal(curve.to_values(ends), ends)
    np.testing.assert_array_equal(apply_curve(curve.table, np.array([[-0.5] * 3, [1.7] * 3])), ends)


def test_slope_is_the_derivative_and_bounded(curve: OutputCurve) -> None:
    encoded = np.random.default_rng(1).random((200, 3))
    low, high = np.clip(encoded - 1 / 255, 0, 1), np.clip(encoded + 1 / 255, 0, 1)
    slope = curve.slope(encoded)
    np.testing.assert_allclose(slope * (curve.to_values(high) - curve.to_values(low)), high - low, atol=1e-12)
    assert np.all(slope <= 9)  # 1 + the bound of 8 on f'


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
    found = apply_curve(curve.table, curve.continued(linear))
    np.testing.assert_allclose(found, wanted, atol=4e-3)  # PCHIP between 33 knots


# --- Node levels: the histogram, equal shares of error, and the grid of a sampled shaper ------------------------------


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
    wanted = EVEN + 0.2 * np.where(np.arange(BINS) < BINS // 10, 10.0 / BINS, 0.0)
    drawn, kept = (equidistributed_levels(x, np.ones(len(x)), uniform_levels(33), floor=one) for one in (EVEN, wanted))
    for few, more in zip(drawn, kept, strict=True):
        assert np.count_nonzero(few < 0.1) <= 3
        assert np.count_nonzero(more < 0.1) >= 7
        assert more[0] == 0 and more[-1] == 1


# --- The thesis's lattices: its uniform baseline without smoothness ---------------------------------------------------


def test_errors_at_the_ends_are_not_lost() -> None:
    """Errors that are even over the range stay so, up to 0 and 1."""
    axis = (np.arange(BINS) + 0.5) / BINS
    for histogram in error_histogram(np.repeat(axis[:, None], 3, axis=1), np.ones(BINS)):
        assert histogram == pytest.approx(1.0 / BINS)
