"""The plainest model that any camera follows, fitted in a few milliseconds to judge samples by.

g(I_c) = a_c · (x − d m), x = m E: one curve g = f⁻¹ for the three channels, a matrix A with no neutral prescribed, and
an offset d of RAW, which white balance colours. A tells what the multipliers leave undone: neutral JPEG values are
x ∝ A⁻¹ (1, 1, 1), and Ts = A diag(A⁻¹ 1) (thesis 4.2.1, 4.2.2). g is one of EMoR's curves, or linear. All is linear in
what is not known, so each round is one least-squares problem; rounds reweight by the slope of g, so that errors count
in JPEG values, and by residual.
"""

from dataclasses import dataclass

import numpy as np

from lutforge.arrays import Array
from lutforge.calibration.physical.unsaturated import BETA, LEAST_SHARE, saturation, untouched_odds
from lutforge.errors import CalibrationError
from lutforge.model.emor import inverse_emor
from lutforge.solvers.blas import one_blas_thread
from lutforge.solvers.robust_weights import RobustWeights, cauchy

CODE = 1.0 / 255.0
CURVES = 6
"""EMoR curves beside its mean, a line and a constant: as many as tell real responses to half a code."""
TERMS = CURVES + 3
LEAST_SAMPLES = 24
PRIOR = np.concatenate([[0.1, 0.1, 0.1], np.arange(1, CURVES + 1) ** 4.0, np.full(9, 1e-2), [4e4]])
"""Precision of the coefficients of g, of A and of d: weak, but of the later curves and of d (0.005)."""


@dataclass(frozen=True, eq=False)
class ColourChain:
    """curve: coefficients of g; matrix: A (3, 3), whose entries sum to 3; offset, offset_doubt: d, its standard error.

    covariance: of A (9, 9); rms: encoded, of the colours that count;
    independent: as many of them tell what all do; low, high: the encoded values that they span.
    """

    curve: Array
    matrix: Array
    offset: float
    offset_doubt: float
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
        """RAW of green, balanced, of neutral JPEG values (n,)."""
        return np.asarray(curve_terms(encoded) @ self.curve * self.neutral[1])

    def predicted(self, x: Array, multipliers: Array) -> Array:
        """g of the JPEG values (n, 3) of balanced RAW x (n, 3)."""
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
    """All products of up to three of the channels of rendered (n, 3) → (n, 20), about the middle grey."""
    r, g, b = 2.0 * rendered.T - 1.0
    one = np.ones_like(r)
    first = (one, r, g, b)
    return np.stack(
        [first[i] * first[j] * first[k] for i in range(4) for j in range(i, 4) for k in range(j, 4)], axis=1
    )


@one_blas_thread
def fit_chain(x: Array, encoded: Array, multipliers: Array) -> ColourChain:
    """Fit the chain to balanced RAW x (n, 3), unclipped JPEG values encoded (n, 3) and the multipliers (n, 3) of x.

    Six hundred of the least saturated colours count. Raises CalibrationError where there are too few.
    """
    if len(x) < LEAST_SAMPLES:
        raise CalibrationError(f"{len(x)} samples are too few to judge")
    chroma = saturation(encoded)
    beta = max(BETA, float(np.quantile(chroma, LEAST_SHARE)))
    rows = np.flatnonzero(chroma < 2.5 * beta)
    if len(rows) > 600:
        rows = np.random.default_rng(0).choice(rows, 600, replace=False, shuffle=False)
    x, encoded, multipliers = x[rows], encoded[rows], multipliers[rows]
    odds = _odds(encoded, chroma[rows], beta)
    terms, steps = curve_terms(encoded), curve_terms(np.clip(encoded + 1e-3, 0, 1)) - curve_terms(encoded - 1e-3)
    first = np.eye(TERMS)[2]
    system = np.zeros((len(x), 3, TERMS + 10))
    system[..., :TERMS] = terms
    for channel in range(3):
        system[:, channel, TERMS + 3 * channel : TERMS + 3 * channel + 3] = -x
    wanted = PRIOR * np.concatenate([first, np.eye(3).ravel(), [0.0]])
    whole = np.concatenate([np.zeros(TERMS), np.ones(9), [0.0]])
    solution, weight, robust = np.concatenate([first, np.eye(3).ravel(), [0.0]]), odds, RobustWeights(cauchy, 2.0, CODE)
    inverse, residual = np.zeros((len(whole), len(whole))), np.zeros(len(x))
    for turn in range(6):
        slope = np.maximum(steps @ solution[:TERMS] / 2e-3, 0.05)
        if turn > 1:
            system[..., -1] = multipliers @ solution[TERMS:-1].reshape(3, 3).T
        scaled = (system * (np.sqrt(weight)[:, None] / slope)[..., None]).reshape(-1, TERMS + 10)
        normal = scaled.T @ scaled * (2.0 / CODE) ** 2 + np.diag(PRIOR) + 1e9 * np.outer(whole, whole)
        inverse = np.linalg.inv(normal)
        solution = inverse @ (wanted + 3e9 * whole)
        residual = np.linalg.norm((system @ solution) / slope, axis=1)
        weight = odds * robust(residual)
    rms = float(np.sqrt(np.average(residual**2, weights=weight)))
    # Residuals of neighbouring colours are alike: a quarter of the samples tells as much.
    doubt = inverse * 4.0 * max(rms * 2.0 / CODE, 1.0) ** 2
    place = slice(TERMS, TERMS + 9)
    return ColourChain(
        solution[:TERMS], solution[place].reshape(3, 3), float(solution[-1]), float(np.sqrt(doubt[-1, -1])),
        doubt[place, place], rms, 0.05 * len(x), float(np.quantile(encoded, 0.01)), float(np.quantile(encoded, 0.99)),
    )  # fmt: skip


def _odds(encoded: Array, chroma: Array, beta: float) -> Array:
    """What colours count at first: the unsaturated most, and tones by the root of their number."""
    odds = untouched_odds(chroma, beta)
    tone = encoded.mean(axis=1)
    counts = np.histogram(tone, 16, (0.0, 1.0), weights=odds)[0] + odds.sum() / 64
    odds = odds / np.sqrt(np.interp(tone, (np.arange(16) + 0.5) / 16, counts))
    return np.asarray(odds / odds.mean())
