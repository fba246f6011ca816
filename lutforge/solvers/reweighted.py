"""Iteratively reweighted least squares (Holland & Welsch 1977, https://doi.org/10.1080/03610927708827533)."""

from collections.abc import Callable
from typing import TypeVar

from lutforge.arrays import Array

Fit = TypeVar("Fit")


def reweighted(solve: Callable[[Array], Fit], weights: Callable[[Fit], Array], weight: Array, rounds: int) -> Fit:
    """Solve with weights (n,), weigh the samples anew by what came out, and solve again.

    solve: of the weights, a fit; weights: of a fit, the weights of the next round; weight: of the first round; rounds:
    number of solves, at least 1.
    """
    fit = solve(weight)
    for _ in range(rounds - 1):
        fit = solve(weights(fit))
    return fit
