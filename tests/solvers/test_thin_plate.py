"""The thin-plate penalty: its integral by quadrature, and the functions for which it is 0."""

import numpy as np

from lutforge.arrays import Array
from lutforge.solvers.cross_validation import joined_alike
from lutforge.solvers.penalties import thin_plate


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


def test_thin_plate_is_the_integral_of_all_squared_second_derivatives() -> None:
    rng = np.random.default_rng(1)
    size = (3, 5, 4)
    b = rng.normal(size=(2, *size))
    total = np.zeros(2)
    for one in range(3):
        for two in range(3):
            orders = np.bincount([one, two], minlength=3)
            vr, wr = basis(size[0], int(orders[0]))
            vg, wg = basis(size[1], int(orders[1]))
            vb, wb = basis(size[2], int(orders[2]))
            derivative = np.einsum("ai,bj,ck,dijk->dabc", vr, vg, vb, b)
            total += np.einsum("a,b,c,dabc->d", wr, wg, wb, derivative**2)
    plate = thin_plate(size)
    np.testing.assert_allclose(np.einsum("dijk,dijk->d", b, plate(b)), total, rtol=1e-10)


def test_groups_that_are_copies_or_a_burst_are_one() -> None:
    rng = np.random.default_rng(0)
    scenes = [rng.uniform(0.0, 255.0, (300, 3)) for _ in range(3)]
    noisy = [scenes[0] + rng.normal(0.0, 1.0, (300, 3)) for _ in range(2)]
    points = np.concatenate([*scenes, scenes[1], noisy[0][:200], noisy[1][100:]])
    names = np.repeat(["a", "b", "c", "copy of b", "burst 1", "burst 2"], [300, 300, 300, 300, 200, 200])
    expected = {"a": "a", "b": "b", "c": "c", "copy of b": "b", "burst 1": "a", "burst 2": "a"}
    joined = joined_alike(names, points, lambda a, b: False)
    assert dict(zip(names.tolist(), joined.tolist(), strict=True)) == expected

    joined = joined_alike(names, points, lambda a, b: {a, b} == {"a", "c"})
    assert dict(zip(names.tolist(), joined.tolist(), strict=True)) == expected | {"c": "a"}
