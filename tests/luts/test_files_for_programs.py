"""What `lutforge bake` makes for a program, and which files it writes."""

from functools import partial
from pathlib import Path

import numpy as np
import pytest

from lutforge.luts.programs import PROGRAMS, files_for, target_of
from lutforge.luts.reading import file_processor
from lutforge.luts.sequence import evaluate
from lutforge.model.camera_profile import load_profile
from tests.cases.profiles import small_profile
from tests.conftest import CommandLine

NAMED = (
    *("resolve", "premiere", "photoshop", "aftereffects", "finalcut", "nuke", "baselight"),
    *("flame", "ffmpeg", "obs", "darktable", "rawtherapee", "gimp", "blender"),
)


@pytest.fixture(scope="module")
def profile(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("profile") / "camera.npz"
    small_profile("A Camera: №1/x").save(path)
    return path


@pytest.mark.parametrize("program", NAMED)
def test_every_program_has_its_files(program: str) -> None:
    files = files_for(program, "../A Camera: №1 RAW to standard/daylight")
    first, *fallback = files
    assert first.suffix in PROGRAMS[program].reads
    assert files[first] == program
    assert len(first.parts) == 1
    assert first.name == first.name.encode("ascii", "ignore").decode()
    if PROGRAMS[program].shaper:
        assert [path.name.endswith(".plain.cube") for path in fallback] == [True]


def test_no_dialect_takes_the_place_of_another() -> None:
    """Plain cubes and cubes with a shaper have different names, so that baking for one program spares the other's."""
    shaped: set[str] = set()
    plain: set[str] = set()
    for name in NAMED:
        for path in (path for path in files_for(name, "look") if path.suffix == ".cube"):
            (shaped if target_of(path, files_for(name, "look")[path]).form == "shaper" else plain).add(path.name)
    assert shaped
    assert plain
    assert not shaped & plain


@pytest.mark.slow
def test_a_program_without_a_name_and_one_file_named_twice(
    tmp_path: Path, profile: Path, lutforge: CommandLine
) -> None:
    bake = partial(lutforge, "bake", profile, cwd=tmp_path)
    wanted = ("refinish", "--from", "standard/daylight", "--to", "standard/daylight", "--size", "5")
    run = bake(*wanted, "--for", "resolve")
    assert run.returncode == 0, run.stderr
    assert len(list(tmp_path.glob("*.cube"))) == 2
    run = bake(*wanted, "-o", "a.clf", "-o", "./a.clf")
    assert run.returncode == 0, run.stderr
    assert "named twice, written once" in run.stderr
    assert run.stdout.count("a.clf:") == 1


@pytest.mark.slow
def test_steps_of_lattices_are_the_model_and_files_say_what_goes_in(
    tmp_path: Path, profile: Path, lutforge: CommandLine
) -> None:
    bake = partial(lutforge, "bake", profile, cwd=tmp_path)
    run = bake(
        "refinish", "--from", "standard/daylight", "--to", "standard/daylight", "--ev", "-1", "-o", "a.clf"
    )  # fmt: skip
    assert run.returncode == 0, run.stderr
    # Colours near white fade into it in the cube between.
    assert "Cube 5³ → Matrix → Range → Curve 4096 → Cube 33³ → Range → Cube 5³" in run.stdout
    # The cube of highlights is within a code in the mean.
    codes = np.random.default_rng(1).integers(0, 256, (4096, 3)) / 255
    model = load_profile(profile).refinish("standard/daylight", "standard/daylight", -1.0)
    assert np.abs(evaluate(file_processor(tmp_path / "a.clf"), codes) - model(codes)).mean() < 1 / 255
    linear = bake("linearize", "--from", "standard/daylight", "-o", "b.png", "--size", "9")
    assert linear.returncode == 0, linear.stderr
    assert "whole numbers band the darks of linear light" in linear.stderr
    assert "8 bits would show bands" in linear.stderr
    scene = ("render", "--space", "acescg", "--ev", "-1", "--to", "standard/daylight", "-o", "c.clf")
    assert bake(*scene).returncode == 0
    assert "not for JPEGs" in (tmp_path / "c.clf").read_text()
    assert "input: scene-linear acescg" in (tmp_path / "c.clf").read_text()
