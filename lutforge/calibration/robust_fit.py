"""The one robust fit of responses, matrices, white balances and gains.

Of every colour the curve t(f⁻¹(I)) is linear in a basis (`curve_basis`; t is the identity or the logarithm), and the
linear values that it stands for are linear in all that is not known besides: rows of a matrix, gains of shots and
settings, errors of shutters. So each round minimizes, over samples n and channels c,

    Σ p_nc (offset(I_nc) + basis(I_nc) θ_c − known_nc − by_channel_nc m_c − shared_nc s)² + the priors of θ and s

under the inequalities that make f⁻¹ rise. For an exposure pair the curve at I stands minus the curve at I'. The
columns state what is fitted; rounds weigh the samples anew by their residuals (IRLS).
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from lutforge.arrays import Array
from lutforge.calibration.curve_basis import CurveBasis
from lutforge.solvers.inequality_least_squares import solve_lsi
from lutforge.solvers.robust_weights import cauchy, weighted_median
from lutforge.solvers.solution import Status

SETTLED_WEIGHTS = 2e-3
"""Weights are settled when they change by less than this share."""
CHANNEL_RIDGE = 1e-9
"""Share of the weights that is added to the normal matrix of m, so that it is never singular."""
TONE_LEVELS = 16
"""Tones at which the residuals of like ones are measured, and bins of their histogram."""
ENOUGH_OF_TONE = 8.0
"""Summed prior weight of the samples that residuals are compared with."""


@dataclass(frozen=True, eq=False)
class LinearModel:
    """The linear values of n samples, as a linear function of what is not known besides the curves.

    known: (n, 3), the part without unknowns; by_channel: (n, 3, q), what the q unknowns m of each channel multiply;
    shared: (n, 3, p), what the p unknowns s of all channels multiply.
    """

    known: Array
    by_channel: Array
    shared: Array


class Problem(Protocol):
    """A problem that the fit solves: it states each round, and takes its solution."""

    encoded: Array
    """The JPEG values (n, 3)."""
    subtracted: Array | None
    """The JPEG values (n, 3) whose curve is subtracted, for exposure pairs."""

    def linear_model(self) -> LinearModel:
        """The linear values of the next round."""

    def precision(self) -> Array:
        """The precision (n, 3) of the values in the next round."""

    def prior(self, basis: CurveBasis) -> tuple[Array, Array]:
        """Return rows (r, 3 m) whose products with the θ of all channels are 0 ± 1, and the precision of s (p, p)."""

    def update(self, curves: Array, by_channel: Array, shared: Array) -> float:
        """Take the curves (k, 3), m (3, q) and s (p,) of a round; return the relative change of the weights."""


def robust_fit(problem: Problem, basis: CurveBasis, most_rounds: int = 20) -> Status:
    """Solve and reweight until the weights hardly change. Raises CalibrationError."""
    offset, design = basis.at(problem.encoded)
    if problem.subtracted is not None:
        subtracted_offset, subtracted_design = basis.at(problem.subtracted)
        offset, design = offset - subtracted_offset, design - subtracted_design

    prior = _prior(problem, basis)
    for _ in range(most_rounds):
        curves, by_channel, shared = _solve(problem, basis, prior, offset, design)
        if problem.update(curves, by_channel, shared) < SETTLED_WEIGHTS:
            return Status.CONVERGED
    return Status.LIMIT


@dataclass(frozen=True, eq=False)
class _Prior:
    """The prior of the θ of all three channels and of s, which is the same in all rounds of a fit.

    of_curves: (3 m, 3 m), shift: (3 m,): the prior θ'·of_curves·θ − 2 shift·θ; of_shared: (p, p), the precision of s;
    rising (3 c, 3 m) θ ≥ least (3 c,): the curves rise.
    """

    of_curves: Array
    shift: Array
    of_shared: Array
    rising: Array
    least: Array


def _prior(problem: Problem, basis: CurveBasis) -> _Prior:
    """The prior of each channel's curve, and what ties the channels together."""
    ties, of_shared = problem.prior(basis)
    return _Prior(
        np.asarray(np.kron(np.eye(3), basis.precision) + ties.T @ ties),
        np.tile(basis.shift, 3),
        of_shared,
        np.asarray(np.kron(np.eye(3), basis.rising)),
        np.tile(basis.least, 3),
    )


def _solve(
    problem: Problem, basis: CurveBasis, prior: _Prior, offset: Array, design: Array
) -> tuple[Array, Array, Array]:
    """The curves (k, 3), m (3, q) and s (p,) of one round."""
    model, precision = problem.linear_model(), problem.precision()
    curve_count, channel_count, shared_count = design.shape[2], model.by_channel.shape[2], model.shared.shape[2]
    # The unknowns are θ of all channels, m of all channels, and s.
    end_of_curves = 3 * curve_count
    end_of_channels = end_of_curves + 3 * channel_count
    unknowns = end_of_channels + shared_count
    normal, right = np.zeros((unknowns, unknowns)), np.zeros(unknowns)

    # The data term of each channel, which has only s in common with the others
    for channel in range(3):
        columns = np.hstack([design[:, channel], -model.by_channel[:, channel], -model.shared[:, channel]])
        weighted = columns * precision[:, [channel]]
        of_curve = curve_count * channel + np.arange(curve_count)
        of_channel = end_of_curves + channel_count * channel + np.arange(channel_count)
        places = np.concatenate([of_curve, of_channel, np.arange(end_of_channels, unknowns)])
        normal[places[:, None], places] += weighted.T @ columns
        right[places] += weighted.T @ (model.known[:, channel] - offset[:, channel])
        normal[of_channel, of_channel] += CHANNEL_RIDGE * precision[:, channel].sum()

    normal[:end_of_curves, :end_of_curves] += prior.of_curves
    right[:end_of_curves] += prior.shift
    normal[end_of_channels:, end_of_channels:] += prior.of_shared
    rising = np.pad(prior.rising, ((0, 0), (0, unknowns - end_of_curves)))
    solution = solve_lsi(normal, right, rising, prior.least)

    of_curves, of_channels, of_shared = np.split(solution, [end_of_curves, end_of_channels])
    curves = basis.offset[:, None] + basis.design @ of_curves.reshape(3, curve_count).T
    return np.maximum.accumulate(curves), of_channels.reshape(3, channel_count), of_shared


class ToneWeights:
    """Weights of samples by their residuals, each compared with those of samples of like tone.

    The median residual of all tones would be that of dark colours, which are many, so that bright ones, whose residuals
    are larger, would lose all weight; and a tone with n samples has the weight n^(1 − weighting), so that many dark
    exposures do not outweigh few bright ones. The loss is Cauchy's, whose weights are never 0: a loss that ignores
    colours altogether can ignore all coloured samples in favour of a perfect fit of greys, which is possible with any
    matrix.

    tone: mean JPEG value (n,); odds: prior weight (n,), such as by saturation. A sample counts half at a residual of
    `multiple` times the median of like tones, and of `least` at least (1 = full scale).
    """

    def __init__(
        self, tone: Array, odds: Array, weighting: float = 0.5, multiple: float = 2.0, least: float = 0.5 / 255.0
    ) -> None:
        self.tone = tone
        self.odds = odds
        self.multiple = multiple
        self.least = least
        self.order = np.argsort(tone)
        self.levels: Array = np.linspace(tone.min(), tone.max() + 1e-9, TONE_LEVELS)
        self.ranges = self._ranges()

        # A smoothed histogram of tones, in which no tone is so rare that a few samples have all the weight
        counts = np.histogram(tone, TONE_LEVELS, (0.0, 1.0), weights=odds)[0] + odds.sum() / (4 * TONE_LEVELS)
        counts = np.convolve(np.pad(counts, 1, mode="edge"), [0.25, 0.5, 0.25], "valid")
        rareness = np.interp(tone, (np.arange(TONE_LEVELS) + 0.5) / TONE_LEVELS, counts) ** -weighting
        self.prior = odds * rareness / np.average(rareness, weights=odds)

    def __call__(self, residual: Array) -> Array:
        """The weights (n,) of the next round, by the residuals (n,) of this one."""
        odds, values = self.odds[self.order], residual[self.order]
        medians = [weighted_median(values[low:high], odds[low:high]) for low, high in self.ranges]
        scale = np.maximum(self.multiple * np.array(medians), self.least)
        return self.prior * cauchy(residual / np.interp(self.tone, self.levels, scale))

    def _ranges(self) -> list[tuple[int, int]]:
        """Around each level the first and the last of the samples in order of tone: enough to weigh eight in all."""
        tone = self.tone[self.order]
        mass = np.concatenate([[0.0], np.cumsum(self.odds[self.order])])
        half, enough = 0.5 * (self.levels[1] - self.levels[0]), min(ENOUGH_OF_TONE, mass[-1])
        ranges = []
        for level in self.levels:
            low, high = np.searchsorted(tone, [level - half, level + half])
            if mass[high] - mass[low] < enough:
                start = min(max(0.5 * (mass[low] + mass[high] - enough), 0.0), mass[-1] - enough)
                low, high = np.searchsorted(mass, [start, start + enough])
                low, high = min(low, len(tone) - 1), min(high, len(tone))
            ranges.append((int(low), int(max(high, low + 1))))
        return ranges
