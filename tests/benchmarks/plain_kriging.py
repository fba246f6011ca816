"""Plain universal kriging in sixty lines, beside which the estimator is measured."""

from collections.abc import Callable

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.spatial.distance import cdist

from lutforge.arrays import Array
from lutforge.colour.srgb import srgb_decode


def kriging(balanced: Array, encoded: Array, most: int = 2000) -> tuple[Callable[[Array], Array], ...]:
    """RAW → JPEG and back, fitted to unclipped samples Tw E → I, each (n, 3), at most so many of them."""
    order = np.random.default_rng(0).permutation(len(balanced))[:most]
    x, y = balanced[order], encoded[order]
    weight = 1 / (0.03 + x.mean(axis=1, keepdims=True))
    matrix = np.linalg.lstsq(x * weight, srgb_decode(y) * weight, rcond=None)[0].T
    matrix /= matrix.sum(axis=1, keepdims=True)
    offset, power = 0.005, 1 / 2.4

    def even(linear: Array) -> Array:
        return np.asarray(np.sign(linear) * ((np.abs(linear) + offset) ** power - offset**power))

    def uneven(z: Array) -> Array:
        return np.asarray(np.sign(z) * ((np.abs(z) + offset**power) ** (1 / power) - offset))

    def covariance(one: Array, other: Array) -> Array:
        distance = cdist(one, other)
        smooth = np.sqrt(3) * distance / 0.8
        return np.asarray(0.2 * np.exp(-distance / 3.2) + 0.8 * (1 + smooth) * np.exp(-smooth))

    def kriged(z: Array, values: Array) -> Callable[[Array], Array]:
        trend = np.column_stack([np.ones(len(z)), z])
        factor = cho_factor(covariance(z, z) + 1e-3 * np.eye(len(z)))
        of_trend = cho_solve(factor, trend)
        slope = np.linalg.solve(trend.T @ of_trend, of_trend.T @ values)
        rest = cho_solve(factor, values - trend @ slope)
        return lambda q: np.asarray(covariance(q, z) @ rest + slope[0] + q @ slope[1:])

    z = even(x @ matrix.T)
    curves = [np.polyfit(z[:, c], y[:, c], 5) for c in range(3)]  # the response, of all colours alike
    curved = np.stack([np.polyval(curves[c], z[:, c]) for c in range(3)], axis=1)
    low, high = z.min(axis=0), z.max(axis=0)
    forward, backward = kriged(z, y - curved), kriged(y, z)

    def render(q: Array) -> Array:
        at = even(q @ matrix.T)
        curve = np.stack([np.polyval(curves[c], np.clip(at[:, c], low[c], high[c])) for c in range(3)], axis=1)
        return np.clip(curve + forward(at), 0.0, 1.0)

    return render, lambda codes: uneven(backward(codes)) @ np.linalg.inv(matrix).T
