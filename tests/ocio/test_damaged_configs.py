"""Configs of strangers: `check` says what they hold and what is missing; damaged ones are one line in every command."""

import shutil
import zipfile
from pathlib import Path

import pytest

from lutforge.errors import ConfigError
from lutforge.pipeline.configs import write_config
from lutforge.pipeline.inspection import check
from tests.cases.profiles import plain_profile
from tests.conftest import CommandLine, Refused
from tests.ocio.test_config import write_config as write_small

pytestmark = pytest.mark.usefixtures("small_inverses")


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("whole") / "a.ocioz"
    return write_small([plain_profile("Nikon D40")], path)


@pytest.fixture
def archive(whole: Path, tmp_path: Path) -> Path:
    """An archive of one camera, for a test to damage."""
    return Path(shutil.copy(whole, tmp_path))


def repacked(path: Path, old: bytes, new: bytes) -> None:
    """Change the text of an archive's config."""
    with zipfile.ZipFile(path) as source:
        entries = {name: source.read(name) for name in source.namelist()}
    assert old in entries["config.ocio"]
    with zipfile.ZipFile(path, "w") as target:
        for name, data in entries.items():
            target.writestr(name, data.replace(old, new) if name == "config.ocio" else data)


def test_check_says_what_a_config_holds_and_who_reads_it(lutforge: CommandLine, tmp_path: Path) -> None:
    write_config([plain_profile("Nikon D40")], tmp_path / "ocio")
    write_config([plain_profile("Nikon D40")], tmp_path / "a.ocioz")
    for path, since in ((tmp_path / "ocio" / "config.ocio", "2.1 (August 2021)"), (tmp_path / "a.ocioz", "2.2")):
        for command in ("check", "inspect"):
            output = lutforge(command, path).stdout
            assert "Nikon D40" in output and "profile version 2.1" in output
            assert "all found" in output and "problem" not in output
            assert f"OpenColorIO {since}" in output
    lut = next((tmp_path / "ocio").rglob("*.clf"))
    lut.unlink()
    output = "\n".join(check(tmp_path / "ocio" / "config.ocio"))
    assert "1 missing" in output and f"file {lut.name}: missing" in output


@pytest.mark.parametrize("place", [60, 0.2, 0.5, 0.8])
def test_a_damaged_archive_is_one_line_wherever_it_is_damaged(
    refused: Refused, archive: Path, tmp_path: Path, place: float
) -> None:
    data = bytearray(archive.read_bytes())
    at = int(place * len(data) if place < 1 else place)
    data[at : at + 40] = b"\xff" * 40
    (tmp_path / "bad.ocioz").write_bytes(data)
    plain_profile("Canon EOS 5D").save(tmp_path / "camera.npz")
    assert "bad.ocioz" in refused(tmp_path, "config", "camera.npz", "--merge", "bad.ocioz", "-o", "out.ocioz")
    try:
        message = "\n".join(check(tmp_path / "bad.ocioz"))
    except ConfigError as error:
        message = str(error)
    assert "problem" in message or "cannot be read" in message


@pytest.mark.parametrize("share", [0.01, 0.3, 0.9])
def test_an_archive_that_is_cut_short_is_told_so(refused: Refused, archive: Path, tmp_path: Path, share: float) -> None:
    data = archive.read_bytes()
    (tmp_path / "bad.ocioz").write_bytes(data[: int(share * len(data))])
    plain_profile("Canon EOS 5D").save(tmp_path / "camera.npz")
    for words in (("config", "camera.npz", "--merge", "bad.ocioz", "-o", "out"), ("check", "bad.ocioz")):
        assert "cut short or damaged: copy it again" in refused(tmp_path, *words)


@pytest.mark.parametrize("name", ["bad.ocioz", "bad.ocio"])
def test_names_that_are_no_text_are_one_line(refused: Refused, archive: Path, tmp_path: Path, name: str) -> None:
    repacked(archive, b"Nikon", b"Nik\xf6n")
    if name == "bad.ocioz":
        archive.rename(tmp_path / name)
    else:
        (tmp_path / name).write_bytes(zipfile.ZipFile(archive).read("config.ocio"))
    plain_profile("Canon EOS 5D").save(tmp_path / "camera.npz")
    for words in (("config", "camera.npz", "--merge", name, "-o", "out"), ("check", name), ("inspect", name)):
        assert "bytes that are not text" in refused(tmp_path, *words)
