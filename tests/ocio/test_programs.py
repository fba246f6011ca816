"""What programs make of a config: oiiotool's pixels are the Python model's, within the error that the LUT states."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO as oiio  # noqa: N813 - the name that its documentation uses
import pytest
from numpy.typing import NDArray

import lutforge as lf
from lutforge.colour.rgb_spaces import from_linear_srgb
from lutforge.model.camera_profile import CameraProfile

CONFIG = Path(__file__).parents[2] / "ocio_configs" / "nikon_d40" / "config.ocio"
ROUNDING = 2e-5
"""Float32 through a matrix and back."""


@pytest.fixture(scope="module")
def d40(shared_data: Path) -> CameraProfile:
    models = [shared_data / "nus_nikon_d40" / name for name in ("other_white_balances", "fluorescent")]
    return lf.import_published(models, "Nikon D40")


def oiiotool(folder: Path, pixels: NDArray[Any], *actions: str, **variables: str) -> NDArray[np.float32]:
    """Pixels (n, 3) through oiiotool with the config, by files of floats."""
    tool = shutil.which("oiiotool", path=str(Path(sys.executable).parent))
    if tool is None:
        pytest.skip("oiiotool is not in this environment")
    source, target = folder / "in.exr", folder / "out.exr"
    oiio.ImageBuf(pixels.astype(np.float32)[None]).write(str(source), oiio.FLOAT)
    command = [tool, "--colorconfig", str(CONFIG), str(source), *actions, "-d", "float", "-o", str(target)]
    run = subprocess.run(command, capture_output=True, text=True, check=False, env=os.environ | variables)
    assert run.returncode == 0, run.stdout + run.stderr
    values: NDArray[np.float32] = np.asarray(oiio.ImageBuf(str(target)).get_pixels(oiio.FLOAT), dtype=np.float32)
    return values.reshape(-1, 3)


def stated(way: str) -> tuple[float, float]:
    """Mean and max error against the model, as a LUT file says of itself."""
    text = (CONFIG.parent / "luts" / f"nikon_d40_standard_{way}.clf").read_text()
    found = re.search(rf"{way} LUT against the model: mean ([\d.e-]+), max ([\d.e-]+)", text)
    assert found is not None
    return float(found[1]), float(found[2])


def jpeg_colours() -> NDArray[np.float64]:
    return np.random.default_rng(6).random((4096, 3))


def assert_within(got: NDArray[Any], model: NDArray[Any], way: str) -> None:
    error = np.linalg.norm(got - model, axis=1)
    mean, largest = stated(way)
    assert error.mean() <= 1.1 * mean + ROUNDING
    assert error.max() <= 1.1 * largest + ROUNDING


def test_colorconvert_to_raw_and_back_is_the_model(d40: CameraProfile, tmp_path: Path) -> None:
    x, gain = jpeg_colours(), d40.multipliers("standard/daylight")
    pair = "Nikon D40 standard daylight", "Nikon D40 RAW daylight"
    raw = oiiotool(tmp_path, x, "--colorconvert", *pair)
    assert_within(raw, d40.linearize("standard/daylight")(x) * gain, "linearize")
    jpeg = oiiotool(tmp_path, x, "--colorconvert", *reversed(pair))
    assert_within(jpeg, d40.render("standard/daylight")(x / gain), "render")


def test_ociodisplay_shows_scene_linear_footage_as_the_model_renders_it(d40: CameraProfile, tmp_path: Path) -> None:
    balanced = jpeg_colours()
    acescg = balanced @ (from_linear_srgb("acescg") @ d40.matrix).T
    actions = ("--iscolorspace", "ACEScg", "--ociodisplay", "sRGB - Display", "Nikon D40 standard")
    got = oiiotool(tmp_path, acescg, *actions)
    model = d40.render("standard/daylight")(balanced / d40.multipliers("standard/daylight"))
    error = np.linalg.norm(got - model, axis=1)
    mean, largest = stated("render")
    assert error.mean() <= 1.1 * mean + 1e-4  # OpenColorIO's sRGB curve there and back, in single precision
    assert error.max() <= 1.1 * largest + 1e-3


def test_ociolook_refinishes_as_the_conversion_does(tmp_path: Path) -> None:
    """The look of a pair, the look of the context variables, and the conversion between the spaces are one."""
    jpeg, source, target = jpeg_colours(), "Nikon D40 standard tungsten", "Nikon D40 standard daylight"
    wanted = oiiotool(tmp_path, jpeg, "--colorconvert", source, target)
    pair = oiiotool(tmp_path, jpeg, "--iscolorspace", source, "--ociolook", "Nikon D40 tungsten to daylight")
    np.testing.assert_allclose(pair, wanted, atol=ROUNDING)
    look = ("--ociolook:from=Camera (as shot):to=Camera (as shot)", "Camera refinish")
    whole = oiiotool(tmp_path, jpeg, *look, LUTFORGE_WB="tungsten", LUTFORGE_TO_WB="daylight")
    np.testing.assert_allclose(whole, wanted, atol=ROUNDING)
    keyed = "--ociolook:from=Camera (as shot):to=Camera (as shot):key=LUTFORGE_WB:value=tungsten"
    np.testing.assert_allclose(oiiotool(tmp_path, jpeg, keyed, "Camera refinish"), wanted, atol=ROUNDING)
