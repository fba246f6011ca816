"""The LUT record: what it accepts, and that folding and resampling keep the function."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from lutforge.errors import ImageError, LutError
from lutforge.luts.chain import LutChain
from lutforge.luts.lut import Lut, lut_from_lattice
from lutforge.luts.shaper import SHAPER_SIZE, on_grid, sampled_shaper, scaled_levels
from lutforge.luts.write import largest_difference
from lutforge.model.lattice import Lattice, grid, uniform_levels
from lutforge.solvers.node_levels import snap_levels

Array = NDArray[np.float64]


def bunched(size: int = 17, power: float = 2.0) -> tuple[Array, Array, Array]:
    axes = [snap_levels(np.linspace(0, 1, size) ** p, SHAPER_SIZE) for p in (power, power + 0.3, power + 0.6)]
    return axes[0], axes[1], axes[2]


def camera(x: Array) -> Array:
    """A smooth rendering: a matrix and a tone curve."""
    mix = np.array([[0.8, 0.15, 0.05], [0.1, 0.8, 0.1], [0.05, 0.2, 0.75]])
    return np.asarray((0.02 + 0.98 * np.clip(x, 0, 1) @ mix.T) ** 0.45)


def smooth_lut(gain: tuple[float, float, float] = (1.0, 1.0, 1.0), size: int = 33) -> Lut:
    levels = bunched(size)
    return Lut(np.array(gain), levels, camera(grid(levels)), np.eye(3))


def test_it_is_the_lattice_behind_gain_and_clamp_and_before_the_matrix() -> None:
    rng = np.random.default_rng(1)
    levels = bunched()
    lattice = Lattice(levels, rng.random((17, 17, 17, 3)), "tetrahedral")
    gain, matrix = np.array([1.9, 1.0, 1.4]), rng.normal(size=(3, 3))
    lut = lut_from_lattice(lattice, gain, matrix)
    x = rng.random((500, 3))
    np.testing.assert_array_equal(lut(x), lattice(np.minimum(x * gain, 1)) @ matrix.T)
    np.testing.assert_array_equal(lut(np.array([[np.nan, -1.0, 9.0]])), lut(np.array([[0.0, 0.0, 1.0]])))


def test_the_shaper_holds_the_node_levels_exactly() -> None:
    levels = bunched(33, 3.0)
    table = sampled_shaper(levels)
    assert table.shape == (SHAPER_SIZE, 3)
    assert np.all(np.diff(table, axis=0) > 0)
    at = np.arange(SHAPER_SIZE) / (SHAPER_SIZE - 1)
    for c in range(3):
        got = np.interp(levels[c], at, table[:, c])
        np.testing.assert_allclose(got, np.arange(33) / 32, atol=1e-12)
        between = 0.5 * (levels[c][1:] + levels[c][:-1])
        np.testing.assert_allclose(np.interp(between, at, table[:, c]), (np.arange(32) + 0.5) / 32, atol=1e-12)


@given(st.integers(2, 65), st.floats(0.5, 8.0), st.floats(0.3, 4.0))
@settings(max_examples=60, deadline=None)
def test_scaled_levels_keep_a_grid_point_each(size: int, power: float, gain: float) -> None:
    axis = snap_levels(np.linspace(0, 1, size) ** power, SHAPER_SIZE)
    scaled = scaled_levels(axis, gain, SHAPER_SIZE)
    assert scaled[0] == 0
    assert np.all(np.diff(scaled) > 0)
    assert on_grid(scaled, SHAPER_SIZE)
    assert scaled[-1] * gain >= 1 - 1e-9
    if gain == 1.0:
        np.testing.assert_allclose(scaled, axis, atol=1e-12)


@pytest.mark.parametrize("gain", [(2.1, 1.0, 1.43), (0.6, 1.0, 0.85), (3.7, 1.0, 0.3)])
def test_folding_keeps_a_smooth_function(gain: tuple[float, float, float]) -> None:
    matrix = np.array([[1.5, -0.4, -0.1], [-0.2, 1.4, -0.2], [0.0, -0.5, 1.5]])
    lut = replace(smooth_lut(gain), matrix=matrix)
    folded = lut.folded()
    assert not folded.has_gain
    assert not folded.has_matrix
    assert largest_difference(lut, folded) < 1e-4
    clipped = np.ones((1, 3))
    np.testing.assert_allclose(folded(clipped), lut(clipped), atol=1e-6)


def test_folding_without_gain_is_exact() -> None:
    lut = replace(smooth_lut(), matrix=np.diag([0.5, 2.0, 1.0]))
    assert largest_difference(lut, lut.folded()) < 1e-12
    assert smooth_lut().folded().levels[0] is not None


def test_without_shaper_samples_a_uniform_cube() -> None:
    lut = smooth_lut((1.5, 1.0, 1.2))
    plain = lut.without_shaper(65)
    assert plain.is_uniform
    assert plain.size == 65
    nodes = grid(uniform_levels(65))
    np.testing.assert_allclose(plain(nodes), lut(nodes), atol=1e-12)
    assert plain.without_shaper(65).cube is plain.cube


def test_a_lattice_off_the_grid_or_of_unequal_sizes_becomes_a_lut() -> None:
    levels = (np.linspace(0, 1, 9) ** 1.7, np.linspace(0, 1, 12) ** 2, np.linspace(0, 1, 12))
    lattice = Lattice(levels, camera(grid(levels)), "trilinear")
    lut = lut_from_lattice(lattice)
    assert lut.size == 12
    x = np.random.default_rng(0).random((2000, 3))
    np.testing.assert_allclose(lut(x), lattice(x), atol=1e-4)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"gain": np.array([0.0, 1.0, 1.0])}, "gain"),
        ({"gain": np.array([np.nan, 1.0, 1.0])}, "gain"),
        ({"matrix": np.eye(4)}, "matrix"),
        ({"cube": np.full((33, 33, 33, 3), np.inf)}, "finite"),
        ({"cube": np.zeros((33, 33, 32, 3))}, "shape"),
        ({"shaper_size": 4096}, "not multiples of 1/4095"),
        ({"shaper_size": 70000}, "65536"),
        ({"interpolation": "cubic"}, "cubic"),
        ({"levels": tuple(axis + 1e-6 for axis in bunched(33))}, "from 0"),
        ({"levels": tuple(np.round(axis, 4) for axis in bunched(33, 1.2))}, "snap"),
    ],
)
def test_what_does_not_fit_is_refused(change: dict[str, object], words: str) -> None:
    with pytest.raises(LutError, match=words):
        replace(smooth_lut(), **change)  # type: ignore[arg-type]  # wrong on purpose


def test_too_many_nodes_for_a_file() -> None:
    with pytest.raises(LutError, match="129"):
        Lut(np.ones(3), uniform_levels(130), np.zeros((130, 130, 130, 3)), np.eye(3))


def test_pixels_that_are_no_colours_are_refused() -> None:
    levels = uniform_levels(2)
    identity = Lut(np.ones(3), levels, grid(levels), np.eye(3))
    for transform in (identity, LutChain((identity, identity))):
        with pytest.raises(ImageError, match="scale them"):
            transform(np.full((4, 4, 3), 200, dtype=np.uint8))
        with pytest.raises(ImageError, match="alpha"):
            transform(np.ones((4, 4, 4)))
