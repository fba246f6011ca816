"""A config of a camera that was calibrated through another camera's RAW."""

from dataclasses import replace

import numpy as np

from lutforge.ocio.config import build_config
from tests.cases.profiles import small_profile


def test_its_spaces_are_of_the_light_of_its_jpegs() -> None:
    """No space claims to be RAW."""
    own = small_profile()
    profile = replace(own, raw_camera="Reference", raw_transfer=np.diag([0.9, 1.0, 1.1]))
    config = build_config([profile])
    names = [space.getName() for space in config.getColorSpaces()]
    assert not any("RAW" in name for name in names if own.camera in name)
    assert any("linear" in name for name in names if own.camera in name)
    assert any("daylight" in name and "linear" not in name for name in names if own.camera in name)
