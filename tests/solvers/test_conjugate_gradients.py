"""Conjugate gradients on dense systems: the solution, and how it is said that there is none."""

from dataclasses import dataclass

import numpy as np
import pytest
from numpy.typing import NDArray

from lutforge.solvers.conjugate_gradients import conjugate_gradients
from lutforge.solvers.solution import Status

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Dense:
    """One matrix for all systems, with its diagonal as the preconditioner."""

    matrix: Array
    threads: int = 1

    def product(self, b: Array, out: Array) -> None:
        out[:] = b @ self.matrix

    def precondition(self, residual: Array) -> Array:
        return residual / np.diag(self.matrix)


def system(count: int = 40) -> tuple[Dense, Array]:
    rng = np.random.default_rng(0)
    factor = rng.normal(size=(count, count))
    return Dense(factor @ factor.T + np.diag(rng.uniform(1, 100, count))), rng.normal(size=(3, count))


@pytest.mark.parametrize("warm", [False, True])
def test_solves_every_system(warm: bool) -> None:
    operator, right = system()
    wanted: Array = np.asarray(np.linalg.solve(operator.matrix, right.T).T, dtype=np.float64)
    start = wanted + 1e-3 if warm else None
    solution = conjugate_gradients(operator, right, start, tolerance=1e-12)
    assert solution.converged and solution.residual <= 1e-12
    np.testing.assert_allclose(solution.value, wanted, atol=1e-10)
    assert conjugate_gradients(operator, right, wanted, tolerance=1e-9).iterations == 0


def test_the_limit_is_a_status_and_nan_is_another() -> None:
    operator, right = system()
    solution = conjugate_gradients(operator, right, tolerance=1e-12, most=3)
    assert solution.status is Status.LIMIT and solution.iterations == 3 and solution.residual > 1e-12
    broken = conjugate_gradients(Dense(np.full((40, 40), np.nan)), right, tolerance=1e-12)
    assert broken.status is Status.SINGULAR
