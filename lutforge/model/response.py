"""The camera response f: linear [0, 1] → encoded [0, 1], one monotone curve per channel (thesis 4.2.1)."""

from dataclasses import dataclass
from functools import cache
from importlib.resources import files

import numpy as np
from numpy.typing import ArrayLike

from lutforge.arrays import Array
from lutforge.errors import ProfileError


@dataclass(frozen=True, eq=False)
class Response:
    """f⁻¹ as a table: `inverse` (n, 3), the linear value at n evenly spaced encoded values 0 … 1, non-decreasing.

    Between the entries both directions are linear; outside they are clamped.
    Raises ProfileError where a column falls, is constant, or holds a number that is not finite.
    """

    inverse: Array

    def __post_init__(self) -> None:
        table = self.inverse
        if table.ndim != 2 or table.shape[1] != 3 or len(table) < 2 or not np.all(np.isfinite(table)):
            raise ProfileError("response: expected a table of n rows and 3 columns of finite numbers")
        if np.any(np.diff(table, axis=0) < 0) or np.any(table[-1] <= table[0]):
            raise ProfileError("response: the inverse response must not fall, and must reach beyond its start")

    def linearize(self, encoded: ArrayLike) -> Array:
        """f⁻¹: encoded (…, 3) → linear (…, 3)."""
        values = np.asarray(encoded, dtype=np.float64)
        codes = np.linspace(0.0, 1.0, len(self.inverse))
        return np.stack([np.interp(values[..., c], codes, self.inverse[:, c]) for c in range(3)], axis=-1)

    def encode(self, linear: ArrayLike) -> Array:
        """f: linear (…, 3) → encoded (…, 3) in [0, 1]. A flat stretch of f⁻¹ answers with its upper end."""
        values = np.asarray(linear, dtype=np.float64)
        codes = np.linspace(0.0, 1.0, len(self.inverse))
        return np.stack([np.interp(values[..., c], self.inverse[:, c], codes) for c in range(3)], axis=-1)


def smooth_response(response: Response) -> Response:
    """The response with a monotone cubic between its entries (Fritsch & Carlson 1980), tabulated at 1,021 codes."""
    from scipy.interpolate import PchipInterpolator  # imported here: what only applies a profile never needs it

    entries = np.linspace(0.0, 1.0, len(response.inverse))
    table = PchipInterpolator(entries, response.inverse, axis=0)(np.linspace(0.0, 1.0, 1021))
    return Response(np.maximum.accumulate(table, axis=0))


# --- EMoR, the empirical model of camera responses: f⁻¹ = g0 + Σ ξ_n h_n ---------------------------------------------
# Grossberg & Nayar, "Modeling the space of camera response functions", PAMI 26(10), 2004.
#
# The numbers are those of `invemor.txt`, published by the authors (Columbia University, CAVE): the mean inverse
# response and the first 15 of its 25 basis curves, at 1024 evenly spaced encoded values, rounded to float32. All basis
# curves are 0 at both ends, so f⁻¹(0) = 0 and f⁻¹(1) = 1 whatever the coefficients.


@dataclass(frozen=True, eq=False)
class ResponseBasis:
    """A mean (1024,) and basis curves (count, 1024) of responses, at evenly spaced encoded values 0 … 1."""

    mean: Array
    curves: Array

    def at(self, encoded: Array) -> tuple[Array, Array]:
        """The mean (n,) and the curves (n, count) at encoded values (n,)."""
        position = np.clip(encoded, 0.0, 1.0) * (self.mean.shape[0] - 1)
        low = np.minimum(position.astype(np.intp), self.mean.shape[0] - 2)
        fraction = position - low
        mean = (1 - fraction) * self.mean[low] + fraction * self.mean[low + 1]
        curves = (1 - fraction)[:, None] * self.curves[:, low].T + fraction[:, None] * self.curves[:, low + 1].T
        return mean, curves


@cache
def inverse_emor(count: int = 15) -> ResponseBasis:
    """f⁻¹ = mean + ξ · curves: the basis in the linear domain, at most 15 curves."""
    with files("lutforge.model").joinpath("data/emor.npz").open("rb") as stream, np.load(stream) as table:
        mean, curves = table["mean"].astype(np.float64), table["basis"].astype(np.float64)
    mean[0], mean[-1] = 0.0, 1.0
    curves[:, [0, -1]] = 0.0
    return ResponseBasis(mean, curves[:count])


def mean_response(linear: Array) -> Array:
    """The mean of EMoR's 201 responses at linear values (n,)."""
    return np.interp(linear, inverse_emor().mean, np.linspace(0.0, 1.0, 1024))


@cache
def log_inverse_emor(count: int = 15) -> ResponseBasis:
    """log f⁻¹ = mean + ξ · curves (4.3), with η_n = h_n / g0: the first-order expansion of log(g0 + Σ ξ_n h_n).

    The authors publish no basis for the logarithm; this one spans sRGB, gamma curves and cameras' curves to 0.006 of
    encoded full scale with 15 curves. The entry at 0, where the logarithm has no value, repeats the next one.
    """
    linear = inverse_emor(count)
    mean = np.log(np.maximum(linear.mean, linear.mean[1]))
    curves = linear.curves / np.maximum(linear.mean, linear.mean[1])
    curves[:, 0] = curves[:, 1]
    return ResponseBasis(mean, curves)
