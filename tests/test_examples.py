"""Every example runs as its own first lines say."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

EXAMPLES = sorted((Path(__file__).parents[1] / "examples").glob("[0-9]*.py"))


def test_there_are_examples() -> None:
    assert len(EXAMPLES) >= 4


@pytest.mark.slow
@pytest.mark.parametrize("example", EXAMPLES, ids=lambda path: path.stem)
def test_example(example: Path, tmp_path: Path, request: pytest.FixtureRequest) -> None:
    environment = dict(os.environ)
    if "LUTFORGE_TEST_DATA" in example.read_text(encoding="utf-8"):
        environment["LUTFORGE_TEST_DATA"] = str(request.getfixturevalue("shared_data"))
    command = [sys.executable, "-W", "error", str(example), str(tmp_path / "out")]
    run = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False, env=environment)
    assert run.returncode == 0, run.stderr
    assert run.stdout


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda path: path.stem)
def test_an_example_without_its_photographs_says_so(example: Path, tmp_path: Path) -> None:
    if "LUTFORGE_TEST_DATA" not in example.read_text(encoding="utf-8"):
        pytest.skip("it makes its own")
    environment = {name: value for name, value in os.environ.items() if name != "LUTFORGE_TEST_DATA"}
    command = [sys.executable, str(example), str(tmp_path / "out")]
    run = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False, env=environment)
    assert run.returncode != 0
    assert "set LUTFORGE_TEST_DATA" in run.stderr and len(run.stderr.splitlines()) == 1
