"""The configs in ocio_configs/: sound, small, fast to load, and what their commands make."""

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from lutforge.colour.rgb_spaces import from_linear_srgb
from lutforge.inverse.round_trip import MAX_GOAL
from lutforge.model.camera_profile import CameraProfile
from lutforge.ocio.check import check_config, load_config
from tests.ocio.test_config import convert, is_clean, ociocheck

CONFIGS = Path(__file__).parents[2] / "ocio_configs"
FOLDERS = sorted(path.parent for path in CONFIGS.glob("*/config.ocio"))


def made_again(folder: Path, data: Path, work: Path) -> Path:
    """Run the commands of a config's README on the data that it names."""

    def found(word: str) -> str:
        """A path that is in the data, else the word as it is."""
        is_path = "." in word[-5:] or "/" in word
        return str(next(data.rglob(word), word)) if is_path else word

    commands = [line.split() for line in (folder / "README.md").read_text().splitlines() if "    lutforge " in line]
    assert len(commands) == 2
    for _, *words in commands:
        command = [sys.executable, "-m", "lutforge", *map(found, words)]
        run = subprocess.run(command, cwd=work, capture_output=True, text=True, timeout=280)
        assert run.returncode == 0, run.stderr
    return work / folder.name / "config.ocio"


@pytest.mark.parametrize("folder", FOLDERS, ids=lambda path: path.name)
def test_sound_and_explained(folder: Path) -> None:
    assert is_clean(ociocheck(folder / "config.ocio"))
    assert check_config(load_config(folder / "config.ocio")) == []
    readme = (folder / "README.md").read_text()
    assert "Made by" in readme
    assert any(licence in readme for licence in ("MIT", "CC0"))


def test_the_table_has_the_figures_of_the_descriptions() -> None:
    """The worst of a config's colour spaces, as the config states it."""
    table = (CONFIGS / "README.md").read_text()
    for folder in FOLDERS:
        text = (folder / "config.ocio").read_text()
        mean, largest = (max(re.findall(rf"round trip {key}: (\S+)", text), key=float) for key in ("mean", "max"))
        (row,) = [line for line in table.splitlines() if f"]({folder.name})" in line]
        assert f"| {mean} / {largest} |" in row


def test_the_d40_is_small() -> None:
    assert sum(file.stat().st_size for file in (CONFIGS / "nikon_d40").rglob("*") if file.is_file()) <= 16_000_000


def test_what_the_d40_renders_comes_back(published_d40: CameraProfile) -> None:
    """JPEG colours of even RAW colours, none of them clipped: back as they were, and there where they came from."""
    profile = published_d40
    config = load_config(CONFIGS / "nikon_d40" / "config.ocio")
    to_reference = from_linear_srgb("aces2065-1") @ profile.matrix * profile.multipliers("standard/daylight")
    for balance in profile.white_balances:
        space, selector = f"Nikon D40 JPEG standard {balance}", f"standard/{balance}"
        raw = np.random.default_rng(4).random((20000, 3)) / profile.multipliers(selector)
        jpeg = profile.render(selector)(raw)
        unclipped = np.all((jpeg > 1 / 255) & (jpeg < 254 / 255), axis=1)
        raw, jpeg = raw[unclipped], jpeg[unclipped]
        there = convert(config, space, "ACES2065-1", pixels=jpeg)
        error = np.linalg.norm(convert(config, "ACES2065-1", space, pixels=there) - jpeg, axis=1)
        assert error.mean() <= 0.001  # a quarter of a code
        assert error.max() <= MAX_GOAL, (balance, error.max())
        assert np.linalg.norm(there - raw @ to_reference.T, axis=1).mean() < 0.005


@pytest.mark.slow
def test_the_d40s_command_still_makes_it(shared_data: Path, tmp_path: Path) -> None:
    """The same text but for measured numbers, and the same colours within a fraction of a code."""
    folder = CONFIGS / "nikon_d40"
    published = load_config(folder / "config.ocio")
    again = load_config(made_again(folder, shared_data, tmp_path))
    assert list(again.getColorSpaceNames()) == list(published.getColorSpaceNames())
    assert list(again.getLookNames()) == list(published.getLookNames())
    for balance in ("tungsten", "fluorescent"):
        space = f"Nikon D40 JPEG standard {balance}"
        for pair in (("ACEScg", space), (space, "ACEScg")):
            difference = np.linalg.norm(convert(again, *pair) - convert(published, *pair), axis=1)
            assert difference.mean() < 0.25 / 255


@pytest.mark.slow
def test_the_s40s_command_still_makes_it(shared_data: Path, tmp_path: Path) -> None:
    """Calibrated anew: the same names, and colours within the held-out error."""
    folder = CONFIGS / "canon_powershot_s40"
    published, again = (load_config(at) for at in (folder / "config.ocio", made_again(folder, shared_data, tmp_path)))
    assert list(again.getColorSpaceNames()) == list(published.getColorSpaceNames())
    space = "Canon PowerShot S40 JPEG standard auto"
    jpeg = convert(published, "ACEScg", space)
    assert np.linalg.norm(convert(again, "ACEScg", space) - jpeg, axis=1).mean() < 0.014
    there = [convert(config, space, "ACEScg", pixels=jpeg) for config in (published, again)]
    assert np.linalg.norm(there[0] - there[1], axis=1).mean() < 0.014
