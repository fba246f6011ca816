"""The profile that kits are made of."""

import pytest

from lutforge.calibration.calibrate import calibrate
from lutforge.calibration.options import CalibrationOptions
from lutforge.model.camera_profile import CameraProfile
from lutforge.samples.sample_set import SampleSet


@pytest.fixture(scope="session")
def profile(s40_samples: SampleSet) -> CameraProfile:
    """Calibrated from RAW files."""
    return calibrate(s40_samples, CalibrationOptions(size=17))[0]
