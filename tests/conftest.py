"""What every test may use."""

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import hypothesis
import pytest

# As many processes run tests as there are cores. The threads of BLAS wait actively, and those of one process would take
# the time of the others; it reads this when numpy loads it, here and in the commands that tests start.
os.environ["OPENBLAS_NUM_THREADS"] = "1"

from lutforge.cli.main import main
from lutforge.model.camera_profile import CameraProfile
from lutforge.model.published_model import import_published
from lutforge.ocio import config
from lutforge.samples.sample_set import SampleSet
from lutforge.samples.table import read_samples
from tests.cases.real_data import CHARTS, S40, PublishedPairs, read_published_pairs

hypothesis.settings.register_profile("lutforge", deadline=None)  # clocks are no test's: other work slows them
hypothesis.settings.load_profile("lutforge")

CommandLine = Callable[..., subprocess.CompletedProcess[str]]
"""What the fixture `lutforge` gives: `lutforge(*words, cwd=folder, status=0)`; status: what it must end with."""
Refused = Callable[..., str]
"""What the fixture `refused` gives: `refused(folder, *words)`."""


@pytest.hookimpl(tryfirst=True)  # before xdist reads the groups
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Keep each file in one process, and all tests that use the demo, so that it runs once; they count as slow."""
    for item in items:
        uses_demo = "demo" in getattr(item, "fixturenames", ())
        item.add_marker(pytest.mark.xdist_group("demo" if uses_demo else str(item.path)))
        if uses_demo:
            item.add_marker(pytest.mark.slow)


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """The folder of real photographs and published models; tests that need it skip where it is missing."""
    root = Path(__file__).resolve().parents[1]
    folder = Path(os.environ.get("LUTFORGE_TEST_DATA", root.parent / "shared" / "data"))
    if not folder.is_dir():
        pytest.skip(f"no test data at {folder}: set LUTFORGE_TEST_DATA to the folder of real shots")
    return folder


@pytest.fixture(scope="session")
def s40_samples() -> SampleSet:
    """Colours of five photographs by a Canon PowerShot S40, on automatic white balance."""
    return read_samples(S40)


@pytest.fixture(scope="session")
def chart_samples() -> SampleSet:
    """Patches of a chart by ten cameras under two lights at four exposures, without white balances."""
    return read_samples(CHARTS)


@pytest.fixture(scope="session")
def d40_pairs() -> PublishedPairs:
    """Colours of a Nikon D40 that the thesis's authors published."""
    return read_published_pairs()


@pytest.fixture(scope="session")
def published_d40(shared_data: Path) -> CameraProfile:
    """The camera model of a Nikon D40 that the thesis's authors published."""
    folder = shared_data / "nus_nikon_d40"
    return import_published([folder / "other_white_balances", folder / "fluorescent"], "Nikon D40")


@pytest.fixture(scope="session")
def demo(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """`lutforge demo` as a user runs it, with small lattices: the folder that it filled, and what it printed."""
    folder = tmp_path_factory.mktemp("demo")
    command = [sys.executable, "-m", "lutforge", "demo", "-o", str(folder), "--size", "17"]
    run = subprocess.run(command, capture_output=True, text=True, timeout=540)
    assert run.returncode == 0, run.stderr
    return folder, run.stdout


@pytest.fixture
def small_inverses(monkeypatch: pytest.MonkeyPatch) -> None:
    """Configs get a JPEG → scene of 9 nodes per axis instead of 49: a hundredth of the work, where only form counts."""
    for function in (config.write_config, config.build_config):
        defaults = function.__kwdefaults__
        assert defaults is not None
        monkeypatch.setitem(defaults, "inverse_size", 9)


@pytest.fixture
def small_profiles(monkeypatch: pytest.MonkeyPatch) -> None:
    """ICC profiles get a cube of 9 nodes per axis instead of 65, where only form counts."""
    monkeypatch.setattr("lutforge.kits.icc.NODES", 9)
    monkeypatch.setattr("lutforge.kits.icc.WIDEST_CELL", 1.0)


@pytest.fixture
def lutforge(monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> CommandLine:
    """The command line in this process, which saves the second that a new one takes to start."""

    def run(*words: object, cwd: Path | None = None, status: int = 0) -> subprocess.CompletedProcess[str]:
        if cwd is not None:
            monkeypatch.chdir(cwd)
        arguments = ["lutforge", *map(str, words)]
        monkeypatch.setattr(sys, "argv", arguments)
        capfd.readouterr()
        with pytest.raises(SystemExit) as ended:
            main()
        printed = capfd.readouterr()
        assert ended.value.code == status, printed
        return subprocess.CompletedProcess(arguments, status, printed.out, printed.err)

    return run


@pytest.fixture
def refused(lutforge: CommandLine) -> Refused:
    """Runs a command; expects status 2, one line, no traceback, and no new file in the folder. Returns the line."""

    def run(folder: Path, *words: object) -> str:
        before = sorted(folder.rglob("*"))
        result = lutforge(*words, cwd=folder, status=2)
        lines = result.stderr.strip().splitlines()
        assert len(lines) == 1, result.stderr
        assert lines[0].startswith("lutforge: ")
        assert sorted(folder.rglob("*")) == before
        return lines[0]

    return run
