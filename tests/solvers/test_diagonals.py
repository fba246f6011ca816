"""The product of a matrix stored by diagonals with several vectors, compared with SciPy's."""

import numpy as np
import pytest
from scipy import sparse

from lutforge.solvers.diagonals import STRETCH, product


@pytest.mark.parametrize("count", [1, 5, STRETCH, 3 * STRETCH + 7, 40_000])
@pytest.mark.parametrize("steps", [(0,), (-1, 0, 1), (-1090, -33, 0, 33, 1090)])
def test_as_scipy(count: int, steps: tuple[int, ...]) -> None:
    rng = np.random.default_rng(count)
    within = [step for step in steps if abs(step) < count]
    lines = [rng.standard_normal(count - abs(step)) for step in within]
    matrix = sparse.diags_array(lines, offsets=within, shape=(count, count))
    diagonal, vectors = rng.standard_normal((2, 3, count))
    expected = np.stack([matrix @ vector for vector in vectors]) + diagonal * vectors
    assert product(matrix, diagonal, vectors) == pytest.approx(expected, rel=1e-12, abs=1e-12)
