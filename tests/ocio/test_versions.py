"""Other versions of OpenColorIO read our configs, and convert colours as this one does."""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.cases.other_versions import OPENCOLORIO, python_with_opencolorio
from tests.cases.profiles import plain_profile
from tests.ocio.test_config import made_profile, write_config

VERSIONS = ("2.1", *OPENCOLORIO)
JPEG, OTHER = "Nikon D40 JPEG standard tungsten", "Nikon D40 JPEG vivid daylight"
ASKED: dict[str, Any] = {
    "colours": np.random.default_rng(6).random(900).tolist(),
    "ways": [
        ("spaces", JPEG, "ACEScg"),
        ("spaces", "ACEScg", JPEG),
        ("spaces", JPEG, OTHER),
        ("spaces", "sRGB", "Nikon D40 RAW unbalanced"),
        ("look", JPEG, "Nikon D40 JPEG standard tungsten → daylight"),
        ("look", OTHER, "Nikon D40 scene tungsten → daylight"),
        ("view", "ACEScg", "sRGB - Display", "Nikon D40 vivid"),
        ("view", JPEG, "Display P3 - Display", "Un-tone-mapped"),
    ],
    "paths": ["a/nikon_d40_jpeg_standard_tungsten.jpg", "b.exr", "c.jpg", "raw/plate_acescct.exr", "d.tif"],
}


def converted(python: Path, config: Path, folder: Path) -> subprocess.CompletedProcess[str]:
    """The run of the script by a Python."""
    asked = folder / "asked.json"
    asked.write_text(json.dumps(ASKED))
    script = Path(__file__).with_name("conversions.py")
    command = [str(python), "-W", "ignore", str(script), str(config), str(asked)]
    return subprocess.run(command, capture_output=True, text=True, timeout=100, env={"PATH": "/usr/bin:/bin"})


@pytest.fixture(scope="module")
def configs(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("configs")
    profiles = [made_profile(), plain_profile("Зенит ЕТ (1)")]
    return {
        "folder": write_config(profiles, folder / "ocio"),
        "archive": write_config(profiles, folder / "cameras.ocioz"),
        "2.5": write_config(profiles, folder / "new", profile_version="2.5"),
    }


@pytest.mark.slow
@pytest.mark.parametrize("form", ["folder", "archive", "2.5"])
@pytest.mark.parametrize("version", VERSIONS)
def test_colours_are_the_same(version: str, form: str, configs: dict[str, Path], tmp_path: Path) -> None:
    python = python_with_opencolorio(version)
    theirs = converted(python, configs[form], tmp_path)
    least = {"folder": (2, 1), "archive": (2, 2), "2.5": (2, 5)}[form]
    if tuple(map(int, version.split(".")))[:2] < least:
        assert "PyOpenColorIO.Exception" in theirs.stderr  # as the guide says
        return
    assert theirs.returncode == 0, theirs.stderr
    here = json.loads(converted(Path(sys.executable), configs[form], tmp_path).stdout)
    there = json.loads(theirs.stdout)
    assert there["version"].startswith(version)
    assert there["paths"] == here["paths"] == [JPEG, "ACEScg", "sRGB Encoded Rec.709 (sRGB)", "ACEScct", "Raw"]
    for way, one, two in zip(ASKED["ways"], there["converted"], here["converted"], strict=True):
        np.testing.assert_allclose(one, two, atol=2e-5, err_msg=str(way))
