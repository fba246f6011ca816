"""Weights of iteratively reweighted least squares (IRLS): how much a sample counts, given its residual.

A robust loss gives large residuals less weight, so that outliers do not bend a fit. Holland & Welsch, "Robust
regression using iteratively reweighted least-squares", Communications in Statistics 6 (1977),
https://doi.org/10.1080/03610927708827533. An Lp norm of p > 2 gives them more, so that a fit comes nearer to the least
maximum error: Lawson's algorithm (1961), as in J. R. Rice and K. H. Usow, "The Lawson algorithm and extensions",
Mathematics of Computation 22 (101), 1968, pages 118–127.

To add a loss, write its weight function of the ratio residual / scale here, and name it where a `RobustWeights` is
made, once in each fit that is robust.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from lutforge.arrays import Array

Loss = Callable[[Array], Array]
"""The IRLS weight, in [0, 1], of each ratio residual / scale ≥ 0."""


def cauchy(ratio: Array) -> Array:
    """The weight 1 / (1 + t²): one half at a ratio of 1, and it falls with the square of large residuals."""
    return np.asarray(1.0 / (1.0 + np.square(ratio)))


def geman_mcclure(ratio: Array) -> Array:
    """The weight 1 / (1 + t²)²: one quarter at a ratio of 1; a far outlier has no influence at all."""
    return np.asarray(1.0 / np.square(1.0 + np.square(ratio)))


@dataclass(frozen=True)
class RobustWeights:
    """A robust loss and its scale: `multiple` times the median residual, and `least` at least.

    `least` is the residual that even a sample without noise has, such as that of 8-bit codes.
    """

    loss: Loss
    multiple: float
    least: float

    def scale(self, residual: Array, weight: Array | None = None) -> float:
        """The scale of residuals (n,); weight: what each counts in their median, (n,)."""
        median = float(np.median(residual)) if weight is None else weighted_median(residual, weight)
        return max(self.multiple * median, self.least)

    def __call__(self, residual: Array, like: Array | None = None) -> Array:
        """Return IRLS weights (n,) of residuals (n,) ≥ 0. like: the residuals (m,) that set the scale, else all."""
        return self.loss(residual / self.scale(residual if like is None else like))


def weighted_median(values: Array, weight: Array) -> float:
    """The value below which half of the weight lies; values, weight: (n,)."""
    order = np.argsort(values)
    total = np.cumsum(weight[order])
    return float(values[order[np.searchsorted(total, 0.5 * total[-1])]])


def lawson(error: Array, power: float, least: float = 0.1, most: float = 20.0) -> Array:
    """Weights (n,) of the next fit of an Lp norm with p = 2 + power, from the errors (n,) ≥ 0 of the last one.

    The ratio of an error to the mean error is raised to `power`. least: what is added to the ratio, so that samples
    without error still count; most: its upper bound, so that one sample does not rule.
    """
    ratio = np.minimum(error / max(float(error.mean()), 1e-300), most)
    return np.asarray((least + ratio) ** power)
