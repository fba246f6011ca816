"""The operator of a 27-point stencil against its dense matrix."""

import numpy as np
import pytest

from lutforge.interpolation import INTERPOLATIONS, Interpolation
from lutforge.solvers.conjugate_gradients import conjugate_gradients
from lutforge.solvers.normal_equations import FOLLOWING, normal_equations
from lutforge.solvers.stencil import StencilOperator, from_planar, planar


@pytest.mark.parametrize("method", INTERPOLATIONS)
def test_the_solution_is_that_of_the_dense_matrix(method: Interpolation) -> None:
    rng = np.random.default_rng(4)
    levels = (np.linspace(0, 1, 5), np.linspace(0, 1, 5) ** 2, np.linspace(0, 1, 5) ** 0.5)
    x, y = rng.random((3000, 3)), rng.normal(size=(3000, 3))
    equations = normal_equations(x, y, levels, method, rng.uniform(0.1, 1.0, 3000))
    stencil = equations.stencil.copy()
    stencil[0] += 0.1
    dense = np.zeros((7, 7, 7, 7, 7, 7))
    for index in np.ndindex(5, 5, 5):
        i, j, k = (place + 1 for place in index)
        for t in range(FOLLOWING):
            other = (i + (t + 13) // 9 - 1, j + (t + 13) // 3 % 3 - 1, k + (t + 13) % 3 - 1)
            dense[(i, j, k, *other)] = dense[(*other, i, j, k)] = stencil[(t, *index)]
    inside = dense[1:-1, 1:-1, 1:-1, 1:-1, 1:-1, 1:-1].reshape(125, 125)
    wanted = np.linalg.solve(inside, equations.right.reshape(125, 3)).reshape(5, 5, 5, 3)
    solution = conjugate_gradients(StencilOperator(stencil), planar(equations.right), tolerance=1e-9)
    found = from_planar(solution.value, (5, 5, 5))
    assert solution.converged
    np.testing.assert_allclose(found, wanted, atol=1e-5 * np.abs(wanted).max())  # its stencil is float32
