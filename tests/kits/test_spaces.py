"""Scene light in the spaces of other programs: a LUT holds the linear transform behind the space's own curve."""

from pathlib import Path

import numpy as np
import pytest

from lutforge.calibration.calibrate import calibrate
from lutforge.calibration.options import CalibrationOptions
from lutforge.colour.colour_difference import delta_e_2000
from lutforge.colour.rgb_spaces import matrix_between, rgb_space
from lutforge.colour.srgb import srgb_encode
from lutforge.errors import SettingsError
from lutforge.luts.bake import bake
from lutforge.luts.check import check_lut
from lutforge.luts.processor import evaluate, file_processor
from lutforge.model.camera_profile import CameraProfile
from lutforge.pipeline.baking import bake_files
from lutforge.pipeline.transforms import Wanted, transform
from lutforge.samples.sample_set import SampleSet

SETTING = "standard/auto"
LOGS = ("vlog", "acescct", "davinci-intermediate")


@pytest.fixture(scope="module")
def profile(s40_samples: SampleSet) -> CameraProfile:
    return calibrate(s40_samples, CalibrationOptions(size=17)).profile


@pytest.fixture(scope="module")
def codes() -> np.ndarray:
    """Colours of a JPEG that are not at its ends."""
    return np.random.default_rng(12).uniform(0.1, 0.9, (4000, 3)).astype(np.float32).astype(np.float64)


@pytest.mark.parametrize("space", LOGS)
def test_a_log_space_is_the_linear_one_encoded(space: str, profile: CameraProfile, codes: np.ndarray) -> None:
    encoding = rgb_space(space)
    linear = transform(profile, "linearize", SETTING, space=encoding.linear.name)(codes)
    assert np.abs(transform(profile, "linearize", SETTING, space=space)(codes) - encoding.encode(linear)).max() < 1e-12
    back = transform(profile, "render", target=SETTING, space=space)(encoding.encode(linear))
    assert np.abs(back - transform(profile, "render", target=SETTING, space=encoding.linear.name)(linear)).max() < 1e-9


@pytest.mark.parametrize("space", LOGS)
def test_a_cube_in_a_log_space_is_as_near_as_one_in_linear_light(
    space: str, profile: CameraProfile, codes: np.ndarray, tmp_path: Path
) -> None:
    """Both against the model itself, as display colours: the cube of a log space may not lose more than a tenth."""
    errors = {}
    wanted = shown(transform(profile, "linearize", SETTING, space="linear-srgb")(codes), "linear-srgb")
    for name in ("linear-srgb", space):
        path = tmp_path / f"{name}.resolve.cube"
        bake(transform(profile, "linearize", SETTING, space=name), path, size=33, display_referred=False)
        got = evaluate(file_processor(path), codes).astype(np.float64)
        errors[name] = delta_e_2000(shown(got, name), wanted).mean()
    assert errors[space] <= 1.1 * errors["linear-srgb"] + 0.02


def shown(values: np.ndarray, space: str) -> np.ndarray:
    """Values of a space as encoded sRGB on a display."""
    encoding = rgb_space(space)
    light = encoding.decode(values) @ matrix_between(encoding.linear.name, "linear-srgb").T
    return srgb_encode(np.clip(light, 0.0, 1.0))


@pytest.mark.parametrize("space", ["vlog", "slog3", "logc3", "clog3"])
def test_legal_ranges_are_kept(space: str, profile: CameraProfile) -> None:
    """Black and white of the JPEG lie between the code values that the camera's makers give to black and saturation."""
    ends = transform(profile, "linearize", SETTING, space=space)(np.array([[0.0] * 3, [1.0] * 3]))
    assert ends[0].min() > 0.05
    assert ends[1].max() < 0.75


@pytest.mark.parametrize("program", ["darktable", "RawTherapee", "art", "lightroom"])
def test_a_developer_is_not_given_a_lut_of_camera_raw(program: str, profile: CameraProfile, tmp_path: Path) -> None:
    suffix = ".png" if program in ("RawTherapee", "art") else ".cube"
    with pytest.raises(SettingsError, match="lutforge kit"):
        bake_files(profile, Wanted("render", target=SETTING), [tmp_path / f"look{suffix}"], program=program)
    assert not list(tmp_path.iterdir())


def test_check_says_who_feeds_no_camera_raw(profile: CameraProfile, tmp_path: Path) -> None:
    bake_files(profile, Wanted("render", target=SETTING), [tmp_path / "look.clf"])
    readers = check_lut(tmp_path / "look.clf").readers
    assert any("lutforge kit" in text for text in readers.values())
