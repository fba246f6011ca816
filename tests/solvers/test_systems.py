"""Solvers of systems, searches of minima, folds and robust weights: against NumPy, scipy, and what is known."""

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from lutforge.arrays import Array
from lutforge.errors import CalibrationError
from lutforge.interpolation import INTERPOLATIONS, Interpolation, Levels, interpolate
from lutforge.model.lattice import grid, uniform_levels
from lutforge.solvers.cross_validation import joined_alike, leave_groups_out, leave_samples_out, predict_held_out
from lutforge.solvers.gauss_newton import Index, gauss_newton
from lutforge.solvers.inequality_least_squares import solve_lsi
from lutforge.solvers.lattice_regression import Prior, Regularization, fit_lattice
from lutforge.solvers.normal_equations import normal_equations
from lutforge.solvers.penalties import thin_plate
from lutforge.solvers.robust_weights import Loss, RobustWeights, cauchy, geman_mcclure, lawson, weighted_median
from lutforge.solvers.solution import Status

# --- Damped Gauss-Newton against minima that are known, many problems at once -----------------------------------------


def rosenbrock(x: Array, which: Index) -> tuple[Array, Array]:
    """Residuals (10 (x₂ − x₁²), 1 − x₁), whose minimum 0 lies at (1, 1), at the end of a bent valley."""
    residual = np.stack([10 * (x[:, 1] - x[:, 0] ** 2), 1 - x[:, 0]], axis=1)
    slope = np.zeros((len(x), 2, 2))
    slope[:, 0, 0], slope[:, 0, 1], slope[:, 1, 0] = -20 * x[:, 0], 10.0, -1.0
    return residual, slope


def test_every_problem_reaches_its_minimum() -> None:
    start = np.random.default_rng(0).uniform(-2, 2, (300, 2))
    minima = gauss_newton(rosenbrock, start, most=200)
    assert minima.converged.all() and minima.status is Status.CONVERGED
    np.testing.assert_allclose(minima.value, 1.0, atol=1e-5)


def test_bounds_hold_and_the_rest_is_minimal_there() -> None:
    start = np.random.default_rng(1).uniform(-2, 2, (50, 2))
    minima = gauss_newton(rosenbrock, start, lower=(-2.0, -2.0), upper=(0.5, 2.0), most=200)
    assert minima.converged.all()
    np.testing.assert_allclose(minima.value, [[0.5, 0.25]] * 50, atol=1e-6)
    np.testing.assert_allclose(minima.residual, 0.5, atol=1e-6)


def test_problems_have_data_of_their_own_and_unequal_lengths_of_search() -> None:
    """Fits of a · exp(b t) to curves, some of them started at the solution."""
    rng = np.random.default_rng(2)
    wanted, t = rng.uniform(0.5, 2.0, (200, 2)), np.linspace(0, 1, 9)
    curves = wanted[:, :1] * np.exp(wanted[:, 1:] * t)
    seen = []

    def linearize(x: Array, which: Index) -> tuple[Array, Array]:
        seen.append(len(which))
        shape = np.exp(x[:, 1:] * t)
        return x[:, :1] * shape - curves[which], np.stack([shape, x[:, :1] * shape * t], axis=2)

    start = np.where(np.arange(200)[:, None] < 50, wanted, 1.0)
    minima = gauss_newton(linearize, start)
    np.testing.assert_allclose(minima.value, wanted, atol=1e-5)
    assert minima.converged.all() and min(seen) < 150


def test_a_search_that_is_cut_short_is_said_so() -> None:
    minima = gauss_newton(rosenbrock, np.array([[-1.2, 1.0], [1.0, 1.0]]), most=2)
    assert minima.status is Status.LIMIT and minima.iterations == 2
    np.testing.assert_array_equal(minima.converged, [False, True])


# --- LSI against scipy's bounded solver and by hand -------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(8))
def test_bounds_agree_with_scipy(seed: int) -> None:
    rng = np.random.default_rng(seed)
    design, target = rng.normal(size=(40, 6)), rng.normal(size=40)
    low = rng.uniform(-0.3, 0.3, 6)
    expected = lsq_linear(design, target, bounds=(low, np.inf), tol=1e-14).x
    np.testing.assert_allclose(solve_lsi(design.T @ design, design.T @ target, np.eye(6), low), expected, atol=1e-7)


def test_isotonic_regression() -> None:
    # Pool-adjacent-violators by hand: 1, 3, 2, 4 → 1, 2.5, 2.5, 4.
    rising = np.diff(np.eye(4), axis=0)
    solution = solve_lsi(np.eye(4), np.array([1.0, 3.0, 2.0, 4.0]), rising, np.zeros(3))
    np.testing.assert_allclose(solution, [1.0, 2.5, 2.5, 4.0], atol=1e-9)
    nearest = solve_lsi(np.eye(2), np.zeros(2), np.array([[1.0, 1.0]]), np.array([2.0]))
    np.testing.assert_allclose(nearest, [1.0, 1.0])


def test_impossible_and_undetermined_problems_are_refused() -> None:
    with pytest.raises(CalibrationError, match="contradict"):
        solve_lsi(np.eye(2), np.zeros(2), np.array([[1.0, 0.0], [-1.0, 0.0]]), np.array([1.0, 1.0]))
    with pytest.raises(CalibrationError, match="too few tones"):
        solve_lsi(np.array([[1.0, 2.0], [2.0, 1.0]]), np.ones(2), np.eye(2), np.zeros(2))


# --- Folds hold out whole shots, each once ----------------------------------------------------------------------------


def test_folds_leave_whole_shots_out_once() -> None:
    groups = np.array(["a"] * 5 + ["b"] * 3 + ["c"] * 9 + ["d"] + ["e"] * 2 + ["f"] * 2)
    masks = leave_groups_out(groups, 4)
    assert len(masks) == 4
    np.testing.assert_array_equal(np.sum(masks, axis=0), 1)
    for mask in masks:
        assert not set(groups[mask]) & set(groups[~mask])
    assert len(leave_groups_out(np.array(["a", "a"]))) == 1


def test_samples_without_groups_are_left_out_once() -> None:
    np.testing.assert_array_equal(np.sum(leave_samples_out(13, 5), axis=0), 1)


def test_a_held_out_prediction_is_of_the_other_samples() -> None:
    values = np.arange(12.0)
    means = predict_held_out(leave_samples_out(12, 3), lambda train, test: np.full(test.sum(), values[train].mean()))
    for fold in range(3):
        np.testing.assert_allclose(means[fold::3], np.delete(values.reshape(4, 3), fold, axis=1).mean())


# --- Weights of robust fits: their values where the definitions say so, and fits that outliers do not bend ------------


def test_weights_at_the_scale() -> None:
    ratio = np.array([0.0, 1.0, 1e6])
    np.testing.assert_allclose(cauchy(ratio), [1.0, 0.5, 0.0], atol=1e-9)
    np.testing.assert_allclose(geman_mcclure(ratio), [1.0, 0.25, 0.0], atol=1e-9)


@pytest.mark.parametrize("loss", [cauchy, geman_mcclure])
def test_reweighted_mean_ignores_outliers(loss: Loss) -> None:
    rng = np.random.default_rng(0)
    values = np.concatenate([rng.normal(2.0, 0.01, 80), rng.normal(9.0, 0.01, 20)])
    robust, mean = RobustWeights(loss, multiple=3.0, least=1e-3), float(np.median(values))
    for _ in range(20):
        mean = float(np.average(values, weights=robust(np.abs(values - mean))))
    assert abs(values.mean() - 2.0) > 1.0 > 100 * abs(mean - 2.0)


def test_scale_is_of_the_samples_that_tell_it_and_not_below_the_least() -> None:
    robust = RobustWeights(cauchy, multiple=2.0, least=0.5)
    assert robust.scale(np.array([1.0, 1.0, 9.0])) == 2.0
    assert robust.scale(np.zeros(5)) == 0.5
    np.testing.assert_allclose(robust(np.array([2.0, 4.0]), like=np.ones(3)), [0.5, 0.2])
    assert robust.scale(np.array([1.0, 5.0]), weight=np.array([1.0, 3.0])) == 10.0


def test_weighted_median_holds_half_of_the_weight() -> None:
    assert weighted_median(np.array([3.0, 1.0, 2.0]), np.array([1.0, 1.0, 5.0])) == 2.0


def test_lawson_weights_bring_the_largest_error_down() -> None:
    """The best constant in the maximum norm is the middle of the range, that of least squares the mean."""
    values = np.concatenate([np.zeros(90), np.full(10, 1.0)])
    weight, constant = np.ones(100), 0.0
    for _ in range(50):
        constant = float(np.average(values, weights=weight))
        weight = weight * lawson(np.abs(values - constant), 1.0, least=0.0)
    assert values.mean() == 0.1 and abs(constant - 0.5) < 1e-3


# --- Lattices: the iterative solution against the dense one, written out with a matrix a term -------------------------


THESIS = Regularization(smoothness=0.1, anchor=0.01, thin_plate=1e-6)


def random_levels(rng: np.random.Generator, size: tuple[int, int, int]) -> Levels:
    """Strictly increasing levels from 0 to 1, far from even."""
    r, g, b = (np.concatenate([[0.0], np.cumsum(rng.uniform(0.1, 2.0, count - 1))]) for count in size)
    return (r / r[-1], g / g[-1], b / b[-1])


def interpolation_weights(x: Array, levels: Levels, method: Interpolation) -> Array:
    """W (n, m): the response of the interpolation to each unit lattice."""
    shape = tuple(len(axis) for axis in levels)
    units = np.eye(int(np.prod(shape))).reshape(*shape, -1)
    return interpolate(x, levels, units, method)


def along(matrix: Array, shape: tuple[int, ...], axis: int) -> Array:
    """The (…, m) matrix that applies `matrix` along one axis of a lattice of that shape."""
    factors = [np.eye(count) for count in shape]
    factors[axis] = matrix
    return np.asarray(np.kron(np.kron(factors[0], factors[1]), factors[2]))


def second_differences(levels: Levels) -> Array:
    """S, row by row from the definition of thesis 5.4."""
    shape = tuple(len(axis) for axis in levels)
    parts = []
    for axis, nodes in enumerate(levels):
        rows = np.zeros((len(nodes) - 2, len(nodes)))
        for i in range(1, len(nodes) - 1):
            before, after = nodes[i] - nodes[i - 1], nodes[i + 1] - nodes[i]
            rows[i - 1, i - 1 : i + 2] = -after / (before + after), 1.0, -before / (before + after)
        parts.append(along(rows, shape, axis))
    return np.concatenate(parts)


def mixed_differences(shape: tuple[int, int, int]) -> Array:
    """T: the difference of differences over each square of neighbours, for each pair of axes."""
    first = [along(np.diff(np.eye(count), axis=0), shape, axis) for axis, count in enumerate(shape)]
    parts = []
    for one, two in ((0, 1), (0, 2), (1, 2)):
        narrow = list(shape)
        narrow[two] -= 1
        inner = first[two]
        outer = along(np.diff(np.eye(shape[one]), axis=0), tuple(narrow), one)
        parts.append(outer @ inner)
    return np.concatenate(parts)


def boundary(size: tuple[int, int, int]) -> tuple[Array, Array]:
    """ρ of thesis 5.4 per output channel: the nodes that it holds (m, 3), and to what."""
    held, target = np.zeros((*size, 3)), np.zeros((*size, 3))
    for i, j, k in np.ndindex(*size):
        for c, (index, count) in enumerate(zip((i, j, k), size, strict=True)):
            if index == count - 1:
                held[i, j, k, c] = target[i, j, k, c] = 1.0
    held[0, 0, 0] = 1.0
    return held.reshape(-1, 3), target.reshape(-1, 3)


@pytest.mark.parametrize("method", INTERPOLATIONS)
def test_the_thesis_objective_is_minimized(method: Interpolation) -> None:
    """(5.4) with all its terms, the closed form (5.5) per channel."""
    rng = np.random.default_rng(0)
    size = (7, 8, 6)
    levels = random_levels(rng, size)
    x, y = rng.random((400, 3)), rng.random((400, 3))
    terms = Regularization(smoothness=0.1, anchor=0.01, thin_plate=1e-3)
    found = fit_lattice(x, y, levels, terms, method=method, tolerance=1e-12)

    weights, s = interpolation_weights(x, levels, method), second_differences(levels)
    count = int(np.prod(size))
    plate = thin_plate(size)(np.eye(count).reshape(count, *size)).reshape(count, count)
    held, target = boundary(size)
    for c in range(3):
        matrix = weights.T @ weights + 0.1 * s.T @ s + 1e-3 * plate + 0.01 * np.diag(held[:, c])
        wanted = np.linalg.solve(matrix, weights.T @ y[:, c] + 0.01 * target[:, c])
        np.testing.assert_allclose(found.value[..., c].ravel(), wanted, atol=1e-8)


@pytest.mark.parametrize("method", INTERPOLATIONS)
def test_prior_weights_and_mixed_differences(method: Interpolation) -> None:
    rng = np.random.default_rng(1)
    size = (6, 7, 9)
    levels = random_levels(rng, size)
    x, y, omega = rng.uniform(-0.1, 1.1, (250, 3)), rng.random((250, 3)), rng.random(250)
    x[:8] = np.array([[i, j, k] for i in (0, 1) for j in (0, 1) for k in (0, 1)])  # the corners themselves
    x[8:20] = np.stack([axis[rng.integers(0, len(axis), 12)] for axis in levels], axis=1)  # and nodes
    prior = Prior(rng.random((*size, 3)), rng.random((*size, 3)) * (rng.random((*size, 3)) > 0.8))
    terms = Regularization(smoothness=0.02, mixed=0.03)
    found = fit_lattice(x, y, levels, terms, method=method, weight=omega, prior=prior, tolerance=1e-12)

    weights = interpolation_weights(x, levels, method)
    s, t = second_differences(levels), mixed_differences(size)
    smooth = 0.02 * s.T @ s + 0.03 * t.T @ t
    for c in range(3):
        hold, b0 = prior.weight[..., c].ravel(), prior.values[..., c].ravel()
        matrix = weights.T @ (omega[:, None] * weights) + smooth + np.diag(hold)
        wanted = np.linalg.solve(matrix, weights.T @ (omega * y[:, c]) + (smooth + np.diag(hold)) @ b0)
        np.testing.assert_allclose(found.value[..., c].ravel(), wanted, atol=1e-8)


def test_without_samples_the_prior_is_the_result() -> None:
    values = np.random.default_rng(3).random((9, 9, 9, 3))
    prior = Prior(values, np.full_like(values, 1e-3))
    terms = Regularization(0.01, 0.01)
    fit = fit_lattice(np.empty((0, 3)), np.empty((0, 3)), uniform_levels(9), terms, prior=prior)
    np.testing.assert_allclose(fit.value, values, atol=1e-12)


def test_a_warm_start_changes_the_time_only() -> None:
    rng = np.random.default_rng(5)
    levels = random_levels(rng, (13, 13, 13))
    x = rng.random((2000, 3))
    cold = fit_lattice(x, x**0.5, levels, THESIS, tolerance=1e-10)
    warm = fit_lattice(x, x**0.5, levels, THESIS, tolerance=1e-10, start=cold.value)
    assert warm.iterations <= 1 < cold.iterations
    np.testing.assert_allclose(warm.value, cold.value, atol=1e-8)


@pytest.mark.parametrize("size", [3, 4, 5, 6, 12, 24])
def test_every_size_converges(size: int) -> None:
    """Few samples and bunched levels, the hard case, held by a prior, as inverses are, or by none."""
    rng = np.random.default_rng(6)
    axis = np.linspace(0, 1, size) ** 3
    x, levels = rng.random((1500, 3)) ** 4, (axis, axis, axis)
    start = grid(levels)
    held = fit_lattice(x, x**0.45, levels, Regularization(1e-3, 1e-3), prior=Prior(start, np.full_like(start, 1e-5)))
    free = fit_lattice(x, x**0.45, levels, THESIS)
    for fit in (held, free):
        assert fit.converged and np.all(np.isfinite(fit.value))


def test_a_lattice_that_does_not_converge_is_said_so() -> None:
    rng = np.random.default_rng(7)
    x, levels = rng.random((300, 3)), uniform_levels(9)
    with pytest.raises(CalibrationError, match="1 iterations it reached its limit"):
        fit_lattice(x, x, levels, Regularization(0.1), prior=Prior(grid(levels) * 0, grid(levels) * 0 + 1e-6), most=1)
    with pytest.raises(CalibrationError, match=Status.SINGULAR.value):
        fit_lattice(x, np.full_like(x, np.nan), levels, THESIS)
    near = fit_lattice(x, x, levels, THESIS, tolerance=1e-6, most=6)
    assert near.status is Status.LIMIT and near.residual > 1e-6


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
    summed = sum(part.matrix.toarray() for part in parts)
    np.testing.assert_allclose(whole.matrix.toarray(), summed, rtol=1e-11, atol=1e-9)
    np.testing.assert_allclose(whole.right, sum(part.right for part in parts), rtol=1e-11, atol=1e-9)
    assert whole.matrix.sum() == pytest.approx(len(x))  # the weights of a sample sum to 1


def test_the_thin_plate_alone_is_minimized() -> None:
    """(5.3) has no smoothness term: most nodes of a lattice of few samples are only in the thin plate's."""
    rng = np.random.default_rng(0)
    size, count = (7, 6, 5), 210
    levels = random_levels(rng, size)
    x, y = rng.random((60, 3)), rng.random((60, 3))
    terms = Regularization(thin_plate=1e-4)
    found = fit_lattice(x, y, levels, terms, tolerance=1e-11)
    weights = interpolation_weights(x, levels, "trilinear")
    plate = thin_plate(size)(np.eye(count).reshape(count, *size)).reshape(count, count)
    wanted = np.linalg.solve(weights.T @ weights + 1e-4 * plate, weights.T @ y)
    np.testing.assert_allclose(found.value.reshape(count, 3), wanted, atol=1e-5)


# --- The thin plate: its integral by quadrature, and what it vanishes on ----------------------------------------------


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
            (vr, wr), (vg, wg), (vb, wb) = (basis(n, int(order)) for n, order in zip(size, orders, strict=True))
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
    joined = joined_alike(names, points)
    assert dict(zip(names.tolist(), joined.tolist(), strict=True)) == {
        "a": "a", "b": "b", "c": "c", "copy of b": "b", "burst 1": "a", "burst 2": "a",
    }  # fmt: skip
