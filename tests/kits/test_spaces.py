"""Scene light in the spaces of other programs: a LUT holds the linear transform behind the space's own curve."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from lutforge.calibration.calibrate import calibrate
from lutforge.calibration.options import CalibrationOptions
from lutforge.colour.rgb_spaces import matrix_between, rgb_space
from lutforge.colour.spectra import surface_reflectances
from lutforge.colour.srgb import delta_e_2000, srgb_encode
from lutforge.errors import SettingsError
from lutforge.luts.check import check_lut
from lutforge.luts.ocio_transforms import evaluate
from lutforge.luts.reading import read_lut, trusted_processor
from lutforge.model.camera_profile import CameraProfile
from lutforge.pipeline.bake_plan import BakeOptions
from lutforge.pipeline.baking import bake, bake_files
from lutforge.pipeline.transforms import TransformRequest, transform
from lutforge.simulate.camera import nikon_d5100
from tests.cases.samples import chart_140, photograph_patches

SETTING = "standard/auto"
DAYLIGHT = "standard/daylight"
LOGS = ("vlog", "acescct", "davinci-intermediate")
SOME_LOGS = [LOGS[0], *(pytest.param(space, marks=pytest.mark.slow) for space in LOGS[1:])]


@pytest.fixture(scope="module")
def codes() -> np.ndarray:
    """Colours of a JPEG that are not at its ends."""
    return np.random.default_rng(12).uniform(0.1, 0.9, (4000, 3)).astype(np.float32).astype(np.float64)


@pytest.mark.parametrize("space", LOGS)
def test_a_log_space_is_the_linear_one_encoded(space: str, profile: CameraProfile, codes: np.ndarray) -> None:
    encoding = rgb_space(space)
    linear = transform(profile, "linearize", SETTING, space=encoding.linear.name)(codes)
    log = transform(profile, "linearize", SETTING, space=space)(codes)
    assert np.abs(log - np.clip(encoding.encode(linear), 0.0, 1.0)).max() < 1e-12
    back = transform(profile, "render", target=SETTING, space=space)(encoding.encode(linear))
    assert np.abs(back - transform(profile, "render", target=SETTING, space=encoding.linear.name)(linear)).max() < 1e-9


@dataclass(frozen=True, eq=False)
class Truth:
    """Surfaces in daylight, as a simulated camera saw them: light in linear sRGB, the JPEG, and a profile of others."""

    profile: CameraProfile
    light: np.ndarray
    jpeg: np.ndarray


@pytest.fixture(scope="module")
def truth() -> Truth:
    """Calibrated from a chart; the surfaces are others, at four exposures, where no channel is clipped."""
    camera = nikon_d5100()
    options = CalibrationOptions(size=17)
    profile = calibrate(photograph_patches(camera, chart_140(), stops=(-3, -2, -1, 0)), options)[0]
    times = camera.nominal_exposure_s * 2.0 ** np.array([-4.0, -2.5, -1.0, 0.0])
    raw = np.concatenate([camera.expose(surface_reflectances(), "daylight", time) for time in times])
    balanced = raw * camera.multipliers("daylight")
    jpeg = camera.render(raw, "standard", "daylight")
    inside = ((jpeg > 2 / 255) & (jpeg < 253 / 255)).all(axis=1) & (balanced < 1).all(axis=1)
    return Truth(profile, balanced[inside] @ camera.matrix.T, jpeg[inside])


@pytest.mark.slow
@pytest.mark.parametrize("space", SOME_LOGS)
@pytest.mark.parametrize("suffix", [".clf", ".resolve.cube", ".cube"])
def test_a_jpeg_in_a_log_space_is_as_good_as_in_linear(suffix: str, space: str, truth: Truth, tmp_path: Path) -> None:
    errors = {}
    for name in (rgb_space(space).linear.name, space):
        path = tmp_path / f"{name}{suffix}"
        bake(transform(truth.profile, "linearize", DAYLIGHT, space=name), path, size=33)
        light = evaluate(trusted_processor(path), np.rint(255 * truth.jpeg) / 255).astype(np.float64)
        errors[name] = delta_e_2000(shown(light, name), shown(truth.light, "linear-srgb")).mean()
    assert errors[space] <= 1.1 * errors[rgb_space(space).linear.name]


@pytest.mark.parametrize("space", SOME_LOGS)
@pytest.mark.parametrize("suffix", [".clf", ".cube"])
def test_log_footage_is_rendered_as_well_as_linear_light(suffix: str, space: str, truth: Truth, tmp_path: Path) -> None:
    errors = {}
    for name, end in ((rgb_space(space).linear.name, ".clf"), (space, suffix)):  # no .cube takes linear light beyond 1
        path = tmp_path / f"{name}{end}"
        bake(transform(truth.profile, "render", target=DAYLIGHT, space=name), path)
        footage = rgb_space(name).encode(truth.light @ matrix_between("linear-srgb", rgb_space(name).linear.name).T)
        jpeg = evaluate(trusted_processor(path), footage).astype(np.float64)
        errors[name] = delta_e_2000(np.clip(jpeg, 0.0, 1.0), truth.jpeg).mean()
    assert errors[space] <= 1.1 * errors[rgb_space(space).linear.name]


@pytest.mark.parametrize(
    ("space", "black", "grey", "highest"),
    [
        ("vlog", 128 / 1023, 433 / 1023, 0.5991),  # V-Log/V-Gamut reference manual, 1.0: 0 and 0.18; its formula of 1
        ("acescct", 0.0729, 0.4135884, 0.5547945),  # S-2016-001: 0, 0.18 and 1
        ("davinci-intermediate", 0.0, 0.336043, 0.513837),  # Blackmagic Design, 2021: 0, 0.18 and 1
    ],
)
def test_codes_are_those_of_the_published_curves(
    space: str, black: float, grey: float, highest: float, truth: Truth, tmp_path: Path
) -> None:
    """A cube takes the JPEG's black, mid grey and white to those of the curve, and nothing beyond what RAW can hold."""
    path = tmp_path / f"{space}.cube"
    bake(transform(truth.profile, "linearize", DAYLIGHT, space=space), path, size=33)
    camera = nikon_d5100()
    mid = camera.render(np.full(3, 0.18) / camera.multipliers("daylight"), "standard", "daylight")
    codes = evaluate(trusted_processor(path), np.stack([np.zeros(3), mid, np.ones(3)]))
    assert np.abs(codes[0] - black).max() < 1.5 / 1023
    assert np.abs(codes[1] - grey).max() < 4 / 1023
    cube = read_lut(path).cube
    assert cube is not None
    assert cube.values.min() >= 0.0
    assert np.abs(codes[2] - highest).max() < 4 / 1023
    # A strong colour of RAW within [0, 1] may lie beyond 1 in another space: where the matrix subtracts nothing.
    matrix = matrix_between("linear-srgb", rgb_space(space).linear.name) @ truth.profile.matrix
    strongest = rgb_space(space).encode(np.maximum(matrix, 0.0).sum(axis=1))
    assert np.all(cube.values.max(axis=(0, 1, 2)) <= np.maximum(strongest, highest) + 4 / 1023)


def shown(values: np.ndarray, space: str) -> np.ndarray:
    """Values of a space as encoded sRGB on a display."""
    encoding = rgb_space(space)
    light = encoding.linearize(values) @ matrix_between(encoding.linear.name, "linear-srgb").T
    return srgb_encode(np.clip(light, 0.0, 1.0))


@pytest.mark.parametrize("program", ["darktable", "RawTherapee", "art", "lightroom"])
def test_a_developer_is_not_given_a_lut_of_camera_raw(program: str, profile: CameraProfile, tmp_path: Path) -> None:
    suffix = ".png" if program in ("RawTherapee", "art") else ".cube"
    request = TransformRequest("render", target=SETTING)
    with pytest.raises(SettingsError, match=r"lutforge kit camera\.npz"):
        bake_files(profile, request, [tmp_path / f"look{suffix}"], BakeOptions(program=program))
    assert not list(tmp_path.iterdir())
    saved = tmp_path / "own.npz"
    profile.save(saved)
    with pytest.raises(SettingsError, match=f"lutforge kit {saved} --to"):
        bake_files(saved, request, [tmp_path / f"look{suffix}"], BakeOptions(program=program))


def test_check_says_who_feeds_no_camera_raw(profile: CameraProfile, tmp_path: Path) -> None:
    bake_files(profile, TransformRequest("render", target=SETTING), [tmp_path / "look.clf"])
    readers = check_lut(tmp_path / "look.clf").readers
    assert any("lutforge kit" in text for text in readers.values())
