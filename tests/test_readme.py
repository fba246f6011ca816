"""The README is true: it names every command and option that it uses, and its Python runs."""

import re
from pathlib import Path

import numpy as np
import pytest

import lutforge as lf
from lutforge.samples.sample_set import SampleSet
from lutforge.simulate.camera import nikon_d5100
from tests.conftest import CommandLine

README = (Path(__file__).parents[1] / "README.md").read_text(encoding="utf-8")


@pytest.fixture
def wide(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "200")
    monkeypatch.setenv("TERM", "dumb")


@pytest.mark.usefixtures("wide")
def test_every_command_is_documented(lutforge: CommandLine) -> None:
    commands = re.findall(
        r"^\W*([a-z][a-z-]+)  ", lutforge("--help").stdout.split("Commands", 1)[1], flags=re.MULTILINE
    )
    assert len(commands) >= 9
    table = README.split("## Commands", 1)[1].split("##", 1)[0]
    assert set(commands) == set(re.findall(r"^\| `lutforge ([a-z-]+)", table, flags=re.MULTILINE))


@pytest.mark.usefixtures("wide")
def test_every_option_that_it_uses_exists(lutforge: CommandLine) -> None:
    used: dict[str, set[str]] = {}
    for line in re.findall(r"lutforge [a-z-]+[^\n]*", README):
        command = line.split()[1].strip("`.,")
        if command.startswith("-"):
            continue
        used.setdefault(command, set()).update(re.findall(r"(?<!\S)--[a-z-]+", line))
    for command, options in used.items():
        if options:
            text = lutforge(command, "--help").stdout
            assert all(option in text for option in options), (command, options)


def test_every_picture_is_there() -> None:
    for name in re.findall(r"!\[[^\]]*\]\(([^)]+)\)", README):
        assert (Path(__file__).parents[1] / name).is_file(), name


def test_its_python_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    code = README.split("```python\n", 1)[1].split("```", 1)[0]
    camera, rng, count = nikon_d5100(), np.random.default_rng(2), 400
    balances = rng.choice(["tungsten", "daylight"], count)
    styles = np.where(np.arange(count) % 2, "standard", "vivid")
    gains = np.array([camera.white_balances[name].multipliers for name in balances])
    raw = rng.uniform(0.02, 0.5, (count, 3)) / gains
    srgb = np.array([camera.render(r, s, b) for r, s, b in zip(raw, styles, balances, strict=True)])
    shot = np.char.add("shot", (np.arange(count) % 4).astype(np.str_))
    patch = np.arange(count).astype(np.str_)
    name = np.full(count, "Simulated")
    lf.write_samples(
        tmp_path / "samples.csv",
        SampleSet(name, styles, balances, shot, patch, np.full(count, 0.01), raw, srgb, gains, name),
    )
    monkeypatch.chdir(tmp_path)
    names = {"pixels": rng.random((4, 5, 3))}
    exec(code, names)
    assert names["image"].shape == (4, 5, 3)
    assert (tmp_path / "fix.cube").stat().st_size > 0
    assert (tmp_path / "camera.npz").stat().st_size > 0
