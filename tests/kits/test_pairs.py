"""Pairs of any two renderings: a known look is found from pictures before and after it."""

from pathlib import Path

import numpy as np
import OpenImageIO
import pytest

from lutforge.errors import SettingsError, ShotError
from lutforge.model.camera_profile import load_profile
from lutforge.pipeline.developing import left_side, sample_pairs
from tests.conftest import CommandLine


def look(x: np.ndarray) -> np.ndarray:
    """Cooler, and with more contrast."""
    y = x**1.2 @ np.array([[0.95, 0.05, 0.0], [0.0, 1.0, 0.0], [0.0, 0.1, 0.9]]).T
    return np.asarray(np.clip(0.04 + 0.9 * y, 0.0, 1.0))


@pytest.fixture(scope="module")
def folders(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """Six frames of coloured squares, before and after the look."""
    folder = tmp_path_factory.mktemp("pairs")
    rng = np.random.default_rng(8)
    for name in "abcdef":
        squares = rng.uniform(0.05, 0.95, (6, 8, 3))
        picture = np.kron(squares, np.ones((80, 80, 1)))
        for side, pixels in (("before", picture), ("after", look(picture))):
            (folder / side).mkdir(exist_ok=True)
            buffer = OpenImageIO.ImageBuf(OpenImageIO.ImageSpec(640, 480, 3, "uint16"))
            buffer.set_pixels(OpenImageIO.ROI(), np.ascontiguousarray(pixels, dtype=np.float32))
            assert buffer.write(str(folder / side / f"{name}.tif"))
    return folder / "before", folder / "after"


def test_a_look_between_two_renderings(folders: tuple[Path, Path], tmp_path: Path, lutforge: CommandLine) -> None:
    before, after = folders
    output = tmp_path / "look.npz"
    run = lutforge("calibrate", "--pairs", before, after, "--from-space", "srgb", "-o", output)
    assert run.returncode == 0, run.stderr
    profile = load_profile(output)
    assert profile.options["raw_space"] == "linear-srgb"
    setting = f"{next(iter(profile.styles))}/{next(iter(profile.white_balances))}"
    x = np.random.default_rng(9).uniform(0.1, 0.9, (500, 3))
    light = np.where(x <= 0.04045, x / 12.92, ((x + 0.055) / 1.055) ** 2.4)
    assert np.abs(profile.render(setting)(light) - look(x)).mean() < 0.004


def test_what_does_not_fit_is_one_line(folders: tuple[Path, Path], tmp_path: Path) -> None:
    before, _ = folders
    with pytest.raises(SettingsError, match="known: "):
        sample_pairs(*folders, "no-such-space")
    with pytest.raises(ShotError, match="no such folder"):
        sample_pairs(before, tmp_path / "nothing", "srgb")
    (tmp_path / "empty").mkdir()
    with pytest.raises(ShotError, match="no picture of one has the name of a picture of the other"):
        sample_pairs(before, tmp_path / "empty", "srgb")
    with pytest.raises(SettingsError, match="--developed-space"):
        left_side(developed=before)
    with pytest.raises(SettingsError, match="not both"):
        left_side("darktable", before, "srgb")
    with pytest.raises(SettingsError, match="it runs darktable, rawtherapee"):
        left_side("lightroom")


def test_of_several_pictures_of_one_name_the_tiff_is_taken(folders: tuple[Path, Path], tmp_path: Path) -> None:
    (tmp_path / "FRAME.TIF").write_bytes((folders[0] / "a.tif").read_bytes())
    (tmp_path / "frame.jpg").write_bytes(b"no picture")
    left = left_side(developed=tmp_path, developed_space="srgb")
    assert left is not None
    assert left(Path("frame.CR2")).pixels.shape == (480, 640, 3)
