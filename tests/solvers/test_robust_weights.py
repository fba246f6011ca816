"""Weights of robust fits: their values by definition, and fits that outliers do not change."""

import numpy as np
import pytest

from lutforge.solvers.robust_weights import Loss, RobustWeights, cauchy, geman_mcclure, lawson, weighted_median


def test_weights_at_the_scale() -> None:
    ratio = np.array([0.0, 1.0, 1e6])
    np.testing.assert_allclose(cauchy(ratio), [1.0, 0.5, 0.0], atol=1e-9)
    np.testing.assert_allclose(geman_mcclure(ratio), [1.0, 0.25, 0.0], atol=1e-9)


@pytest.mark.parametrize("loss", [cauchy, geman_mcclure])
def test_reweighted_mean_ignores_outliers(loss: Loss) -> None:
    rng = np.random.default_rng(0)
    values = np.concatenate([rng.normal(2.0, 0.01, 80), rng.normal(9.0, 0.01, 20)])
    robust, mean = RobustWeights(loss, multiple=3.0, least=1e-3), float(np.median(values))
    for _ in range(20):
        mean = float(np.average(values, weights=robust(np.abs(values - mean))))
    assert abs(values.mean() - 2.0) > 1.0 > 100 * abs(mean - 2.0)


def test_scale_is_of_the_samples_that_tell_it_and_not_below_the_least() -> None:
    robust = RobustWeights(cauchy, multiple=2.0, least=0.5)
    assert robust.scale(np.array([1.0, 1.0, 9.0])) == 2.0
    assert robust.scale(np.zeros(5)) == 0.5
    np.testing.assert_allclose(robust(np.array([2.0, 4.0]), like=np.ones(3)), [0.5, 0.2])
    assert robust.scale(np.array([1.0, 5.0]), weight=np.array([1.0, 3.0])) == 10.0


def test_weighted_median_holds_half_of_the_weight() -> None:
    assert weighted_median(np.array([3.0, 1.0, 2.0]), np.array([1.0, 1.0, 5.0])) == 2.0


def test_lawson_weights_bring_the_largest_error_down() -> None:
    """The best constant in the maximum norm is the middle of the range, that of least squares the mean."""
    values = np.concatenate([np.zeros(90), np.full(10, 1.0)])
    weight, constant = np.ones(100), 0.0
    for _ in range(50):
        constant = float(np.average(values, weights=weight))
        weight = weight * lawson(np.abs(values - constant), 1.0, least=0.0)
    assert values.mean() == 0.1 and abs(constant - 0.5) < 1e-3
