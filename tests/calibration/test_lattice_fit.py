"""Lattices baked of fitted models: a simulated camera, whose truth is known, and samples that say too little."""

import numpy as np
import pytest
from threadpoolctl import threadpool_limits  # type: ignore[import-untyped]  # it has no type information

from lutforge import threads as shared
from lutforge.arrays import Array
from lutforge.calibration.lattice.fit import node_coverage
from lutforge.calibration.options import CalibrationOptions
from lutforge.calibration.style import fit_lattices
from lutforge.colour.srgb import delta_e_2000
from lutforge.model.lattice import Lattice
from lutforge.simulate.camera import nikon_d5100
from lutforge.solvers import normal_equations
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
    unseen, expected = colours_in_gamut(10_000, 2)
    lattice = fit(x, y, 33)
    difference = delta_e_2000(np.clip(lattice(unseen), 0, 1), expected)
    assert difference.mean() <= 0.35
    assert np.quantile(difference, 0.95) <= 0.8
    assert difference.max() <= 4.0


@pytest.mark.slow
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
    unseen, expected = colours_in_gamut(2000, 8)
    strays = np.random.default_rng(0).permutation(2000)[:20]
    bad = y.copy()
    bad[strays] = np.random.default_rng(1).random((20, 3))
    clean, strayed = (np.linalg.norm(fit(x, values, 17)(unseen) - expected, axis=1).mean() for values in (y, bad))
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
    for first, second in zip(*fitted, strict=True):
        np.testing.assert_array_equal(first.values, second.values)
        for levels, others in zip(first.levels, second.levels, strict=True):
            np.testing.assert_array_equal(levels, others)
