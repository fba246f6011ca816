"""`lutforge config` as users type it."""

from pathlib import Path

import pytest

from lutforge.ocio.check import load_config
from tests.cases.profiles import plain_profile
from tests.conftest import CommandLine, Refused


@pytest.mark.slow
def test_merging_and_folders_in_use(tmp_path: Path, lutforge: CommandLine, refused: Refused) -> None:
    profile = tmp_path / "camera.npz"
    plain_profile("Nikon D40").save(profile)
    made = lutforge("config", profile, "-o", tmp_path / "ocio")
    assert "profile version 2.1, checked: " in made.stdout and "input colour spaces" in made.stdout
    assert len(made.stdout.splitlines()) == 1  # counts: names of a hundred spaces would hide the notes
    lutforge("config", profile, "-o", tmp_path / "ocio", "--replace")
    lutforge("config", profile, "-o", tmp_path / "all.ocioz", "--merge", tmp_path / "ocio" / "config.ocio")
    spaces = load_config(tmp_path / "all.ocioz").getColorSpaceNames()
    assert any("Nikon D40 2 JPEG standard daylight" in name for name in spaces)
    for says, *wrong in (("--replace",), ("nothing.ocio", "--merge", "nothing.ocio"), ("given twice", profile)):
        target = tmp_path / ("other" if wrong else "ocio")
        assert says in refused(tmp_path, "config", profile, "-o", target, *wrong)
