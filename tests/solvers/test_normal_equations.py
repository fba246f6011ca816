"""W'W and W'y against the dense matrices."""

import numpy as np
import pytest

from lutforge.interpolation import INTERPOLATIONS, Interpolation
from lutforge.solvers.normal_equations import normal_equations
from tests.solvers.dense_lattice import interpolation_weights, random_levels


@pytest.mark.parametrize("method", INTERPOLATIONS)
@pytest.mark.parametrize("weighted", [False, True])
def test_equals_the_dense_matrices(method: Interpolation, weighted: bool) -> None:
    rng = np.random.default_rng(3)
    size = (4, 5, 6)
    levels = random_levels(rng, size)
    x, y = rng.uniform(-0.1, 1.1, (300, 3)), rng.random((300, 3))
    x[:8] = np.array([[i, j, k] for i in (0, 1) for j in (0, 1) for k in (0, 1)])  # the corners themselves
    x[8:20] = np.stack([axis[rng.integers(0, len(axis), 12)] for axis in levels], axis=1)  # and nodes
    omega = rng.random(300) if weighted else None
    found = normal_equations(x, y, levels, method, omega)

    weights = interpolation_weights(x, levels, method)
    scaled = weights if omega is None else weights * omega[:, None]
    np.testing.assert_allclose(found.matrix.toarray(), weights.T @ scaled, atol=1e-12)
    np.testing.assert_allclose(found.right.reshape(-1, 3), scaled.T @ y, atol=1e-12)


@pytest.mark.parametrize("method", INTERPOLATIONS)
def test_many_samples_are_summed_as_a_few_are(method: Interpolation) -> None:
    """The threaded assembly of a large sample set, sample by sample in one's own words."""
    rng = np.random.default_rng(4)
    levels = random_levels(rng, (7, 6, 5))
    x, y = rng.random((200_000, 3)) ** 3, rng.random((200_000, 3))
    whole = normal_equations(x, y, levels, method)
    parts = [
        normal_equations(x[start : start + 999], y[start : start + 999], levels, method)
        for start in range(0, len(x), 999)
    ]
    np.testing.assert_allclose(
        whole.matrix.toarray(), sum(part.matrix.toarray() for part in parts), rtol=1e-11, atol=1e-9
    )
    np.testing.assert_allclose(whole.right, sum(part.right for part in parts), rtol=1e-11, atol=1e-9)
    assert whole.matrix.sum() == pytest.approx(len(x))  # the weights of a sample sum to 1
