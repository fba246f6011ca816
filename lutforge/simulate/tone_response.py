"""The response f of the simulated camera, linear sRGB → encoded values: one film-like curve per channel."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from lutforge.arrays import Array
from lutforge.colour.srgb import srgb_decode, srgb_encode


@dataclass(frozen=True)
class ToneResponse:
    """f(x) = S(srgb(x)): the sRGB curve (IEC 61966-2-1), then a cubic Bézier curve from (0, 0) to (1, 1).

    S(v) = 3 toe v (1 − v)² + 3 shoulder v² (1 − v) + v³ increases strictly where 0 < toe ≤ shoulder < 1.
    """

    toe: tuple[float, float, float]
    shoulder: tuple[float, float, float]

    def __call__(self, linear: ArrayLike) -> Array:
        """f: linear sRGB (…, 3), clipped to [0, 1] as the camera does, to encoded values in [0, 1]."""
        clipped = np.clip(linear, 0.0, 1.0)
        return np.where(clipped < 1, self._curve(srgb_encode(clipped)), 1.0)  # rounding must not hide a clip

    def inverse(self, encoded: ArrayLike) -> Array:
        """f⁻¹: encoded values (…, 3), clipped to [0, 1], to linear sRGB in [0, 1], to about 1e-12."""
        target = np.clip(encoded, 0.0, 1.0)
        return srgb_decode(invert_increasing(self._curve, target, 0.0, 1.0))

    def _curve(self, v: Array) -> Array:
        toe, shoulder = np.asarray(self.toe), np.asarray(self.shoulder)
        return np.asarray(v * (3 * toe * (1 - v) ** 2 + v * (3 * shoulder * (1 - v) + v)))


def invert_increasing(function: Callable[[Array], Array], target: Array, low: float, high: float) -> Array:
    """Solve function(x) = target for x in [low, high], where it increases strictly, by bisection to float precision."""
    a: Array = np.full(target.shape, low)
    b: Array = np.full(target.shape, high)
    for _ in range(54):
        middle = (a + b) / 2
        below = function(middle) < target
        a, b = np.where(below, middle, a), np.where(below, b, middle)
    return a / 2 + b / 2
