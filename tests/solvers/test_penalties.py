"""The smoothness terms: what they vanish on, and their integrals by quadrature."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from lutforge.solvers.penalties import keys_cubic, second_difference, thin_plate

Array = NDArray[np.float64]


@given(st.integers(0, 2**32), st.integers(3, 40))
def test_second_difference_vanishes_on_linear_functions_of_uneven_levels(seed: int, count: int) -> None:
    rng = np.random.default_rng(seed)
    levels = np.cumsum(rng.uniform(1e-4, 1.0, count))
    slope, offset = rng.normal(size=2)
    rows = second_difference(levels)
    assert rows.shape == (count - 2, count)
    np.testing.assert_allclose(rows @ (slope * levels + offset), 0, atol=1e-12 * count)
    assert np.all(np.diagonal(rows, 1) == 1.0)
    assert np.all(np.abs(rows @ levels**2) > 0)


def test_second_difference_as_the_thesis_writes_it() -> None:
    # d12 = 1, d23 = 3
    np.testing.assert_allclose(second_difference(np.array([0.0, 1.0, 4.0])), [[-0.75, 1.0, -0.25]])


def keys(t: Array, order: int) -> Array:
    """Keys' kernel, a = −1/2, or its first or second derivative (Keys 1981, equation 15), unit spacing."""
    near = np.polynomial.Polynomial([1.0, 0.0, -2.5, 1.5]).deriv(order)
    far = np.polynomial.Polynomial([2.0, -4.0, 2.5, -0.5]).deriv(order)
    s = np.abs(t)
    value = np.where(s < 1, near(s), np.where(s < 2, far(s), 0.0))
    return value * np.sign(t) ** order if order == 1 else value


def extended(count: int) -> Array:
    """(count + 2, count): node values with one more at each end, by linear extrapolation."""
    rows = np.zeros((count + 2, count))
    rows[1:-1] = np.eye(count)
    rows[0, :2] = 2.0, -1.0
    rows[-1, -2:] = -1.0, 2.0
    return rows


def basis(count: int, order: int) -> tuple[Array, Array]:
    """Basis functions at Gauss points of every cell (points, count) and the weights of the points."""
    points, weights = np.polynomial.legendre.leggauss(5)
    t = (np.arange(count - 1)[:, None] + 0.5 + 0.5 * points).ravel()
    return keys(t[:, None] - np.arange(-1, count + 1), order) @ extended(count), np.tile(weights / 2, count - 1)


def test_keys_integrals_by_gauss_quadrature() -> None:
    for order, gram in enumerate(keys_cubic(6)):
        values, weights = basis(6, order)
        np.testing.assert_allclose(gram, values.T @ (weights[:, None] * values), atol=1e-12)


def test_thin_plate_is_the_integral_of_all_squared_second_derivatives() -> None:
    rng = np.random.default_rng(1)
    size = (3, 5, 4)
    b = rng.normal(size=(2, *size))
    total = np.zeros(2)
    for one in range(3):
        for two in range(3):
            orders = np.bincount([one, two], minlength=3)
            (vr, wr), (vg, wg), (vb, wb) = (basis(n, int(order)) for n, order in zip(size, orders, strict=True))
            derivative = np.einsum("ai,bj,ck,dijk->dabc", vr, vg, vb, b)
            total += np.einsum("a,b,c,dabc->d", wr, wg, wb, derivative**2)
    plate = thin_plate(size)
    np.testing.assert_allclose(np.einsum("dijk,dijk->d", b, plate(b)), total, rtol=1e-10)


def test_thin_plate_is_symmetric_and_positive_and_vanishes_on_linear_functions() -> None:
    size = (4, 3, 5)
    plate = thin_plate(size)
    count = int(np.prod(size))
    dense = plate(np.eye(count).reshape(count, *size)).reshape(count, count)
    np.testing.assert_allclose(dense, dense.T, atol=1e-12)
    np.testing.assert_allclose(plate.diagonal().ravel(), np.diag(dense), atol=1e-12)
    values = np.linalg.eigvalsh(dense)
    assert values[0] > -1e-12
    assert np.sum(values < 1e-9) == 4  # 1, r, g, b and nothing else
    r, g, b = np.meshgrid(*(np.arange(n, dtype=float) for n in size), indexing="ij")
    flat = np.stack([np.ones(size), r, g, b, 1 + 2 * r - 3 * g + b])
    np.testing.assert_allclose(plate(flat), 0, atol=1e-11)
    assert np.abs(plate(r * g)).max() > 0.01
