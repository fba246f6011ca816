"""EMoR, the empirical model of camera responses: f⁻¹ = g0 + Σ ξ_n h_n.

Grossberg & Nayar, "Modeling the space of camera response functions", PAMI 26(10), 2004. The numbers are those of
`invemor.txt`, published by the authors (Columbia University, CAVE): the mean inverse response and the first 15 of its
25 basis curves, at 1024 evenly spaced encoded values, rounded to float32. All basis curves are 0 at both ends, so
f⁻¹(0) = 0 and f⁻¹(1) = 1 whatever the coefficients.
"""

from dataclasses import dataclass
from functools import cache
from importlib.resources import files

import numpy as np

from lutforge.arrays import Array


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
