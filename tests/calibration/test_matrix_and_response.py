"""Matrix and response from samples of a camera that has no gamut map but clips, noise and strays."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from lutforge.calibration.options import CalibrationOptions
from lutforge.calibration.physical.matrix_and_response import encoded_residual, fit_matrix_and_response
from lutforge.calibration.style import fit_lattices, style_data
from lutforge.errors import CalibrationError
from lutforge.samples.table import read_samples
from lutforge.solvers.robust_weights import RobustWeights, cauchy
from tests.cases.real_data import S40
from tests.cases.samples import style_of

Array = NDArray[np.float64]

MATRIX = np.array([[1.6, -0.5, -0.1], [-0.2, 1.5, -0.3], [0.0, -0.6, 1.6]])


def encode(linear: Array) -> Array:
    """A toe, a shoulder, and another curve per channel."""
    return np.asarray(np.clip(linear, 0, 1) ** np.array([0.45, 0.42, 0.48]))


def samples(count: int, seed: int, noise: float = 0.0, strays: float = 0.0) -> tuple[Array, Array]:
    rng = np.random.default_rng(seed)
    x = rng.random((4 * count, 3)) * rng.random((4 * count, 1)) * 0.95
    x = x[np.all((x @ MATRIX.T > 0.002) & (x @ MATRIX.T < 0.99), axis=1)][:count]
    y = np.clip(encode(x @ MATRIX.T) + noise * rng.normal(size=(count, 3)), 0.001, 0.999)
    bad = rng.random(count) < strays
    y[bad] = rng.random((int(bad.sum()), 3))
    return x, y


@pytest.mark.parametrize(("noise", "strays", "least"), [(0.0, 0.0, 0.02), (0.003, 0.0, 0.03), (0.003, 0.05, 0.06)])
def test_recovers_both(noise: float, strays: float, least: float) -> None:
    x, y = samples(2000, 1, noise, strays)
    found = fit_matrix_and_response(x, y)
    np.testing.assert_allclose(found.matrix.sum(axis=1), 1.0, atol=1e-12)
    np.testing.assert_allclose(found.matrix, MATRIX, atol=least)
    unseen, wanted = samples(500, 2)
    error = np.linalg.norm(found.render(unseen) - wanted, axis=1)
    assert error.mean() < 0.006
    # But for the few colours that the fitted curve clips.
    assert np.quantile(np.abs(found.linearize(found.render(unseen)) - unseen), 0.99) < 1e-9


def test_strays_are_told_from_the_others() -> None:
    x, y = samples(1000, 3, 0.002)
    y[:50] = 1 - y[:50]
    found = fit_matrix_and_response(x, y)
    moved = np.linalg.norm(y[:50] - encode(x[:50] @ MATRIX.T), axis=1) > 0.2
    inlier = RobustWeights(cauchy, multiple=4.0, least=2.0 / 255.0)(
        encoded_residual(found.response, found.matrix, x, y)
    )
    assert inlier[:50][moved].max() < 0.2 < 0.5 < np.median(inlier[50:])


def test_grey_samples_leave_the_matrix_the_identity() -> None:
    x = np.linspace(0.01, 0.9, 80)[:, None].repeat(3, axis=1)
    found = fit_matrix_and_response(x, encode(x))
    np.testing.assert_allclose(found.matrix, np.eye(3), atol=1e-6)
    np.testing.assert_allclose(found.render(x), encode(x), atol=0.02)


def test_more_light_makes_no_channel_of_photographs_darker() -> None:
    """Their brightest colours are at half of saturation, where the camera renders white all the same."""
    photographs = read_samples(S40)
    style = style_data(photographs, photographs.wb)[0]["standard"]
    stops = np.arange(-3.0, 3.01, 0.5)[:, None]
    raw = np.minimum(photographs.raw[::20, None] * 2.0**stops, 1.0)
    codes = 255 * style.model.render(np.minimum(raw * photographs.wb[::20, None], 1.0))
    falls = (np.maximum.accumulate(codes, axis=1) - codes).max(axis=(1, 2))
    assert falls.max() <= 5
    np.testing.assert_allclose(255 * style.model.render(np.ones(3)), 255, atol=0.1)


def test_white_that_is_no_saturation_stays_as_the_samples_have_it() -> None:
    """A film scan from a program's pictures, whose light 1 is code 237."""

    def scan(light: Array) -> Array:
        return np.asarray(0.03 + 0.9 * light ** (1 / 2.2))

    light = np.random.default_rng(0).random((1500, 3)) ** 2
    style = style_of(light, np.rint(255 * scan(light)) / 255)
    style = replace(style, samples=replace(style.samples, developer=np.full(len(light), "a program")))
    top = np.linspace(0.9, 1.0, 21)[:, None].repeat(3, axis=1)
    rendered = fit_lattices(style, CalibrationOptions(size=17)).render(top)
    np.testing.assert_allclose(255 * rendered, 255 * scan(top), atol=1)


def test_too_few_samples() -> None:
    x, y = samples(9, 4)
    with pytest.raises(CalibrationError, match="9 samples"):
        fit_matrix_and_response(x, y)


def squeeze(linear: Array) -> Array:
    """A gamut map: less chroma where there is much."""
    grey = linear.mean(axis=1, keepdims=True)
    chroma = linear - grey
    size = np.linalg.norm(chroma, axis=1, keepdims=True)
    return np.asarray(grey + chroma * 0.25 / np.maximum(0.25, size))
