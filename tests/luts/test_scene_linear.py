"""Scene-linear light beyond [0, 1] through a camera, as OpenColorIO reads it from the files."""

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import ArrayLike

from lutforge.arrays import Array
from lutforge.colour.rgb_spaces import from_linear_srgb
from lutforge.colour.srgb import delta_e_2000
from lutforge.errors import LutError, SettingsError
from lutforge.luts.ocio_transforms import evaluate
from lutforge.luts.ops import Matrix
from lutforge.luts.reading import trusted_processor
from lutforge.luts.verification import verify
from lutforge.model.camera_profile import CameraProfile, through_camera
from lutforge.model.transform import Transform
from lutforge.pipeline.baking import bake
from tests.cases.profiles import small_profile


@pytest.fixture(scope="module")
def footage(published_d40: CameraProfile) -> Transform:
    """ACEScg, exposed two stops down: neutral light up to 4 is not clipped."""
    return through_camera(published_d40, "standard/daylight", "acescg", -2.0)


def light(highest: float) -> Array:
    """Scene-linear colours up to `highest`, most of them dark, and a grey ramp."""
    rng = np.random.default_rng(2)
    colours = rng.random((4000, 3)) * highest * rng.random((4000, 1)) ** 3
    grey = np.repeat(np.geomspace(1e-4, highest, 500)[:, None], 3, axis=1)
    x: Array = np.concatenate([colours, grey]).astype(np.float32).astype(np.float64)
    return x


def test_exposure_makes_room_for_highlights(published_d40: CameraProfile) -> None:
    for ev, last in ((0.0, 1.0), (-2.0, 4.0), (-5.0, 32.0)):
        transform = through_camera(published_d40, "standard/daylight", "linear-srgb", ev)
        assert transform.highest() >= last
        below, at, beyond = transform(np.array([[0.8 * last] * 3, [last] * 3, [2 * last] * 3]))
        assert np.all(below < at + 1e-12)
        np.testing.assert_allclose(beyond, at, atol=0.01)
    with pytest.raises(SettingsError, match="20 stops"):
        through_camera(published_d40, "standard/daylight", "acescg", 30.0)
    with pytest.raises(SettingsError, match="not raw"):
        through_camera(published_d40, "standard/daylight", "raw")
    assert np.linalg.cond(from_linear_srgb("acescg")) < 10


@pytest.mark.parametrize("suffix", [".clf", ".ctf"])
def test_a_process_list_takes_any_light(tmp_path: Path, footage: Transform, suffix: str) -> None:
    """Also negative values, which saturated colours of other spaces have, and what the camera clips."""
    path = tmp_path / f"a{suffix}"
    lut = bake(footage, path)
    x = np.concatenate([light(footage.highest()), 3 * light(footage.highest()), light(1.0) - 0.05])
    got = evaluate(trusted_processor(path), x)
    np.testing.assert_allclose(got, lut(x), atol=2e-5)
    assert delta_e_2000(got.astype(np.float64), footage(x)).mean() < 0.05
    assert verify(path, footage, lut).mean < 1e-3


def test_tables_are_fine_enough_for_the_darks(tmp_path: Path, footage: Transform) -> None:
    """Down to 2^-12 of saturation."""
    lut = bake(footage, tmp_path / "a.clf")
    raw = 2.0 ** np.arange(-12.0, -4.0, 0.125)[:, None] * np.ones(3)
    front = lut.ops[0]
    assert isinstance(front, Matrix)
    x = raw @ np.linalg.inv(front.matrix).T
    got = evaluate(trusted_processor(tmp_path / "a.clf"), x)
    np.testing.assert_allclose(got, lut(x), rtol=2e-5)
    assert delta_e_2000(got.astype(np.float64), footage(x)).max() < 1.0


@pytest.mark.parametrize(
    "name", ["a.csp", *(pytest.param(name, marks=pytest.mark.slow) for name in ("a.resolve.cube", "a.spi1d"))]
)
def test_other_files_span_the_range_of_the_camera(tmp_path: Path, footage: Transform, name: str) -> None:
    lut = bake(footage, tmp_path / name)
    assert lut.shaper is not None
    assert lut.shaper.high == footage.highest() > 4.0
    x = light(footage.highest())
    if name != "a.spi1d":  # two files: verify reads them one after the other
        got = evaluate(trusted_processor(tmp_path / name), x)
        np.testing.assert_allclose(got, lut(x), atol=1e-3 if name == "a.csp" else 5e-5)
        assert delta_e_2000(got.astype(np.float64), footage(x)).mean() < 0.25
    assert verify(tmp_path / name, footage, lut).mean < 0.005


def test_the_printed_error_counts_negatives_and_what_clips_a_channel_at_a_time(tmp_path: Path) -> None:
    model = through_camera(small_profile(), "standard/daylight", "acescg")
    lut = bake(model, tmp_path / "a.resolve.cube", size=9)
    (file,) = lut.files
    assert lut.shaper is not None
    ramp = np.linspace(-0.1, 1.25 * lut.shaper.high, 500)[:, None]
    for channel in range(3):
        x = (ramp * np.eye(3)[channel]).astype(np.float32).astype(np.float64)
        off = np.linalg.norm(evaluate(trusted_processor(file.path), x) - model(x), axis=1)
        assert off.max() <= 1.01 * file.error.max


@pytest.mark.parametrize("name", ["a.png", "a.3dl"])
def test_files_without_a_range_are_refused(tmp_path: Path, footage: Transform, name: str) -> None:
    with pytest.raises(LutError, match="beyond 1"):
        bake(footage, tmp_path / name, size=9)
    with pytest.raises(LutError, match=r"beyond 1|holds one (cube|curve)"):
        bake(footage, form="shaper", size=9).write(tmp_path / name)


@pytest.mark.slow
def test_any_function_of_light(tmp_path: Path) -> None:
    def tone(x: ArrayLike) -> Array:
        values = np.maximum(np.asarray(x, dtype=np.float64), 0.0)
        return np.asarray(values / (values + 0.3))

    x = light(64.0)
    for name in ("a.clf", "a.resolve.cube"):
        lut = bake(tone, tmp_path / name, highest=64.0)
        got = evaluate(trusted_processor(tmp_path / name), x)
        np.testing.assert_allclose(got, lut(x), atol=5e-5)
        assert np.abs(got - tone(x)).mean() < 2e-3
    with pytest.raises(LutError, match="65504"):
        bake(tone, size=5, highest=1e6)
