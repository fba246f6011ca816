"""Damped Gauss-Newton (Levenberg-Marquardt) for many small independent nonlinear least-squares problems at once.

Each problem has k unknowns within bounds, and m residuals r(x). A step solves (J'J + μ D) δ = −J'r, where D is the mean
of the diagonal of J'J, in the unknowns that are not held at a bound by the gradient; x + δ is cut to the bounds. A step
that brings the cost ‖r‖² down is taken and μ shrinks; else μ grows and the step is tried again. Nocedal & Wright,
Numerical Optimization (2006), section 10.3; Marquardt (1963), https://doi.org/10.1137/0111030.
"""

from collections.abc import Callable
from dataclasses import dataclass

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
    low, high = (np.broadcast_to(np.asarray(bound, dtype=np.float64), value.shape) for bound in (lower, upper))
    residual, slope = linearize(value, np.arange(len(value)))
    cost = np.einsum("nm,nm->n", residual, residual)
    mu, converged = np.full(len(value), damping), cost <= small
    active, iterations = np.flatnonzero(~converged), 0
    residual, slope = residual[active], slope[active]
    while len(active) and iterations < most:
        iterations += 1
        trial = _steps(residual, slope, value[active], mu[active], low[active], high[active])
        tried, steep = linearize(trial, active)
        reached = np.einsum("nm,nm->n", tried, tried)
        before = cost[active]
        better = reached < before
        taken = active[better]
        value[taken], cost[taken] = trial[better], reached[better]
        residual[better], slope[better] = tried[better], steep[better]
        mu[active] = np.where(better, 0.1 * mu[active], 10.0 * np.maximum(mu[active], 1e-12))
        done = np.where(better, (reached >= (1.0 - tolerance) * before) | (reached <= small), mu[active] > 1e8)
        converged[active[done]] = True
        active, residual, slope = active[~done], residual[~done], slope[~done]
    return Minima(value, np.sqrt(cost), converged, iterations)


def _steps(residual: Array, slope: Array, value: Array, mu: Array, low: Array, high: Array) -> Array:
    """Return where one damped step leads each problem, (a, k), within its bounds."""
    trial = np.empty_like(value)
    run(
        lambda first, last: _step(residual, slope, value, mu, low, high, trial, first, last),
        shares(len(value), 4096),  # fewer take less time than to hand them to a thread
    )
    return trial


@compiled()
def _step(
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
    """Fill trial (a, k) for the problems first … last − 1, by a Cholesky factorisation of each."""
    unknowns = slope.shape[2]
    square, step = np.empty((unknowns, unknowns)), np.empty(unknowns)
    for n in range(first, last):
        _normal_equations(residual[n], slope[n], mu[n], square, step)
        for p in range(unknowns):
            if (value[n, p] <= low[n, p] and step[p] < 0.0) or (value[n, p] >= high[n, p] and step[p] > 0.0):
                step[p] = 0.0  # it stays at its bound, whatever the others do
                square[p, :p] = 0.0
                square[p + 1 :, p] = 0.0
        _solve(square, step)
        for p in range(unknowns):
            trial[n, p] = min(max(value[n, p] + step[p], low[n, p]), high[n, p])


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
        scale += square[p, p] / unknowns
    for p in range(unknowns):
        square[p, p] += mu * scale + 1e-300


@compiled()
def _solve(square: Array, step: Array) -> None:
    """Solve square · δ = step in place, by Cholesky factors of the lower triangle."""
    unknowns = len(step)
    for p in range(unknowns):  # factor and substitute forward
        for q in range(p):
            total = square[p, q]
            for k in range(q):
                total -= square[p, k] * square[q, k]
            square[p, q] = total / square[q, q]
            step[p] -= square[p, q] * step[q]
            square[p, p] -= square[p, q] ** 2
        square[p, p] = np.sqrt(max(square[p, p], 1e-300))
        step[p] /= square[p, p]
    for p in range(unknowns - 1, -1, -1):
        for q in range(p + 1, unknowns):
            step[p] -= square[q, p] * step[q]
        step[p] /= square[p, p]
