"""A partially linear model of the scene's light: a smooth function of the JPEG colour, plus a few linear terms.

A fixed rendering takes each scene colour to one JPEG colour I, so that y = log₂ Σ Tw E is a smooth function λ of I.
Brightness that depends on place, shot or setting is added linearly with a few coefficients β: y = λ(I) + z·β + ε
(Robinson 1988, https://doi.org/10.2307/1912705). λ is a Gaussian process for each style, with the kernel of the gamut
map, spanned by its values at a few of the colours. It is projected out of y and of every column of z, and β is fitted
to the residuals, which gives the β of the joint fit (Frisch & Waugh 1933, https://doi.org/10.2307/1907330). So the
gamut map need not be known.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag, cho_factor, cho_solve

from lutforge.arrays import Array, Mask
from lutforge.calibration.physical.gamut_map import farthest_points
from lutforge.model.gamut_map import kriging_covariance
from lutforge.samples.sample_set import SampleSet
from lutforge.solvers.robust_weights import RobustWeights, cauchy

NOISE = 0.03
"""Standard deviation of y, in stops, of bright samples; that of darker ones is larger, because codes are rounded."""
PRIOR = 10.0
"""Standard deviation of λ, in stops, from black to white."""


@dataclass(frozen=True, eq=False)
class PartialModel:
    """The samples of a partially linear model.

    rows: (n,) their places in the sample set; y: log₂ of the scene's light, (n,); precision: (n,) by their noise;
    style: (n,) place of their style; designs: by style the functions of λ at its samples; bending: their penalty.
    """

    rows: NDArray[np.intp]
    y: Array
    precision: Array
    style: NDArray[np.intp]
    designs: tuple[Array, ...]
    bending: tuple[Array, ...]

    def residual(self, columns: Array, weight: Array) -> Array:
        """Fit a function of colour to columns (n, k) with weights (n,), and return the residuals (n, k)."""
        left = np.empty_like(columns)
        for place, (design, bending) in enumerate(zip(self.designs, self.bending, strict=True)):
            mine = self.style == place
            weighted = design * weight[mine, None]
            normal = weighted.T @ design + bending
            left[mine] = columns[mine] - design @ cho_solve(cho_factor(normal), weighted.T @ columns[mine])
        return left

    def reweighted(self, residual: Array) -> Array:
        """Weights (n,) of the next round of a robust fit, from the residuals (n,) of this one."""
        return np.asarray(self.precision * RobustWeights(cauchy, multiple=2.5, least=0.02)(np.abs(residual)))


def partial_model(samples: SampleSet, multipliers: Array, usable: Mask) -> PartialModel | None:
    """State the model of the usable samples (n,), at most 4,000 of a style; None where colours cannot tell λ.

    multipliers: (n, 3), what makes RAW white-balanced. Each shot has an offset of its own with a prior of a tenth of a
    stop around 0, so that no exposure that is off is taken for something else.
    """
    rng = np.random.default_rng(0)
    parts, designs, bending = [], [], []
    for name in np.unique(samples.style[usable]):
        mine = np.flatnonzero(usable & (samples.style == name))
        mine = np.sort(rng.permutation(mine)[:4000])
        encoded = np.ascontiguousarray(samples.srgb[mine])
        shots, member = np.unique(samples.shot[mine], return_inverse=True)
        centres = encoded[farthest_points(encoded, min(150, len(mine) // 8))]
        covariance = np.tril(kriging_covariance(centres))
        covariance += np.tril(covariance, -1).T + 1e-9 * np.eye(len(centres))
        parts.append(mine)
        designs.append(np.hstack([kriging_covariance(encoded, centres), np.eye(len(shots))[member]]))
        bending.append(block_diag((NOISE / PRIOR) ** 2 * covariance, (NOISE / 0.1) ** 2 * np.eye(len(shots))))
    if not parts:
        return None
    rows = np.concatenate(parts)
    y = np.log2((samples.raw[rows] * multipliers[rows]).sum(axis=1))
    rounding = 2.2 / np.log(2.0) * (0.5 / 255) / np.maximum(samples.srgb[rows].mean(axis=1), 0.02)  # of a power of 2.2
    precision = NOISE**2 / (NOISE**2 + rounding**2)
    style = np.repeat(np.arange(len(parts)), [len(part) for part in parts])
    return PartialModel(rows, y, precision, style, tuple(designs), tuple(bending))
