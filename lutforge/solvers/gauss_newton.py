"""Damped Gauss-Newton (Levenberg-Marquardt) for many small independent nonlinear least-squares problems at once.

Each problem has k unknowns within bounds, and m residuals r(x). A step solves (J'J + μ D) δ = −J'r, where D is the mean
of the diagonal of J'J, in the unknowns that are not held at a bound by the gradient; x + δ is cut to the bounds. A step
that brings the cost ‖r‖² down is taken and μ shrinks; else μ grows and the step is tried again. Nocedal & Wright,
Numerical Optimization (2006), section 10.3; Marquardt (1963), https://doi.org/10.1137/0111030.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lutforge.arrays import Array, Mask
from lutforge.compiled import compiled
from lutforge.solvers.solution import Status
from lutforge.threads import run, shares

Index = NDArray[np.intp]
Linearize = Callable[[Array, Index], tuple[Array, Array]]
"""Residuals (a, m) and their slopes (a, m, k) of the problems `which` (a,), at unknowns (a, k)."""


@dataclass(frozen=True, eq=False)
class Minima:
    """The minima that were found, one a problem.

    value: (n, k); residual: ‖r‖ there, (n,); converged: (n,), whether the last step changed the cost by less than the
    tolerance, or the residual vanished; iterations: steps that the slowest problem took.
    """

    value: Array
    residual: Array
    converged: Mask
    iterations: int

    @property
    def status(self) -> Status:
        """How the search ended, for all problems together."""
        return Status.CONVERGED if np.all(self.converged) else Status.LIMIT


def gauss_newton(
    linearize: Linearize,
    start: Array,
    *,
    lower: ArrayLike = -np.inf,
    upper: ArrayLike = np.inf,
    damping: float = 1e-4,
    tolerance: float = 1e-7,
    small: float = 1e-12,
    most: int = 50,
) -> Minima:
    """Local minima of ‖r(x)‖² within bounds, from unknowns `start` (n, k).

    lower, upper: bounds, broadcast to (n, k); damping: the first μ; tolerance: relative change of the cost that ends a
    search; small: cost below which the residual counts as vanished; most: steps at most, tried ones included.
    A problem whose damping grows until no step helps has converged, too: its minimum is reached to rounding.
    """
    value = np.clip(np.ascontiguousarray(start, dtype=np.float64), lower, upper)
    low, high = (np.broadcast_to(np.asarray(bound, dtype=np.float64), value.shape).copy() for bound in (lower, upper))
    residual, slope = linearize(value, np.arange(len(value)))
    cost = np.einsum("nm,nm->n", residual, residual)
    mu, converged = np.full(len(value), damping), cost <= small
    active, iterations = np.flatnonzero(~converged), 0
    residual, slope = residual[active], slope[active]
    while len(active) and iterations < most:
        iterations += 1
        trial = np.empty((len(active), value.shape[1]))
        step_some = partial(_step, active, residual, slope, value, mu, low, high, trial)
        run(step_some, shares(len(active), 4096))  # fewer take less time than to hand them to a thread
        tried, steep = linearize(trial, active)
        remaining = _judge(active, trial, tried, steep, tolerance, small, value, residual, slope, cost, mu, converged)
        active, residual, slope = active[:remaining], residual[:remaining], slope[:remaining]
    return Minima(value, np.sqrt(cost), converged, iterations)


@compiled()
def _step(
    active: Index,
    residual: Array,
    slope: Array,
    value: Array,
    mu: Array,
    low: Array,
    high: Array,
    trial: Array,
    first: int,
    last: int,
) -> None:
    """Fill trial (a, k), where one damped step leads each problem within its bounds, by a factorization.

    residual, slope: of the problems `active` (a,), of which first … last − 1 are stepped; the others: of all.
    """
    unknowns = slope.shape[2]
    square, step = np.empty((unknowns, unknowns)), np.empty(unknowns)
    for a in range(first, last):
        n = active[a]
        _normal_equations(residual[a], slope[a], mu[n], square, step)
        for p in range(unknowns):
            if (value[n, p] <= low[n, p] and step[p] < 0.0) or (value[n, p] >= high[n, p] and step[p] > 0.0):
                step[p] = 0.0  # it stays at its bound, whatever the others do
                square[p, :p] = 0.0
                square[p + 1 :, p] = 0.0
        _solve(square, step)
        for p in range(unknowns):
            trial[a, p] = min(max(value[n, p] + step[p], low[n, p]), high[n, p])


@compiled()
def _judge(
    active: Index,
    trial: Array,
    tried: Array,
    steep: Array,
    tolerance: float,
    small: float,
    value: Array,
    residual: Array,
    slope: Array,
    cost: Array,
    mu: Array,
    converged: Mask,
) -> int:
    """Take the steps that help, of the problems `active` (a,), and adapt the damping.

    Those that go on are moved to the front of active, residual and slope; returned is how many they are.
    """
    remaining, (rows, unknowns) = 0, slope.shape[1:]
    for a in range(len(active)):
        n, reached = active[a], 0.0
        for r in range(rows):
            reached += tried[a, r] ** 2
        better, before = reached < cost[n], cost[n]
        if better:
            value[n], cost[n] = trial[a], reached
            mu[n] *= 0.1
        else:
            mu[n] = 10.0 * max(mu[n], 1e-12)
        done = (reached >= (1.0 - tolerance) * before or reached <= small) if better else mu[n] * tolerance > 10.0
        converged[n] = done
        if done:
            continue
        active[remaining] = n
        for r in range(rows):
            residual[remaining, r] = tried[a, r] if better else residual[a, r]
            for p in range(unknowns):
                slope[remaining, r, p] = steep[a, r, p] if better else slope[a, r, p]
        remaining += 1
    return remaining


@compiled()
def _normal_equations(residual: Array, slope: Array, mu: float, square: Array, right: Array) -> None:
    """Fill the lower triangle of J'J + μ D, and −J'r, of one problem."""
    rows, unknowns = slope.shape
    scale = 0.0
    for p in range(unknowns):
        total = 0.0
        for r in range(rows):
            total -= slope[r, p] * residual[r]
        right[p] = total
        for q in range(p + 1):
            total = 0.0
            for r in range(rows):
                total += slope[r, p] * slope[r, q]
            square[p, q] = total
        scale += square[p, p]
    for p in range(unknowns):
        square[p, p] += mu * scale / unknowns + 1e-300


@compiled()
def _solve(square: Array, step: Array) -> None:
    """Solve square · δ = step in place, by factors L D L': below the diagonal is L D, on it 1 / D."""
    unknowns = len(step)
    for p in range(unknowns):  # factor and substitute forward
        for q in range(p):
            for k in range(q):
                square[p, q] -= square[p, k] * square[q, k] * square[k, k]
            share = square[p, q] * square[q, q]
            step[p] -= share * step[q]
            square[p, p] -= share * square[p, q]
        square[p, p] = 1.0 / max(square[p, p], 1e-300)
    for p in range(unknowns - 1, -1, -1):
        for q in range(p + 1, unknowns):
            step[p] -= square[q, p] * step[q]
        step[p] *= square[p, p]
