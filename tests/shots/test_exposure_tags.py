"""Exposure time, aperture and sensitivity by every tag that Exif 2.32 has for them, in its order."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import OpenImageIO as oiio  # noqa: N813 - the name that its documentation uses
import pytest
from PIL import Image, TiffImagePlugin

from lutforge.grading.grade import LutRecipe
from lutforge.grading.image import apply_image
from lutforge.shots.metadata import read_picture_settings
from tests.cases.pictures import write_cube

SENSITIVITY, KIND, OUTPUT, INDEX, SPEED, LATITUDE = 0x8827, 0x8830, 0x8831, 0x8832, 0x8833, 0x8834
EXPOSURE_INDEX = 0xA215


def settings_of(tmp_path: Path, tags: Mapping[int, object]) -> tuple[float, float, float]:
    exif = Image.Exif()
    exif.get_ifd(0x8769).update(tags)
    Image.new("RGB", (64, 64)).save(tmp_path / "a.jpg", exif=exif)
    settings = read_picture_settings(tmp_path / "a.jpg")
    return settings.exposure_s, settings.aperture, settings.iso


@pytest.mark.parametrize(
    ("tags", "iso"),
    [
        ({SENSITIVITY: 400}, 400),
        ({SENSITIVITY: 400, KIND: 2, INDEX: 800}, 400),  # what fits in PhotographicSensitivity stands there
        ({SENSITIVITY: 65535, KIND: 2, INDEX: 102400}, 102400),
        ({SENSITIVITY: 65535, KIND: 1, OUTPUT: 204800, INDEX: 102400}, 204800),
        ({SENSITIVITY: 65535, KIND: 2, OUTPUT: 204800, INDEX: 102400}, 102400),
        ({SENSITIVITY: 65535, KIND: 3, OUTPUT: 204800, INDEX: 102400, SPEED: 81920}, 81920),
        ({SENSITIVITY: 65535, KIND: 4, OUTPUT: 204800, INDEX: 204800}, 204800),
        ({SENSITIVITY: 65535, KIND: 7, OUTPUT: 409600, INDEX: 409600, SPEED: 409600, LATITUDE: 9}, 409600),
        ({SENSITIVITY: 65535, INDEX: 102400}, 102400),
        ({SENSITIVITY: 65535}, 65535),
        ({KIND: 2, INDEX: 3200}, 3200),
        ({SPEED: 1600}, 1600),
        ({EXPOSURE_INDEX: TiffImagePlugin.IFDRational(250, 1)}, 250),  # of old cameras
        ({SENSITIVITY: 100, EXPOSURE_INDEX: TiffImagePlugin.IFDRational(250, 1)}, 100),
    ],
)
def test_sensitivity(tmp_path: Path, tags: dict[int, object], iso: float) -> None:
    assert settings_of(tmp_path, tags)[2] == iso


def test_time_and_aperture_or_their_apex_values(tmp_path: Path) -> None:
    ratio = TiffImagePlugin.IFDRational
    apex = {0x9201: ratio(6, 1), 0x9202: ratio(4, 1)}
    assert settings_of(tmp_path, apex)[:2] == pytest.approx((1 / 64, 4.0))
    slow = {0x9201: ratio(-2, 1), 0x9202: ratio(4, 1)}
    assert settings_of(tmp_path, slow)[:2] == pytest.approx((4.0, 4.0))
    stated = {0x829A: ratio(1, 100), 0x829D: ratio(56, 10), **apex}
    assert settings_of(tmp_path, stated)[:2] == pytest.approx((1 / 100, 5.6))


@pytest.mark.parametrize("suffix", ["jpg", "tif", "png", "webp", "jp2", "exr"])
@pytest.mark.parametrize(
    "sensitivity",
    [{SENSITIVITY: 400}, {SENSITIVITY: 65535, KIND: 2, INDEX: 102400}, {SENSITIVITY: 65535, KIND: 3, SPEED: 81920}],
)
@pytest.mark.parametrize("is_apex", [False, True], ids=["", "APEX"])
def test_a_graded_picture_states_the_exposure_of_its_source(
    tmp_path: Path, suffix: str, sensitivity: dict[int, object], is_apex: bool
) -> None:
    ratio = TiffImagePlugin.IFDRational
    time = {0x9201: ratio(-2, 1), 0x9202: ratio(4, 1)} if is_apex else {0x829A: ratio(1, 100), 0x829D: ratio(4, 1)}
    stated = settings_of(tmp_path, {**time, **sensitivity})
    done = apply_image(
        LutRecipe(write_cube(tmp_path / "a.cube")).grade(tmp_path / "a.jpg"),
        tmp_path / "a.jpg",
        tmp_path / f"graded.{suffix}",
    )
    found = read_picture_settings(done.target)
    assert (found.exposure_s, found.aperture, found.iso) == pytest.approx(stated, rel=1e-3)


def test_attributes_of_odd_types_are_unknown(tmp_path: Path) -> None:
    spec = oiio.ImageSpec(16, 16, 3, "half")
    spec.attribute("Exif:PhotographicSensitivity", oiio.TypeDesc("int[2]"), (100, 200))
    spec.attribute("ExposureTime", "a while")
    spec.attribute("FNumber", oiio.TypeDesc("float[3]"), (1.0, 2.0, 3.0))
    target = oiio.ImageOutput.create("a.exr")
    assert target is not None
    assert target.open(str(tmp_path / "a.exr"), spec) and target.write_image(np.zeros((16, 16, 3), np.float32))
    target.close()
    settings = read_picture_settings(tmp_path / "a.exr")
    assert np.isnan([settings.exposure_s, settings.aperture, settings.iso]).all()
