"""The demo ends with LUTs, a config, a graded photograph and small errors against the known truth."""

import re
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

import lutforge as lf
from lutforge.cli.demo_shots import SHOTS
from lutforge.evaluation.next_shots import known_colours
from lutforge.images.read import read_image
from lutforge.samples.table import read_samples
from lutforge.simulate.camera import nikon_d5100
from tests.conftest import CommandLine


def errors(stdout: str) -> dict[str, list[float]]:
    """The last table: what → mean, max, RMSE and ΔE00 (where there is one)."""
    rows = {}
    for line in stdout.splitlines():
        found = re.fullmatch(r"(render|linearize|refinish|graded)(.*?)\s+(\d+)((?:\s+[\d.]+){3})\s+([\d.]+|–)\s*", line)
        if found:
            values = [float(word) for word in found[4].split()]
            rows[(found[1] + found[2]).strip()] = values + ([] if found[5] == "–" else [float(found[5])])
    return rows


def test_it_makes_every_file_that_it_names(demo: tuple[Path, str]) -> None:
    tables = ("samples.csv", "camera.npz", "calibration.png", "refinish.png", "graded/held-out.JPG")
    for name in (*tables, "luts/render.clf", "luts/refinish.cube", "luts/refinish.resolve.cube", "ocio/config.ocio"):
        assert (demo[0] / name).stat().st_size > 0, name
    assert len(list((demo[0] / "shots").glob("*.dng"))) == len(SHOTS)


def test_it_prints_a_line_for_each_stage(demo: tuple[Path, str]) -> None:
    _, stdout = demo
    lines = stdout.splitlines()
    assert len(lines) <= 25
    assert [line[0] for line in lines if re.match(r"\d\. ", line)] == list("12345678")
    assert "ociocheck passed" in stdout
    assert "?" not in stdout  # control characters, an end of line among them, are printed as "?"
    assert "tiles" not in stdout


def test_its_shots_are_those_that_the_guide_advises() -> None:
    """Every white balance more than once, dials that are wrong for the light, shots that are darker and brighter."""
    balances = [shot.white_balance for shot in SHOTS]
    assert all(balances.count(balance) >= 2 for balance in balances)
    for style in {shot.style for shot in SHOTS}:
        of_style = [shot for shot in SHOTS if shot.style == style]
        assert any(shot.light not in (None, shot.white_balance) for shot in of_style)
        exposures = [shot.exposure for shot in of_style]
        assert min(exposures) <= 0.5 and max(exposures) >= 1.2


def test_nothing_is_left_to_shoot(demo: tuple[Path, str]) -> None:
    folder, _ = demo
    profile, samples = lf.load_profile(folder / "camera.npz"), read_samples(folder / "samples.csv")
    assert profile.notes == ()
    for name in profile.styles:
        known = known_colours(profile, name, samples.select(samples.style == name).srgb)
        assert known.gaps == () and known.are_vouched_for


@pytest.mark.slow
def test_the_whole_demo_makes_the_readmes_picture_and_verbose_names_the_error_of_each_lut(
    lutforge: CommandLine, tmp_path: Path
) -> None:
    stdout = lutforge("demo", "-o", tmp_path / "demo", "-v").stdout
    (line,) = (line for line in stdout.splitlines() if "refinish.resolve.cube" in line)
    assert line.count("; mean ") == 1
    assert stdout.count(": kept ") == len(SHOTS)
    # The last digits of a sum depend on where its numbers lie in memory: among other work a pixel in twenty differs.
    made = read_image(tmp_path / "demo" / "refinish.png").pixels
    shown = read_image(Path(__file__).parents[2] / "examples" / "pictures" / "refinish.png").pixels
    assert 255 * np.abs(made - shown).mean() < 0.2, "run make pictures"


def test_errors_against_the_truth(demo: tuple[Path, str]) -> None:
    """Bounds of the simulated camera: rendering within a few codes, linearizing below 0.4 % of full scale."""
    table = errors(demo[1])
    assert len(table) == 5
    assert all(values[0] < 0.02 for name, values in table.items() if name.startswith("render"))
    assert table["linearize standard/tungsten"][0] < 0.004
    assert table["refinish"][0] < 0.03
    assert table["graded JPEG, 8 bit"][2] < 0.025


def test_grading_comes_near_what_the_cameras_own_functions_would_make(demo: tuple[Path, str]) -> None:
    folder = demo[0]
    before = read_image(folder / "shots/held-out/held-out.JPG").pixels
    camera = nikon_d5100()
    perfect = camera.render(camera.linearize(before, "standard", "tungsten"), "vivid", "daylight", 0.7)
    expected = read_image(folder / "shots/held-out/wanted.JPG").pixels
    after = read_image(folder / "graded/held-out.JPG").pixels

    def rmse(image: NDArray[np.floating]) -> float:
        return float(np.sqrt(np.mean((image - expected) ** 2)))

    # Noise and compression of the JPEG leave the camera's own functions an error, too. What comes on top is saturated
    # colours that no calibration shot shows.
    assert rmse(perfect) < 0.09 * rmse(before)
    assert rmse(after) < 1.24 * rmse(perfect)
