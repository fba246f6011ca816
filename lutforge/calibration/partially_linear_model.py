"""The brightness of samples as a smooth function of their colour and linear terms: a partially linear model.

y = λ(I) + terms + ε, where y = log₂ Σ Tw E and λ is a smooth function of the JPEG colour I (Robinson 1988,
https://doi.org/10.2307/1912705). λ is a Gaussian process for each style, with the kernel of the gamut map, spanned by
its values at a few of the colours. It is projected out of y and of every linear term, whose coefficients are fitted to
the residuals, which gives those of the joint fit (Frisch & Waugh 1933, https://doi.org/10.2307/1907330).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag, cho_factor, cho_solve

from lutforge.arrays import Array, Mask
from lutforge.model.gamut_map import kriging_covariance
from lutforge.samples.sample_set import SampleSet
from lutforge.solvers.farthest_points import farthest_points
from lutforge.solvers.robust_weights import RobustWeights, cauchy

SAMPLE_NOISE = 0.03
"""Standard deviation of y, in stops, of bright samples; that of darker ones is larger, because codes are rounded."""
FUNCTION_SPREAD = 10.0
"""Standard deviation of λ, in stops, from black to white."""
SHOT_SPREAD = 0.1
"""Standard deviation of the offset of a shot, in stops."""
TYPICAL_POWER, LEAST_ROUNDED_VALUE = 2.2, 0.02
"""Rounding of codes is that of a response of this power, and of values of this at least."""
MOST_OF_STYLE = 4000
"""The largest number of a style's samples that are used; of more, as many are drawn at random."""
MOST_FUNCTION_CENTRES, SAMPLES_PER_CENTRE = 150, 8
"""λ is spanned by its values at so many colours at most, and at one for so many samples."""
NUGGET = 1e-9
"""This is added to the variances of λ, so that colours which nearly coincide keep their covariance positive."""
RESIDUAL_WEIGHTS = RobustWeights(cauchy, multiple=2.5, least=0.02)


@dataclass(frozen=True, eq=False)
class StyleFunction:
    """λ of one style, and the offsets of its shots, as a linear function of p unknowns.

    of_style: which samples of the model are of the style, m of them; design: (m, p), by what each unknown raises them;
    penalty: (p, p), by the priors of the unknowns, where the variance of bright samples is 1.
    """

    of_style: slice
    design: Array
    penalty: Array


@dataclass(frozen=True, eq=False)
class Projection:
    """The fit of λ to samples that are weighted in one way. It is factorized once, for all columns that are fitted."""

    functions: Sequence[StyleFunction]
    weight: Array

    @cached_property
    def _factorized(self) -> list[tuple[Array, tuple[Array, bool]]]:
        """By style, the weighted design (m, p) and the Cholesky factor of the normal matrix (p, p)."""
        factorized = []
        for function in self.functions:
            weighted = function.design * self.weight[function.of_style, None]
            factorized.append((weighted, cho_factor(weighted.T @ function.design + function.penalty)))
        return factorized

    def residual(self, columns: Array) -> Array:
        """Fit λ to columns (n, k), each by itself, and return the residuals, (n, k)."""
        residuals = np.empty_like(columns)
        for function, (weighted, factor) in zip(self.functions, self._factorized, strict=True):
            of_style = function.of_style
            coefficients = cho_solve(factor, weighted.T @ columns[of_style])
            residuals[of_style] = columns[of_style] - function.design @ coefficients
        return residuals


@dataclass(frozen=True, eq=False)
class PartiallyLinearModel:
    """The samples of a partially linear model, and the functions of colour that it has.

    samples: n of them; channels: log₂ of balanced RAW, (n, 3); y: log₂ of its sum, (n,); precision: (n,) by the noise
    of the samples; functions: λ of each style.
    """

    samples: SampleSet
    channels: Array
    y: Array
    precision: Array
    functions: Sequence[StyleFunction]

    @cached_property
    def by_noise(self) -> Projection:
        """The fit of λ with the samples weighted by their noise alone."""
        return Projection(self.functions, self.precision)

    def reweighted(self, residual: Array) -> Projection:
        """The fit of λ in the next round of a robust fit, by the residuals (n,) of the terms in this one."""
        return Projection(self.functions, np.asarray(self.precision * RESIDUAL_WEIGHTS(np.abs(residual))))


def partially_linear_model(samples: SampleSet, multipliers: Array, usable: Mask) -> PartiallyLinearModel | None:
    """State the model of the usable samples (n,); None where there are none.

    multipliers: (n, 3), what makes RAW white-balanced. Each shot has an offset of its own with a prior of a tenth of a
    stop around 0, so that no exposure that is off is taken for something else.
    """
    styles = np.unique(samples.style[usable])
    if not len(styles):
        return None

    rng = np.random.default_rng(0)
    chosen = list[NDArray[np.intp]]()
    functions = list[StyleFunction]()
    count = 0
    for style in styles:
        rows = np.flatnonzero(usable & (samples.style == style))
        rows = np.sort(rng.permutation(rows)[:MOST_OF_STYLE])
        of_style = slice(count, count + len(rows))
        functions.append(_style_function(of_style, samples.srgb[rows], samples.shot[rows]))
        chosen.append(rows)
        count += len(rows)

    rows = np.concatenate(chosen)
    balanced = samples.raw[rows] * multipliers[rows]
    level = np.maximum(samples.srgb[rows].mean(axis=1), LEAST_ROUNDED_VALUE)
    rounding = TYPICAL_POWER / np.log(2.0) * (0.5 / 255) / level
    precision = SAMPLE_NOISE**2 / (SAMPLE_NOISE**2 + rounding**2)
    logs, log_sums = np.log2(balanced), np.log2(balanced.sum(axis=1))
    return PartiallyLinearModel(samples.select(rows), logs, log_sums, precision, functions)


def _style_function(of_style: slice, srgb: Array, shot: NDArray[np.str_]) -> StyleFunction:
    """λ of a style, and the offsets of its shots, at samples of colours (m, 3) and shots (m,)."""
    encoded = np.ascontiguousarray(srgb)
    centres = encoded[farthest_points(encoded, min(MOST_FUNCTION_CENTRES, len(encoded) // SAMPLES_PER_CENTRE))]
    shots, place_of_shot = np.unique(shot, return_inverse=True)
    design = np.hstack([kriging_covariance(encoded, centres), np.eye(len(shots))[place_of_shot]])

    # The covariance is computed below its diagonal only.
    covariance = np.tril(kriging_covariance(centres))
    covariance += np.tril(covariance, -1).T + NUGGET * np.eye(len(centres))
    of_function = (SAMPLE_NOISE / FUNCTION_SPREAD) ** 2 * covariance
    of_offsets = (SAMPLE_NOISE / SHOT_SPREAD) ** 2 * np.eye(len(shots))
    return StyleFunction(of_style, design, block_diag(of_function, of_offsets))
