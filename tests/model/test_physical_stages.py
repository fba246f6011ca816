"""The stages of the camera model: the response and its EMoR basis, gamut maps, the colours that they know."""

import numpy as np
import pytest
from scipy.spatial.distance import cdist

from lutforge.arrays import Array
from lutforge.errors import ProfileError
from lutforge.interpolation import INTERPOLATIONS, Interpolation, Levels, indexed, locate
from lutforge.model.coverage import FARTHEST, confidence, uncovered
from lutforge.model.emor import inverse_emor, log_inverse_emor
from lutforge.model.gamut_map import REACH, GamutMap, even_slope, flattened, from_even, identity_gamut_map, to_even
from lutforge.model.lattice import Lattice, grid, uniform_levels
from lutforge.model.profile import CameraModel, PictureStyle
from lutforge.model.response import Response
from tests.cases.profiles import gamma_response, identity_map, small_profile


def test_encode_undoes_linearize_and_clamps() -> None:
    response = Response(np.stack([np.linspace(0, 1, 256) ** p for p in (1.8, 2.2, 2.6)], axis=1))
    x = np.random.default_rng(0).uniform(0.01, 0.99, size=(100, 3))
    np.testing.assert_allclose(response.encode(response.linearize(x)), x, atol=1e-12)
    np.testing.assert_allclose(response.linearize([1.5, -1.0, 0.5])[:2], [1.0, 0.0])
    np.testing.assert_allclose(response.encode([7.0, -7.0, 0.0]), [1.0, 0.0, 0.0])


def test_curves_that_fall_or_stand_still_are_refused() -> None:
    rising = np.linspace(0, 1, 16)
    for bad in (rising[::-1], np.zeros(16), np.where(np.arange(16) == 5, 0.9, rising), np.full(16, np.nan)):
        with pytest.raises(ProfileError, match="response"):
            Response(np.stack([rising, rising, bad], axis=1))
    with pytest.raises(ProfileError, match="3 columns"):
        Response(rising[:, None])


def test_emor_has_the_published_numbers() -> None:
    # invemor.txt (Columbia CAVE): g0 and hinv(1) at their second entries.
    basis = inverse_emor()
    assert basis.curves.shape == (15, 1024)
    assert basis.mean[1] == pytest.approx(1.47726e-3, abs=2e-8)
    assert basis.curves[0, 1] == pytest.approx(-3.7067e-4, abs=2e-8)
    np.testing.assert_allclose(basis.curves @ basis.curves.T, np.eye(15), atol=1e-6)
    assert basis.mean[0] == 0.0 and basis.mean[-1] == 1.0
    assert np.all(np.diff(basis.mean) > 0)


@pytest.mark.parametrize("gamma", [1.0, 1.8, 2.2])
def test_the_logarithmic_basis_spans_gamma_curves(gamma: float) -> None:
    basis = log_inverse_emor()
    encoded = np.linspace(0.03, 1.0, 400)
    mean, curves = basis.at(encoded)
    target = gamma * np.log(encoded) - mean
    coefficients = np.linalg.lstsq(curves, target, rcond=1e-10)[0]
    error = np.expm1((curves @ coefficients - target) / gamma) * encoded  # in encoded values
    assert np.abs(error).max() < 0.006
    assert np.sqrt(np.mean(error**2)) < 0.001


# --- Radial basis functions against the formula (4.7) in plain numpy --------------------------------------------------


@pytest.mark.parametrize(("count", "offset"), [(1, 0.0), (5, 0.0), (127, 0.0), (128, 0.0), (1000, 0.0), (60, 0.01)])
def test_evaluation_is_the_formula(count: int, offset: float) -> None:
    rng = np.random.default_rng(count)
    centres, coefficients = rng.uniform(size=(count, 3)), rng.normal(size=(count, 3)) / (50 if offset else count**0.5)
    polynomial = np.vstack([np.zeros(3), np.eye(3)]) if offset else rng.normal(size=(4, 3))
    x = rng.uniform(-0.2, 1.2, size=(300, 3))
    even, knots = to_even(x, offset), to_even(centres, offset)
    distance = np.linalg.norm(even[:, None, :] - knots[None], axis=2)
    expected = distance @ coefficients + polynomial[0] + even @ polynomial[1:]
    gamut_map = GamutMap(centres, coefficients, polynomial, offset)
    np.testing.assert_allclose(to_even(gamut_map(x), offset), expected, atol=5e-6)
    assert gamut_map(x.reshape(10, 30, 3)).shape == (10, 30, 3)


@pytest.mark.parametrize("offset", [0.0, 0.005, 0.1])
def test_the_even_scale_and_back(offset: float) -> None:
    x = np.linspace(-0.5, 2.0, 501)
    even = to_even(x, offset)
    np.testing.assert_allclose(from_even(even, offset), x, atol=1e-12)
    assert np.all(np.diff(even) > 0)
    np.testing.assert_allclose(to_even([0.0, 1.0], offset), [0.0, 1.0], atol=1e-12)
    if offset:
        middle = 0.5 * (x[1:] + x[:-1])
        np.testing.assert_allclose(even_slope(middle, offset), np.diff(even) / np.diff(x), rtol=0.03)


def test_kriging_is_the_sum_of_its_kernel_up_to_twice_as_far_as_its_centres() -> None:
    rng = np.random.default_rng(0)
    centres, coefficients = rng.random((700, 3)), rng.normal(size=(700, 3))
    coefficients *= 2000 / np.abs(coefficients).sum(axis=0)
    coefficients -= coefficients.mean(axis=0)  # as of a fit, whose long parts cancel
    gamut_map = GamutMap(centres, coefficients, identity_gamut_map().polynomial, 0.005, "kriging", 0.3)
    x = np.concatenate([rng.random((300, 3)), rng.uniform(-0.3, 3.0, (300, 3))])
    even = to_even(x, 0.005)
    distance = cdist(flattened(even), flattened(to_even(centres, 0.005))) / REACH
    near = 0.8 * (1 + 8 * distance) * np.exp(-8 * distance)
    kernel = 0.3 * np.exp(-distance) + near + 3 * np.exp(-3 * distance**2)
    np.testing.assert_allclose(to_even(gamut_map(x), 0.005), even + kernel @ coefficients, rtol=0, atol=1e-4)


def test_bad_parts_are_refused() -> None:
    with pytest.raises(ProfileError, match="expected n centres"):
        GamutMap(np.zeros((2, 3)), np.zeros((3, 3)), np.zeros((4, 3)))
    with pytest.raises(ProfileError, match="not finite"):
        GamutMap(np.zeros((1, 3)), np.full((1, 3), np.inf), np.zeros((4, 3)))
    with pytest.raises(ProfileError, match="offset"):
        GamutMap(np.zeros((1, 3)), np.zeros((1, 3)), np.zeros((4, 3)), offset=-0.1)


# --- The mask of colours that are clipped, or far from every sample ---------------------------------------------------


def test_distance_to_the_nearest_centre_in_encoded_values() -> None:
    known = np.array([[0.2, 0.3, 0.4], [0.8, 0.7, 0.6]])
    back = GamutMap(known**2.2, np.zeros((2, 3)), identity_map().polynomial)
    model = CameraModel(("daylight",), np.eye(3), gamma_response(), identity_map(), back)
    x = np.array([[[0.2, 0.3, 0.45], [0.5, 0.5, 0.5]], [[0.8, 0.7, 0.6], [0.2, 0.3, 0.61]]])
    style = PictureStyle(models=(model,))
    np.testing.assert_array_equal(uncovered(style, x, 0.1), [[False, True], [False, True]])
    np.testing.assert_array_equal(uncovered(style, x, 0.4), [[False, False], [False, False]])


def test_a_lattice_knows_the_nodes_that_samples_touched() -> None:
    style = small_profile().styles["standard"]
    assert style.linearize is not None
    coverage = np.zeros((5, 5, 5))
    coverage[2, 2, 2] = 1.0
    lattice_only = PictureStyle(style.render, style.linearize, coverage={"linearize": coverage})
    x = np.array([[0.5, 0.5, 0.55], [0.1, 0.1, 0.1]])
    np.testing.assert_array_equal(uncovered(lattice_only, x), [False, True])
    assert uncovered(PictureStyle(), x).all()


def test_confidence_is_the_mask_as_a_lattice() -> None:
    rng = np.random.default_rng(3)
    known = rng.uniform(0.1, 0.9, (60, 3))
    back = GamutMap(known**2.2, np.zeros((60, 3)), identity_map().polynomial)
    style = PictureStyle(models=(CameraModel(("daylight",), np.eye(3), gamma_response(), identity_map(), back),))
    trust = confidence(style)
    near = np.clip(known + rng.normal(size=(60, 3)) * 0.2 * FARTHEST / np.sqrt(3), 0.02, 0.98)
    assert trust(near)[:, 0].min() > 0.7
    x = rng.uniform(0.02, 0.98, (4000, 3))
    distance = np.linalg.norm(x[:, None] - known, axis=-1).min(axis=1)
    assert np.all(trust(x)[distance > 2.2 * FARTHEST][:, [0, 2]] == 0)
    # The cells of the lattice are a third of the limit wide.
    agree = (trust(x)[:, 0] < 0.5) == uncovered(style, x)
    assert agree[np.abs(distance - FARTHEST) > 0.3 * FARTHEST].all()
    edge = np.repeat(known[:1], 2, axis=0)
    edge[0, 1], edge[1, 2] = 0.0, 1.0
    np.testing.assert_array_equal(trust(edge)[:, :2], 0)
    np.testing.assert_allclose(trust(x)[:, 1], 1)
    assert np.all(confidence(PictureStyle())(x)[:, [0, 2]] == 0)


# --- The nonuniform lattice: interpolation against known functions, and what it refuses -------------------------------


RNG = np.random.default_rng(1)
LEVELS = [0.0, 0.5, 1.0]


def _levels(rng: np.random.Generator, sizes: tuple[int, int, int] = (5, 7, 6)) -> Levels:
    r, g, b = (np.concatenate([[0.0], np.sort(rng.uniform(0.01, 0.99, size - 2)), [1.0]]) for size in sizes)
    return (r, g, b)


@pytest.mark.parametrize("method", INTERPOLATIONS)
def test_linear_functions_are_exact_on_any_levels(method: Interpolation) -> None:
    levels = _levels(RNG)
    matrix, offset = RNG.normal(size=(3, 3)), RNG.normal(size=3)
    lattice = Lattice(levels, grid(levels) @ matrix.T + offset, method)
    x = RNG.uniform(size=(500, 3))
    np.testing.assert_allclose(lattice(x), x @ matrix.T + offset, atol=1e-12)


@pytest.mark.parametrize("method", INTERPOLATIONS)
def test_nodes_are_met_and_outside_is_clamped(method: Interpolation) -> None:
    levels = _levels(RNG)
    lattice = Lattice(levels, RNG.uniform(size=(5, 7, 6, 3)), method)
    np.testing.assert_allclose(lattice(grid(levels)), lattice.values, atol=1e-12)
    x = RNG.uniform(-1.0, 2.0, size=(200, 3))
    np.testing.assert_allclose(lattice(x), lattice(np.clip(x, 0.0, 1.0)), atol=1e-12)


def test_the_shape_of_the_input_is_kept() -> None:
    lattice = Lattice(uniform_levels(3), grid(uniform_levels(3)))
    assert lattice(np.zeros((4, 5, 3))).shape == (4, 5, 3)
    assert lattice(np.zeros(3)).shape == (3,)
    assert lattice(np.zeros((0, 3))).shape == (0, 3)
    assert lattice.size == (3, 3, 3)


@pytest.mark.parametrize(
    ("green", "blue", "values", "says"),
    [
        (LEVELS, LEVELS, np.zeros((3, 3, 2, 3)), "shape"),
        (LEVELS, LEVELS, np.full((3, 3, 3, 3), np.nan), "not a finite"),
        (LEVELS, LEVELS, np.full((3, 3, 3, 3), 1e30), "no colour"),
        ([0.0, 0.5, 0.5], LEVELS, np.zeros((3, 3, 3, 3)), "G node levels"),
        (LEVELS, [0.0, np.inf, 1.0], np.zeros((3, 3, 3, 3)), "B node levels"),
    ],
)
def test_bad_lattices_are_refused(green: list[float], blue: list[float], values: np.ndarray, says: str) -> None:
    with pytest.raises(ProfileError, match=says):
        Lattice((np.array(LEVELS), np.array(green), np.array(blue)), values)


def crowded(count: int, power: float) -> Array:
    """Levels that stand the closer, the nearer to the low end they are, on an axis that is not [0, 1]."""
    return 3.0 * np.linspace(0.0, 1.0, count) ** power - 0.5


@pytest.mark.parametrize("count", [2, 3, 33, 65])
@pytest.mark.parametrize("power", [0.3, 1.0, 2.4, 9.0])
def test_each_number_is_in_its_cell(count: int, power: float) -> None:
    levels = crowded(count, power)
    axis = indexed((levels, levels, levels))[0]
    beside = [np.nextafter(levels, end) for end in (-np.inf, np.inf)]
    x = np.concatenate([levels, *beside, np.random.default_rng(1).uniform(-1.0, 3.0, 2000), [-np.inf, np.inf]])
    found = [locate(axis, number) for number in x]
    cell, inside = np.clip(np.searchsorted(levels, x, side="right") - 1, 0, count - 2), np.clip(x, -0.5, levels[-1])
    assert [i for i, _ in found] == cell.tolist()
    assert np.array_equal([f for _, f in found], (inside - levels[cell]) / (levels[cell + 1] - levels[cell]))


def test_what_is_no_number_is_at_the_first_node() -> None:
    levels = crowded(9, 2.0)
    assert locate(indexed((levels, levels, levels))[0], np.nan) == (0, 0.0)
