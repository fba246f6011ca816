"""The inverse of a baked render: exact where it makes a colour, smooth elsewhere, neutral on neutrals."""

import numpy as np
import pytest
from numpy.typing import NDArray

from lutforge.arrays import Array
from lutforge.errors import LutError
from lutforge.interpolation import Interpolation
from lutforge.inverse import linearization
from lutforge.inverse.baked_render import BakedRender
from lutforge.inverse.linearization import Linearization, inverse_of
from lutforge.inverse.preimages import preimages
from lutforge.inverse.round_trip import MAX_GOAL, RoundTrip, as_8_bit, measure, raw_colours, rounded_up
from lutforge.luts.ops import Cube, Curve, Matrix, Range
from lutforge.luts.sequence import Lut
from lutforge.luts.shaper import shaper
from lutforge.model.lattice import grid, uniform_levels

MIXED = np.array([[1.5, -0.4, -0.1], [-0.2, 1.4, -0.2], [0.0, -0.4, 1.4]])


def clipping_render(method: Interpolation = "tetrahedral") -> BakedRender:
    """A camera that clips: saturated RAW leaves the range of its response on both sides."""
    axis = np.linspace(0, 1, 17) ** 1.5
    linear = np.linspace(0, 1, 4096)
    curve = np.where(linear < 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    cube = grid((axis, axis, axis)) @ MIXED.T
    cube = cube - 0.15 * cube * (1 - cube)
    return BakedRender((axis, axis, axis), cube, method, np.repeat(curve[:, None], 3, axis=1))


def inverted(render: BakedRender, size: int = 33) -> Linearization:
    """The inverse that follows the matrix where the render makes nothing."""
    return inverse_of(render, lambda jpeg: render.to_values(jpeg) @ np.linalg.inv(MIXED).T, size)


@pytest.fixture(scope="module")
def render() -> BakedRender:
    return clipping_render()


@pytest.fixture(scope="module")
def inverse(render: BakedRender) -> Linearization:
    return inverted(render)


@pytest.mark.parametrize("method", ["tetrahedral", "trilinear"])
def test_preimages_are_exact(method: Interpolation) -> None:
    render, raw = clipping_render(method), np.random.default_rng(1).random((5000, 3))
    jpeg = render(raw)
    found, residual = preimages(render, jpeg, np.full_like(raw, 0.4))
    assert residual.max() < 2e-3  # of the sampled inverse curve, steep at black
    unclipped = np.all((jpeg > 0.05) & (jpeg < 0.999), axis=1)
    assert unclipped.sum() > 1000
    np.testing.assert_allclose(found[unclipped], raw[unclipped], atol=2e-4)


def test_a_margin_takes_clipped_channels_beyond_the_end(render: BakedRender) -> None:
    raw = np.random.default_rng(2).random((5000, 3))
    jpeg = render(raw)
    jpeg = jpeg[np.any(jpeg == 0, axis=1) & np.all(jpeg < 1, axis=1)]
    found, residual = preimages(render, jpeg, raw_colours(1, 0)[:1].repeat(len(jpeg), axis=0), margin=0.01)
    beyond = -render.cube_values(found)[jpeg == 0]
    assert residual.max() < 2e-3
    assert np.median(beyond) > 0.0099


def test_jpegs_come_back(render: BakedRender, inverse: Linearization) -> None:
    """On colours of seeds that the fit has not seen, through the LUTs as files hold them."""
    lut = inverse.as_lut()
    for seed in (77, 78):
        trip = measure(render, lut, count=1 << 13, seed=seed)
        assert trip.mean <= 0.001 and trip.maximum <= MAX_GOAL, trip  # a quarter of a code, and five
        assert trip.p999 <= 0.01


def test_colours_at_the_end_of_raw_come_back_where_no_code_clips(monkeypatch: pytest.MonkeyPatch) -> None:
    """The table may not run on past RAW 1 in the cells at the rim: the render clamps that, and hues change."""
    whole = clipping_render()
    dim = BakedRender(whole.levels, 0.7 * grid(whole.levels) @ MIXED.T, "tetrahedral", whole.output_curve)
    trip = measure(dim, inverted(dim).as_lut(), count=1 << 12)
    with monkeypatch.context() as patch:
        patch.setattr(linearization, "OUTSIDE", np.inf)
        without = measure(dim, inverted(dim).as_lut(), count=1 << 12)
    assert trip.p999 < 0.2 * without.p999, (trip, without)


def test_neutrals_stay_neutral_and_rise(render: BakedRender, inverse: Linearization) -> None:
    """White, too, whose scene clipping hides."""
    grey = np.repeat(np.linspace(0.0, 1.0, 256)[:, None], 3, axis=1)
    back = inverse(grey)
    assert np.ptp(back, axis=1).max() < 2e-3  # this render's neutrals are neutral
    assert np.all(np.diff(back, axis=0) > 0)


def test_it_runs_on_without_jumps_where_nothing_is_made(inverse: Linearization) -> None:
    share = np.linspace(0.02, 1, 200)
    ramp = np.stack([share, np.zeros(200), 1 - share], axis=1)
    assert np.abs(np.diff(inverse(ramp), 2, axis=0)).max() < 0.05


def test_clipped_codes_stay_clipped_and_leave_others_alone(render: BakedRender, inverse: Linearization) -> None:
    jpeg = as_8_bit(render(raw_colours(1 << 13, seed=8)))
    back = render(inverse(jpeg))
    for end in (0.0, 1.0):
        clipped = jpeg == end
        assert clipped.sum() > 1000
        assert np.abs(back - end)[clipped].max() < 0.01
    one = np.any(jpeg == 1 / 255, axis=1)
    assert one.sum() > 100
    assert np.abs(back - jpeg)[one].max() < 0.01


def test_a_render_without_a_response_comes_back_where_it_clips() -> None:
    axis = uniform_levels(9)
    cube = np.clip(grid(axis) @ MIXED.T, 0.0, 1.0)
    render = BakedRender.of(Lut((Cube(cube),)))
    trip = measure(render, inverted(render), count=1 << 12)
    assert trip.mean <= 0.002, trip  # its clips are rounded off between nodes, where colours have no inverse


def test_a_lut_of_levels_cube_and_response_is_a_render_and_others_are_none(render: BakedRender) -> None:
    axis = np.rint(render.levels[0] * 4095) / 4095
    levels = shaper((axis, axis, axis), 4096)
    lut = Lut((levels, Cube(render.values), Curve(render.output_curve)))
    raw = np.random.default_rng(3).random((500, 3))
    np.testing.assert_allclose(BakedRender.of(lut)(raw), np.clip(lut(raw), 0, 1), atol=1e-6)
    mixed = Matrix(np.array([[1.2, -0.1, -0.1], [-0.1, 1.2, -0.1], [-0.1, -0.1, 1.2]]), np.full(3, 0.05))
    after_matrix = Lut((mixed, Range(), *lut.ops))
    np.testing.assert_allclose(BakedRender.of(after_matrix)(raw), np.clip(after_matrix(raw), 0, 1), atol=1e-6)
    for ops in ((*lut.ops, Matrix(2 * np.eye(3))), (Curve(levels.outputs**2), *lut.ops[1:])):
        with pytest.raises(LutError, match="node levels, a cube and a curve"):
            BakedRender.of(Lut(ops))


def test_errors_are_said_no_smaller_than_they_are() -> None:
    assert [rounded_up(value) for value in (0.0, 0.00121, 0.0199, 0.2)] == ["0", "0.0013", "0.02", "0.2"]


def test_a_loss_beyond_the_goal_says_where() -> None:
    """The worst code, and what is lost where samples were: only there is it known what the camera does."""
    within = RoundTrip(0.0005, 0.005, MAX_GOAL, (1, 2, 3), 0.0)
    assert str(within).endswith("99.9 % within 0.005")
    assert "at JPEG code 254 254 43" in str(RoundTrip(0.0005, 0.005, 0.03, (254, 254, 43)))
    assert "only for colours that no sample showed" in str(RoundTrip(0.0005, 0.005, 0.03, (254, 254, 43), 0.0))
    assert "; 0.025 for colours that samples showed" in str(RoundTrip(0.0005, 0.005, 0.03, (254, 254, 43), 0.025))


def test_the_worst_code_and_what_samples_showed_are_measured(render: BakedRender, inverse: Linearization) -> None:
    """A linearization that is wrong for reds alone."""

    def red(jpeg: Array) -> NDArray[np.bool_]:
        return np.asarray((jpeg[:, 0] > 0.7) & (jpeg[:, 1:].max(axis=1) < 0.3))

    def wrong(jpeg: Array) -> Array:
        return np.asarray(np.where(red(jpeg)[:, None], 0.5, 1.0) * inverse(jpeg))

    others_shown = measure(render, wrong, count=1 << 10, shown=lambda jpeg: ~red(jpeg))
    reds_shown = measure(render, wrong, count=1 << 10, shown=red)
    assert others_shown.maximum > 0.1
    assert others_shown.shown == 0
    assert reds_shown.shown == reds_shown.maximum
    assert reds_shown.worst[0] > 0.69 * 255
    assert max(reds_shown.worst[1:]) < 0.31 * 255
