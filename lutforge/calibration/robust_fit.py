"""The one robust fit behind response, matrix, white balances and gains.

Of every colour the curve t(f⁻¹(I)) is linear in a basis (`curve_basis`; t is the identity or the logarithm), and the
light that it stands for is linear in all that is not known besides: rows of a matrix, gains of shots and settings,
errors of shutters. So each round minimizes, over samples n and channels c,

    Σ p_nc (offset(I_nc) + basis(I_nc) θ_c − known_nc − own_nc m_c − shared_nc s)² + the priors of θ and s

under the inequalities that make f⁻¹ rise. For an exposure pair the curve at I stands minus the curve at I'. What enters
as columns says what is fitted; rounds weigh the samples anew by their residuals (IRLS).
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from lutforge.arrays import Array
from lutforge.calibration.curve_basis import CurveBasis
from lutforge.solvers.inequality_least_squares import solve_lsi
from lutforge.solvers.robust_weights import cauchy, weighted_median
from lutforge.solvers.solution import Status


@dataclass(frozen=True, eq=False)
class Light:
    """The design of the light of n samples. known: (n, 3); own: (n, 3, q); shared: (n, 3, p)."""

    known: Array
    own: Array
    shared: Array


class Problem(Protocol):
    """What a front end hands to the fit, and learns from each round."""

    encoded: Array
    """(n, 3) JPEG values."""
    before: Array | None
    """(n, 3) JPEG values whose curve is subtracted, for exposure pairs."""

    def light(self) -> Light:
        """The design of the next round."""

    def precision(self) -> Array:
        """(n, 3), how much each value counts in the next round."""

    def prior(self, basis: CurveBasis) -> tuple[Array, Array]:
        """Return rows (r, 3 m) whose products with the θ of all channels are 0 ± 1, and the precision of s (p, p)."""

    def update(self, curves: Array, own: Array, shared: Array) -> float:
        """Take the curves (k, 3), m (3, q) and s (p,) of a round; return the relative change of the weights."""


def robust_fit(problem: Problem, basis: CurveBasis, most_rounds: int = 20) -> Status:
    """Solve and reweight until the weights hardly change. Raises CalibrationError."""
    offset, design = basis.at(problem.encoded)
    if problem.before is not None:
        less_offset, less_design = basis.at(problem.before)
        offset, design = offset - less_offset, design - less_design
    prior = _prior(problem, basis)
    for _ in range(most_rounds):
        curves, own, shared = _solve(problem, basis, prior, offset, design)
        if problem.update(curves, own, shared) < 2e-3:
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
    light, precision = problem.light(), problem.precision()
    count, free, common = design.shape[2], light.own.shape[2], light.shared.shape[2]
    curved, channelwise = 3 * count, 3 * (count + free)
    unknowns = channelwise + common
    normal, right = np.zeros((unknowns, unknowns)), np.zeros(unknowns)

    # The data term of each channel, which shares with the others only s
    for channel in range(3):
        columns = np.hstack([design[:, channel], -light.own[:, channel], -light.shared[:, channel]])
        weighted = columns * precision[:, [channel]]
        of_own = curved + free * channel + np.arange(free)
        place = np.concatenate([count * channel + np.arange(count), of_own, np.arange(channelwise, unknowns)])
        normal[place[:, None], place] += weighted.T @ columns
        right[place] += weighted.T @ (light.known[:, channel] - offset[:, channel])
        normal[of_own, of_own] += 1e-9 * precision[:, channel].sum()

    normal[:curved, :curved] += prior.of_curves
    right[:curved] += prior.shift
    normal[channelwise:, channelwise:] += prior.of_shared
    rising = np.pad(prior.rising, ((0, 0), (0, unknowns - curved)))
    solution = solve_lsi(normal, right, rising, prior.least)

    curves = basis.offset[:, None] + basis.design @ solution[:curved].reshape(3, count).T
    own = solution[curved:channelwise].reshape(3, free)
    return np.maximum.accumulate(curves), own, solution[channelwise:]


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
        self.tone, self.odds, self.multiple, self.least = tone, odds, multiple, least
        self.order = np.argsort(tone)
        counts = np.histogram(tone, 16, (0.0, 1.0), weights=odds)[0] + odds.sum() / 64
        counts = np.convolve(np.pad(counts, 1, mode="edge"), [0.25, 0.5, 0.25], "valid")
        rare = np.interp(tone, (np.arange(16) + 0.5) / 16, counts) ** -weighting
        self.prior = odds * rare / np.average(rare, weights=odds)
        self.levels: Array = np.linspace(tone.min(), tone.max() + 1e-9, 16)
        self.ranges = self._ranges()

    def __call__(self, residual: Array) -> Array:
        """(n,): for the next round, of the residuals (n,) of this one."""
        odds, values = self.odds[self.order], residual[self.order]
        medians = [weighted_median(values[low:high], odds[low:high]) for low, high in self.ranges]
        scale = np.maximum(self.multiple * np.array(medians), self.least)
        return self.prior * cauchy(residual / np.interp(self.tone, self.levels, scale))

    def _ranges(self) -> list[tuple[int, int]]:
        """Around each level the first and the last of the samples in order of tone: enough to weigh eight in all."""
        tone = self.tone[self.order]
        mass = np.concatenate([[0.0], np.cumsum(self.odds[self.order])])
        half, enough = 0.5 * (self.levels[1] - self.levels[0]), min(8.0, mass[-1])
        ranges = []
        for level in self.levels:
            low, high = np.searchsorted(tone, [level - half, level + half])
            if mass[high] - mass[low] < enough:
                start = min(max(0.5 * (mass[low] + mass[high] - enough), 0.0), mass[-1] - enough)
                low, high = np.searchsorted(mass, [start, start + enough])
                low, high = min(low, len(tone) - 1), min(high, len(tone))
            ranges.append((int(low), int(max(high, low + 1))))
        return ranges
