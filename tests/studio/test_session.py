"""What a visitor may reach, and work in another process: cancelled at once, errors in one line."""

import asyncio
import gc
import os
import shlex
import signal
import subprocess
import sys
import time
import weakref
from collections.abc import Callable, Iterator
from dataclasses import replace
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from PIL.TiffImagePlugin import IFDRational
from typer.testing import CliRunner

from lutforge.cli.main import command_line
from lutforge.colour.spectra import chart_reflectances
from lutforge.progress import silent
from lutforge.samples.chart import chart_kind
from lutforge.simulate.camera import nikon_d5100
from tests.cases.brackets import bracket
from tests.cases.charts import photograph_chart
from tests.cases.pictures import apply_to_pixels
from tests.cases.same_bytes import same_bytes
from tests.studio.job_functions import broken, doubled, endless, killed, writes_for_ever, wrong
from tests.studio.shots_for_the_studio import chart_samples, photograph

pytest.importorskip("panel", reason="the studio needs Panel: pip install 'lutforge[studio]'")
import panel as pn
from bokeh.document import Document
from bokeh.events import SelectionGeometry
from panel.io.state import set_curdoc
from tornado.httputil import HTTPHeaders, HTTPServerRequest, RequestStartLine

from lutforge.calibration.options import CalibrationOptions
from lutforge.errors import ImageError
from lutforge.grading.batch import apply_batch
from lutforge.grading.profile_recipe import ProfileRecipe
from lutforge.images.read import read_image
from lutforge.images.write import write_image
from lutforge.luts.ops import Range
from lutforge.luts.sequence import Lut
from lutforge.model.camera_profile import CameraProfile, load_profile
from lutforge.pipeline.calibration import calibrate
from lutforge.pipeline.evaluation import predict
from lutforge.pipeline.looks import ChosenLook, look_lut, usual_setting
from lutforge.pipeline.photographs import read_small, thumbnail
from lutforge.settings import Selector
from lutforge.shots.metadata import software_tag
from lutforge.studio.export_page import ExportPage
from lutforge.studio.folders import FolderError, Folders
from lutforge.studio.jobs import Job
from lutforge.studio.kept_sessions import KeptSessions
from lutforge.studio.models import MODEL_TITLES, FittedModel
from lutforge.studio.opening import Opened, bracket_in, find_pairs
from lutforge.studio.page import PAGE_NAMES, Page, progress_of
from lutforge.studio.results import fit_in_turn, open_files, take_opened
from lutforge.studio.server import ContentSecurityPolicy, refused
from lutforge.studio.session import Session
from lutforge.studio.setting_control import BY_MULTIPLIERS, BY_TEMPERATURE, LABEL_AS_SHOT, SettingControl
from lutforge.studio.thumbnails import addresses
from lutforge.studio.ui import written
from lutforge.studio.workspace import Workspace, WorkspaceError, with_profile


def test_no_path_leads_out_of_the_folders(tmp_path: Path) -> None:
    inside, outside = tmp_path / "inside", tmp_path / "outside"
    inside.mkdir()
    outside.mkdir()
    (outside / "secret.csv").write_text("x")
    (inside / "link.csv").symlink_to(outside / "secret.csv")
    (inside / "folder").symlink_to(outside)
    (inside / "loop.csv").symlink_to(inside / "loop.csv")
    (inside / "mine.csv").write_text("x")
    folders = Folders([inside])
    assert folders.inside("mine.csv") == (inside / "mine.csv").resolve()
    assert folders.inside(str(inside / "new" / "file.npz")).name == "file.npz"
    for path in (
        "../../etc/passwd", "/etc/passwd", "../outside/secret.csv", "link.csv", "folder/secret.csv",
        "new/../../outside/x", "", "  ", "a\0b", "loop.csv/../../outside/x", "../inside2/x",
    ):  # fmt: skip
        with pytest.raises(FolderError) as error:
            folders.inside(path)
        assert "\n" not in str(error.value)
    assert folders.files([".csv"]) == ["mine.csv"]
    with pytest.raises(FolderError, match="not a folder"):
        Folders([inside / "mine.csv"])


def test_a_job_brings_its_result_or_one_line() -> None:
    jobs = [Job(doubled, 21), Job(wrong), Job(broken), Job(killed)]
    done, failed, raised, dead = (job.wait(120) for job in jobs)
    assert (done.state, done.result) == ("done", 42)
    assert (failed.state, failed.message) == ("failed", "two lines")
    assert raised.state == "failed" and "ZeroDivisionError: never" in raised.message
    assert dead.state == "failed" and "without a result" in dead.message
    assert Job(lambda progress: None).wait(120).state == "failed"  # which no other process can be given


def test_cancelling_ends_the_process(tmp_path: Path) -> None:
    mark = tmp_path / "alive"
    job = Job(endless, mark)
    deadline = time.monotonic() + 120
    while not mark.exists() or not mark.read_text():
        assert time.monotonic() < deadline
        time.sleep(0.05)
    number = int(mark.read_text())
    job.cancel()
    with pytest.raises(ProcessLookupError):
        os.kill(number, 0)


@pytest.fixture(scope="module")
def profile() -> CameraProfile:
    return calibrate(chart_samples(patches=45), CalibrationOptions(size=9))


def opened(folder: Path, profile: CameraProfile | None = None, workspace: Workspace | None = None) -> Page:
    """The page of a visit with a folder, without a browser: what takes long is done at once."""
    page = Page(Folders([folder]), ())
    page.session.state = replace(page.session.state, opened=Opened(profile=profile))
    page.session.start_over(workspace)
    page.session.page.on_change()
    return page


@pytest.mark.slow
def test_what_the_look_shows_is_what_apply_makes(profile: CameraProfile, tmp_path: Path) -> None:
    photograph(tmp_path / "picture.png", 120, 180)
    pixels = read_small(tmp_path / "picture.png", 2_100_000)
    assert pixels.shape == (120, 180, 3) and pixels.dtype == np.float32
    pixels[:20], pixels[20:25, :, 2] = 1.0, 1.0  # burnt out, and clipped in one channel
    write_image(tmp_path / "burnt.png", pixels, read_image(tmp_path / "picture.png"))
    profile.save(tmp_path / "camera.npz")
    for ev in (-0.7, 0.0, 0.7):
        lut = look_lut(profile, ChosenLook("standard/tungsten", "vivid/4500K+5", ev))
        assert lut is not None
        recipe = ProfileRecipe((tmp_path / "camera.npz",), "standard/tungsten", "vivid/4500K+5", ev)
        apply_batch(recipe, [tmp_path / "burnt.png"], tmp_path / "out")
        shown = apply_to_pixels(lut.processor(), read_image(tmp_path / "burnt.png").pixels[..., :3].copy())
        applied = np.rint(read_image(tmp_path / "out" / "burnt.png").pixels * 255)
        codes = np.clip(shown, 0.0, 1.0) * 255
        assert np.abs(codes - applied).max() <= 0.5 + 1e-3  # apply's codes are those that are shown, rounded
        assert np.ptp(applied[0, 0, :3]) <= 12  # white stays white
    assert look_lut(profile, ChosenLook("standard/daylight", "standard/daylight")) is None


def test_metadata_say_what_a_photograph_was_taken_as(profile: CameraProfile, tmp_path: Path) -> None:
    """As apply reads them, not the first setting of the list; a picture that tells nothing asks."""
    for name, make in (("tells.jpg", "Simulated"), ("silent.jpg", "")):
        photograph(tmp_path / name, 60, 90)
        if make:
            exif = Image.Exif()
            exif[0x010F], exif[0x0110], exif[0x0131] = make, make, software_tag(make, "vivid/tungsten")
            Image.open(tmp_path / name).save(tmp_path / name, exif=exif)
    page = opened(tmp_path, profile)
    page.show("Look")
    look = page.pages["Look"]
    assert page.session.look.target == "standard/daylight"  # not the first of the alphabet, cloudy
    look._open(tmp_path / "tells.jpg")
    assert "taken as vivid/tungsten" in page.session.page.status.object
    assert page.session.look == ChosenLook("vivid/tungsten", "vivid/tungsten") and not page.session.state.look_chosen
    assert progress_of(page.session)["Look"] == "done"
    look.wanted.style.value, look.wanted.balance.value = "standard", "daylight"
    assert page.session.look == ChosenLook("vivid/tungsten", "standard/daylight")
    look._open(tmp_path / "silent.jpg")
    assert "does not tell how it was taken" in page.session.page.status.object
    assert "vivid/tungsten" not in look.words.object and progress_of(page.session)["Look"] == "to do"
    assert (look.source.style.value, look.source.balance.value) == ("", "")  # not what the last was taken as
    assert page.session.look == ChosenLook("", "standard/daylight") and look.view.a == []
    look.source.style.value, look.source.balance.value = "standard", "tungsten"
    assert page.session.look.source == "standard/tungsten" and look.view.a


def test_undo_of_a_slider_leaves_what_a_photograph_was_taken_as(profile: CameraProfile, tmp_path: Path) -> None:
    photograph(tmp_path / "tells.jpg", 60, 90)
    exif = Image.Exif()
    exif[0x010F], exif[0x0110], exif[0x0131] = "Simulated", "Simulated", software_tag("Simulated", "vivid/tungsten")
    Image.open(tmp_path / "tells.jpg").save(tmp_path / "tells.jpg", exif=exif)
    page = opened(tmp_path, profile)
    page.show("Look")
    look = page.pages["Look"]
    look.ev.value = 1.0
    look._open(tmp_path / "tells.jpg")
    page.session.undo()
    assert page.session.look == ChosenLook("vivid/tungsten", "standard/daylight", 0.0)


def test_a_look_takes_presets_temperatures_and_multipliers(profile: CameraProfile) -> None:
    control = SettingControl("Wanted")
    control.offer(profile)
    taken = Selector("vivid", "tungsten")
    for balance, expected in (
        ("cloudy", "standard/cloudy"), (LABEL_AS_SHOT, "standard/tungsten"), (BY_TEMPERATURE, "standard/4300K"),
        (BY_MULTIPLIERS, "standard/2.1,1,1.4"),
    ):  # fmt: skip
        control.balance.value, control.kelvin.value, control.multipliers.value = balance, 4300, "2.1,1,1.4"
        assert control.text(taken) == expected
        profile.selector(control.text(taken))
    control.balance.value, control.tint.value = "daylight", 5
    assert control.text(None) == "standard/daylight+5"
    control.balance.value = LABEL_AS_SHOT
    with pytest.raises(WorkspaceError, match="choose one"):
        control.text(None)


def test_a_profile_of_another_camera_does_not_take_the_place_of_a_model(tmp_path: Path, profile: CameraProfile) -> None:
    session = opened(tmp_path, workspace=with_profile(Workspace(chart_samples(patches=9)), profile)).session
    other = replace(profile, camera="Another")
    session.page.attempt(take_opened, session, Opened(profile=other), "other.npz")
    assert "other.npz: a profile of Another, which is not used" in session.page.status.object
    assert session.profile is profile and session.opened.profile is None
    session.start_over(None)
    take_opened(session, Opened(profile=other), "other.npz")
    assert session.profile is other


def test_pairs_are_ticked_one_by_one_and_all_at_once(tmp_path: Path) -> None:
    samples = chart_samples(patches=9)
    page = opened(tmp_path, workspace=Workspace(samples, find_pairs(samples)))
    page.show("Model")
    pairs, session = page.pages["Model"].pairs, page.session
    first, *others = pairs.value
    pairs.value = others
    assert session.require_workspace().unticked_pairs == {first}
    pairs.value = []
    assert len(session.require_workspace().unticked_pairs) == 1 + len(others)
    session.undo()
    assert pairs.value == others


@pytest.fixture
def served(tmp_path: Path) -> Iterator[tuple[Page, Document]]:
    """A page as it is while a browser shows it, whose callbacks are due when the test says so."""
    page, document, context = opened(tmp_path, workspace=Workspace(chart_samples(patches=9))), Document(), object()
    document._session_context = lambda: context
    pn.state._loaded[document] = True  # what a browser reports
    with set_curdoc(document):
        yield page, document
        page.session.close()


def polled(session: Session, until: Callable[[], bool]) -> None:
    """Take over what jobs report until there is what is waited for."""
    deadline = time.monotonic() + 120
    while not until():
        assert time.monotonic() < deadline
        session.work.poll()
        time.sleep(0.02)


def test_what_is_started_meanwhile_waits_for_its_turn(served: tuple[Page, Document]) -> None:
    session, results = served[0].session, list[int]()
    for number in (1, 2):
        session.work.start(f"job {number}", results.append, doubled, number)
    assert "job 2: comes after job 1" in session.page.status.object
    polled(session, lambda: len(results) == 2)
    assert results == [2, 4] and not session.work.cancel_button.visible


@pytest.mark.slow
def test_a_lattice_that_waits_for_a_matrix_builds_on_it(served: tuple[Page, Document]) -> None:
    """It takes the stages, and the samples, of when its turn has come, not of when it was asked for."""
    session = served[0].session
    session.change_workspace(replace(session.require_workspace(), options=CalibrationOptions(size=9)))
    fit_in_turn(session, "matrix")
    fit_in_turn(session, "lattice")
    session.change_workspace(session.require_workspace().mark(np.arange(162) < 3, 1))
    polled(session, lambda: not session.work.queue.works)
    workspace = session.require_workspace()
    assert [workspace.is_stale(kind) for kind in MODEL_TITLES] == [False, False]
    task = workspace.models["lattice"].task
    assert task is not None and task.stages is workspace.models["matrix"]


def test_work_whose_samples_are_gone_is_one_line(served: tuple[Page, Document]) -> None:
    session = served[0].session
    session.work.start("a job", lambda result: None, doubled, 1)
    fit_in_turn(session, "lattice")
    session.start_over(None)
    polled(session, lambda: not session.work.queue.works)
    assert "no samples are open" in session.page.status.object


def test_an_error_outlives_the_news_of_other_jobs(served: tuple[Page, Document]) -> None:
    """It stays until its job runs again, or until the visitor presses a button or goes to another step."""
    page = served[0]
    session, results, fails = page.session, list[int](), [True]

    def start(title: str) -> None:
        if title == "a fit" and fails[0]:
            session.work.start(title, results.append, wrong)
        else:
            session.work.start(title, results.append, doubled, 1)
        polled(session, lambda: not session.work.queue.works)

    def status() -> str:
        return str(session.page.status.object)

    start("a fit")
    start("another job")
    assert results == [2] and 'role="alert"' in status() and "a fit" in status() and "another job" in status()
    page.pages["Shots"].chart.value = "classic"  # while it is read
    assert 'role="alert"' in status()
    fails[0] = False
    start("a fit")
    assert 'role="alert"' not in status()

    fails[0] = True
    start("a fit")
    page.show("Samples")
    assert 'role="alert"' not in status()


def test_a_picture_is_opened_beside_a_fit(served: tuple[Page, Document], tmp_path: Path) -> None:
    session, results = served[0].session, list[int]()
    session.work.start("a fit", results.append, endless, tmp_path / "alive")
    session.work.start("a picture", results.append, endless, tmp_path / "alive too", short=True)
    session.work.start("the next picture", results.append, doubled, 21, short=True)  # takes its place
    polled(session, lambda: results == [42])
    assert session.work.cancel_button.visible
    session.work.cancel()
    assert "a fit: cancelled" in session.page.status.object and not session.work.cancel_button.visible


def test_what_is_clicked_while_a_job_ends_is_done(served: tuple[Page, Document]) -> None:
    """A click whose callback is due after the news of a job, which draw all controls anew, is not undone by them."""
    page, document = served
    name, paper = next(iter(page.pages["Shots"].papers.items()))
    page.session.page.guarded(page.session.page.on_change)()  # as a job does that has ended
    (news,) = document.session_callbacks
    paper[0].value = False
    (click,) = set(document.session_callbacks) - {news}
    for due in (news, click):
        due.callback()
    assert page.session.workspace is not None
    assert page.session.workspace.left_out_shots == {name} and not paper[0].value


def test_undo_and_redo_go_back_and_forth(tmp_path: Path) -> None:
    first = Workspace(chart_samples(patches=9))
    page = opened(tmp_path, workspace=first)
    session, second = page.session, replace(first, limits={"saturation": (0.0, 0.5)})
    third = second.mark(np.arange(len(first.samples)) < 3, 1)
    session.change_workspace(second)
    session.change_workspace(third)
    session.undo()
    assert session.workspace is second
    session.redo()
    assert session.workspace is third and page.redo.disabled and not page.undo.disabled
    for _ in range(3):
        session.undo()
    assert session.workspace is first and page.undo.disabled
    session.change_workspace(third)
    session.redo()
    assert session.workspace is third and session.history.next("Shots") is None


def test_a_shot_keeps_its_box_while_its_card_is_drawn_anew(tmp_path: Path) -> None:
    samples = chart_samples(patches=9)
    page = opened(tmp_path, workspace=Workspace(samples))
    session, shots = page.session, page.pages["Shots"]
    papers, boxes = list(shots.grid), [paper[0] for paper in shots.grid]
    assert len(papers) == len(np.unique(samples.shot))
    session.change_workspace(Workspace(samples.select(samples.patch == "0")))
    assert "1 samples" in papers[0][1].object
    assert all(first is second for first, second in zip(shots.grid, papers, strict=True))
    assert all(paper[0] is box for paper, box in zip(shots.grid, boxes, strict=True))
    boxes[0].value = False
    assert session.workspace is not None and session.workspace.left_out_shots == {next(iter(shots.papers))}


def test_what_was_written_keeps_its_card(profile: CameraProfile, tmp_path: Path) -> None:
    page = opened(tmp_path, profile)
    page.show("Export")
    view = page.pages["Export"]
    assert {"darktable", "rawtherapee"} <= set(view.program.options)
    view._save_profile()
    card = view.main[0]
    page.session.page.on_change()
    assert view.main[0] is card
    view._announce("LUT, render", tmp_path / "camera_render.clf", (), "", ("target",))
    page.session.state = replace(page.session.state, chosen=ChosenLook("", "vivid/tungsten"))
    page.session.page.on_change()
    assert "(stale)" in view.main[0][0].object and view.main[1] is card


def test_names_of_styles_are_text_in_every_step(profile: CameraProfile, tmp_path: Path) -> None:
    hostile = "<img src=x onerror=alert(1)>"
    styles = {hostile if name == "standard" else name: style for name, style in profile.styles.items()}
    samples = chart_samples(patches=9)
    workspace = Workspace(replace(samples, style=np.full(len(samples), hostile)))
    page = opened(tmp_path, replace(profile, styles=styles), workspace)
    page.session.selected = np.ones(len(samples), dtype=np.bool_)
    page.session.state = replace(page.session.state, chosen=ChosenLook("", f"{hostile}/daylight"))
    for step in PAGE_NAMES:
        page.show(step)
        shown = [str(pane.object) for part in (page.controls, page.body) for pane in part.select(pn.pane.HTML)]
        assert shown and not any("<img src=x" in text for text in shown), step
        assert step != "Samples" or any("&lt;img src=x" in text for text in shown)  # which names a sample's style


def test_a_path_is_opened_by_the_enter_key(tmp_path: Path) -> None:
    chart_samples(patches=9).save(tmp_path / "samples.csv")
    page = opened(tmp_path)
    path = page.pages["Shots"].path
    path.param.update(value="samples.csv", value_input="samples.csv")
    path.param.trigger("enter_pressed")
    assert page.session.workspace is not None


def test_a_folder_of_raw_files_is_offered_by_its_name(tmp_path: Path) -> None:
    (tmp_path / "a.dng").write_bytes(b"")
    listed = opened(tmp_path).pages["Shots"].listed
    assert listed.value == "." and listed.options[f"{tmp_path.name}, this folder"] == "."


def test_an_error_goes_with_the_next_step(tmp_path: Path) -> None:
    page = opened(tmp_path)
    page.pages["Shots"].path.value = "../outside"
    page.session.page.guarded(page.pages["Shots"]._open)()
    assert 'role="alert"' in page.session.page.status.object
    page.show("Model")
    assert "alert" not in page.session.page.status.object


def test_the_first_plots_of_samples_show_something(tmp_path: Path) -> None:
    page, samples = opened(tmp_path), chart_samples(patches=9)
    paired = Workspace(samples, find_pairs(samples))
    for workspace, shown in ((Workspace(replace(samples)), "saturation"), (paired, "srgb_btf")):
        page.session.start_over(workspace)
        page.session.page.on_change()
        page.show("Samples")
        view = page.pages["Samples"]
        assert view.first.value == shown
        assert all(len(plot.source.data["x"]) for plot in (view.left, view.right))


@pytest.mark.slow
def test_a_profile_without_raw_works_in_every_step(tmp_path: Path) -> None:
    samples = chart_samples(patches=45)
    reference = replace(samples, raw_camera=np.full(len(samples), "Reference"), wb=np.full((len(samples), 3), np.nan))
    page = opened(tmp_path, calibrate(reference, CalibrationOptions(centres=60)))
    for workspace in (None, with_profile(Workspace(reference), page.session.require_profile())):
        page.session.start_over(workspace)
        page.session.page.on_change()
        for step in PAGE_NAMES:
            page.show(step)
    look = page.pages["Look"]
    look.wanted.style.value, look.source.style.value, look.source.balance.value = "vivid", "standard", "daylight"
    assert page.session.look.source and look.view.a and page.session.look.target.startswith("vivid/")


def export_page(folder: Path, profile: CameraProfile, **opened_from: Any) -> tuple[ExportPage, Session]:
    page = opened(folder, profile)
    page.session.state = replace(page.session.state, opened=Opened(profile=profile, **opened_from))
    page.session.state = replace(page.session.state, chosen=ChosenLook("standard/tungsten", "vivid/daylight", 0.8))
    page.show("Export")
    return page.pages["Export"], page.session


def test_a_profile_does_not_replace_a_file_unasked(profile: CameraProfile, tmp_path: Path) -> None:
    view, _ = export_page(tmp_path, profile)
    (tmp_path / "camera.npz").write_text("another's")
    with pytest.raises(WorkspaceError, match="press again"):
        view._save_profile()
    assert (tmp_path / "camera.npz").read_text() == "another's"
    for _ in range(2):  # asked for again, and then its own file
        view._save_profile()
        assert load_profile(tmp_path / "camera.npz").camera == profile.camera


def test_exports_of_an_opened_profile_leave_it_as_it_is(profile: CameraProfile, tmp_path: Path) -> None:
    profile.save(tmp_path / "camera.npz")
    page = opened(tmp_path)
    open_files(page.session, (tmp_path / "camera.npz",))
    page.session.state = replace(page.session.state, chosen=ChosenLook("standard/tungsten", "vivid/daylight"))
    page.show("Export")
    page.pages["Export"]._bake_lut()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["camera.npz", "camera_refinish.clf"]


@pytest.mark.usefixtures("small_profiles", "small_inverses")
@pytest.mark.parametrize(
    ("action", "suffix"),
    [
        ("Bake LUT", "_refinish.clf"),
        ("Write kit", "_rawtherapee_kit"),
        pytest.param("Write config", ".ocioz", marks=pytest.mark.slow),
        pytest.param("Write report", ".html", marks=pytest.mark.slow),
    ],
)
def test_an_export_is_the_command_that_it_tells(
    profile: CameraProfile, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, action: str, suffix: str
) -> None:
    monkeypatch.chdir(tmp_path)
    profile.save(tmp_path / "camera.npz")
    view, session = export_page(tmp_path, profile, profile_source=tmp_path / "camera.npz")
    view.name.value, view.program.value = "mine", "rawtherapee"
    view.actions[action]()
    (written,) = session.written.values()
    assert written.lines and all("\n" not in line for line in written.lines)
    assert any("read back, against the model" in line for line in written.lines) or action not in (
        "Bake LUT",
        "Write kit",
    )
    result = CliRunner().invoke(command_line(), shlex.split(written.command.replace("mine", "theirs"))[1:])
    assert result.exit_code == 0, result.output
    mine, theirs = (tmp_path / f"{name}{suffix}" for name in ("mine", "theirs"))
    for file in sorted(mine.rglob("*")) if mine.is_dir() else [mine]:
        other = theirs / file.relative_to(mine) if mine.is_dir() else theirs
        assert same_bytes(file, other), file


def test_a_lut_that_changes_nothing_is_not_written(profile: CameraProfile, tmp_path: Path) -> None:
    view, session = export_page(tmp_path, profile)
    session.state = replace(session.state, chosen=ChosenLook("vivid/daylight", "vivid/daylight"))
    with pytest.raises(WorkspaceError, match="nothing changes"):
        view._bake_lut()
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_a_kit_is_written_again_over_what_was_written(profile: CameraProfile, tmp_path: Path) -> None:
    """Without a look it is of the camera's usual one."""
    view, session = export_page(tmp_path, profile)
    session.state = replace(session.state, chosen=None)
    view.program.value = "rawtherapee"
    for _ in range(2):
        view._write_kit()
    written = session.written["kit for rawtherapee"]
    assert "read README.md first" in written.lines[0] and "--to standard/daylight" in written.command


def test_what_changes_upstream_makes_the_steps_stale(profile: CameraProfile, tmp_path: Path) -> None:
    page = opened(tmp_path)
    session, samples = page.session, chart_samples(patches=9)
    assert list(progress_of(session).values()) == ["to do"] * 5
    workspace = Workspace(samples)
    session.start_over(workspace)
    model = FittedModel(profile, predict(profile, samples), task=workspace.task("lattice"))
    session.change_workspace(workspace.with_model("lattice", model))
    assert list(progress_of(session).values()) == ["done", "done", "done", "to do", "to do"]
    page.show("Look")
    assert progress_of(session)["Look"] == "to do"
    page.pages["Look"].wanted.style.value = "vivid"
    page.show("Export")
    page.pages["Export"].name.value = "mine"
    page.pages["Export"]._save_profile()
    assert list(progress_of(session).values()) == ["done"] * 5
    page.show("Look")
    page.pages["Look"].ev.value = 1.0
    assert progress_of(session)["Export"] == "done"  # a profile is that of any look
    page.show("Export")
    page.pages["Export"]._announce("kit", tmp_path / "kit", (), "", ("target",))
    page.pages["Export"]._announce("LUT", tmp_path / "mine.clf", (), "", ("source", "target", "ev"))
    page.show("Look")
    page.pages["Look"].ev.value = 0.5
    assert [session.is_old(written) for written in session.written.values()] == [False, False, True]
    page.pages["Look"].wanted.style.value = "standard"
    assert [session.is_old(written) for written in session.written.values()] == [False, True, True]
    assert progress_of(session)["Export"] == "stale"
    session.change_workspace(replace(session.require_workspace(), left_out_shots=frozenset({str(samples.shot[0])})))
    assert list(progress_of(session).values()) == ["done", "done", "stale", "stale", "stale"]
    session.undo()
    assert progress_of(session)["Model"] == "done"


def test_a_lasso_picks_what_is_thinned_out_of_the_drawing(tmp_path: Path) -> None:
    few = chart_samples(patches=90)
    many = few.select(np.resize(np.arange(len(few)), 100_000))
    many = replace(many, patch=np.arange(len(many)).astype(np.str_))
    page = opened(tmp_path, workspace=Workspace(many))
    page.show("Samples")
    plot = page.pages["Samples"].right
    shape = {"type": "poly", "x": [0.0, 0.9, 0.0], "y": [0.0, 0.0, 0.9]}
    plot._select(SelectionGeometry(plot.figure, shape, final=True))
    raw, srgb = many.raw[:, 1], many.srgb[:, 1]
    inside = (raw > 0) & (srgb > 0) & (raw + srgb < 0.9)
    assert inside.sum() > 5_000 and np.array_equal(page.session.selected, inside)
    assert len(plot.source.data["x"]) <= 4_000
    page.session.select(inside)
    page.pages["Samples"].refresh()
    assert 4_000 < len(plot.source.data["x"]) <= 8_000  # what is selected is drawn, too


def test_large_photographs_are_averaged_down(tmp_path: Path) -> None:
    photograph(tmp_path / "large.png", 300, 400)
    small = read_small(tmp_path / "large.png", 20_000)
    whole = read_small(tmp_path / "large.png", 2_100_000)
    assert small.shape == (100, 133, 3)
    assert np.allclose(small[0, 0], whole[:3, :3].mean(axis=(0, 1)), atol=1e-5)


def test_pages_run_their_own_scripts_alone() -> None:
    request = HTTPServerRequest(
        headers=HTTPHeaders({"Host": "127.0.0.1:5006"}), start_line=RequestStartLine("GET", "/", "HTTP/1.1")
    )
    headers = HTTPHeaders({"Content-Type": "text/html"})
    _, headers, page = ContentSecurityPolicy(request).transform_first_chunk(200, headers, b"<script>1</script>", True)
    (policy,) = (part for part in headers["Content-Security-Policy"].split("; ") if part.startswith("script-src"))
    assert "unsafe-inline" not in policy and "*" not in policy
    number = page.decode().split('nonce="')[1].split('"')[0]
    assert f"'nonce-{number}'" in policy and len(number) > 20


@pytest.mark.slow
def test_ctrl_c_ends_the_studio_without_a_traceback(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "lutforge", "studio", "--no-browser", "--port", "0", "--folder", str(tmp_path)]
    for early in (True, False):  # while the processes of its jobs start, and later
        with (tmp_path / "log").open("w") as log:
            server = subprocess.Popen(command, stdout=log, stderr=log, cwd=tmp_path, start_new_session=True)
            deadline = time.monotonic() + 120
            while "http://" not in (tmp_path / "log").read_text():
                assert server.poll() is None and time.monotonic() < deadline, (tmp_path / "log").read_text()
                time.sleep(0.05)
            time.sleep(0.3 if early else 8.0)
            os.killpg(server.pid, signal.SIGINT)  # as a terminal does: to every process of the group
            assert server.wait(60) in (0, 130)
        printed = (tmp_path / "log").read_text()
        assert "Traceback" not in printed
        assert "leaked" not in printed  # as libraries say of objects that are there when Python has ended


@pytest.fixture(scope="module")
def bracket_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a bracket in it, whose files state their exposure times."""
    folder = tmp_path_factory.mktemp("studio") / "bracket"
    folder.mkdir()
    times, _, images = bracket(lambda light: light ** (1 / 1.8))
    for index, (seconds, image) in enumerate(zip(times, images, strict=True)):
        exif = Image.Exif()
        exif[0x0110] = "Drone 7"
        exif.get_ifd(0x8769)[0x829A] = IFDRational(float(seconds))
        picture = Image.fromarray(np.rint(255 * image).astype(np.uint8))
        picture.save(folder / f"{index}.jpg", quality=97, exif=exif)
    return folder


def opened_bracket(folder: Path) -> Page:
    """The page of a visit that has opened the folder of a bracket."""
    page = Page(Folders([folder.parent]), ())
    open_files(page.session, (folder,))
    return page


def test_what_is_a_bracket(bracket_folder: Path, tmp_path: Path) -> None:
    opened = bracket_in([bracket_folder], silent)
    assert opened is not None and "pictures of Drone 7 without RAW: a bracket of" in str(opened.bracket)
    assert bracket_in([bracket_folder / "0.jpg"], silent) is None  # a picture alone
    assert bracket_in([tmp_path], silent) is None
    for name in ("a.jpg", "b.jpg"):
        Image.new("RGB", (8, 8)).save(tmp_path / name)
    opened = bracket_in([tmp_path], silent)
    assert opened is not None and "do not state their exposures" in str(opened.bracket)
    (tmp_path / "a.dng").write_bytes(b"")
    assert bracket_in([tmp_path], silent) is None
    assert "bracket" in Folders([bracket_folder.parent]).with_shots()


@pytest.mark.slow
def test_a_response_is_exported_as_by_the_command_line(bracket_folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    page = opened_bracket(bracket_folder)
    session, shots = page.session, page.pages["Shots"]
    assert "a bracket of" in session.page.status.object and "press Fit response" in shots.notes.object
    assert shots.bracket.visible and not shots.response.visible
    workspace = session.require_workspace()
    assert len(workspace.samples) > 100 and not workspace.has_raw and workspace.pairs is not None
    page.show("Samples")
    assert len(page.pages["Samples"].left.source.data["x"]) > 100
    page.show("Shots")
    shots.papers["1.jpg"][0].value = False
    shots._fit()
    assert session.response is not None
    assert [file.name for file in session.response[0].files][:2] == ["0.jpg", "2.jpg"]
    assert "is a fixed property of this camera" in shots.findings.object and shots.response.visible
    assert any("true / stated" in card[1].object for card in shots.grid)
    assert session.require_workspace().response is not None  # whose brightness transfer functions the samples lie on
    for step in PAGE_NAMES:
        page.show(step)
    assert page.pages["Model"].views["Fit"].figures.layout[0]  # a profile shows its response, without RAW
    view = page.pages["Export"]
    assert (view.kind.value, view.space.value) == ("linearize", "raw")
    view.name.value = "drone"
    view._save_profile()
    commands = [session.written["profile"].command]
    root = bracket_folder.parent
    for suffix in (".cube", ".clf", ".csp"):
        view.suffix.value = suffix
        view._bake_lut()
        assert suffix != ".cube" or "LUT_1D_SIZE" in (root / "drone_linearize.cube").read_text()
        commands.append(session.written["LUT, linearize"].command)
    view.actions["Write config"]()
    commands.append(session.written["config"].command)
    monkeypatch.chdir(root)
    made = [path for path in root.iterdir() if path.name.startswith("drone")]
    assert len(made) >= 5
    for command in commands:
        words = [word.replace("drone", "theirs") for word in shlex.split(command)[1:]]
        assert CliRunner().invoke(command_line(), words).exit_code == 0, command
    for path in made:
        theirs = root / path.name.replace("drone", "theirs")
        assert same_bytes(path, theirs.read_bytes().replace(b"theirs", b"drone")), path


@pytest.mark.slow
def test_a_chart_gives_an_input_transform(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = tmp_path / "chart"
    folder.mkdir()
    photograph_chart(nikon_d5100(), chart_kind("classic"), chart_reflectances(), folder, (-3, -2, -1, 0, 1))
    page = opened_bracket(folder)
    view = page.pages["Shots"]
    view.chart.value, view.light.value = "classic", "5200K"
    view._fit()
    assert any("chart found here" in card[1].object for card in view.grid)
    page.show("Export")
    export = page.pages["Export"]
    assert (export.kind.value, export.space.value) == ("linearize", "aces2065-1")
    export._save_profile()
    monkeypatch.chdir(tmp_path)
    words = shlex.split(page.session.written["profile"].command)[1:]
    assert CliRunner().invoke(command_line(), [*words[:-1], "theirs.npz"]).exit_code == 0
    assert same_bytes(tmp_path / "theirs.npz", tmp_path / "camera.npz")


def test_undo_is_of_the_step_that_is_seen_and_named(profile: CameraProfile, tmp_path: Path) -> None:
    page = opened(tmp_path, workspace=with_profile(Workspace(chart_samples(patches=9)), profile))
    session = page.session
    page.show("Samples")
    session.change_workspace(
        session.require_workspace().mark(session.require_workspace().samples.patch == "0", 1), "marked"
    )
    page.show("Look")
    look = page.pages["Look"]
    for value in (0.4, 0.95, 1.5):  # one move, from press to release
        look.ev.value = value
    assert page.undo.label == "Undo Exposure, EV +1.5 → 0"
    session.undo()
    assert look.ev.value == 0 and session.profile is profile and session.look.ev == 0
    assert page.undo.disabled and page.redo.label == "Redo Exposure, EV 0 → +1.5"
    session.redo()
    assert look.ev.value == 1.5
    look.wanted.kelvin.value = 4000
    assert look.wanted.balance.value == BY_TEMPERATURE and session.look.target.endswith("/4000K")
    page.reset("Exposure, EV")
    assert look.ev.value == 0
    page.show("Samples")
    assert page.undo.label == "Undo marked"
    for end in (0.8, 0.6):
        page._slider("Saturation").value = (0.0, end)
    assert page.undo.label == "Undo Saturation: 0 – 0.6 → 0 – 1"
    session.undo()
    session.undo()
    assert not session.require_workspace().hand_marks.any() and session.profile is profile


def test_multipliers_that_are_written_are_the_white_balance(profile: CameraProfile, tmp_path: Path) -> None:
    page = opened(tmp_path, profile)
    page.show("Look")
    look = page.pages["Look"]
    look.wanted.multipliers.value = "2.1,1,1.4"
    assert look.wanted.balance.value == BY_MULTIPLIERS and page.session.look.target == "standard/2.1,1,1.4"
    page.session.undo()
    assert page.session.look.target == "standard/daylight" and page.undo.disabled
    look.wanted.balance.value = BY_MULTIPLIERS  # which begins with those of the usual setting
    assert len(page.session.look.target.split(",")) == 3
    page.session.undo()
    assert page.session.look.target == "standard/daylight" and page.undo.disabled


def test_the_temperature_begins_at_the_chosen_white_balance(profile: CameraProfile, tmp_path: Path) -> None:
    page = opened(tmp_path, profile)
    page.show("Look")
    look = page.pages["Look"]
    look.wanted.balance.value = "cloudy"
    assert look.wanted.kelvin.value == 6000 and page.session.look.target == "standard/cloudy"
    look.wanted.kelvin.value = 5000
    assert page.session.look.target == "standard/5000K"
    page.session.undo()
    assert look.wanted.kelvin.value == 6000 and page.session.look.target == "standard/cloudy"


def test_the_usual_setting_is_one_that_shots_were_taken_with(profile: CameraProfile) -> None:
    assert usual_setting(profile) == "standard/daylight"
    on_tungsten = {
        name: replace(style, models=tuple(replace(model, white_balances=("tungsten",)) for model in style.models))
        for name, style in profile.styles.items()
    }
    assert usual_setting(replace(profile, styles=on_tungsten)) == "standard/tungsten"


def test_a_photograph_that_is_dropped_is_shown(profile: CameraProfile, tmp_path: Path) -> None:
    photograph(tmp_path / "silent.jpg", 60, 90)
    inside = tmp_path / "studio"
    inside.mkdir()
    page = opened(inside, profile)
    page.show("Look")
    look = page.pages["Look"]
    look.path.value_input = "typed.jpg"
    picture = (tmp_path / "silent.jpg").read_bytes()
    look.drop.param.update(value=picture, filename="dropped.jpg", mime_type="image/jpeg")
    assert look.view.title == "dropped.jpg" and look.view.picture == picture
    look.drop.param.update(value=b"text", filename="notes.txt", mime_type="text/plain")
    assert "not a photograph" in page.session.page.status.object
    look.drop.param.update(value=picture, filename="../../out.jpg", mime_type="image/jpeg")
    assert look.view.title == "out.jpg" and list(tmp_path.glob("*.jpg")) == [tmp_path / "silent.jpg"]
    page.session.close()


def test_the_gamut_map_is_drawn_in_both_directions(profile: CameraProfile, tmp_path: Path) -> None:
    page = opened(tmp_path, profile)
    page.show("Model")
    model = page.pages["Model"]
    model.shown.value = "Gamut map"
    view, heights = model.views["Gamut map"], []
    for direction in ("render", "linearize"):
        view.direction.value = direction
        surface = view.space.plot.data[0]
        inverse = "inverse" in view.space.plot.layout["title"]["text"]
        assert inverse == (direction == "linearize")
        assert surface["type"] == "surface" and np.isfinite(surface["z"]).all()
        heights.append(np.array(surface["z"]))
    assert np.abs(heights[0] - heights[1]).max() > 1e-3


def test_moves_of_a_slider_between_press_and_release_are_one_change(profile: CameraProfile, tmp_path: Path) -> None:
    page = opened(tmp_path, profile)
    page.show("Look")
    look = page.pages["Look"]
    for value in (0.5, 1.0, 1.5):
        look.ev.value = value
    look.ev.value_throttled = 1.5
    look.ev.value = 0.7
    page.session.undo()
    assert look.ev.value == 1.5
    page.session.undo()
    assert look.ev.value == 0 and page.undo.disabled


def test_what_does_not_reach_the_response_of_a_bracket_says_so(
    bracket_folder: Path,
) -> None:
    page = opened_bracket(bracket_folder)
    page.show("Samples")
    page.show("Model")
    model, samples = page.pages["Model"], page.pages["Samples"]
    choices = (model.builds_on_stages, model.preset, model.pairs, *model.options.values(), *model.numbers.values())
    assert all(control.disabled for control in choices)
    assert "does not reach" in model.takes.object
    assert "fitted to all colours" in samples.counts.object

    # Samples with RAW make them choices again
    take_opened(page.session, Opened(Workspace(chart_samples())), "samples.npz")
    page.show("Samples")
    page.show("Model")
    assert not any(control.disabled for control in choices)
    assert "Fitted to" in model.takes.object and "fitted to all colours" not in samples.counts.object


def test_opening_other_files_can_be_undone(profile: CameraProfile, bracket_folder: Path) -> None:
    page = Page(Folders([bracket_folder.parent]), ())
    session = page.session
    session.start_over(with_profile(Workspace(chart_samples(patches=9)), profile))
    workspace = session.workspace
    open_files(session, (bracket_folder,))
    assert page.pages["Shots"].bracket.visible and not page.undo.disabled
    session.undo()
    assert session.workspace is workspace and session.profile is profile and session.opened.bracket is None
    session.redo()
    assert page.pages["Shots"].bracket.visible


def test_opening_another_profile_can_be_undone(profile: CameraProfile, tmp_path: Path) -> None:
    profile.save(tmp_path / "first.npz")
    other = replace(profile, camera="Another")
    other.save(tmp_path / "other.npz")
    page = opened(tmp_path)
    session = page.session
    open_files(session, (tmp_path / "first.npz",))
    assert page.undo.disabled  # nothing was open before
    open_files(session, (tmp_path / "other.npz",))
    assert session.require_profile().camera == "Another" and page.undo.label == "Undo opening other.npz"
    session.undo()
    assert session.require_profile().camera == profile.camera
    session.redo()
    assert session.require_profile().camera == "Another"
    samples = Workspace(chart_samples(patches=9))
    session.start_over(samples)
    session.state = replace(session.state, opened=Opened())
    open_files(session, (tmp_path / "first.npz",))
    assert session.require_workspace().models
    session.undo()
    assert session.workspace is samples and session.profile is None


def test_a_style_whose_name_has_a_slash_is_no_traceback(profile: CameraProfile, tmp_path: Path) -> None:
    styles = {"day/night": profile.styles["standard"]}
    page = opened(tmp_path, replace(profile, styles=styles))
    for step in PAGE_NAMES:
        page.session.page.attempt(page.show, step)
        assert "this failed" not in page.session.page.status.object, step


def test_a_photograph_of_unknown_settings_says_so_in_the_picture(profile: CameraProfile, tmp_path: Path) -> None:
    photograph(tmp_path / "silent.jpg", 60, 90)
    photograph(tmp_path / "other.jpg", 60, 90)
    page = opened(tmp_path, profile)
    page.show("Look")
    look, session = page.pages["Look"], page.session
    look.path.value = "silent.jpg"
    look.path.param.trigger("enter_pressed")
    assert look.session.photograph.path.name == "silent.jpg" and "not known" in look.view.notice
    assert "Shown as it is" in look.words.object
    look.wanted.style.value = "vivid"
    assert progress_of(session)["Look"] == "to do"
    look.wanted.balance.value = LABEL_AS_SHOT
    assert "alert" not in session.page.status.object
    page.show("Export")
    export = page.pages["Export"]
    export.program.value = "rawtherapee"
    with pytest.raises(WorkspaceError, match="never on screen"):
        export._write_kit()
    page.show("Look")
    look.view._handle_msg("help")
    assert look.view.notice == "" and session.look == ChosenLook("standard/daylight", "vivid/daylight")
    assert look.view.a and progress_of(session)["Look"] == "done"
    session.undo()
    assert look.view.notice
    look.listed.value = "other.jpg"
    look._open_named()
    assert look.session.photograph.path.name == "other.jpg"  # the newer choice, not the path in the line


def test_a_session_outlives_its_page(tmp_path: Path) -> None:
    kept, first = KeptSessions(), opened(tmp_path, workspace=Workspace(chart_samples(patches=9))).session
    shown = {"first": True, "second": True}
    one, two = (lambda: shown["first"]), (lambda: shown["second"])
    kept.add("visitor", first, one)
    kept.show(first)
    assert kept.left_by("visitor") is None  # another tab shows it
    shown["first"] = False
    kept.leave(first, one)
    assert kept.left_by("visitor") is first and kept.left_by("another") is None
    new = Page(Folders([tmp_path]), ())
    kept.add("visitor", new.session, lambda: False)
    new.session.start_over(Workspace(chart_samples(patches=9)))
    assert kept.left_by("visitor") is first  # a page that is loading was not left
    new.session.start_over(None)
    new.offer_to_continue(first)
    assert new.offer.visible and "162 samples" in new.offer.object
    page = Page(Folders([tmp_path]), (), first)
    kept.add("visitor", page.session, two)
    assert page.session is first and "162 samples" in str(first) and kept.left_by("visitor") is None
    kept.leave(first, one)  # the news of the first page's end, late
    assert progress_of(page.session)["Shots"] == "done" and kept.left_by("visitor") is None


def test_a_page_that_loads_does_not_end_with_a_tab_that_is_closed(tmp_path: Path) -> None:
    kept, closed, loading = KeptSessions(), opened(tmp_path), opened(tmp_path)
    for page in (closed, loading):
        kept.add("visitor", page.session, lambda: False)
    kept.show(closed.session)
    entry = next(entry for entry in kept._kept if entry.session is closed.session)
    kept.leave(closed.session, entry.is_shown)
    loading.session.start_over(Workspace(chart_samples(patches=9)))
    loading.session.page.on_change()
    assert loading.pages["Shots"].papers  # it still draws what changes


def test_a_session_that_goes_on_shows_its_photograph_and_look(profile: CameraProfile, tmp_path: Path) -> None:
    photograph(tmp_path / "silent.jpg", 60, 90)
    left = opened(tmp_path, profile)
    left.show("Look")
    look = left.pages["Look"]
    look._open(tmp_path / "silent.jpg")
    look.source.style.value, look.source.balance.value = "standard", "tungsten"
    look.wanted.style.value, look.wanted.kelvin.value, look.ev.value = "vivid", 4000, 0.5
    before = left.session.look
    assert before == ChosenLook("standard/tungsten", "vivid/4000K", 0.5)
    left.session.detach()
    page = Page(Folders([tmp_path]), (), left.session)
    again = page.pages["Look"]
    assert again.view.picture == look.view.picture and again.view.title == "silent.jpg"
    assert page.session.look == before and again.view.a and page.shown == "Look"
    page.session.undo()
    assert again.ev.value == 0 and again.wanted.kelvin.value == 4000


def test_controls_are_as_the_page_before_has_left_them(profile: CameraProfile, tmp_path: Path) -> None:
    left = opened(tmp_path, profile, Workspace(chart_samples(patches=9)))
    for step in PAGE_NAMES:
        left.show(step)
    shots, samples, model, look, export = (left.pages[step] for step in PAGE_NAMES)
    shots.light.value_input = "5500K"
    samples.first.value, samples.group.value_input = "saturation", "half typ"
    model.kind.value, model.shown.value, model.views["Lattice"].level.value = "matrix", "Lattice", 0.7
    look.view.param.update(mode="side", clipping=True)
    look.view.grade(Lut((Range(),)), "kept")
    look.view.kept += 1
    export.name.value_input, export.program.value, export.suffix.value = "mine", "rawtherapee", ".cube"
    left.session.detach()
    page = Page(Folders([tmp_path]), (), left.session)
    for step in PAGE_NAMES:
        page.show(step)
    shots, samples, model, look, export = (page.pages[step] for step in PAGE_NAMES)
    assert written(shots.light) == "5500K"
    assert (samples.first.value, written(samples.group)) == ("saturation", "half typ")
    assert (model.kind.value, model.shown.value, model.views["Lattice"].level.value) == ("matrix", "Lattice", 0.7)
    assert (look.view.mode, look.view.clipping, look.view.b_name) == ("side", True, "kept") and look.view.b
    assert (written(export.name), export.program.value, export.suffix.value) == ("mine", "rawtherapee", ".cube")


def test_what_waits_for_its_turn_runs_on_without_a_page(tmp_path: Path) -> None:
    """Its news are there when a page shows the session again."""
    session, results = Session(Folders([tmp_path])), list[int]()

    def first(result: int) -> None:
        results.append(result)
        session.work.start("a job after it", results.append, doubled, 3)

    async def served() -> None:
        session.work.start("a job", first, doubled, 1)
        session.work.start("a job that waits", results.append, doubled, 2)
        session.work.start("a job that fails", results.append, Path.read_text, tmp_path)
        session.detach()
        while session.work.queue.works:
            await asyncio.sleep(0.02)

    asyncio.run(asyncio.wait_for(served(), 120))
    assert results == [2, 4, 6]
    session.attach()
    assert "a job" in session.page.status.object


def test_a_slider_takes_what_is_typed(profile: CameraProfile, tmp_path: Path) -> None:
    page = opened(tmp_path, profile, Workspace(chart_samples(patches=9)))
    page.show("Look")
    page.put("Exposure, EV", "−9")
    assert page.pages["Look"].ev.value == -3
    page.show("Samples")
    page.put("Saturation", ".4 .. 0.1")
    assert page.session.require_workspace().limits_of("saturation") == (0.1, 0.4)
    with pytest.raises(WorkspaceError, match="write one like"):
        page.put("Saturation", "much")
    page.session.undo()
    assert page.session.require_workspace().limits == {}


def test_the_film_strip_has_a_frame_of_each_shot(shared_data: Path, tmp_path: Path) -> None:
    for name in ("a.JPG", "a.dng", "b.dng", "c.png", "B.tif"):
        (tmp_path / name).touch()
    frames = addresses(Folders([tmp_path]), ["a.JPG", "a.dng", "b.dng", "c.png", "B.tif"])
    assert [frame["name"] for frame in frames] == ["B.tif", "a.JPG", "b.dng", "c.png"]
    assert all(frame["url"].startswith("thumbnail?of=") for frame in frames)
    with Image.open(BytesIO(thumbnail(shared_data / "canon_powershot_s40" / "CRW_0101.CRW"))) as small:
        assert small.size == (200, 150)
    (tmp_path / "a.JPG").write_bytes(b"no picture")
    with pytest.raises(ImageError):
        thumbnail(tmp_path / "a.JPG")


def test_a_page_is_freed_while_its_session_is_kept(tmp_path: Path) -> None:
    page = opened(tmp_path, workspace=Workspace(chart_samples(patches=9)))
    session, freed = page.session, weakref.ref(page)
    session.detach()
    del page
    gc.collect()
    assert freed() is None and session.workspace is not None


def test_what_a_cancelled_job_was_writing_is_removed(tmp_path: Path) -> None:
    job = Job(writes_for_ever, tmp_path / "out")
    polled_until = time.monotonic() + 120
    while not list(tmp_path.glob(".*/begun")):
        assert time.monotonic() < polled_until
        time.sleep(0.02)
    job.cancel()
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
@pytest.mark.skipif(os.name != "posix", reason="signals of POSIX end the processes")
@pytest.mark.parametrize("ending", ["SIGKILL", "SIGHUP"])
def test_nothing_half_written_is_left_when_the_studio_ends(tmp_path: Path, ending: str) -> None:
    """It is killed while a job writes; or its terminal is closed, of which the job hears, too."""
    program = (
        "import sys\nfrom pathlib import Path\nfrom lutforge.studio.jobs import Job\n"
        "from tests.studio.job_functions import writes_for_ever\n"
        "if __name__ == '__main__':\n    Job(writes_for_ever, Path(sys.argv[1])).wait(120)\n"
    )
    (tmp_path / "studio.py").write_text(program)
    folder = tmp_path / "kits"
    folder.mkdir()
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    command = [sys.executable, str(tmp_path / "studio.py"), str(folder / "out")]
    studio = subprocess.Popen(command, env=environment, start_new_session=True)
    deadline = time.monotonic() + 120
    while not list(folder.glob(".*/begun")):
        assert studio.poll() is None and time.monotonic() < deadline
        time.sleep(0.02)
    if ending == "SIGKILL":
        studio.kill()
    else:
        os.killpg(studio.pid, signal.SIGHUP)
    studio.wait()
    while list(folder.iterdir()):
        assert time.monotonic() < deadline
        time.sleep(0.02)


@pytest.mark.parametrize(
    ("path", "headers", "status"),
    [
        ("/", {}, None),
        ("/", {"Sec-Fetch-Site": "same-origin", "Origin": "http://127.0.0.1:5006"}, None),
        ("/", {"Sec-Fetch-Site": "cross-site"}, 403),
        ("/", {"Sec-Fetch-Site": "same-site"}, 403),
        ("/", {"Origin": "http://evil.example"}, 403),
        ("/", {"Origin": "null"}, 403),
        ("/", {"Host": "evil.example"}, 403),
        ("/autoload.js", {}, 404),
        ("/static/%00", {}, 404),
        ("/static/js/a%00b.js", {}, 404),
    ],
)
def test_requests_of_other_places_are_refused(path: str, headers: dict[str, str], status: int | None) -> None:
    request = HTTPServerRequest(
        headers=HTTPHeaders({"Host": "127.0.0.1:5006", **headers}), start_line=RequestStartLine("GET", path, "HTTP/1.1")
    )
    assert refused(request, ["127.0.0.1:5006", "localhost:5006"]) == status
