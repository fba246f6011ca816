"""What a visitor may reach, and work in another process: cancelled at once, errors in one line."""

import os
import shlex
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from typer.testing import CliRunner

from tests.studio.job_functions import broken, doubled, endless, killed, wrong
from tests.studio.shots_for_the_studio import chart_samples, photograph

pytest.importorskip("panel", reason="the studio needs Panel: pip install 'lutforge[studio]'")
import panel as pn
from bokeh.document import Document
from bokeh.events import SelectionGeometry
from panel.io.state import set_curdoc
from tornado.httputil import HTTPHeaders, HTTPServerRequest, RequestStartLine

from lutforge.apply.batch import apply_batch
from lutforge.apply.blocks import apply_to_pixels
from lutforge.apply.candidates import read_small
from lutforge.apply.profile_recipe import ProfileRecipe
from lutforge.calibration.options import CalibrationOptions, PhysicalOptions
from lutforge.cli.main import command_line
from lutforge.images.read import read_image
from lutforge.images.write import write_image
from lutforge.model.camera_profile import CameraProfile, load_profile
from lutforge.pipeline.calibration import calibrate
from lutforge.pipeline.predictions import predict
from lutforge.progress import silent
from lutforge.settings import Selector
from lutforge.shots.picture_settings import software_tag
from lutforge.studio.export_page import (
    Export,
    ExportPage,
    config_export,
    kit_export,
    lut_export,
    report_export,
    run,
    wanted_lut,
)
from lutforge.studio.jobs import Job
from lutforge.studio.look_page import AS_SHOT, BY_MULTIPLIERS, BY_TEMPERATURE, SettingControl, look_lut
from lutforge.studio.opening import FolderError, Folders, Opened, open_paths
from lutforge.studio.page import STEPS, ContentSecurityPolicy, Page, origins, states_of
from lutforge.studio.session import ChosenLook, Session
from lutforge.studio.workspace import FittedModel, History, Workspace, WorkspaceError, find_pairs, with_profile


def test_no_path_leads_out_of_the_folders(tmp_path: Path) -> None:
    inside, outside = tmp_path / "inside", tmp_path / "outside"
    inside.mkdir()
    outside.mkdir()
    (outside / "secret.csv").write_text("x")
    (inside / "link.csv").symlink_to(outside / "secret.csv")
    (inside / "folder").symlink_to(outside)
    (inside / "loop.csv").symlink_to(inside / "loop.csv")
    (inside / "mine.csv").write_text("x")
    folders = Folders.of([inside])
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
        Folders.of([inside / "mine.csv"])


def test_a_job_brings_its_result_or_one_line() -> None:
    jobs = [Job("doubling", doubled, 21), Job("a", wrong), Job("b", broken), Job("c", killed)]
    done, failed, raised, dead = (job.wait(120) for job in jobs)
    assert (done.state, done.result) == ("done", 42)
    assert (failed.state, failed.message) == ("failed", "two lines")
    assert raised.state == "failed" and "ZeroDivisionError: never" in raised.message
    assert dead.state == "failed" and "without a result" in dead.message


def test_cancelling_ends_the_process(tmp_path: Path) -> None:
    mark = tmp_path / "alive"
    job = Job("endless", endless, mark)
    deadline = time.monotonic() + 120
    while not mark.exists() or not mark.read_text():
        assert time.monotonic() < deadline
        time.sleep(0.05)
    number = int(mark.read_text())
    job.cancel()
    assert job.wait(60).state == "cancelled"
    with pytest.raises(ProcessLookupError):
        os.kill(number, 0)


@pytest.fixture(scope="module")
def profile() -> CameraProfile:
    return calibrate(chart_samples(patches=45), CalibrationOptions(size=9))


def opened(folder: Path, profile: CameraProfile | None = None) -> Page:
    """The page of a visit with a folder and a profile, without a browser."""
    page = Page(Folders.of([folder]), ())
    page.session.opened = Opened(profile=profile)
    return page


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
    look.path.value = "tells.jpg"
    look._open_named()
    assert "taken as vivid/tungsten" in page.session.status.object
    assert page.session.look == ChosenLook("vivid/tungsten", "vivid/tungsten") and not page.session.look_chosen
    look.wanted.style.value, look.wanted.balance.value = "standard", "daylight"
    assert page.session.look == ChosenLook("vivid/tungsten", "standard/daylight")
    look.path.value = "silent.jpg"
    look._open_named()
    assert "does not tell how it was taken" in page.session.status.object
    assert (look.source.style.value, look.source.balance.value) == ("", "")  # not what the last was taken as
    assert page.session.look == ChosenLook("", "standard/daylight") and look.view.a == []
    look.source.style.value, look.source.balance.value = "standard", "tungsten"
    assert page.session.look.source == "standard/tungsten" and look.view.a
    look._choose(0)
    assert page.session.look.source == "vivid/tungsten"
    look._choose(1)
    assert page.session.look.source == "standard/tungsten" and "as you said" in page.session.status.object
    before = [each["thumbnail"] for each in look.view.pictures]
    look.ev.value = 1.5
    assert all(old != new["thumbnail"] for old, new in zip(before, look.view.pictures, strict=True))


def test_a_look_takes_presets_temperatures_and_multipliers(profile: CameraProfile) -> None:
    control = SettingControl("Wanted")
    control.offer(profile)
    taken = Selector("vivid", "tungsten")
    for balance, expected in (
        ("cloudy", "standard/cloudy"), (AS_SHOT, "standard/tungsten"), (BY_TEMPERATURE, "standard/4300K"),
        (BY_MULTIPLIERS, "standard/2.1,1,1.4"),
    ):  # fmt: skip
        control.balance.value, control.kelvin.value, control.multipliers.value = balance, 4300, "2.1,1,1.4"
        assert control.text(taken) == expected
        profile.selector(control.text(taken))
    control.balance.value, control.tint.value = "daylight", 5
    assert control.text(None) == "standard/daylight+5"
    control.balance.value = AS_SHOT
    with pytest.raises(WorkspaceError, match="choose one"):
        control.text(None)


def polled(session: Session, kind: str) -> None:
    """Wait for the job under way, and take over its result."""
    job = session._works[kind][0].job
    assert job is not None and job.wait(120).state == "done"
    session.poll(kind)


def test_what_is_started_meanwhile_waits_for_its_turn(tmp_path: Path) -> None:
    session, found = opened(tmp_path).session, list[int]()
    for number in (1, 2):
        session.start(f"job {number}", found.append, doubled, number)
    assert "job 2: comes after job 1" in session.status.object
    polled(session, "long")
    polled(session, "long")
    assert found == [2, 4] and not session.cancel.visible


def test_a_picture_is_opened_beside_a_fit(tmp_path: Path) -> None:
    session, found = opened(tmp_path).session, list[int]()
    session.start("a fit", lambda result: None, endless, tmp_path / "alive")
    session.start_short("a picture", found.append, endless, tmp_path / "alive too")
    session.start_short("the next picture", found.append, doubled, 21)  # takes its place
    polled(session, "short")
    assert found == [42] and session.cancel.visible
    session._cancel()
    assert "a fit: cancelled" in session.status.object and not session.cancel.visible


def test_what_is_clicked_while_a_job_ends_is_done(tmp_path: Path) -> None:
    """A click whose callback is due after the news of a job, which draw all controls anew, is not undone by them."""
    page, samples = opened(tmp_path), chart_samples(patches=9)
    session = page.session
    session.history, session.selected = History(Workspace(samples)), np.zeros(len(samples), dtype=np.bool_)
    page._changed()
    document, context = Document(), object()
    document._session_context = lambda: context
    name, box = next(iter(page.pages["Shots"].boxes.items()))
    with set_curdoc(document):
        session.guarded(page._changed)()  # as a job does that has ended
        (news,) = document.session_callbacks
        box.value = False
        (click,) = set(document.session_callbacks) - {news}
        for due in (news, click):
            due.callback()
    assert session.workspace.out == {name} and not box.value


def test_a_shot_keeps_its_box_while_its_card_is_drawn_anew(tmp_path: Path) -> None:
    page, samples = opened(tmp_path), chart_samples(patches=9)
    session, shots = page.session, page.pages["Shots"]
    session.history, session.selected = History(Workspace(samples)), np.zeros(len(samples), dtype=np.bool_)
    page._changed()
    boxes, papers = list(shots.boxes.values()), list(shots.grid)
    assert len(boxes) == len(papers) == len(np.unique(samples.shot))
    shots.shown.value = "tiles"
    few = samples.select(samples.patch == "0")
    session.change(replace(Workspace(few)))
    assert "1 samples" in papers[0][1].object
    assert all(one is other for one, other in zip(shots.boxes.values(), boxes, strict=True))
    assert all(one is other for one, other in zip(shots.grid, papers, strict=True))
    boxes[0].value = False
    assert session.workspace.out == {next(iter(shots.boxes))}


def test_what_was_written_keeps_its_card(profile: CameraProfile, tmp_path: Path) -> None:
    page = opened(tmp_path, profile)
    page.show("Export")
    view = page.pages["Export"]
    view._save_profile()
    card = view.main[0]
    page._changed()
    assert view.main[0] is card
    page.session.chosen = ChosenLook("", "vivid/tungsten")
    page._changed()
    assert "(stale)" in view.main[0][0].object


@pytest.mark.parametrize("step", STEPS)
def test_names_of_styles_are_text_in_every_step(profile: CameraProfile, step: str, tmp_path: Path) -> None:
    hostile = "<img src=x onerror=alert(1)>"
    styles = {hostile if name == "standard" else name: style for name, style in profile.styles.items()}
    page, samples = opened(tmp_path, replace(profile, styles=styles)), chart_samples(patches=9)
    page.session.history = History(Workspace(replace(samples, style=np.full(len(samples), hostile))))
    page.session.selected = np.ones(len(samples), dtype=np.bool_)
    page.session.chosen = ChosenLook("", f"{hostile}/daylight")
    page.show(step)
    shown = [str(pane.object) for part in (page.controls, page.body) for pane in part.select(pn.pane.HTML)]
    assert shown and not any("<img src=x" in text for text in shown)
    assert step != "Samples" or any("&lt;img src=x" in text for text in shown)  # which names the style of a sample


def test_a_folder_of_raw_files_is_offered_by_its_name(tmp_path: Path) -> None:
    (tmp_path / "a.dng").write_bytes(b"")
    listed = opened(tmp_path).pages["Shots"].listed
    assert listed.value == "." and listed.options[f"{tmp_path.name}, this folder"] == "."


def test_darktable_is_among_the_programs_of_a_kit(profile: CameraProfile, tmp_path: Path) -> None:
    page = opened(tmp_path, profile)
    page.show("Export")
    assert {"darktable", "rawtherapee"} <= set(page.pages["Export"].program.options)


def test_an_error_goes_with_the_next_step(tmp_path: Path) -> None:
    page = opened(tmp_path)
    page.pages["Shots"].path.value = "../outside"
    page.session.guarded(page.pages["Shots"]._open)()
    assert 'role="alert"' in page.session.status.object
    page.show("Model")
    assert "alert" not in page.session.status.object


def test_the_first_plots_of_samples_show_something(tmp_path: Path) -> None:
    page, samples = opened(tmp_path), chart_samples(patches=9)
    for pairs, shown in ((None, "saturation"), (find_pairs(samples), "srgb_btf")):
        page.session.history = History(Workspace(replace(samples), pairs))
        page.session.selected = np.zeros(len(samples), dtype=np.bool_)
        page.session.on_change()
        page.show("Samples")
        view = page.pages["Samples"]
        assert view.first.value == shown
        assert all(len(plot.source.data["x"]) for plot in (view.left, view.right))


@pytest.mark.parametrize("step", STEPS)
def test_a_profile_without_raw_works_in_every_step(step: str, tmp_path: Path) -> None:
    samples = chart_samples(patches=45)
    reference = replace(samples, raw_camera=np.full(len(samples), "Reference"), wb=np.full((len(samples), 3), np.nan))
    page = opened(tmp_path, calibrate(reference, CalibrationOptions(physical=PhysicalOptions(centres=60))))
    workspace = with_profile(Workspace(reference), page.session.profile)
    for history in (None, History(workspace)):
        page.session.history = history
        page.show(step)
    if step == "Look":
        look = page.pages["Look"]
        look.wanted.style.value, look.source.style.value, look.source.balance.value = "vivid", "standard", "daylight"
        assert page.session.look.source and look.view.a
        assert page.session.look.target.startswith("vivid/")


def test_a_profile_does_not_replace_a_file_unasked(profile: CameraProfile, tmp_path: Path) -> None:
    view = ExportPage(opened(tmp_path, profile).session)
    for name in ("camera", "mine"):
        (tmp_path / f"{name}.npz").write_text("another's")
    view._save_profile()  # under the name that the page proposes, which gives way
    assert load_profile(tmp_path / "camera_2.npz").camera == profile.camera
    view._save_profile()  # its own file
    assert not (tmp_path / "camera_3.npz").exists()
    view.name.value = "mine"
    with pytest.raises(WorkspaceError, match="press again"):
        view._save_profile()
    assert [(tmp_path / f"{name}.npz").read_text() for name in ("camera", "mine")] == ["another's"] * 2
    view._save_profile()
    assert load_profile(tmp_path / "mine.npz").camera == profile.camera


def test_exports_of_an_opened_profile_leave_it_as_it_is(profile: CameraProfile, tmp_path: Path) -> None:
    page = opened(tmp_path)
    profile.save(tmp_path / "camera.npz")
    page.session._opened(open_paths((tmp_path / "camera.npz",), silent), "camera.npz")
    page.session.chosen = ChosenLook("standard/tungsten", "vivid/daylight")
    runs: list[Export] = []
    page.show("Export")
    view = page.pages["Export"]
    view._run = lambda what, path, export: runs.append(export)
    (tmp_path / "camera_refinish.clf").write_text("another's")
    view._bake()
    assert runs[0].arguments[:2] == (tmp_path / "camera.npz", tmp_path / "camera_2_refinish.clf")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["camera.npz", "camera_refinish.clf"]


@pytest.mark.parametrize(
    ("command", "suffix"),
    [
        ("bake", ".clf"),
        ("kit", "_kit"),
        pytest.param("config", ".ocioz", marks=pytest.mark.slow),
        pytest.param("report", ".html", marks=pytest.mark.slow),
    ],
)
def test_an_export_is_the_command_that_it_tells(
    profile: CameraProfile, tmp_path: Path, command: str, suffix: str
) -> None:
    profile.save(tmp_path / "camera.npz")
    paths, target = (tmp_path / "camera.npz", tmp_path / f"mine{suffix}"), "vivid/daylight"
    exports: dict[str, Export] = {
        "bake": lut_export(*paths, wanted_lut("refinish", "standard/tungsten", target, 0.8)),
        "kit": kit_export(*paths, target, "rawtherapee"),
        "config": config_export(*paths),
        "report": report_export(*paths),
    }
    export = exports[command]
    lines = run(export, lambda what, share: None)
    assert lines and all("\n" not in line for line in lines)
    assert command != "bake" or "read back, against the model" in lines[0]
    words = shlex.split(str(export).replace("mine", "theirs"))
    result = CliRunner().invoke(command_line(), words[1:])
    assert result.exit_code == 0, result.output
    mine, theirs = (tmp_path / f"{name}{suffix}" for name in ("mine", "theirs"))
    for file in sorted(mine.rglob("*")) if mine.is_dir() else [mine]:
        other = theirs / file.relative_to(mine) if mine.is_dir() else theirs
        assert file.read_bytes() == other.read_bytes(), file


def test_a_kit_needs_no_look_and_is_written_again(profile: CameraProfile, tmp_path: Path) -> None:
    page = opened(tmp_path, profile)
    page.session.start = lambda title, done, *call: done(call[0](*call[1:], silent))  # type: ignore[method-assign]
    page.show("Export")
    view = page.pages["Export"]
    for _ in range(2):
        view.program.value = "rawtherapee"
        view._kit()
        assert "kit for rawtherapee: written" in page.session.status.object
    assert "--to standard/daylight" in page.session.written["kit for rawtherapee"].command


@pytest.mark.parametrize(
    ("program", "why"), [("rawtherapee", "rawtherapee-cli is not installed"), ("resolve", "by eye")]
)
def test_a_kit_is_written_where_its_program_is_not(
    profile: CameraProfile, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, program: str, why: str
) -> None:
    monkeypatch.setenv("PATH", "/nowhere")
    profile.save(tmp_path / "camera.npz")
    (tmp_path / "one.dng").write_bytes(b"")
    shots = (tmp_path / "one.dng",)
    export = kit_export(tmp_path / "camera.npz", tmp_path / "kit", "vivid/daylight", program, shots)
    lines = run(export, lambda what, share: None)
    assert "read README.md first" in lines[0] and "not checked: " in lines[1] and why in lines[1]
    both = kit_export(tmp_path / "camera.npz", tmp_path / "kit", "vivid/daylight", program, (*shots, *shots))
    assert shlex.split(str(both)).count("--check") == 2  # each path is an option's one word


def test_what_changes_upstream_makes_the_steps_stale(profile: CameraProfile, tmp_path: Path) -> None:
    page = opened(tmp_path)
    session = page.session
    assert [state for state, _ in states_of(session).values()] == ["to do"] * 5
    samples = chart_samples(patches=9)
    session.history = History(Workspace(samples))
    task = session.workspace.task("lattice")
    model = FittedModel(profile, predict(profile, samples), task=task)
    session.change(session.workspace.with_model("lattice", model))
    assert [state for state, _ in states_of(session).values()] == ["done", "done", "done", "to do", "to do"]
    page.show("Look")
    assert states_of(session)["Look"][0] == "to do"
    page.pages["Look"].wanted.style.value = "vivid"
    page.show("Export")
    page.pages["Export"].name.value = "mine"
    page.pages["Export"]._save_profile()
    assert [state for state, _ in states_of(session).values()] == ["done"] * 5
    page.show("Look")
    page.pages["Look"].ev.value = 1.0
    assert states_of(session)["Export"][0] == "stale"
    session.change(replace(session.workspace, out=frozenset({str(samples.shot[0])})))
    assert [state for state, _ in states_of(session).values()] == ["done", "done", "stale", "stale", "stale"]
    assert all(words.endswith(".") for _, words in states_of(session).values())
    session.undo()
    assert states_of(session)["Model"][0] == "done"


def test_a_lasso_picks_what_is_thinned_out_of_the_drawing(tmp_path: Path) -> None:
    few = chart_samples(patches=90)
    many = few.select(np.resize(np.arange(len(few)), 100_000))
    many = replace(many, patch=np.arange(len(many)).astype(np.str_))
    page = opened(tmp_path)
    page.session.history, page.session.selected = History(Workspace(many)), np.zeros(len(many), dtype=np.bool_)
    page.show("Samples")
    plot = page.pages["Samples"].right
    shape = {"type": "poly", "x": [0.0, 0.9, 0.9, 0.0], "y": [0.0, 0.0, 0.95, 0.95]}
    plot._geometry(SelectionGeometry(plot.figure, shape, final=True))
    assert page.session.selected.sum() > 50_000  # though no more than a few thousand are drawn


def test_large_photographs_are_averaged_down(tmp_path: Path) -> None:
    photograph(tmp_path / "large.png", 300, 400)
    small = read_small(tmp_path / "large.png", 20_000)
    whole = read_small(tmp_path / "large.png", 2_100_000)
    assert small.shape == (100, 133, 3)
    assert np.allclose(small[0, 0], whole[:3, :3].mean(axis=(0, 1)), atol=1e-5)


def test_only_pages_of_the_studio_itself_may_connect() -> None:
    assert origins("127.0.0.1", 5006) == ["127.0.0.1:5006", "localhost:5006"]
    assert origins("10.0.0.5", 80) == ["10.0.0.5:80"]


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
        assert "Traceback" not in (tmp_path / "log").read_text()
