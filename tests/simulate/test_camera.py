"""The stages of the simulated camera have the properties that the thesis assumes, and render inverts exactly."""

import numpy as np
import pytest
from numpy.typing import NDArray

from lutforge.colour.spectra import WAVELENGTHS, chart_reflectances, light, linear_srgb_under, surface_reflectances
from lutforge.simulate.camera import SimulatedCamera, nikon_d5100, sigma_sd_merrill

CAMERAS = [nikon_d5100(), sigma_sd_merrill()]
CAMERA = pytest.mark.parametrize("camera", CAMERAS, ids=lambda camera: camera.model)
STYLES = pytest.mark.parametrize("style", ["standard", "vivid", "landscape"])


def balanced_colors(camera: SimulatedCamera, count: int = 30000) -> NDArray[np.float64]:
    """All white-balanced RAW values, and Ts of them: the domain of h."""
    return np.random.default_rng(5).random((count, 3)) @ camera.matrix.T


@CAMERA
def test_a_white_surface_is_neutral_under_every_white_balance(camera: SimulatedCamera) -> None:
    for name, balance in camera.white_balances.items():
        white = camera.expose(np.ones(len(WAVELENGTHS)), name)
        assert white.max() == pytest.approx(0.9)
        assert balance.multipliers[1] == 1.0
        assert min(balance.multipliers) >= 1.0
        for style in camera.styles:
            for level in (0.05, 0.2, 0.9):
                encoded = camera.render(level * white, style, name)
                assert np.ptp(encoded) < 1e-12
                assert 0 < encoded[0] < 1


@CAMERA
def test_the_matrix_keeps_white_and_sees_colours_nearly_as_people_do(camera: SimulatedCamera) -> None:
    np.testing.assert_allclose(camera.matrix.sum(axis=1), 1.0, atol=1e-12)
    surfaces = np.vstack([surface_reflectances(), chart_reflectances()])
    white = camera.expose(np.ones(len(WAVELENGTHS)), "daylight")
    estimated = camera.expose(surfaces, "daylight") / white @ camera.matrix.T
    true = linear_srgb_under(surfaces, light(5200.0))
    assert np.sqrt(np.mean((estimated - true) ** 2)) < 0.035
    neutral = light(6504.0) @ camera.sensitivity
    white = camera.color_matrix() @ [0.95047, 1.0, 1.08883]
    np.testing.assert_allclose(white, neutral / neutral[1], rtol=1e-3)


@CAMERA
@STYLES
def test_linearize_inverts_render(camera: SimulatedCamera, style: str) -> None:
    raw = np.random.default_rng(1).random((40, 500, 3)) / camera.multipliers("tungsten") / 2**0.5
    encoded = camera.render(raw, style, "tungsten", ev=0.5)
    assert encoded.min() >= 0 and encoded.max() <= 1
    unclipped = ((encoded > 0) & (encoded < 1)).all(axis=-1)
    assert unclipped.mean() > 0.6
    back = camera.linearize(encoded, style, "tungsten", ev=0.5)
    np.testing.assert_allclose(back[unclipped], raw[unclipped], atol=1e-9)


@CAMERA
@STYLES
def test_low_saturations_do_not_move(camera: SimulatedCamera, style: str) -> None:
    rng = np.random.default_rng(2)
    largest = rng.uniform(0.01, 1.0, (20000, 1))
    colors = largest * (1 - 0.15 * rng.random((20000, 3)))
    np.testing.assert_allclose(camera.styles[style][0](colors), colors, atol=1e-12)


@CAMERA
@STYLES
def test_the_gamut_map_is_smooth_and_never_folds(camera: SimulatedCamera, style: str) -> None:
    h, colors, step = camera.styles[style][0], balanced_colors(camera), 1e-6
    shifts = step * np.eye(3)
    jacobian = np.stack([(h(colors + d) - h(colors - d)) / (2 * step) for d in shifts], axis=-1)
    assert np.linalg.det(jacobian).min() > 0
    assert np.linalg.norm(jacobian, ord=2, axis=(1, 2)).max() < 6


@CAMERA
@STYLES
def test_surfaces_fit_the_cube_and_vivid_moves_them(camera: SimulatedCamera, style: str) -> None:
    surfaces = camera.expose(np.vstack([surface_reflectances(), chart_reflectances()]), "daylight")
    linear = surfaces * camera.multipliers("daylight") @ camera.matrix.T
    mapped = camera.styles[style][0](linear)
    assert mapped.min() > 0 and mapped.max() < 1
    if style == "vivid":
        assert np.linalg.norm(mapped - linear, axis=-1).max() > 0.05
