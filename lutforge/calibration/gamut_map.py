"""The gamut map h by kriging: the mean of a Gaussian process with the kernel of `model.gamut_map`.

With z = e(X) and ê(X) on perceptual scales, h(X) = ê⁻¹(ê(X) + r(z)), and the correction r is a Gaussian process of
mean zero given the samples (Rasmussen & Williams, Gaussian Processes for Machine Learning, 2006, equation 2.23). In the
words of (4.7) and (4.8) of the thesis: φ is the kernel, 8Nπρ the noise, and the polynomial the identity.

The roughness of the kernel is estimated from the samples: it is that of the largest marginal likelihood (equation 5.8
of the book). Simulated cameras have the least, the Canon S40 has 0.5 to 2. The other numbers were chosen among factors
of two on one half of a fleet of cameras; the guide has the figures of both halves.
"""

from collections.abc import Callable

import numpy as np
from scipy.linalg import cho_solve, solve_triangular
from scipy.optimize import minimize_scalar

from lutforge.arrays import Array, Mask
from lutforge.calibration.matrix_and_response import MatrixAndResponse
from lutforge.calibration.options import MOST_CENTRES
from lutforge.errors import CalibrationError
from lutforge.model.gamut_map import (
    CORRECTION_OFFSET,
    OFFSET,
    ROUGHNESS,
    GamutMap,
    flattened,
    from_even,
    identity_gamut_map,
    kriging_covariance,
    to_even,
)
from lutforge.solvers.robust_weights import RobustWeights, cauchy

NOISE = 1.5e-4
"""Variance of a sample's error, where a priori the correction's is 1."""
CELL = 0.005
"""The least size of these cells. Samples so near are of one surface, share their errors, and count once."""
LIKELIHOOD_CENTRES = 500
"""Centres of the fits by which the roughness is estimated."""
ROUGHNESS_RANGE = (0.005, 2.0)
"""The least and the largest roughness that is tried. Beyond them a fit hardly changes."""
BEYOND_CENTRES = 1_000
"""Centres of the fit that tells how far beyond its end a clipped channel goes on."""
DEVIATION_CENTRES = 1_500
"""Centres that the standard deviation of the process is computed from, after merging those of the fit."""


def krige(
    source: Array,
    target: Array,
    error_scale: Array,
    most_centres: int,
    clipped: tuple[Array, Array, Mask, Mask] | None = None,
) -> GamutMap:
    """Fit target = h(source), both (n, 3) linear.

    error_scale: (n,), how much an encoded error of a sample is on the even scale of corrections. Outliers lose their
    weight by residuals of a coarse fit. clipped: more samples, source and target (m, 3), with the channels
    (m, 3) at white and at black, whose rendering lies at or beyond the target. Time O(most_centres³ + n).
    """
    z = to_even(source, OFFSET)
    correction = _correction(source, target)
    # IRLS weights by encoded residuals from a fit with few centres and much noise.
    coarse = _solve(z, correction, np.full(len(z), 0.01), min(400, most_centres), ROUGHNESS)
    residual = _correction(target, coarse(source))
    robust = RobustWeights(cauchy, multiple=10.0, least=12.0 / 255.0)
    weight = robust(np.linalg.norm(residual, axis=1) / error_scale)
    roughness = likely_roughness(z, correction, weight)

    black, white = np.zeros((1, 3)), np.ones((1, 3))  # which a gamut map leaves alone
    z, correction = np.concatenate([z, black, white]), np.concatenate([correction, np.zeros((2, 3))])
    weight = np.concatenate([weight, np.ones(2)])
    if clipped is not None and len(clipped[0]):
        bounded, ends, at_white, at_black = clipped
        # What a fit without them continues beyond the bound holds; the bound holds where that falls short of it.
        fit = _solve(z, correction, weight, min(BEYOND_CENTRES, most_centres), roughness)
        continued = fit(bounded)
        beyond = np.where(at_white, np.maximum(continued, ends), ends)
        beyond = np.where(at_black, np.minimum(continued, ends), beyond)
        z = np.concatenate([z, to_even(bounded, OFFSET)])
        correction = np.concatenate([correction, _correction(bounded, beyond)])
        weight = np.concatenate([weight, np.ones(len(bounded))])
    return _solve(z, correction, weight, most_centres, roughness)


def likely_roughness(z: Array, correction: Array, weight: Array) -> float:
    """The roughness that makes samples likeliest: corrections (n, 3) at z (n, 3), of noise NOISE / weight (n,).

    The process has any variance; the likelihood is the largest over it, (5.8) with σ² = yᵀ K⁻¹ y / 3n. Where nothing is
    to be corrected, every roughness is as likely, and ROUGHNESS is returned.
    """
    if not correction.any():
        return ROUGHNESS
    places, values, weight = _merged(z, correction, weight, LIKELIHOOD_CENTRES)
    noise = NOISE / weight

    def negative_log_likelihood(logarithm: float) -> float:
        covariance = kriging_covariance(places, roughness=np.exp(logarithm))
        covariance[np.diag_indices(len(places))] += noise
        factor = np.linalg.cholesky(covariance)
        whitened = solve_triangular(factor, values, lower=True, check_finite=False)
        return float(0.5 * values.size * np.log(np.sum(whitened**2)) + 3.0 * np.sum(np.log(np.diag(factor))))

    least, most = np.log(ROUGHNESS_RANGE)
    found = minimize_scalar(negative_log_likelihood, bounds=(least, most), method="bounded", options={"xatol": 0.2})
    return float(np.exp(found.x))


def fit_gamut_map(
    base: MatrixAndResponse,
    balanced: Array,
    encoded: Array,
    clipped: tuple[Array, Array] | None = None,
    most_centres: int = MOST_CENTRES,
) -> GamutMap:
    """Fit h of one style after matrix and response, to unclipped samples Tw E → I, both (n, 3).

    clipped: Tw E and I (m, 3) of censored observations, with a JPEG channel at 0 or 1, which state a bound only. Raises
    CalibrationError.
    """
    matrix, response = base.matrix, base.response
    linear, mapped = balanced @ matrix.T, response.linearize(encoded)
    half_code = 0.5 / 255.0
    low, high = np.clip(encoded - half_code, 0.0, 1.0), np.clip(encoded + half_code, 0.0, 1.0)
    steps = _correction(response.linearize(low), response.linearize(high))
    error_scale = np.maximum((steps / (high - low)).mean(axis=1), 1e-3)
    bounds = None
    if clipped is not None:
        scene, codes = clipped
        bounds = (scene @ matrix.T, response.linearize(codes), codes >= 1.0, codes <= 0.0)
    return krige(linear, mapped, error_scale, most_centres, bounds)


def posterior_deviation(gamut_map: GamutMap) -> Callable[[Array], Array]:
    """The standard deviation of the process that a kriged gamut map is the mean of, as a function of colours (m, 3).

    It is that of one channel, on the even scale of corrections (equation 2.24 of the book). The variance of the process
    is the likeliest, (5.8) with σ² = yᵀ K⁻¹ y / 3n: the coefficients are K⁻¹ y.
    """
    z = to_even(gamut_map.centres, OFFSET)
    coefficients = gamut_map.coefficients
    mapped = gamut_map(gamut_map.centres)
    corrections = _correction(gamut_map.centres, mapped) + NOISE * coefficients
    amplitude = np.sqrt(max(float(np.sum(coefficients * corrections)), 0.0) / corrections.size)

    centres, _, _ = _merged(z, corrections, np.ones(len(z)), DEVIATION_CENTRES)
    covariance = kriging_covariance(centres, roughness=gamut_map.roughness)
    variance = covariance[0, 0]
    covariance[np.diag_indices(len(centres))] += NOISE
    whitening = np.linalg.inv(np.linalg.cholesky(covariance))

    def deviation(linear: Array) -> Array:
        points = to_even(linear.reshape(-1, 3), OFFSET)
        across = kriging_covariance(centres, points, roughness=gamut_map.roughness)
        known = np.sum((whitening @ across) ** 2, axis=0)
        return np.asarray(amplitude * np.sqrt(np.maximum(variance - known, NOISE)).reshape(linear.shape[:-1]))

    return deviation


def _solve(z: Array, correction: Array, weight: Array, most_centres: int, roughness: float) -> GamutMap:
    """The mean of the process given samples of noise NOISE / weight (n,) at z (n, 3)."""
    centres, values, weight = _merged(z, correction, weight, most_centres)
    covariance = kriging_covariance(centres, roughness=roughness)
    covariance[np.diag_indices(len(centres))] += NOISE / weight
    try:
        # NumPy's factorization releases Python's lock, so that fits run beside each other; SciPy's does not.
        coefficients = cho_solve((np.linalg.cholesky(covariance), True), values, check_finite=False)
    except np.linalg.LinAlgError as error:
        raise CalibrationError("the colours hold numbers that are not finite, or far beyond 1") from error
    if not np.all(np.isfinite(coefficients)):
        raise CalibrationError("the colours hold numbers that are not finite, or far beyond 1")
    identity = identity_gamut_map().polynomial
    linear = from_even(centres, OFFSET)
    return GamutMap(linear, coefficients, identity, OFFSET, "kriging", roughness, CORRECTION_OFFSET)


def _correction(source: Array, target: Array) -> Array:
    """What leads from one linear colour (n, 3) to another, on the perceptual scale of corrections."""
    return to_even(target, CORRECTION_OFFSET) - to_even(source, CORRECTION_OFFSET)


def _merged(z: Array, correction: Array, weight: Array, most: int) -> tuple[Array, Array, Array]:
    """Means of samples in one cell, at most `most`: places (m, 3), corrections (m, 3), and the largest weight (m,)."""
    size = CELL
    while True:
        cells = np.floor(flattened(z) / size).astype(np.int64)
        key = (cells - cells.min(axis=0)) @ np.array([1, 1 << 20, 1 << 40])
        _, place = np.unique(key, return_inverse=True)
        total = np.bincount(place, weight)
        means = [np.bincount(place, weight * column) / total for column in (*z.T, *correction.T)]
        largest = np.zeros(len(total))
        np.maximum.at(largest, place, weight)
        z, correction, weight = np.stack(means[:3], axis=1), np.stack(means[3:], axis=1), largest
        if len(z) <= most:
            return z, correction, weight
        size *= 1.25
