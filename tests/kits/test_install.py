"""Kits in the folders of programs: what is written there, what is left alone, and what is there afterwards."""

import json
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from lutforge.colour.srgb import delta_e_2000
from lutforge.errors import LutForgeError
from lutforge.images.read import read_image
from lutforge.kits.all_kits import KITS
from lutforge.kits.install import install, read_journal, uninstall
from lutforge.kits.places import Machine, place_of
from lutforge.model.camera_profile import CameraProfile
from lutforge.pipeline.kit_installation import install_kit, uninstall_kit
from lutforge.pipeline.kits import write_kit
from tests.cases.same_bytes import same_bytes
from tests.conftest import CommandLine

SETTING = "standard/auto"

pytestmark = pytest.mark.usefixtures("small_profiles")


@pytest.fixture
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A user's folder with nothing in it."""
    folder = tmp_path / "home"
    folder.mkdir()
    for name in ("XDG_CONFIG_HOME", "XDG_DATA_HOME", "RT_SETTINGS", "ART_SETTINGS"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("HOME", str(folder))
    monkeypatch.setattr("sys.platform", "linux")
    return folder


def contents(folder: Path) -> dict[str, bytes | None]:
    """Every file and folder below a folder, but for the cache of compiled code."""
    paths = {path.relative_to(folder).as_posix(): path for path in folder.rglob("*")}
    return {
        name: path.read_bytes() if path.is_file() else None
        for name, path in paths.items() if not name.startswith(".cache")
    }  # fmt: skip


def settings(home: Path, name: str, used: bool) -> Path:
    """A program's folder of settings: missing, or one with settings and looks of its user's."""
    folder = home / ".config" / name
    if used:
        for path in ("color/in/mine.icc", "profiles/mine.pp3", "styles/mine.dtstyle", "darktablerc", "options"):
            (folder / path).parent.mkdir(parents=True, exist_ok=True)
            (folder / path).write_bytes(path.encode())
    return folder


@pytest.mark.parametrize("used", [False, True])
@pytest.mark.parametrize(("program", "folder"), [("darktable", "darktable"), ("rawtherapee", "RawTherapee")])
def test_the_configuration_is_as_it_was(
    program: str, folder: str, used: bool, home: Path, profile: CameraProfile, tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch, lutforge: CommandLine,
) -> None:  # fmt: skip
    place = settings(home, folder, used)
    monkeypatch.setattr(shutil, "which", lambda command, **_: f"/usr/bin/{command}")
    profile.save(tmp_path / "camera.npz")
    before = contents(home)
    words = ("kit", "camera.npz", "--to", SETTING, "--for", program, "-o", "kit")
    for _ in range(2):  # the second replaces what the first installed
        printed = lutforge(*words, "--install", cwd=tmp_path).stdout
    named = {Path(line.removeprefix("installed: ")) for line in printed.splitlines() if line.startswith("installed: ")}
    assert named == {
        path for path in place.rglob("*") if path.is_file() and path.relative_to(home).as_posix() not in before
    }
    assert {path.suffix for path in named} == (
        {".icc", ".dtstyle", ".xmp"} if program == "darktable" else {".icc", ".dcp", ".pp3"}
    )
    for path in named:
        assert same_bytes(path, tmp_path / "kit" / path.name)
    gone = lutforge("kit", "--uninstall", "--for", program, cwd=tmp_path).stdout
    assert {Path(line.removeprefix("removed: ")) for line in gone.splitlines()} == named
    assert contents(home) == before
    assert "nothing is installed" in lutforge("kit", "--uninstall", "--for", program, cwd=tmp_path, status=2).stderr


def test_what_the_user_has_is_never_replaced_nor_removed(
    home: Path, profile: CameraProfile, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(shutil, "which", lambda command, **_: f"/usr/bin/{command}")
    kit = write_kit(profile, SETTING, tmp_path / "kit", "darktable")
    place = home / ".config" / "darktable" / "color" / "in"
    place.mkdir(parents=True)
    name = "Canon PowerShot S40 standard.icc"
    (place / name).write_bytes(b"the user's own")
    before = contents(home)
    with pytest.raises(LutForgeError, match="is there already, and not as LutForge wrote it"):
        install_kit(kit)
    assert contents(home) == before
    (place / name).unlink()
    install_kit(kit)
    (place / name).write_bytes(b"changed by the user")
    with pytest.raises(LutForgeError, match="is there already"):
        install_kit(kit)
    removed, changed = uninstall_kit("darktable")
    assert changed == [place / name]
    assert len(removed) == 5
    assert contents(home).keys() == before.keys()


def test_without_the_program_it_says_where_the_files_go(
    home: Path, profile: CameraProfile, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, lutforge: CommandLine
) -> None:
    monkeypatch.setattr(shutil, "which", lambda command, **_: None)
    profile.save(tmp_path / "camera.npz")
    words = ("kit", "camera.npz", "--to", SETTING, "-o", "kit", "--install", "--for")
    message = lutforge(*words, "darktable", cwd=tmp_path).stderr
    assert "is not on this machine" in message
    assert str(home / ".config" / "darktable" / "color" / "in") in message
    assert (
        "no folder of Lightroom and Camera Raw is known on this system"
        in lutforge(*words, "lightroom", cwd=tmp_path).stderr
    )
    assert contents(home) == {}
    (tmp_path / "elsewhere").mkdir()  # a folder of settings that is named shows that the program is there
    lutforge(*words, "darktable", "--into", tmp_path / "elsewhere", cwd=tmp_path)
    assert (tmp_path / "elsewhere" / "color" / "in" / "Canon PowerShot S40 standard.icc").is_file()
    for more, why in ((("--uninstall",), "exclude each other"), (("--into", "none"), "no such folder")):
        assert why in lutforge(*words, "darktable", *more, cwd=tmp_path, status=2).stderr


def test_a_killed_installation_is_taken_away_too(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "a.icc").write_bytes(b"a")
    (tmp_path / "b.icc").write_bytes(b"b")
    journal, place = tmp_path / "data" / "journal.json", tmp_path / "settings"
    targets = {place / "in" / name: tmp_path / name for name in ("a.icc", "b.icc")}
    copy: Callable[..., object] = shutil.copyfile

    def killed(source: Path, target: Path) -> None:
        if source.name == "b.icc":
            raise KeyboardInterrupt
        copy(source, target)

    monkeypatch.setattr(shutil, "copyfile", killed)
    with pytest.raises(KeyboardInterrupt):
        install("darktable", targets, journal)
    uninstall("darktable", journal)
    assert not place.exists()
    assert not journal.parent.exists()


@pytest.mark.parametrize("text", ["no JSON", "[]", '{"darktable": 1}', '{"darktable": {"files": [], "folders": 2}}'])
def test_a_damaged_journal_is_one_line(text: str, tmp_path: Path) -> None:
    (tmp_path / "journal.json").write_text(text)
    with pytest.raises(LutForgeError) as raised:
        read_journal(tmp_path / "journal.json")
    assert len(str(raised.value).splitlines()) == 1
    assert "journal.json" in str(raised.value)


@pytest.mark.parametrize("program", sorted(KITS))
@pytest.mark.parametrize("system", ["linux", "darwin", "win32"])
def test_every_program_has_a_place_on_every_system(program: str, system: str, tmp_path: Path) -> None:
    place = place_of(program, Machine(system, {}, tmp_path))
    assert place.use
    assert place.settings is None or place.settings.is_absolute() or system == "win32"
    moved = place_of(program, Machine(system, {"XDG_CONFIG_HOME": str(tmp_path / "x"), "RT_SETTINGS": "/r"}, tmp_path))
    if program == "rawtherapee":
        assert moved.settings == Path("/r")
    if program == "darktable":
        assert place.settings == {"win32": tmp_path / "AppData" / "Local" / "darktable"}.get(
            system, tmp_path / ".config" / "darktable"
        )


@pytest.mark.slow
@pytest.mark.parametrize("used", [False, True])
@pytest.mark.parametrize("program", ["darktable", "rawtherapee"])
def test_the_program_shows_the_look_by_its_own_settings(
    program: str, used: bool, home: Path, profile: CameraProfile, shared_data: Path, tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    """With default preferences, in a folder that it has not used before and in one that it has."""
    command = f"{program}-cli"
    if shutil.which(command) is None:
        pytest.skip(f"{command} is not installed")
    raw = str(shared_data / "canon_powershot_s40" / "CRW_0117.CRW")
    folder = tmp_path / "settings"
    folder.mkdir()
    monkeypatch.setenv("RT_SETTINGS", str(folder))

    def develop(preset: Path | None, picture: Path) -> None:
        chosen = [] if preset is None else [str(preset)]
        words = [command, raw, *chosen, str(picture), "--icc-type", "SRGB", "--core", "--configdir", str(folder)]
        words += ["--conf", "plugins/imageio/format/tiff/bpp=16"]
        if program == "rawtherapee":
            # Its window opens a photograph with the profile of its preferences, and what is chosen then comes over it.
            words = [command, "-o", str(picture), "-d", *(["-p", *chosen] if chosen else []), "-t", "-b16", "-Y"]
            words += ["-c", raw]
        subprocess.run(words, check=True, capture_output=True)

    if used:
        develop(None, tmp_path / "before.tif")
    kit = write_kit(profile, SETTING, tmp_path / "kit", program)
    files = install_kit(kit, folder).files
    suffix = ".xmp" if program == "darktable" else ".pp3"
    (preset,) = [path for path in files if path.name == f"Canon PowerShot S40 standard{suffix}"]
    develop(preset, tmp_path / "program.tif")
    subprocess.run([str(kit / "develop.sh"), raw, str(tmp_path / "script.tif")], check=True, capture_output=True)
    shown, scripted = (read_image(tmp_path / name).pixels[::4, ::4, :3] for name in ("program.tif", "script.tif"))
    assert delta_e_2000(np.asarray(shown, np.float64), np.asarray(scripted, np.float64)).mean() < 0.05
    uninstall_kit(program)
    assert not [path for path in folder.rglob("*") if path.name in json.dumps([file.name for file in files])]
