"""The studio's state: what counts as an outlier, undo and redo, and that a file brings the whole of it back."""

import json
import zipfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from lutforge.colour.srgb import chromaticities, srgb_decode
from lutforge.progress import silent
from lutforge.samples.sample_set import SampleSet
from lutforge.thesis.options import ThesisOptions
from tests.studio.shots_for_the_studio import chart_samples

pytest.importorskip("panel", reason="the studio needs Panel: pip install 'lutforge[studio]'")
from bokeh.events import SelectionGeometry, Tap

from lutforge.calibration.options import CalibrationOptions
from lutforge.colour.saturation import saturation
from lutforge.pipeline.calibration import calibrate, calibrate_base
from lutforge.pipeline.evaluation import predict
from lutforge.studio.brushed_plot import BrushedPlot
from lutforge.studio.folders import Folders
from lutforge.studio.models import MODEL_TITLES, ModelKind, fit_model
from lutforge.studio.opening import find_pairs
from lutforge.studio.sample_plots import COLOURS, PLOTS, colours, points, tristimulus
from lutforge.studio.samples_page import find_rows
from lutforge.studio.session import Session
from lutforge.studio.shots_page import card_of, facts_of
from lutforge.studio.workspace import Workspace, WorkspaceError
from lutforge.studio.workspace_file import open_workspace, save_workspace
from tests.cases.same_bytes import same_bytes


@pytest.fixture(scope="module")
def samples() -> SampleSet:
    return chart_samples(patches=45)


def fitted(workspace: Workspace, kind: ModelKind) -> Workspace:
    """The workspace with a model of this kind, as a session computes it."""
    task = workspace.task(kind)
    return workspace.with_model(kind, replace(fit_model(task, workspace.samples, silent), task=task))


def rows_of(workspace: Workspace, *rows: int) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    mask = np.zeros(len(workspace.samples), dtype=np.bool_)
    mask[list(rows)] = True
    return mask


def test_filters_find_what_they_say(samples: SampleSet) -> None:
    workspace = Workspace(samples, limits={"saturation": (0.0, 0.3), "raw": (0.0, 0.5)})
    assert np.array_equal(workspace.filtered["saturation"], saturation(samples.srgb) > 0.3)
    clipped = (samples.srgb.max(axis=1) > 254 / 255) | (samples.srgb.min(axis=1) < 1 / 255)
    found = workspace.filtered
    assert np.array_equal(found["darkest"] | found["brightest"], clipped)
    assert np.array_equal(found["raw"], samples.raw.max(axis=1) > 0.5)
    assert 0 < workspace.outliers.sum() < len(samples)
    assert not Workspace(samples).filtered["saturation"].any()


def test_the_hand_overrules_the_filters_and_groups(samples: SampleSet) -> None:
    workspace = Workspace(samples, limits={"saturation": (0.0, 0.2)})
    found = int(np.flatnonzero(workspace.outliers)[0])
    free = int(np.flatnonzero(~workspace.outliers)[0])
    workspace = workspace.mark(rows_of(workspace, found), -1).mark(rows_of(workspace, free), 1)
    assert not workspace.outliers[found] and workspace.outliers[free]
    grouped = workspace.with_group("glossy", rows_of(workspace, found, free, free + 1))
    assert not grouped.excluded[found]
    assert grouped.excluded[free + 1]
    assert not grouped.with_active_groups([]).excluded[free + 1]
    assert not workspace.mark(rows_of(workspace, free), 0).outliers[free]


def test_saturated_colours_are_kept_from_the_response_alone(samples: SampleSet) -> None:
    workspace = Workspace(samples, limits={"saturation": (0.0, 0.3)}).mark(np.arange(len(samples)) == 5, 1)
    assert workspace.fitting_rows("matrix").sum() == (~workspace.outliers).sum()
    assert workspace.fitting_rows("lattice").sum() == len(samples) - 1
    assert not workspace.fitting_rows("lattice")[5]
    moved = replace(workspace, limits={"saturation": (0.0, 0.3), "brightest": (0, 200)})
    bright = moved.filtered["brightest"]
    assert bright.any()
    assert np.array_equal(~moved.fitting_rows("lattice"), bright | (np.arange(len(samples)) == 5))


@pytest.mark.slow
def test_gamut_map_and_lattice_stand_on_the_stages_that_were_fitted(samples: SampleSet) -> None:
    """What the filters keep from the response is in no model that builds on it."""
    options = CalibrationOptions(size=17)
    workspace = fitted(Workspace(samples, limits={"saturation": (0.0, 0.5)}, options=options), "matrix")
    stages = workspace.models["matrix"].profile
    assert workspace.models["matrix"].task is not None
    assert workspace.models["matrix"].task.rows.sum() < len(samples)
    mapped = fitted(workspace, "lattice")
    np.testing.assert_array_equal(mapped.models["lattice"].profile.matrix, stages.matrix)
    for name, style in stages.styles.items():
        kept = mapped.models["lattice"].profile.styles[name].models[0]
        np.testing.assert_array_equal(kept.response.inverse, style.models[0].response.inverse)
        assert len(kept.gamut_map.centres) > 8
    saturated = workspace.columns["saturation"] > 0.5
    before, after = (
        np.linalg.norm(model.predicted.rendered - samples.srgb, axis=1)[saturated].mean()
        for model in (workspace.models["matrix"], mapped.models["lattice"])
    )
    assert after < 0.5 * before
    lattice, alone = fitted(workspace, "lattice"), fitted(replace(workspace, builds_on_stages=False), "lattice")
    np.testing.assert_array_equal(lattice.models["lattice"].profile.matrix, stages.matrix)
    assert not np.array_equal(alone.models["lattice"].profile.matrix, stages.matrix)


@pytest.mark.slow
def test_what_changes_upstream_makes_models_stale(samples: SampleSet) -> None:
    fresh = Workspace(samples, find_pairs(samples), options=CalibrationOptions(size=5))
    workspace = fitted(fitted(fresh, "matrix"), "lattice")
    assert not workspace.is_stale("matrix") and not workspace.is_stale("lattice")
    marked = workspace.mark(rows_of(workspace, 3), 1)
    assert marked.is_stale("matrix") and marked.is_stale("lattice")
    assert np.array_equal(marked.fitted_rows, workspace.fitting_rows("lattice"))
    assert not marked.mark(rows_of(workspace, 3), 0).is_stale("lattice")
    out = replace(workspace, left_out_shots=frozenset({str(samples.shot[0])}))
    assert out.is_stale("lattice") and not out.fitting_rows("lattice")[samples.shot == samples.shot[0]].any()
    assert replace(workspace, options=CalibrationOptions(size=7)).is_stale("lattice")
    filtered = replace(workspace, limits={"saturation": (0.0, 0.4)})  # the lattice itself takes saturated colours
    assert filtered.is_stale("matrix") and filtered.is_stale("lattice")
    again = fitted(filtered, "matrix")
    assert not again.is_stale("matrix") and again.is_stale("lattice")
    assert not fitted(again, "lattice").is_stale("lattice")


def test_samples_of_no_ticked_pair_do_not_tell_the_response(samples: SampleSet) -> None:
    workspace = Workspace(samples, find_pairs(samples), options=ThesisOptions())
    assert workspace.pairs is not None
    shots = [name for name in workspace.pairs.shots if name.startswith("shot standard daylight")]
    everything = frozenset((first, second) for first in shots for second in shots)
    unticked = replace(workspace, unticked_pairs=everything)
    mine = np.isin(samples.shot, shots)
    assert unticked.outliers[mine].all() and not unticked.excluded.any()
    assert np.array_equal(unticked.fitting_rows("lattice"), workspace.fitting_rows("lattice"))
    first = replace(workspace, unticked_pairs=frozenset({(shots[0], shots[1])}))
    assert isinstance(options := first.task("matrix").options, ThesisOptions)
    assert options.without_pairs == ((shots[0], shots[1]),)


@pytest.mark.slow
def test_figures_of_a_camera_without_raw_are_those_of_the_profile_itself() -> None:
    samples = chart_samples(patches=120)
    reference = replace(samples, raw_camera=np.full(len(samples), "Reference"), wb=np.full((len(samples), 3), np.nan))
    profile = calibrate(reference, CalibrationOptions())
    predicted = predict(profile, reference)
    for setting in np.unique(samples.white_balance):
        rows = (samples.white_balance == setting) & (samples.style == "standard")
        exact = profile.render(f"standard/{setting}")(samples.raw[rows])
        np.testing.assert_array_equal(predicted.rendered[rows], exact)


def test_samples_of_a_setting_are_rendered_with_its_gain(samples: SampleSet) -> None:
    """By the name of the setting where the file tells its multipliers, and with the gain where a shot has its own."""
    profile = calibrate_base(samples, CalibrationOptions(size=5))
    balance = replace(profile.white_balances["tungsten"], gain=1.2)
    profile = replace(profile, white_balances={**profile.white_balances, "tungsten": balance})
    rows = (samples.white_balance == "tungsten") & (samples.style == "standard")
    exact = profile.render("standard/tungsten")(samples.raw[rows])
    np.testing.assert_allclose(predict(profile, samples).rendered[rows], exact, atol=1e-12)
    shifted = replace(samples, wb=samples.wb * [1.0 + 1e-4, 1.0, 1.0])
    np.testing.assert_allclose(predict(profile, shifted).rendered[rows], exact, atol=1e-3)


@pytest.mark.parametrize("wrong", [{"saturation": (0.5, 2.0)}, {"darkest": (9, 3)}, {"other": (0.0, 1.0)}])
def test_limits_that_mean_nothing_are_refused(samples: SampleSet, wrong: dict[str, tuple[float, float]]) -> None:
    with pytest.raises(WorkspaceError):
        Workspace(samples, limits=wrong)


@pytest.mark.slow
def test_the_profile_is_the_one_of_the_command_line(samples: SampleSet, tmp_path: Path) -> None:
    """Of a camera, too, that brings RAW up by 2 % on one setting."""
    brighter = np.where(samples.white_balance == "tungsten", 1.02, 1.0)
    samples = replace(samples, raw=samples.raw / brighter[:, None])
    workspace = Workspace(samples, options=CalibrationOptions(size=9)).mark(np.arange(len(samples)) < 4, 1)
    profile = fitted(workspace, "lattice").models["lattice"].profile
    assert profile.white_balances["tungsten"].gain == pytest.approx(1.02, abs=0.004)
    profile.save(tmp_path / "studio.npz")
    chosen = samples.select(workspace.fitting_rows("lattice"))
    calibrate(chosen, workspace.options).save(tmp_path / "command.npz")
    assert same_bytes(tmp_path / "studio.npz", tmp_path / "command.npz")


def test_a_file_brings_everything_back(samples: SampleSet, tmp_path: Path) -> None:
    options = CalibrationOptions(size=5, beta=0.25)
    workspace = Workspace(samples, limits={"saturation": (0.0, 0.4), "residual": (0.0, 12.0)}, options=options)
    workspace = workspace.mark(np.arange(len(samples)) < 3, 1).mark(np.arange(len(samples)) == 7, -1)
    workspace = workspace.with_group("<b>odd</b>", np.arange(len(samples)) % 50 == 0)
    workspace = workspace.with_group("off", samples.style == "vivid").with_active_groups(["<b>odd</b>"])
    workspace = replace(
        workspace, left_out_shots=frozenset({str(samples.shot[-1])}), unticked_pairs=frozenset({("a", "b")})
    )
    for kind in MODEL_TITLES:
        workspace = fitted(workspace, kind)
    save_workspace(workspace, tmp_path / "all.workspace")
    again = open_workspace(tmp_path / "all.workspace")
    assert again.limits == workspace.limits and again.options == options and again.model == "lattice"
    assert again.left_out_shots == workspace.left_out_shots and again.unticked_pairs == workspace.unticked_pairs
    assert np.array_equal(again.hand_marks, workspace.hand_marks)
    assert np.array_equal(again.outliers, workspace.outliers)
    assert np.array_equal(again.excluded, workspace.excluded)
    for name in ("raw", "srgb", "wb", "shot", "patch", "exposure_s"):
        assert np.array_equal(getattr(again.samples, name), getattr(samples, name))
    assert np.array_equal(again.residual, workspace.residual)
    assert np.array_equal(again.fitted_rows, workspace.fitted_rows)
    assert np.array_equal(again.models["matrix"].predicted.linearized, workspace.models["matrix"].predicted.linearized)
    for kind in MODEL_TITLES:
        assert again.is_stale(kind) == workspace.is_stale(kind)


def edited(**changes: object) -> dict[str, Callable[[bytes], bytes]]:
    return {"workspace.json": lambda data: json.dumps(json.loads(data) | changes).encode()}


PICKLED = b"\x93NUMPY\x01\x00v\x00{'descr': '|O', 'fortran_order': False, 'shape': (1,), }".ljust(128) + b"\n"
DAMAGES: dict[str, dict[str, Callable[[bytes], bytes]]] = {
    "foreign model": edited(models=["../../etc/passwd"]),
    "newer": edited(version=99),
    "text for a number": edited(limits={"saturation": ["1", "x"]}),
    "pickled marks": {"marks.npy": lambda data: PICKLED},
    "no samples": {"samples.npz": lambda data: b""},
}


@pytest.mark.parametrize("kind", ["no zip", "cut off", *DAMAGES])
def test_a_damaged_file_is_refused_in_one_line(kind: str, tmp_path: Path) -> None:
    good, bad = tmp_path / "good.workspace", tmp_path / "bad.workspace"
    save_workspace(Workspace(chart_samples(patches=9)), good)
    if kind in DAMAGES:
        with zipfile.ZipFile(good) as source, zipfile.ZipFile(bad, "w") as target:
            for name in source.namelist():
                if data := DAMAGES[kind].get(name, bytes)(source.read(name)):
                    target.writestr(name, data)
    else:
        bad.write_bytes(b"not a workspace" if kind == "no zip" else good.read_bytes()[:2000])
    with pytest.raises(WorkspaceError) as error:
        open_workspace(bad)
    assert "\n" not in str(error.value) and "bad.workspace" in str(error.value)


def test_pairs_and_models_of_unknown_settings(samples: SampleSet) -> None:
    pairs = find_pairs(samples)
    assert pairs is not None
    assert np.array_equal(pairs.first, samples.srgb[pairs.first_row])
    one = samples.select(samples.shot == samples.shot[0])
    assert find_pairs(one) is None
    standard = samples.select(samples.style == "standard")
    profile = fitted(Workspace(standard), "matrix").models["matrix"].profile
    assert np.all(np.isnan(predict(profile, samples).rendered[samples.style == "vivid"]))


HOSTILE = "<script>alert(1)</script>"


@pytest.fixture(scope="module")
def workspace(samples: SampleSet) -> Workspace:
    fresh = Workspace(samples, find_pairs(samples))
    return fresh.with_model("matrix", fit_model(fresh.task("matrix"), samples, silent))


def test_pairs_show_one_patch_at_two_exposures(workspace: Workspace) -> None:
    for channel in range(3):
        shown = points(workspace, "srgb_btf", channel)
        srgb, patch = workspace.samples.srgb, workspace.samples.patch
        assert np.array_equal(shown.x, srgb[shown.row, channel])
        assert np.array_equal(shown.y, srgb[shown.partner, channel])
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
        x = transfers.x[mine]
        y = transfers.y[mine]
        errors = [np.median(np.abs(np.interp(x, *curve) - y)) for curve in transfers.curves]
        assert min(errors) < 0.01 < max(errors)
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
    session.start_over(workspace)
    plot, shown = BrushedPlot(session), points(workspace, "srgb_btf", 1)
    plot.show(workspace, shown, COLOURS[0], inliers=False)
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
    assert not find_rows(samples, "").any()
    for words in ("999999999999", "no such shot"):
        with pytest.raises(WorkspaceError):
            find_rows(samples, words)


def test_names_in_cards_are_text() -> None:
    samples = chart_samples(patches=9, names=(HOSTILE, HOSTILE))
    name, shot = next(samples.by_shot())
    card = card_of(name, {HOSTILE: np.zeros((8, 8, 3), dtype=np.uint8)}, [HOSTILE, *facts_of(name, shot, None, None)])
    assert "script" in card and "<script" not in card


def test_unticked_pairs_are_not_drawn(workspace: Workspace) -> None:
    assert workspace.pairs is not None
    names = [name for name in workspace.pairs.shots if name.startswith("shot standard")]
    fewer = replace(workspace, unticked_pairs=frozenset((first, second) for first in names for second in names))
    all_points, shown = points(workspace, "srgb_btf", 1), points(fewer, "srgb_btf", 1)
    assert 0 < len(shown) < len(all_points)
    assert (fewer.samples.style[shown.row] == "vivid").all()
