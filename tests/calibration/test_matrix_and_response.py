"""Matrix, response and multipliers: of a made camera that clips, with noise and strays, and of the simulated one."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from lutforge.calibration.options import CalibrationOptions, Preset
from lutforge.calibration.physical.matrix_and_response import fit_matrix_and_response
from lutforge.calibration.physical.physical_model import KNOWN, fit_matrix
from lutforge.calibration.physical.unsaturated import BETA, saturation, untouched
from lutforge.calibration.style import fit_lattices, style_data, unclipped
from lutforge.samples.table import read_samples
from lutforge.simulate.camera import nikon_d5100
from tests.cases.real_data import S40
from tests.cases.samples import BALANCES, chart_140, photograph_patches, style_of

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


# --- Ts and Tw of the simulated camera, with multipliers known, partly known, and unknown -----------------------------


CAMERA = nikon_d5100()
SAMPLES = photograph_patches(CAMERA, chart_140())
SAMPLES = SAMPLES.select(unclipped(SAMPLES, SAMPLES.wb))
LINEAR = CAMERA.styles["standard"][1].inverse(SAMPLES.srgb)
TRUSTED = untouched(SAMPLES.srgb).astype(np.float64)
BALANCED, ALL_KNOWN = SAMPLES.raw * SAMPLES.wb, np.full(len(SAMPLES), KNOWN)


@pytest.mark.parametrize("known", [BALANCES, ("daylight",), ()])
@pytest.mark.parametrize("preset", ["lutforge", "thesis"])
def test_matrix_and_multipliers_are_the_cameras(known: tuple[str, ...], preset: Preset) -> None:
    is_known = np.isin(SAMPLES.white_balance, known)
    raw = np.where(is_known[:, None], SAMPLES.raw * SAMPLES.wb, SAMPLES.raw)
    setting = np.where(is_known, KNOWN, SAMPLES.white_balance)
    matrix, multipliers = fit_matrix(LINEAR, raw, setting, trusted=TRUSTED, preset=preset)
    assert np.linalg.norm(matrix - CAMERA.matrix) < 0.01 * np.linalg.norm(CAMERA.matrix)
    for name in np.unique(SAMPLES.white_balance[~is_known]):
        np.testing.assert_allclose(multipliers[name], CAMERA.multipliers(name), rtol=0.005)
        assert multipliers[name][1] == 1.0


def test_colours_near_white_are_what_turns_the_plain_fit() -> None:
    """The thesis's threshold β alone lets them in; the robust fit tells them by their residual."""
    every = (saturation(SAMPLES.srgb) < BETA).astype(np.float64)
    error = {}
    for name, trusted in (("β", every), ("not near white", TRUSTED)):
        matrix, _ = fit_matrix(LINEAR, BALANCED, ALL_KNOWN, trusted=trusted, preset="thesis")
        error[name] = np.linalg.norm(matrix - CAMERA.matrix) / np.linalg.norm(CAMERA.matrix)
    assert error["not near white"] < 0.005 < 0.02 < error["β"]


def test_strays_do_not_turn_the_robust_fit() -> None:
    rng = np.random.default_rng(0)
    raw = BALANCED.copy()
    strays = rng.permutation(len(raw))[: len(raw) // 20]
    raw[strays] *= rng.uniform(0.5, 2.0, (len(strays), 3))
    matrix, _ = fit_matrix(LINEAR, raw, ALL_KNOWN, trusted=TRUSTED)
    assert np.linalg.norm(matrix - CAMERA.matrix) < 0.01 * np.linalg.norm(CAMERA.matrix)
