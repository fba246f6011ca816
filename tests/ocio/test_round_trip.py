"""The linearization of a config: the inverse of its render, smooth where the render makes nothing; and a render that
gives way where it folds, since two scenes of one colour have no way back."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import PyOpenColorIO as OCIO  # noqa: N814 - the name that its documentation uses
import pytest
from numpy.typing import NDArray

from lutforge.errors import LutError
from lutforge.interpolation import Interpolation, through
from lutforge.model.lattice import grid, uniform_levels
from lutforge.ocio import mutual_inverses
from lutforge.ocio.exact_inverse import exact_inverse
from lutforge.ocio.lattice_lut import LatticeLut as Lut
from lutforge.ocio.layered_levels import neutral_nodes
from lutforge.ocio.lut_files import compact, write_compact
from lutforge.ocio.made_colours import MadeColours, as_8_bit, spread
from lutforge.ocio.mutual_inverses import consistent
from lutforge.ocio.preimage import Render, as_render, curve_inverse, preimages
from lutforge.ocio.round_trip import MAX_GOAL, MEAN_GOAL, measure, rounded_up
from lutforge.ocio.unfolding import folded_share, unfolded

Array = NDArray[np.float64]

MIXED = np.array([[1.5, -0.4, -0.1], [-0.2, 1.4, -0.2], [0.0, -0.4, 1.4]])


def render_lut(size: int = 17, method: Interpolation = "tetrahedral") -> Lut:
    """A camera that clips: saturated RAW leaves the range of its response on both sides."""
    axis = np.round(np.linspace(0, 1, size) ** 1.5 * 4095) / 4095
    levels = (axis, axis.copy(), axis.copy())
    linear = np.linspace(0, 1, 4096)
    curve = np.where(linear < 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    response = np.repeat(curve[:, None], 3, axis=1)
    cube = grid(levels) @ MIXED.T
    cube = cube - 0.15 * cube * (1 - cube)
    return compact(Lut(levels, cube, 4096, method, response=response))


def own_linearization(size: int = 17) -> Lut:
    """As a profile has it: near, and not the inverse."""
    levels = uniform_levels(size)
    return compact(Lut(levels, grid(levels) ** 2.1 @ np.linalg.inv(MIXED).T))


@pytest.mark.parametrize("method", ["tetrahedral", "trilinear"])
def test_preimages_are_exact(method: Interpolation) -> None:
    lut = render_lut(method=method)
    render = as_render(lut)
    raw = np.random.default_rng(1).random((5000, 3))
    jpeg = render(raw)
    inner = through(curve_inverse(render.response, 4096), jpeg)
    found, all_found = preimages(render, inner, jpeg, np.full_like(raw, 0.4))
    assert all_found.all()
    assert np.abs(render(found) - jpeg).max() < 2e-3  # of the sampled inverse curve, steep at black
    unclipped = np.all((jpeg > 0.05) & (jpeg < 0.999), axis=1)
    assert unclipped.sum() > 1000
    np.testing.assert_allclose(found[unclipped], raw[unclipped], atol=2e-4)


def test_what_the_render_never_makes_is_not_found() -> None:
    render = as_render(replace(render_lut(), cube=0.5 * render_lut().cube))
    bright = np.full((1, 3), 0.9)
    _, found = preimages(render, bright**2, bright, np.full((1, 3), 0.5))
    assert not found.any()


@pytest.fixture(scope="module")
def pair() -> tuple[Lut, Lut]:
    """Of the camera that clips."""
    *pair, trip = consistent(render_lut(), own_linearization())
    assert trip.met
    return pair[0], pair[1]


def test_a_linearization_becomes_the_inverse_and_stays_smooth(pair: tuple[Lut, Lut]) -> None:
    """Within the goals on colours of other seeds; neutral and rising on neutrals, without jumps beyond the gamut."""
    assert not measure(render_lut(), own_linearization()).met
    moved, inverse = pair
    other = measure(moved, inverse, seed=77)
    assert other.mean <= MEAN_GOAL
    assert other.maximum <= MAX_GOAL
    codes = as_8_bit(moved(spread(1 << 12, seed=78)))
    assert np.linalg.norm(moved(inverse(codes)) - codes, axis=1).max() <= MAX_GOAL
    grey = np.linspace(0.02, 1, 200)
    back = inverse(np.repeat(grey[:, None], 3, axis=1))
    assert np.ptp(back, axis=1).max() < 2e-3  # this render's neutrals are neutral
    assert np.all(np.diff(back, axis=0) > 0)
    ramp = np.stack([grey, np.zeros(200), 1 - grey], axis=1)  # most of it is never made
    assert np.abs(np.diff(inverse(ramp), 2, axis=0)).max() < 0.05


def folding_lut() -> Lut:
    """The same camera, but the darkest reds of bright blues turn back: two scenes make one colour."""
    lut = render_lut()
    cube = lut.cube.copy()
    cube[0, :, 11:, 0] = 1.15 * cube[1, :, 11:, 0] - 0.15 * cube[0, :, 11:, 0]
    return replace(lut, cube=cube)


@pytest.mark.slow
def test_a_render_gives_way_where_it_folds() -> None:
    """Its colours come back, those of the render as it was, too; it moves by little, and neutrals not at all."""
    before = folding_lut()
    render, inverse, trip = consistent(before, own_linearization())
    assert trip.met
    of_both = [one(spread(1 << 12, seed=5)) for one in (render, before)]
    for jpeg in (*of_both, *map(as_8_bit, of_both)):
        error = np.linalg.norm(render(inverse(jpeg)) - jpeg, axis=1)
        assert error.mean() <= MEAN_GOAL
        assert error.max() <= MAX_GOAL
    change = np.linalg.norm(render(spread(1 << 14, seed=6)) - before(spread(1 << 14, seed=6)), axis=1)
    assert 0 < change.mean() < 0.002
    assert change.max() < 0.05
    grey = np.repeat(np.linspace(0, 1, 4097)[:, None], 3, axis=1)
    np.testing.assert_array_equal(render(grey), before(grey))


def flat_ended_lut() -> Lut:
    """A camera with a toe and a shoulder so flat that black and white say little of their scenes."""
    lut = render_lut()
    linear = np.linspace(0, 1, 4096)
    flat = linear**2 * (3 - 2 * linear)
    return replace(lut, response=np.repeat(flat[:, None], 3, axis=1))


def test_greys_are_the_profiles_where_the_render_does_not_tell(monkeypatch: pytest.MonkeyPatch) -> None:
    """Black exactly; white, too, which the render takes it to; between, all channels rise and none is tinted."""
    monkeypatch.setattr(mutual_inverses, "SIZE", 17)
    monkeypatch.setattr(mutual_inverses, "POOL", 1 << 12)
    own = own_linearization()
    render, inverse, _ = consistent(flat_ended_lut(), own)
    assert inverse is not own
    codes = np.repeat(np.linspace(0, 1, 256)[:, None], 3, axis=1)
    back, said = inverse(codes), own(codes)
    np.testing.assert_array_equal(back[[0, -1]], said[[0, -1]])
    assert np.diff(back, axis=0).min() > 0
    assert np.ptp(back, axis=1).max() < np.ptp(said, axis=1).max() + 2e-3
    assert np.abs(render(back) - codes).max() < 0.004


def test_clipped_codes_stay_clipped(pair: tuple[Lut, Lut]) -> None:
    """A layer of nodes of their own is beyond the clip, and the codes beside it are not drawn along."""
    render, inverse = pair
    jpeg = as_8_bit(render(spread(1 << 13, seed=8)))
    back = render(inverse(jpeg))
    for end in (0.0, 1.0):
        clipped = jpeg == end
        assert clipped.sum() > 1000
        assert np.abs(back - end)[clipped].max() < 0.01
    one = np.any(jpeg == 1 / 255, axis=1)
    assert one.sum() > 100
    assert np.abs(back - jpeg)[one].max() < 0.01


@pytest.mark.parametrize("method", ["tetrahedral", "trilinear"])
def test_a_finer_render_is_the_same(method: Interpolation) -> None:
    """Between twice as many nodes: to the rounding of the files."""
    lut = render_lut(17, method)
    finer = mutual_inverses.finer(as_render(lut), 33).lut
    assert finer.size == 33
    assert mutual_inverses.finer(as_render(lut), 17).lut is lut
    raw = spread(1 << 12, seed=9)
    # Files hold five digits of values beyond 1, and levels on the shaper, half a step from the middle of some cells.
    assert np.abs(finer.inner(raw) - lut.inner(raw)).max() < (3e-4 if method == "tetrahedral" else 6e-5)


@pytest.mark.slow
def test_a_render_without_a_response_comes_back_where_it_clips(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its nodes may leave the range behind a response that clamps."""
    monkeypatch.setattr(mutual_inverses, "SIZE", 17)
    monkeypatch.setattr(mutual_inverses, "POOL", 1 << 13)
    bare = replace(render_lut(), response=None, cube=np.clip(render_lut().cube, 0.0, 1.0))
    render, inverse, trip = consistent(bare, own_linearization())
    assert trip.met
    raw = spread(1 << 12, seed=10)
    jpeg = render(raw)
    assert np.array_equal(jpeg, np.clip(jpeg, 0.0, 1.0))
    assert np.abs(jpeg - bare(raw)).mean() < 1e-3
    assert np.linalg.norm(render(inverse(jpeg)) - jpeg, axis=1).max() <= MAX_GOAL


@pytest.mark.slow
def test_the_fit_is_the_same_again(monkeypatch: pytest.MonkeyPatch) -> None:
    """On a small lattice, that no pool is too small for."""
    monkeypatch.setattr(mutual_inverses, "SIZE", 9)
    monkeypatch.setattr(mutual_inverses, "POOL", 1 << 12)
    first, second = (consistent(folding_lut(), own_linearization()) for _ in range(2))
    assert not np.array_equal(first[0].cube, folding_lut().cube)
    for one, other in zip(first[:2], second[:2], strict=True):
        np.testing.assert_array_equal(one.cube, other.cube)


def test_errors_are_said_no_smaller_than_they_are() -> None:
    assert [rounded_up(value) for value in (0.0, 0.01201, 0.02, 0.00999)] == ["0", "0.013", "0.02", "0.01"]


def test_an_inverse_is_left_alone() -> None:
    levels = uniform_levels(2)
    same = compact(Lut(levels, grid(levels)))
    *kept, trip = consistent(same, same)
    assert kept == [same, same]
    assert trip.departure == 0


def inside(render: Render) -> Array:
    """Node values of an unfolded render without those beyond the range that it had."""
    return np.ascontiguousarray(render.values[1:-1, 1:-1, 1:-1])


@pytest.mark.parametrize("method", ["tetrahedral", "trilinear"])
def test_an_unfolded_render_is_one_to_one_and_stays_where_samples_are(method: Interpolation) -> None:
    """A wide fold is taken out; kept nodes and a render without folds do not move; samples draw the change away."""
    sound = as_render(render_lut(9, method))
    none, everywhere = np.zeros((9, 9, 9), dtype=np.bool_), np.ones((9, 9, 9))
    assert folded_share(sound) == 0
    np.testing.assert_allclose(inside(unfolded(sound, everywhere, none)), sound.values, atol=1e-3)
    cube = sound.values.copy()
    cube[3, :, :, 0] = cube[5, :, :, 0]
    folded = as_render(compact(replace(sound.lut, cube=cube)))
    assert folded_share(folded) > 0.05
    r, g, b = folded.levels
    fixed = neutral_nodes((r, g, b))
    cube[fixed] = sound.values[fixed]
    folded = as_render(compact(replace(sound.lut, cube=cube)))
    kept = unfolded(folded, None, fixed)
    np.testing.assert_array_equal(inside(kept)[fixed], folded.values[fixed])
    seen = np.zeros((9, 9, 9))
    seen[3] = np.all((folded.values[3] > 0) & (folded.values[3] < 1), axis=-1)
    free, held = (unfolded(folded, support, none) for support in (None, seen))
    for render in (kept, free, held):
        assert folded_share(render) < 0.05 * folded_share(folded)
        assert render.levels.min() < -0.08
        assert render.levels.max() > 1.08
    moved, moved_least = (np.abs(inside(render) - folded.values)[seen > 0].mean() for render in (free, held))
    assert moved_least < 0.2 * moved


def test_a_bend_that_no_sample_showed_is_straightened() -> None:
    """One node off its neighbours' line comes near it; where samples are it stays."""
    sound = as_render(render_lut(9))
    cube = sound.values.copy()
    cube[5, 3, 4] += 0.03
    bent = as_render(compact(replace(sound.lut, cube=cube)))
    none, there, elsewhere = np.zeros((9, 9, 9), dtype=np.bool_), np.zeros((9, 9, 9)), np.zeros((9, 9, 9))
    there[5, 3, 4] = elsewhere[3, 6, 6] = 1.0
    held, off = (np.abs(inside(unfolded(bent, s, none))[5, 3, 4] - cube[5, 3, 4]).max() for s in (there, elsewhere))
    assert off > 0.01
    assert held < 0.003


def test_an_exact_inverse_runs_on_beyond_the_gamut() -> None:
    """Within it, the render takes it to the codes again, clipped ones too; beyond, it keeps rising."""
    pool = MadeColours.of(as_render(render_lut()), 1 << 10, 3)
    jpeg = as_8_bit(pool.jpeg)
    back = exact_inverse(pool, pool.render, pool.on_axes(jpeg), jpeg, np.full_like(jpeg, 0.3))
    assert np.quantile(np.linalg.norm(pool.render(back) - jpeg, axis=1), 0.99) < 0.004
    ramp = np.stack([np.linspace(0.6, 0.9, 30), np.zeros(30), np.full(30, 0.2)], axis=1)
    red = exact_inverse(pool, pool.render, pool.on_axes(ramp), ramp, np.full_like(ramp, 0.3))[:, 0]
    assert np.diff(red).min() > 0


def test_an_exact_inverse_of_clipped_codes_is_within_the_range_and_smooth() -> None:
    """Of all scenes of a clipped colour, one that the camera can take; beside it, the codes' scenes are beside it."""
    pool = MadeColours.of(as_render(render_lut()), 1 << 12, 3)
    clipped = pool.chosen(np.flatnonzero(np.any((pool.jpeg <= 0) | (pool.jpeg >= 1), axis=1)))
    scenes = [
        exact_inverse(pool, pool.render, clipped.inner, clipped.jpeg, np.full_like(clipped.jpeg, x)) for x in (0.2, 0.8)
    ]
    for raw in scenes:
        assert np.linalg.norm(pool.render(raw) - clipped.jpeg, axis=1).max() < 0.01
        assert np.abs(raw - np.clip(raw, 0.0, 1.0)).max() < 0.01
    assert np.quantile(np.linalg.norm(scenes[0] - scenes[1], axis=1), 0.99) < 0.01  # wherever the search begins


def waving_lut() -> Lut:
    """The same camera, but the green of saturated colours goes up and down."""
    lut = render_lut()
    raw, cube = grid(lut.levels), lut.cube.copy()
    cube[..., 1] += 0.3 * np.maximum(np.ptp(raw, axis=-1) - 0.45, 0.0) * np.sin(16.0 * raw[..., 1])
    return replace(lut, cube=cube)


@pytest.mark.slow
def test_a_render_that_folds_widely_comes_back(monkeypatch: pytest.MonkeyPatch) -> None:
    """With the colours that it made as it was, and its neutrals; said is how far it moved."""
    monkeypatch.setattr(mutual_inverses, "SIZE", 13)
    monkeypatch.setattr(mutual_inverses, "FINER", 21)
    monkeypatch.setattr(mutual_inverses, "POOL", 1 << 11)
    before, raw = waving_lut(), spread(1 << 12, seed=5)
    assert folded_share(as_render(before)) > mutual_inverses.WIDELY
    assert np.linalg.norm(before(raw) - render_lut()(raw), axis=1).mean() > 0.01
    render, inverse, trip = consistent(before, own_linearization())
    assert folded_share(as_render(render)) < 0.001
    for jpeg in (render(raw), before(raw)):
        error = np.linalg.norm(np.clip(render(inverse(jpeg)), 0, 1) - np.clip(jpeg, 0, 1), axis=1)
        assert error.mean() <= MEAN_GOAL / 4
        assert error.max() <= MAX_GOAL
    assert 1e-4 < trip.moved < 0.01
    assert f"of render where samples are {trip.moved:.2g}" in str(trip)
    grey = np.repeat(np.linspace(0, 1, 257)[:, None], 3, axis=1)
    np.testing.assert_allclose(render(grey), before(grey), atol=2e-3)


def test_a_file_of_a_render_from_below_raw_0_is_the_lut(tmp_path: Path) -> None:
    """OpenColorIO renders negative RAW as the LUT does; formats without such a range say so."""
    lut = replace(render_lut(9), lowest=-1 / 12)
    write_compact(lut, tmp_path / "render.clf")
    raw = np.random.default_rng(4).uniform(-0.2, 1.2, (2000, 3)).astype(np.float32)
    got = raw.copy()
    file = OCIO.FileTransform(str(tmp_path / "render.clf"), interpolation=OCIO.INTERP_BEST)
    OCIO.Config.CreateRaw().getProcessor(file).getDefaultCPUProcessor().applyRGB(got)
    np.testing.assert_allclose(got, lut(raw), atol=1e-4)
    assert np.abs(lut(raw) - lut(np.maximum(raw, 0))).max() > 0.01
    with pytest.raises(LutError, match='form="shaper"'):
        lut.as_lut().write(tmp_path / "render.csp")
