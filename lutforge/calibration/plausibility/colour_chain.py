"""A simple model of any camera, fitted in a few milliseconds, by which samples are judged.

The model is g(I) = A (x − d m), where x = m E is RAW times its multipliers m. g = f⁻¹ is one curve for the three
channels: a sum of EMoR's curves, a line and a constant. A is a matrix that need not map grey to grey. d is an offset of
RAW, such as a black level that was not subtracted; white balance multiplies it, too.

The RAW colour that the camera renders neutral is A⁻¹ (1, 1, 1), which is (1, 1, 1) where the multipliers are right. The
camera's matrix is Ts = A diag(A⁻¹ 1) (thesis 4.2.1, 4.2.2).

The model is linear in its unknowns, so each round of the fit is one least-squares problem. Each round takes weights
from the one before: by the slope of g, so that errors count in JPEG values, and robust ones by residual.
"""

from dataclasses import dataclass

import numpy as np

from lutforge.arrays import Array
from lutforge.calibration.physical.unsaturated import BETA, saturation, untouched_odds
from lutforge.errors import CalibrationError
from lutforge.model.emor import inverse_emor
from lutforge.solvers.blas import one_blas_thread
from lutforge.solvers.robust_weights import RobustWeights, cauchy

CODE = 1.0 / 255.0
CURVES = 6
"""EMoR curves beside its mean, a line and a constant. With this many, real responses are matched to half a code."""
TERMS = CURVES + 3
PRIOR = np.concatenate([[0.1, 0.1, 0.1], np.arange(1, CURVES + 1) ** 4.0, np.full(9, 1e-2), [4e4]])
"""Prior precisions of the coefficients of g, of A and of d. Only those of the later curves and of d are strong: the
standard deviation of d is 0.005."""


@dataclass(frozen=True, eq=False)
class ColourChain:
    """The fitted model.

    curve: coefficients of g; matrix: A (3, 3), whose entries sum to 3; offset, offset_error: d and its standard error;
    covariance: of the entries of A, (9, 9); rms: root mean square of the residuals, encoded; independent: the number of
    independent samples that hold as much information as all; low, high: the range of their encoded values.
    """

    curve: Array
    matrix: Array
    offset: float
    offset_error: float
    covariance: Array
    rms: float
    independent: float
    low: float
    high: float

    @property
    def neutral(self) -> Array:
        """The white-balanced RAW (3,) that the camera renders neutral: (1, 1, 1) where its multipliers are right."""
        return np.asarray(np.linalg.solve(self.matrix, np.ones(3)))

    @property
    def camera_matrix(self) -> Array:
        """Ts (3, 3), whose rows sum to 1."""
        return np.asarray(self.matrix * self.neutral)

    def light(self, encoded: Array) -> Array:
        """Balanced RAW of the green channel at neutral JPEG values (n,)."""
        return np.asarray(curve_terms(encoded) @ self.curve * self.neutral[1])

    def predicted(self, x: Array, multipliers: Array) -> Array:
        """The linear values g(I), (n, 3), that balanced RAW x (n, 3) leads to."""
        return np.asarray((x - self.offset * multipliers) @ self.matrix.T)

    def encoded(self, linear: Array) -> Array:
        """g⁻¹ of linear values of any shape, in [0, 1]."""
        codes = np.linspace(0.0, 1.0, 513)
        return np.interp(linear, np.maximum.accumulate(curve_terms(codes) @ self.curve), codes)


def curve_terms(encoded: Array) -> Array:
    """A constant, a line, EMoR's mean and its curves at encoded values (…) → (…, TERMS)."""
    basis = inverse_emor(CURVES)
    flat = encoded.ravel()
    mean, curves = basis.at(flat)
    return np.column_stack([np.ones_like(flat), flat, mean, curves]).reshape(*encoded.shape, TERMS)


def cubic_terms(rendered: Array) -> Array:
    """The terms of a cubic polynomial of the channels of rendered (n, 3) around middle grey, (n, 20)."""
    r, g, b = 2.0 * rendered.T - 1.0
    one = np.ones_like(r)
    first = (one, r, g, b)
    return np.stack(
        [first[i] * first[j] * first[k] for i in range(4) for j in range(i, 4) for k in range(j, 4)], axis=1
    )


@one_blas_thread
def fit_chain(x: Array, encoded: Array, multipliers: Array) -> ColourChain:
    """Fit the model to balanced RAW x (n, 3), unclipped JPEG values encoded (n, 3) and the multipliers (n, 3) of x.

    At most 600 of the less saturated colours are used. Raises CalibrationError where there are too few.
    """
    if len(x) < 24:
        raise CalibrationError(f"{len(x)} samples are too few to judge")
    chroma = saturation(encoded)
    beta = max(BETA, float(np.quantile(chroma, 0.35)))
    rows = np.flatnonzero(chroma < 2.5 * beta)
    if len(rows) > 600:
        rows = np.random.default_rng(0).choice(rows, 600, replace=False, shuffle=False)
    x, encoded, multipliers = x[rows], encoded[rows], multipliers[rows]
    initial = _initial_weights(encoded, chroma[rows], beta)
    terms, steps = curve_terms(encoded), curve_terms(np.clip(encoded + 1e-3, 0, 1)) - curve_terms(encoded - 1e-3)
    first = np.eye(TERMS)[2]
    system = np.zeros((len(x), 3, TERMS + 10))
    system[..., :TERMS] = terms
    for channel in range(3):
        system[:, channel, TERMS + 3 * channel : TERMS + 3 * channel + 3] = -x
    solution, weight = np.concatenate([first, np.eye(3).ravel(), [0.0]]), initial
    right_side, robust = PRIOR * solution, RobustWeights(cauchy, 2.0, CODE)
    entries_of_matrix = np.concatenate([np.zeros(TERMS), np.ones(9), [0.0]])  # whose sum is held at 3
    inverse, residual = np.zeros((len(solution), len(solution))), np.zeros(len(x))
    for turn in range(6):
        slope = np.maximum(steps @ solution[:TERMS] / 2e-3, 0.05)
        if turn > 1:
            system[..., -1] = multipliers @ solution[TERMS:-1].reshape(3, 3).T
        scaled = (system * (np.sqrt(weight)[:, None] / slope)[..., None]).reshape(-1, TERMS + 10)
        data_term, sum_term = scaled.T @ scaled * (2.0 / CODE) ** 2, np.outer(entries_of_matrix, entries_of_matrix)
        inverse = np.linalg.inv(data_term + np.diag(PRIOR) + 1e9 * sum_term)
        solution = inverse @ (right_side + 3e9 * entries_of_matrix)
        residual = np.linalg.norm((system @ solution) / slope, axis=1)
        weight = initial * robust(residual)
    rms = float(np.sqrt(np.average(residual**2, weights=weight)))
    # Residuals of similar colours are correlated: the samples hold as much information as a quarter of them would.
    covariance = inverse * 4.0 * max(rms * 2.0 / CODE, 1.0) ** 2
    place, (low, high) = slice(TERMS, TERMS + 9), np.quantile(encoded, [0.01, 0.99])
    return ColourChain(
        solution[:TERMS], solution[place].reshape(3, 3), float(solution[-1]), float(np.sqrt(covariance[-1, -1])),
        covariance[place, place], rms, 0.05 * len(x), float(low), float(high),
    )  # fmt: skip


def _initial_weights(encoded: Array, chroma: Array, beta: float) -> Array:
    """Initial weights (n,) with mean 1: high for unsaturated colours, and low for tones that many samples have."""
    weight = untouched_odds(chroma, beta)
    tone = encoded.mean(axis=1)
    counts = np.histogram(tone, 16, (0.0, 1.0), weights=weight)[0] + weight.sum() / 64
    weight = weight / np.sqrt(np.interp(tone, (np.arange(16) + 0.5) / 16, counts))
    return np.asarray(weight / weight.mean())
