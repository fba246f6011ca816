"""The main job on real photographs: five RAW files of a Canon PowerShot S40."""

import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import lutforge as lf
from lutforge.images.read import read_image
from lutforge.samples.sample_set import SampleSet


def run(*words: object) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "lutforge", *map(str, words)]
    return subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)


@pytest.fixture(scope="module")
def profile(shared_data: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("s40")
    shots = sorted((shared_data / "canon_powershot_s40").glob("CRW_*.CRW"))
    sampled = run("sample", *shots, "-o", folder / "s40.csv")
    assert sampled.returncode == 0, sampled.stderr
    assert sampled.stdout.count("kept") == 5
    made = run("calibrate", folder / "s40.csv", "-o", folder / "s40.npz", "--size", "17")
    assert made.returncode == 0, made.stderr
    assert "Error on held-out shots" in made.stdout
    return folder / "s40.npz"


def test_each_shot_left_out_is_predicted_within_six_codes(s40_samples: SampleSet) -> None:
    """Mean RGB error of the held-out shot; matrix and response alone leave 0.040, polynomials 0.080."""
    profile = lf.calibrate(s40_samples, lf.CalibrationOptions(size=17))
    rows = [row for row in lf.evaluate(profile, s40_samples).rows if row.direction == "render"]
    shots = [row for row in rows if row.method == "lattice" and row.shot != "all"]
    assert len(shots) == 5 and all(row.held_out for row in shots)
    assert all(row.figures.mean < 6 / 255 for row in shots)
    mean = {row.method: row.figures.mean for row in rows if row.shot == "all"}
    assert mean["lattice"] < 0.5 * mean["matrix and response"] < 0.5 * mean["polynomial per channel"]


@pytest.mark.slow
def test_bake_config_and_apply(profile: Path, shared_data: Path, tmp_path: Path) -> None:
    for words in (
        ("bake", profile, "render", "--to", "standard/auto", "-o", tmp_path / "render.clf"),
        ("bake", profile, "linearize", "--from", "standard/auto", "--space", "acescg", "-o", tmp_path / "linear.clf"),
        ("config", profile, "-o", tmp_path / "ocio"),
    ):
        made = run(*words)
        assert made.returncode == 0, made.stderr
    photograph = shared_data / "canon_powershot_s40" / "IMG_0102.JPG"
    graded = run("apply", tmp_path / "linear.clf", photograph, "-o", tmp_path / "graded", "--suffix", ".exr")
    assert graded.returncode == 0, graded.stderr
    linear, encoded = read_image(tmp_path / "graded" / "IMG_0102.exr"), read_image(photograph)
    assert linear.spec.getattribute("Model") == "Canon PowerShot S40"
    wanted = lf.load_profile(profile).linearize("standard/auto", "acescg")(encoded.pixels[::16, ::16])
    np.testing.assert_allclose(linear.pixels[::16, ::16], wanted, atol=2e-3, rtol=2e-3)  # EXR holds half floats
    tool = shutil.which("ociocheck", path=str(Path(sys.executable).parent))
    if tool is not None:
        checked = subprocess.run(
            [tool, "--iconfig", str(tmp_path / "ocio" / "config.ocio")], capture_output=True, check=False
        )
        assert checked.returncode == 0
