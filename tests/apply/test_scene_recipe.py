"""Pictures to scene-linear light: one scene, photographed with many settings, comes out as one."""

from pathlib import Path

import numpy as np
import OpenImageIO as oiio  # noqa: N813 - the name that its documentation uses
import pytest

from lutforge.arrays import Array, Mask
from lutforge.calibration.options import CalibrationOptions
from lutforge.colour.rgb_spaces import from_linear_srgb
from lutforge.colour.srgb import srgb_decode
from lutforge.errors import SettingsError
from lutforge.images.read import read_image
from lutforge.pipeline.calibration import calibrate
from lutforge.pipeline.grading import Grading, apply
from lutforge.simulate.camera import nikon_d5100
from lutforge.simulate.photograph import CameraSettings, photograph
from lutforge.simulate.scene import still_life
from tests.cases.samples import samples_of_settings

STYLES, BALANCES, EXPOSURES = ("standard", "vivid"), ("tungsten", "daylight", "shade"), (-2, -1, 0, 1, 2)
TILE = 8


@pytest.fixture(scope="module")
def profile(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("profile") / "camera.npz"
    calibrate(samples_of_settings(nikon_d5100(), 1, STYLES, BALANCES), CalibrationOptions(size=17)).save(path)
    return path


@pytest.fixture(scope="module")
def bracket(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """One scene in daylight, in every style, white balance and exposure."""
    folder, camera, scene = tmp_path_factory.mktemp("bracket"), nikon_d5100(), still_life(240, 360, 5)
    files = []
    for style in STYLES:
        for balance in BALANCES:
            for ev in EXPOSURES:
                settings = CameraSettings(style, balance, camera.nominal_exposure_s * 2.0**ev, preview_scale=0.25)
                shot = photograph(camera, scene, settings, folder, f"{style}-{balance}{ev:+d}", light="daylight")
                assert shot.jpeg is not None
                files.append(shot.jpeg)
    return files


def tiles(values: Array) -> Array:
    """Mean of tiles of an image (h, w, c)."""
    height, width = (side // TILE for side in values.shape[:2])
    cut = values[: height * TILE, : width * TILE]
    return np.asarray(cut.reshape(height, TILE, width, TILE, -1).mean(axis=(1, 3)))


def departures(pictures: list[Array], clipped: list[Mask]) -> Array:
    """How far each surface's channels are from their median over the pictures that do not clip it, as shares of it."""
    means = np.array([tiles(picture) for picture in pictures])
    whole = np.array([tiles(mask[..., None].astype(np.float64)) == 0 for mask in clipped])[..., 0]
    means[~whole] = np.nan
    means = means[:, whole.sum(axis=0) >= 2]
    shares = np.abs(means / np.nanmedian(means, axis=0) - 1)
    return np.asarray(shares[np.isfinite(shares)])


def test_pictures_of_one_scene_agree(profile: Path, bracket: list[Path], tmp_path: Path) -> None:
    result = apply(profile, bracket, tmp_path, space="acescg", exposure="exif")
    assert not result.failed and len(result.done) == len(bracket)
    light = [read_image(done.target).pixels.astype(np.float64) for done in result.done]
    masks = [picture[..., 3] > 0.5 for picture in light]
    shares = departures([picture[..., :3] for picture in light], masks)
    codes = [read_image(path).pixels.astype(np.float64) for path in bracket]
    times = [2.0 ** float(path.stem[-2:]) for path in bracket]
    naive = departures([srgb_decode(image) / time for image, time in zip(codes, times, strict=True)], masks)
    assert np.median(shares) < 0.02 and np.quantile(shares, 0.95) < 0.05
    assert np.median(shares) < np.median(naive) / 10


def test_light_is_that_of_the_scene(profile: Path, bracket: list[Path], tmp_path: Path) -> None:
    """In the camera's own white balance, without exposure: 1 is where a neutral surface saturates."""
    camera, picture = nikon_d5100(), next(path for path in bracket if path.stem == "standard-daylight+0")
    result = apply(profile, picture, tmp_path, space="acescg")
    light = read_image(result.done[0].target).pixels
    scene = still_life(240, 360, 5).irradiance(camera, "daylight").astype(np.float64) * camera.multipliers("daylight")
    truth = scene @ (from_linear_srgb("acescg") @ camera.matrix).T
    side = [(a - b) // 2 for a, b in zip(truth.shape, light.shape, strict=False)][:2]
    truth = truth[side[0] : side[0] + light.shape[0], side[1] : side[1] + light.shape[1]]
    sound = tiles(light[..., 3:].astype(np.float64))[..., 0] == 0
    ratio = tiles(light[..., :3].astype(np.float64))[sound] / tiles(truth)[sound]
    assert abs(np.median(ratio) - 1) < 0.02


def test_the_file_tells_what_it_holds(profile: Path, bracket: list[Path], tmp_path: Path) -> None:
    (done,) = apply(profile, bracket[0], tmp_path, space="acescg", exposure="exif").done
    file = oiio.ImageInput.open(str(done.target))
    assert file is not None
    spec = file.spec()
    assert (
        done.target.suffix == ".exr" and spec.channelnames == ("R", "G", "B", "clipped") and str(spec.format) == "half"
    )
    assert spec.get_string_attribute("colorInteropID") == "lin_ap1_scene"
    assert spec.get_string_attribute("Model") == "Simulated D5100" and spec.get_float_attribute("FNumber") == 8.0
    codes = read_image(bracket[0]).pixels
    ends = ((codes <= 0.5 / 255) | (codes >= 254.5 / 255)).any(axis=-1)
    assert np.array_equal(read_image(done.target).pixels[..., 3] > 0.5, ends)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"exposure": "exif"}, "--exposure goes with --space"),
        ({"space": "acescg", "exposure": "meter"}, "unknown exposure"),
        ({"space": "vlog"}, "pictures become linear light"),
        ({"space": "acescg", "target": "vivid/daylight"}, "light has no style"),
        ({"space": "acescg", "suffix": ".jpg"}, "linear light is written as .exr"),
        ({"space": "acescg", "look": Path("b.npz")}, "--as goes without --space"),
    ],
)
def test_options_that_do_not_go_together(
    options: dict[str, object], message: str, profile: Path, bracket: list[Path], tmp_path: Path
) -> None:
    with pytest.raises(SettingsError, match=message):
        Grading((profile, bracket[0]), tmp_path / "out", **options).run()  # type: ignore[arg-type]  # a row of the table
    assert not (tmp_path / "out").exists()
