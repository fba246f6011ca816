"""What the plots show is what the samples and the models say; what is drawn is thinned, what is picked is not."""

from dataclasses import replace

import numpy as np
import pytest

from tests.studio.shots_for_the_studio import chart_samples

pytest.importorskip("panel", reason="the studio needs Panel: pip install 'lutforge[studio]'")
from bokeh.events import SelectionGeometry, Tap

from lutforge.colour.srgb import chromaticities, srgb_decode
from lutforge.progress import silent
from lutforge.samples.sample_set import SampleSet
from lutforge.studio.opening import Folders
from lutforge.studio.samples_page import COLOURS, PLOTS, BrushedPlot, colours, find_rows, points, tristimulus
from lutforge.studio.session import Session
from lutforge.studio.shots_page import card_of, facts_of, framed
from lutforge.studio.workspace import Workspace, WorkspaceError, find_pairs, fit_model

HOSTILE = "<script>alert(1)</script>"


@pytest.fixture(scope="module")
def workspace() -> Workspace:
    samples = chart_samples(patches=45)
    fresh = Workspace(samples, find_pairs(samples))
    return fresh.with_model("matrix", fit_model(fresh.task("matrix"), samples, silent))


def test_pairs_show_one_patch_at_two_exposures(workspace: Workspace) -> None:
    for channel in range(3):
        shown = points(workspace, "srgb_btf", channel)
        srgb, patch = workspace.samples.srgb, workspace.samples.patch
        assert np.array_equal(shown.x, srgb[shown.row, channel]) and np.array_equal(
            shown.y, srgb[shown.partner, channel]
        )
        assert np.array_equal(patch[shown.row], patch[shown.partner])
        assert np.all(workspace.samples.exposure_s[shown.row] < workspace.samples.exposure_s[shown.partner])
    raw = points(workspace, "raw_btf", 1)
    ratio = workspace.samples.exposure_s[raw.partner] / workspace.samples.exposure_s[raw.row]
    assert np.allclose(raw.y / raw.x, ratio, rtol=0.02)


def test_the_model_puts_neutral_colours_on_its_curve(workspace: Workspace) -> None:
    shown = points(workspace, "transformed", 1)
    (curve,) = shown.curves
    neutral = workspace.columns["saturation"][shown.row] < 0.1
    assert neutral.sum() > 50
    on_curve = np.interp(shown.x[neutral], *curve)
    assert np.median(np.abs(on_curve - shown.y[neutral])) < 0.01
    transfers = points(workspace, "srgb_btf", 1)
    stops = np.log2(workspace.samples.exposure_s[transfers.partner] / workspace.samples.exposure_s[transfers.row])
    assert len(transfers.curves) == len(np.unique(np.rint(100 * stops))) > 1
    for ratio in np.unique(np.rint(100 * stops)):  # each pair lies on the curve of its own ratio
        mine = (np.rint(100 * stops) == ratio) & (workspace.columns["saturation"][transfers.row] < 0.1)
        off = [np.median(np.abs(np.interp(transfers.x[mine], *one) - transfers.y[mine])) for one in transfers.curves]
        assert min(off) < 0.01 < max(off)
    linear = points(workspace, "linearization", 1)
    near = workspace.columns["saturation"][linear.row] < 0.1
    assert np.median(np.abs(linear.y[near] - linear.x[near])) < 0.01


@pytest.mark.parametrize("plot", PLOTS)
@pytest.mark.parametrize("by", COLOURS)
def test_every_plot_has_a_colour_for_each_point(workspace: Workspace, plot: str, by: str) -> None:
    shown = points(workspace, plot, 2)
    assert len(shown) > 0 and np.all(np.isfinite(shown.x)) and np.all(np.isfinite(shown.y))
    named = colours(workspace, shown, np.arange(len(shown)), by)
    assert len(named) == len(shown) and all(len(name) == 7 and name[0] == "#" for name in named)


def test_plots_say_why_they_are_empty() -> None:
    one = chart_samples(patches=9)
    alone = Workspace(one.select(one.shot == one.shot[0]))
    assert "exposures" in points(alone, "srgb_btf", 0).missing
    assert "fit a model" in points(alone, "transformed", 0).missing
    assert len(points(alone, "srgb_raw", 0)) == 9


def test_a_point_of_a_pair_selects_both_samples(workspace: Workspace) -> None:
    session = Session(Folders(()))
    session.begin(workspace)
    plot, shown = BrushedPlot(session), points(workspace, "srgb_btf", 1)
    plot.show(workspace, shown, "shot", inliers=False)
    plot._select(Tap(plot.figure, x=shown.x[10] + 1e-6, y=shown.y[10]))
    assert session.selected.sum() == 2 and session.selected[[shown.row[10], shown.partner[10]]].all()
    plot._select(Tap(plot.figure, x=5.0, y=5.0))
    assert not session.selected.any()
    (left, right), (low, high) = (0.1, 0.4), (0.2, 0.6)
    plot._select(SelectionGeometry(plot.figure, {"type": "rect", "x0": left, "x1": right, "y0": high, "y1": low}, True))
    inside = (shown.x >= left) & (shown.x <= right) & (shown.y >= low) & (shown.y <= high)
    assert set(np.flatnonzero(session.selected)) == {*shown.row[inside], *shown.partner[inside]} != set()


def test_colours_lie_where_cie_says() -> None:
    encoded = srgb_decode(np.array([[1.0, 1, 1], [1, 0, 0], [0, 0, 0]]))
    xy = chromaticities(encoded)
    assert np.allclose(xy, [[0.3127, 0.3290], [0.64, 0.33], [0.3127, 0.3290]], atol=2e-4)
    assert np.allclose(tristimulus(encoded)[0], [0.9505, 1.089, 1.0], atol=2e-3)  # X, Z, and Y upward


def test_rows_are_found_by_number_and_name(workspace: Workspace) -> None:
    samples = workspace.samples
    assert np.flatnonzero(find_rows(samples, "3, 7-9")).tolist() == [3, 7, 8, 9]
    assert np.array_equal(find_rows(samples, str(samples.shot[0])), samples.shot == samples.shot[0])
    for words in ("", "999999999999", "no such shot"):
        with pytest.raises(WorkspaceError):
            find_rows(samples, words)


def test_names_in_cards_are_text() -> None:
    samples: SampleSet = chart_samples(patches=9, names=(HOSTILE, HOSTILE))
    name, shot = next(samples.by_shot())
    card = card_of(name, {HOSTILE: b""}, [HOSTILE, *facts_of(name, shot, None, None)])
    assert "script" in card and "<script" not in card


def test_each_sample_has_a_frame_in_the_picture_of_its_shot() -> None:
    picture, places = np.full((200, 300, 3), 60, dtype=np.uint8), np.array([[0.25, 0.5], [0.7, 0.2]])
    drawn = framed(picture, places, np.array([False, True]))
    rows, columns = np.nonzero((drawn != picture).any(axis=2))
    for (x, y), colour in zip(places * (300, 200), ((255, 255, 255), (255, 140, 0)), strict=True):
        near = np.hypot(columns - x, rows - y) < 20
        assert np.all(drawn[rows[near], columns[near]] == colour)
        assert {(columns < x)[near].any(), (columns > x)[near].any(), (rows < y)[near].any()} == {True}
        np.testing.assert_array_equal(drawn[round(y), round(x)], 60)  # the sample itself stays to be seen
    assert (picture == 60).all()


def test_unticked_pairs_are_not_drawn(workspace: Workspace) -> None:
    assert workspace.pairs is not None
    names = [name for name in workspace.pairs.shots if name.startswith("shot standard")]
    fewer = replace(workspace, unticked=frozenset((one, other) for one in names for other in names))
    all_points, shown = points(workspace, "srgb_btf", 1), points(fewer, "srgb_btf", 1)
    assert 0 < len(shown) < len(all_points)
    assert (fewer.samples.style[shown.row] == "vivid").all()
