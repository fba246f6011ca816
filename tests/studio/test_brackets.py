"""A bracket of a camera without RAW in the studio: what it says, and exports that equal the command line's."""

import shlex
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from PIL.TiffImagePlugin import IFDRational
from typer.testing import CliRunner

from lutforge.cli.main import command_line
from lutforge.colour.spectra import chart_reflectances
from lutforge.progress import silent
from lutforge.samples.chart_kinds import chart_kind
from lutforge.simulate.camera import nikon_d5100
from tests.cases.brackets import bracket
from tests.cases.charts import photograph_chart

pytest.importorskip("panel", reason="the studio needs Panel: pip install 'lutforge[studio]'")
from lutforge.studio.opening import Folders, bracket_in
from lutforge.studio.page import STEPS, Page, states_of


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a bracket in it, whose files state their exposure times."""
    folder = tmp_path_factory.mktemp("studio") / "bracket"
    folder.mkdir()
    times, _, images = bracket(lambda light: light ** (1 / 1.8))
    for index, (time, image) in enumerate(zip(times, images, strict=True)):
        exif = Image.Exif()
        exif[0x0110] = "Drone 7"
        exif.get_ifd(0x8769)[0x829A] = IFDRational(float(time))
        picture = Image.fromarray(np.rint(255 * image).astype(np.uint8))
        picture.save(folder / f"{index}.jpg", quality=97, exif=exif)
    return folder


def opened(folder: Path) -> Page:
    """The page of a visit that has opened the folder of a bracket."""
    page = Page(Folders([folder.parent]), ())
    page.session.open((folder,))
    return page


def test_what_is_a_bracket(folder: Path, tmp_path: Path) -> None:
    opened = bracket_in([folder], silent)
    assert opened is not None and "pictures of Drone 7 without RAW: a bracket of" in str(opened.bracket)
    assert bracket_in([folder / "0.jpg"], silent) is None  # a picture alone
    assert bracket_in([tmp_path], silent) is None
    for name in ("a.jpg", "b.jpg"):
        Image.new("RGB", (8, 8)).save(tmp_path / name)
    opened = bracket_in([tmp_path], silent)
    assert opened is not None and "do not state their exposures" in str(opened.bracket)
    (tmp_path / "a.dng").write_bytes(b"")
    assert bracket_in([tmp_path], silent) is None
    assert "bracket" in Folders([folder.parent]).with_shots()


@pytest.mark.slow
def test_a_response_is_fitted_shown_and_exported_as_by_the_command_line(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    page = opened(folder)
    session, shots = page.session, page.pages["Shots"]
    assert "a bracket of" in session.status.object and "press Fit response" in states_of(session)["Shots"][1]
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
    for step in STEPS:
        page.show(step)
    assert page.pages["Model"].views["Fit"].figures.layout[0]  # a profile shows its response, without RAW
    view = page.pages["Export"]
    assert (view.kind.value, view.space.value) == ("linearize", "raw")
    view.name.value = "drone"
    view._save_profile()
    commands = [session.written["profile"].command]
    root = folder.parent
    for suffix in (".cube", ".clf", ".csp"):
        view.suffix.value = suffix
        view._bake()
        assert suffix != ".cube" or "LUT_1D_SIZE" in (root / "drone_linearize.cube").read_text()
        commands.append(session.written["LUT, linearize"].command)
    view._config()
    commands.append(session.written["config"].command)
    monkeypatch.chdir(root)
    made = [path for path in root.iterdir() if path.name.startswith("drone")]
    assert len(made) >= 5
    for command in commands:
        words = [word.replace("drone", "theirs") for word in shlex.split(command)[1:]]
        assert CliRunner().invoke(command_line(), words).exit_code == 0, command
    for path in made:
        theirs = root / path.name.replace("drone", "theirs")
        assert theirs.read_bytes().replace(b"theirs", b"drone") == path.read_bytes(), path


@pytest.mark.slow
def test_a_chart_gives_an_input_transform(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = tmp_path / "chart"
    folder.mkdir()
    photograph_chart(nikon_d5100(), chart_kind("classic"), chart_reflectances(), folder, (-3.0, -2.0, -1.0, 0.0, 1.0))
    page = opened(folder)
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
    assert (tmp_path / "theirs.npz").read_bytes() == (tmp_path / "camera.npz").read_bytes()
