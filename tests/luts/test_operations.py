"""Operations, their sequence, and the shaper: the values that they accept, compute and print."""

import numpy as np
import pytest

from lutforge.arrays import Array
from lutforge.errors import ImageError, LutError
from lutforge.luts.ocio_transforms import evaluate
from lutforge.luts.ops import Cube, Curve, Matrix, Op, Range
from lutforge.luts.sequence import Lut
from lutforge.luts.shaper import MAX_SHAPER_SIZE, lattice_ops, shaper
from lutforge.model.lattice import Lattice, grid, snap_levels, uniform_levels
from tests.cases.pictures import lut_of_nodes

MATRIX = np.array([[1.5, -0.4, -0.1], [-0.2, 1.4, -0.2], [0.0, -0.5, 1.5]])


def bunched(size: int = 17, power: float = 2.0) -> tuple[Array, Array, Array]:
    axes = [snap_levels(np.linspace(0, 1, size) ** p, MAX_SHAPER_SIZE) for p in (power, power + 0.3, power + 0.6)]
    return axes[0], axes[1], axes[2]


def camera(x: Array) -> Array:
    """A smooth rendering: a matrix and a tone curve."""
    mix = np.array([[0.8, 0.15, 0.05], [0.1, 0.8, 0.1], [0.05, 0.2, 0.75]])
    return np.asarray((0.02 + 0.98 * np.clip(x, 0, 1) @ mix.T) ** 0.45)


@pytest.mark.parametrize(
    "op",
    [
        Matrix(np.diag([2.0, 1.0, 0.5]), np.array([0.1, 0.0, -0.2])),
        Matrix(MATRIX),
        Range(),
        Range(None, 0.5),
        Curve(np.linspace(0, 1, 9)[:, None] ** [[1.0, 2.0, 0.5]]),
        Curve(np.linspace(0, 1, 9)[:, None] ** [[1.0, 2.0, 0.5]], -1.0, 3.0),
        Cube(np.random.default_rng(0).random((5, 5, 5, 3))),
        Cube(np.random.default_rng(0).random((5, 5, 5, 3)), "trilinear"),
    ],
    ids=str,
)
def test_each_operation_is_opencolorios(op: Op) -> None:
    x = np.random.default_rng(1).uniform(-0.5, 1.5, (500, 3)).astype(np.float32)
    np.testing.assert_allclose(evaluate(Lut((op,)).processor(), x), op(x.astype(np.float64)), atol=2e-6)
    assert type(op).__name__ in str(op)


def test_numbers_that_are_none_are_the_lowest() -> None:
    none = np.array([[np.nan, np.nan, np.nan]])
    for op in (Range(), Curve(np.array([[0.2] * 3, [1.0] * 3])), Cube(grid(uniform_levels(2)) + 0.2)):
        np.testing.assert_array_equal(op(none), op(np.zeros((1, 3))))
    knots = np.array([[0.0] * 3, [0.3] * 3, [1.0] * 3])
    np.testing.assert_array_equal(Curve(knots**2, inputs=knots)(none), np.zeros((1, 3)))


def test_a_curve_at_free_knots_draws_straight_lines() -> None:
    knots = np.array([[0.0, 0.0, -1.0], [0.1, 0.5, 0.0], [1.0, 2.0, 1.0]])
    curve = Curve(np.array([[0.0] * 3, [0.5] * 3, [1.0] * 3]), inputs=knots)
    np.testing.assert_allclose(curve(np.array([[0.05, 1.25, -0.5], [9, -9, 0.5]])), [[0.25, 0.75, 0.25], [1, 0, 0.75]])
    with pytest.raises(LutError, match="free knots"):
        Lut((curve,)).processor()


def test_a_sequence_says_what_it_is() -> None:
    lut = lut_of_nodes(bunched(33), camera(grid(bunched(33))), (2.0, 1.0, 1.5), MATRIX, title="a look")
    assert lut.summary == "Matrix → Range → Curve 65536 → Cube 33³ → Matrix"
    text = str(lut)
    assert text.splitlines()[0] == 'LUT "a look"'
    assert "1. Matrix diagonal 2 1 1.5" in text
    assert "33³ nodes, tetrahedral" in text
    assert repr(lut) == f"<Lut {lut.summary} 'a look'>"
    assert lut.size == 33
    with pytest.raises(LutError, match="no operation"):
        Lut(())


def test_a_lattice_off_the_grid_or_of_unequal_sizes_becomes_a_lut() -> None:
    levels = (np.linspace(0, 1, 9) ** 1.7, np.linspace(0, 1, 12) ** 2, np.linspace(0, 1, 12))
    lattice = Lattice(levels, camera(grid(levels)), "trilinear")
    lut = Lut(lattice_ops(lattice))
    assert lut.size == 12
    x = np.random.default_rng(0).random((2000, 3))
    np.testing.assert_allclose(lut(x), lattice(x), atol=1e-4)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Matrix(np.eye(4)), "3 × 3"),
        (lambda: Matrix(np.full((3, 3), np.nan)), "not finite"),
        (lambda: Range(1.0, 0.0), "empty"),
        (lambda: Curve(np.zeros((1, 3))), "table"),
        (lambda: Curve(np.zeros((4, 3)), 1.0, 1.0), "no domain"),
        (lambda: Curve(np.zeros((2, 3)), inputs=np.zeros((2, 3))), "increase"),
        (lambda: Cube(np.full((3, 3, 3, 3), np.inf)), "finite"),
        (lambda: Cube(np.zeros((3, 3, 3))), "shape"),
        (lambda: Cube(np.zeros((3, 3, 3, 3)), "cubic"), "cubic"),  # type: ignore[arg-type]  # wrong on purpose
        (lambda: shaper(bunched(33), 4096), "not multiples of 1/4095"),
        (lambda: shaper(bunched(33), 70000), "65536"),
        (lambda: shaper((bunched()[0] + 1e-6, *bunched()[1:])), "from 0"),
        (lambda: shaper(bunched(), MAX_SHAPER_SIZE, np.zeros((9, 3))), "does not rise"),
    ],
)
def test_what_does_not_fit_is_refused(make: object, words: str) -> None:
    assert callable(make)
    with pytest.raises(LutError, match=words):
        make()


def test_pixels_that_are_no_colours_are_refused() -> None:
    identity = Lut((Cube(grid(uniform_levels(2))),))
    with pytest.raises(ImageError, match="scale them"):
        identity(np.full((4, 4, 3), 200, dtype=np.uint8))
    with pytest.raises(ImageError, match="alpha"):
        identity(np.ones((4, 4, 4)))
