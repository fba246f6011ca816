"""The response and its EMoR basis."""

import numpy as np
import pytest

from lutforge.errors import ProfileError
from lutforge.model.emor import inverse_emor, log_inverse_emor
from lutforge.model.response import Response


def test_encode_undoes_linearize_and_clamps() -> None:
    response = Response(np.stack([np.linspace(0, 1, 256) ** p for p in (1.8, 2.2, 2.6)], axis=1))
    x = np.random.default_rng(0).uniform(0.01, 0.99, size=(100, 3))
    np.testing.assert_allclose(response.encode(response.linearize(x)), x, atol=1e-12)
    np.testing.assert_allclose(response.linearize([1.5, -1.0, 0.5])[:2], [1.0, 0.0])
    np.testing.assert_allclose(response.encode([7.0, -7.0, 0.0]), [1.0, 0.0, 0.0])


def test_curves_that_fall_or_stand_still_are_refused() -> None:
    rising = np.linspace(0, 1, 16)
    for bad in (rising[::-1], np.zeros(16), np.where(np.arange(16) == 5, 0.9, rising), np.full(16, np.nan)):
        with pytest.raises(ProfileError, match="response"):
            Response(np.stack([rising, rising, bad], axis=1))
    with pytest.raises(ProfileError, match="3 columns"):
        Response(rising[:, None])


def test_emor_has_the_published_numbers() -> None:
    # invemor.txt (Columbia CAVE): g0 and hinv(1) at their second entries.
    basis = inverse_emor()
    assert basis.curves.shape == (15, 1024)
    assert basis.mean[1] == pytest.approx(1.47726e-3, abs=2e-8)
    assert basis.curves[0, 1] == pytest.approx(-3.7067e-4, abs=2e-8)
    np.testing.assert_allclose(basis.curves @ basis.curves.T, np.eye(15), atol=1e-6)
    assert basis.mean[0] == 0.0 and basis.mean[-1] == 1.0
    assert np.all(np.diff(basis.mean) > 0)


@pytest.mark.parametrize("gamma", [1.0, 1.8, 2.2])
def test_the_logarithmic_basis_spans_gamma_curves(gamma: float) -> None:
    basis = log_inverse_emor()
    encoded = np.linspace(0.03, 1.0, 400)
    mean, curves = basis.at(encoded)
    target = gamma * np.log(encoded) - mean
    coefficients = np.linalg.lstsq(curves, target, rcond=1e-10)[0]
    error = np.expm1((curves @ coefficients - target) / gamma) * encoded  # in encoded values
    assert np.abs(error).max() < 0.006
    assert np.sqrt(np.mean(error**2)) < 0.001
