"""The studio's state: what counts as an outlier, undo and redo, and that a file brings the whole of it back."""

import json
import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.studio.shots_for_the_studio import chart_samples

pytest.importorskip("panel", reason="the studio needs Panel: pip install 'lutforge[studio]'")
from lutforge.calibration.options import CalibrationOptions
from lutforge.calibration.physical.physical_model import fit_stages
from lutforge.calibration.physical.unsaturated import saturation
from lutforge.model.profile_file import save_profile
from lutforge.pipeline.calibration import calibrate
from lutforge.samples.sample_set import SampleSet
from lutforge.simulate.camera import nikon_d5100
from lutforge.studio.fits import before, evaluate_on, fit_model, residuals
from lutforge.studio.workspace import Filters, History, Workspace, WorkspaceError
from lutforge.studio.workspace_file import find_pairs, open_workspace, save_workspace


def silent(what: str, share: float) -> None:
    pass


@pytest.fixture(scope="module")
def samples() -> SampleSet:
    return chart_samples(patches=45)


def rows_of(workspace: Workspace, *rows: int) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    mask = np.zeros(len(workspace.samples), dtype=np.bool_)
    mask[list(rows)] = True
    return mask


def test_filters_find_what_they_say(samples: SampleSet) -> None:
    workspace = Workspace(samples, filters=Filters(saturation=0.3, raw_saturated=0.5))
    assert np.array_equal(workspace.filtered["saturation"], saturation(samples.srgb) > 0.3)
    clipped = (samples.srgb.max(axis=1) > 254 / 255) | (samples.srgb.min(axis=1) < 1 / 255)
    assert np.array_equal(workspace.filtered["clipping"], clipped | (samples.raw.max(axis=1) >= 0.5))
    assert 0 < workspace.outliers.sum() < len(samples)
    assert not Workspace(samples).filtered["saturation"].any()


def test_the_hand_overrules_the_filters_and_groups(samples: SampleSet) -> None:
    workspace = Workspace(samples, filters=Filters(saturation=0.2))
    found = int(np.flatnonzero(workspace.outliers)[0])
    free = int(np.flatnonzero(~workspace.outliers)[0])
    workspace = workspace.mark(rows_of(workspace, found), False).mark(rows_of(workspace, free), True)
    assert not workspace.outliers[found] and workspace.outliers[free]
    grouped = workspace.with_group("glossy", rows_of(workspace, found, free, free + 1))
    assert not grouped.removed[found]
    assert grouped.removed[free + 1]
    assert not grouped.with_active_groups([]).removed[free + 1]
    assert not workspace.unmark(rows_of(workspace, free)).outliers[free]


def test_saturated_colours_are_kept_from_the_response_alone(samples: SampleSet) -> None:
    workspace = Workspace(samples, filters=Filters(saturation=0.3)).mark(np.arange(len(samples)) == 5, True)
    assert workspace.fitting_rows("response").sum() == (~workspace.outliers).sum()
    assert workspace.fitting_rows("lattice").sum() == len(samples) - 1
    assert not workspace.fitting_rows("rbf")[5]
    moved = replace(workspace, filters=Filters(saturation=0.3, brightest=200 / 255))
    bright = moved.filtered["clipping"]
    assert bright.any()
    assert np.array_equal(~moved.fitting_rows("lattice"), bright | (np.arange(len(samples)) == 5))


def test_a_gamut_map_stands_between_the_stages_that_were_fitted(samples: SampleSet) -> None:
    options = CalibrationOptions()
    workspace = Workspace(samples, filters=Filters(saturation=0.5))
    stages = fit_model("matrix", samples, workspace.fitting_rows("matrix"), options, None, silent).profile
    mapped = fit_model("rbf", samples, workspace.fitting_rows("rbf"), options, stages, silent)
    assert np.array_equal(mapped.profile.matrix, stages.matrix)
    for name, style in stages.styles.items():
        kept = mapped.profile.styles[name].physical[0]
        assert np.array_equal(kept.response.inverse, style.physical[0].response.inverse)
        assert len(kept.gamut_map.centres)
    saturated = workspace.chroma > 0.5
    before, after = (
        np.linalg.norm(model.predicted - samples.srgb, axis=1)[saturated].mean()
        for model in (evaluate_on(stages, "matrix", samples), mapped)
    )
    assert after < 0.5 * before


def test_figures_are_those_of_the_profile_itself() -> None:
    """Each white balance of a camera without RAW has a model of its own."""
    samples = chart_samples(patches=120)
    reference = replace(samples, raw_camera=np.full(len(samples), "Reference"), wb=np.full((len(samples), 3), np.nan))
    profile = calibrate(reference, CalibrationOptions())
    assert len(profile.styles["standard"].physical) > 1
    fitted = evaluate_on(profile, "rbf", reference)
    for setting in np.unique(samples.white_balance):
        rows = (samples.white_balance == setting) & (samples.style == "standard")
        exact = profile.render(f"standard/{setting}")(samples.raw[rows])
        np.testing.assert_array_equal(fitted.predicted[rows], exact)


def test_undo_and_redo_go_back_and_forth(samples: SampleSet) -> None:
    first = Workspace(samples)
    second = replace(first, filters=Filters(saturation=0.5))
    third = second.mark(np.arange(len(samples)) < 3, True)
    history = History(first).do(second).do(third)
    assert history.undo().present is second
    assert history.undo().undo().undo().present is first
    assert history.undo().redo().present is third
    assert history.undo().do(first).future == ()


@pytest.mark.parametrize("wrong", [{"saturation": 0.0}, {"darkest": 0.9, "brightest": 0.2}, {"residual": -1.0}])
def test_filters_refuse_limits_that_mean_nothing(wrong: dict[str, float]) -> None:
    with pytest.raises(WorkspaceError):
        Filters(**wrong)


def test_models_tell_the_camera_ever_better(samples: SampleSet) -> None:
    workspace = Workspace(samples, filters=Filters(saturation=0.6))
    options = CalibrationOptions(size=9)
    start = before(samples)
    assert start is not None
    everything = ~workspace.outliers
    errors = [residuals(start, "before", samples, everything)]
    for kind in ("response", "matrix", "lattice"):
        fitted = fit_model(kind, samples, workspace.fitting_rows(kind), options, None, silent)
        errors.append(residuals(fitted, kind, samples, everything))
        workspace = workspace.with_model(kind, fitted)
    means = [error.mean for error in errors if error is not None]
    assert len(means) == 4
    assert means[2] < 0.5 * means[1] < 0.5 * means[0]
    truth = nikon_d5100().matrix
    assert np.abs(workspace.models["matrix"].profile.matrix - truth).max() < 0.05
    assert workspace.models["lattice"].profile.styles["standard"].errors["render_mean"] == pytest.approx(
        calibrate(samples, options).styles["standard"].errors["render_mean"], abs=0
    )
    # The stages are those of the physical model that the command line fits.
    multipliers, known = samples.wb, np.ones(len(samples), dtype=np.bool_)
    rows = workspace.fitting_rows("matrix")
    usable = rows & np.all(samples.raw * multipliers < 1, axis=1) & np.all(samples.srgb < 1 - 0.5 / 255, axis=1)
    stages = fit_stages(samples.select(usable), multipliers[usable], known[usable])
    assert np.allclose(workspace.models["matrix"].profile.matrix, stages.matrix, atol=1e-9)


def test_the_profile_is_the_one_of_the_command_line(samples: SampleSet, tmp_path: Path) -> None:
    workspace = Workspace(samples).mark(np.arange(len(samples)) < 4, True)
    options = CalibrationOptions(size=9)
    rows = workspace.fitting_rows("lattice")
    save_profile(fit_model("lattice", samples, rows, options, None, silent).profile, tmp_path / "studio.npz")
    save_profile(calibrate(samples.select(rows), options), tmp_path / "command.npz")
    assert (tmp_path / "studio.npz").read_bytes() == (tmp_path / "command.npz").read_bytes()


def test_a_file_brings_everything_back(samples: SampleSet, tmp_path: Path) -> None:
    options = CalibrationOptions(size=9)
    workspace = Workspace(samples, filters=Filters(saturation=0.4, residual=0.05), options=options)
    workspace = workspace.mark(np.arange(len(samples)) < 3, True).mark(np.arange(len(samples)) == 7, False)
    workspace = workspace.with_group("<b>odd</b>", np.arange(len(samples)) % 50 == 0)
    workspace = workspace.with_group("off", samples.style == "vivid").with_active_groups(["<b>odd</b>"])
    for kind in ("response", "lattice"):
        workspace = workspace.with_model(
            kind, fit_model(kind, samples, workspace.fitting_rows(kind), options, None, silent)
        )
    save_workspace(workspace, tmp_path / "all.workspace")
    again = open_workspace(tmp_path / "all.workspace")
    assert again.filters == workspace.filters and again.options == options and again.model == "lattice"
    assert np.array_equal(again.hand, workspace.hand)
    assert np.array_equal(again.outliers, workspace.outliers)
    assert np.array_equal(again.removed, workspace.removed)
    for name in ("raw", "srgb", "wb", "shot", "patch", "exposure_s"):
        assert np.array_equal(getattr(again.samples, name), getattr(samples, name))
    assert np.array_equal(again.residual, workspace.residual)
    assert np.array_equal(again.fitted_rows, workspace.fitted_rows)
    assert np.array_equal(again.models["response"].linearized, workspace.models["response"].linearized)


def test_marks_after_a_fit_leave_what_it_was_fitted_to(samples: SampleSet) -> None:
    workspace = Workspace(samples, filters=Filters(saturation=0.6))
    rows = workspace.fitting_rows("response")
    fitted = fit_model("response", samples, rows, CalibrationOptions(), None, silent)
    later = workspace.with_model("response", fitted).mark(np.arange(len(samples)) < 9, True)
    assert np.array_equal(later.fitted_rows, rows)
    assert not np.array_equal(later.fitting_rows("response"), rows)


def damaged(path: Path, kind: str) -> None:
    """A workspace file with something wrong."""
    workspace = Workspace(chart_samples(patches=9))
    good = path.with_name("good.workspace")
    save_workspace(workspace, good)
    if kind == "no zip":
        path.write_bytes(b"not a workspace")
        return
    if kind == "cut off":
        path.write_bytes(good.read_bytes()[:2000])
        return
    with zipfile.ZipFile(good) as source, zipfile.ZipFile(path, "w") as target:
        for name in source.namelist():
            data = source.read(name)
            if name == "workspace.json":
                document = json.loads(data)
                document["models"] = ["../../etc/passwd"] if kind == "foreign model" else document["models"]
                document["version"] = 99 if kind == "newer" else 1
                document["filters"]["saturation"] = "1" if kind == "text for a number" else 1.0
                data = json.dumps(document).encode()
            if name == "marks.npy" and kind == "pickled marks":
                data = (
                    b"\x93NUMPY\x01\x00v\x00{'descr': '|O', 'fortran_order': False, 'shape': (1,), }".ljust(128) + b"\n"
                )
            if not (name == "samples.parquet" and kind == "no samples"):
                target.writestr(name, data)


@pytest.mark.parametrize(
    "kind", ["no zip", "cut off", "foreign model", "newer", "text for a number", "pickled marks", "no samples"]
)
def test_a_damaged_file_is_refused_in_one_line(kind: str, tmp_path: Path) -> None:
    damaged(tmp_path / "bad.workspace", kind)
    with pytest.raises(WorkspaceError) as error:
        open_workspace(tmp_path / "bad.workspace")
    assert "\n" not in str(error.value) and "bad.workspace" in str(error.value)


def test_pairs_and_models_of_unknown_settings(samples: SampleSet) -> None:
    pairs = find_pairs(samples)
    assert pairs is not None
    assert np.array_equal(pairs.first, samples.srgb[pairs.first_row])
    one = samples.select(samples.shot == samples.shot[0])
    assert find_pairs(one) is None
    fitted = fit_model(
        "response",
        samples.select(samples.style == "standard"),
        np.ones(540, dtype=np.bool_)[: (samples.style == "standard").sum()],
        CalibrationOptions(),
        None,
        silent,
    )
    assert np.all(np.isnan(evaluate_on(fitted.profile, "response", samples).predicted[samples.style == "vivid"]))
