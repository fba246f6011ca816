"""Every example runs as its own first lines say."""

import subprocess
import sys
from pathlib import Path

import pytest

EXAMPLES = sorted((Path(__file__).parents[1] / "examples").glob("[0-9]*.py"))


INPUTS = {"03_published_model": "nus_nikon_d40", "06_response_from_a_bracket": "brackets/nikon_e995_window"}
"""What is named to an example that makes no photographs itself."""


@pytest.mark.slow
@pytest.mark.parametrize("example", EXAMPLES, ids=lambda path: path.stem)
def test_example(example: Path, tmp_path: Path, request: pytest.FixtureRequest) -> None:
    command = [sys.executable, "-W", "error", str(example), str(tmp_path / "out")]
    if example.stem in INPUTS:
        command.append(str(request.getfixturevalue("shared_data") / INPUTS[example.stem]))
    run = subprocess.run(command, capture_output=True, text=True, timeout=300)
    assert run.returncode == 0, run.stderr
    assert run.stdout


@pytest.mark.parametrize("name", INPUTS)
def test_an_example_without_its_photographs_says_so(name: str, tmp_path: Path) -> None:
    command = [sys.executable, str(EXAMPLES[0].with_name(f"{name}.py")), str(tmp_path / "out")]
    run = subprocess.run(command, capture_output=True, text=True, timeout=300)
    assert run.returncode != 0
    assert "the folder that holds the" in run.stderr and len(run.stderr.splitlines()) == 1
