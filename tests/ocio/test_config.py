"""Configs: valid for OpenColorIO's own checker, and each conversion is the profile's own transform."""

import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import PyOpenColorIO as OCIO  # noqa: N814 - the name that its documentation uses
import pytest
from numpy.typing import NDArray

from lutforge.errors import ConfigError
from lutforge.model.camera_profile import CameraProfile, PictureStyle
from lutforge.model.lattice import Lattice, grid, uniform_levels
from lutforge.model.white_balance import WhiteBalance
from lutforge.ocio.check import check_config, load_config
from lutforge.ocio.config import build_config, config_luts, write_config
from lutforge.ocio.names import UniqueNames, file_stem, space_name

MATRIX = np.array([[1.6, -0.5, -0.1], [-0.2, 1.5, -0.3], [0.0, -0.5, 1.5]])


def made_profile(camera: str = "Nikon D40") -> CameraProfile:
    axis = np.round(np.linspace(0, 1, 17) ** 2 * 65535) / 65535
    raw = (axis, axis, axis)
    jpeg = uniform_levels(17)
    standard = PictureStyle(
        Lattice(raw, np.clip(grid(raw) @ (MATRIX.T * 0.9), 0, 1) ** 0.45, "tetrahedral"),
        Lattice(jpeg, 0.9 * grid(jpeg) ** 2.2, "tetrahedral"),
        errors={"render_mean": 0.0123, "linearize_mean": 0.0045},
    )
    vivid = PictureStyle(Lattice(raw, grid(raw) ** 0.4, "tetrahedral"), Lattice(jpeg, grid(jpeg) ** 2.5))
    balances = {
        "daylight": WhiteBalance((2.0, 1.0, 1.4), 5200.0),
        "tungsten": WhiteBalance((1.2, 1.0, 2.4), 3200.0),
    }
    return CameraProfile(camera, MATRIX, balances, {"standard": standard, "vivid": vivid})


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> tuple[CameraProfile, OCIO.Config, Path]:
    profile = made_profile()
    path = write_config([profile], tmp_path_factory.mktemp("config"))
    return profile, load_config(path), path


def convert(config: OCIO.Config, *arguments: object) -> NDArray[np.float32]:
    pixels = colours()
    config.getProcessor(*arguments).getOptimizedCPUProcessor(OCIO.OPTIMIZATION_LOSSLESS).applyRGB(pixels)
    return pixels


def colours() -> NDArray[np.float32]:
    return np.random.default_rng(3).random((4000, 3), dtype=np.float32)


@pytest.mark.parametrize("balance", ["daylight", "tungsten"])
@pytest.mark.parametrize("style", ["standard", "vivid"])
def test_raw_to_jpeg_is_the_render_and_back_the_linearization(
    written: tuple[CameraProfile, OCIO.Config, Path], style: str, balance: str
) -> None:
    profile, config, _ = written
    raw, jpeg, selector = "Nikon D40 RAW", f"Nikon D40 {style} {balance}", f"{style}/{balance}"
    np.testing.assert_allclose(convert(config, raw, jpeg), profile.render(selector)(colours()), atol=1e-5)
    np.testing.assert_allclose(convert(config, jpeg, raw), profile.linearize(selector)(colours()), atol=1e-5)


def test_style_to_scene_linear(written: tuple[CameraProfile, OCIO.Config, Path]) -> None:
    profile, config, _ = written
    jpeg = "Nikon D40 standard daylight"
    for space, name in (("acescg", "ACEScg"), ("aces2065-1", "ACES2065-1")):
        wanted = profile.linearize("standard/daylight", space)(colours())  # type: ignore[arg-type]  # both are spaces
        np.testing.assert_allclose(convert(config, jpeg, name), wanted, atol=2e-5)
    wanted = profile.linearize("standard/daylight", "linear-srgb")(colours())
    np.testing.assert_allclose(
        convert(config, "nikon_d40_standard_daylight", "Linear Rec.709 (sRGB)"), wanted, atol=1e-5
    )


def test_from_jpeg_to_jpeg_is_a_refinish(written: tuple[CameraProfile, OCIO.Config, Path]) -> None:
    profile, config, _ = written
    got = convert(config, "Nikon D40 standard tungsten", "Nikon D40 vivid daylight")
    wanted = profile.refinish("standard/tungsten", "vivid/daylight")(colours())
    np.testing.assert_allclose(got, wanted, atol=1e-5)


def test_a_look_changes_the_white_balance(written: tuple[CameraProfile, OCIO.Config, Path]) -> None:
    profile, config, _ = written
    look = OCIO.LookTransform(src="Nikon D40 RAW", dst="Nikon D40 standard daylight", looks="+Nikon D40 as tungsten")
    np.testing.assert_allclose(convert(config, look), profile.render("standard/tungsten")(colours()), atol=1e-5)


def test_daylight_neutral_is_neutral_in_scene_linear(written: tuple[CameraProfile, OCIO.Config, Path]) -> None:
    """What daylight makes neutral has equal ACES values, as RAW before and after any white balance."""
    _, config, _ = written
    grey = 0.18 / np.array([[2.0, 1.0, 1.4]])
    for name, multipliers in (("RAW", (1, 1, 1)), ("RAW daylight", (2.0, 1.0, 1.4)), ("RAW tungsten", (1.2, 1.0, 2.4))):
        pixels = (grey * np.array(multipliers)).astype(np.float32)
        config.getProcessor(f"Nikon D40 {name}", "ACES2065-1").getDefaultCPUProcessor().applyRGB(pixels)
        np.testing.assert_allclose(pixels, 0.18, atol=1e-3)


def test_the_srgb_spaces_agree_with_the_standard(written: tuple[CameraProfile, OCIO.Config, Path]) -> None:
    """IEC 61966-2-1; and the texture space through the colorimetric view is itself."""
    _, config, _ = written
    encoded = colours()
    linear = np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)
    np.testing.assert_allclose(convert(config, "sRGB - Texture", "Linear Rec.709 (sRGB)"), linear, atol=2e-4)
    shown = convert(config, "sRGB - Texture", "sRGB - Display", "Colorimetric", OCIO.TRANSFORM_DIR_FORWARD)
    np.testing.assert_allclose(shown, encoded, atol=2e-3)


def test_a_view_through_the_camera(written: tuple[CameraProfile, OCIO.Config, Path]) -> None:
    profile, config, _ = written
    shown = convert(config, "Nikon D40 RAW", "sRGB - Display", "Nikon D40 standard", OCIO.TRANSFORM_DIR_FORWARD)
    np.testing.assert_allclose(shown, profile.render("standard/daylight")(colours()), atol=1e-5)


def test_descriptions_and_families(written: tuple[CameraProfile, OCIO.Config, Path]) -> None:
    _, config, _ = written
    space = config.getColorSpace("Nikon D40 standard tungsten")
    assert space.getFamily() == "Input/Nikon D40"
    assert "render mean 0.0123" in space.getDescription()
    assert "not measured" in config.getColorSpace("Nikon D40 vivid daylight").getDescription()
    assert "multipliers 1.2000, 1.0000, 2.4000" in config.getColorSpace("Nikon D40 RAW tungsten").getDescription()


def test_one_lut_per_style_and_direction_with_relative_paths(
    written: tuple[CameraProfile, OCIO.Config, Path],
) -> None:
    profile, _, path = written
    files = {file.name for file in (path.parent / "luts").iterdir()}
    assert files == set(config_luts([profile])) == {
        f"nikon_d40_{style}_{way}.clf" for style in ("standard", "vivid") for way in ("render", "linearize")
    }  # fmt: skip
    assert str(path.parent) not in path.read_text()


@pytest.mark.parametrize("form", ["folder", "archive"])
def test_ociocheck_passes_without_warnings(tmp_path: Path, form: str) -> None:
    tool = shutil.which("ociocheck", path=str(Path(sys.executable).parent))
    if tool is None:
        pytest.skip("ociocheck is not in this environment")
    profiles = [made_profile(), made_profile("Canon EOS/5D, é"), made_profile("Nikon D40")]
    path = write_config(profiles, tmp_path / ("cameras.ocioz" if form == "archive" else "cameras"))
    run = subprocess.run([tool, "--iconfig", str(path)], capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stdout
    assert "Validation: passed" in run.stdout
    assert "WARNING" not in run.stdout
    assert "ERROR" not in run.stdout
    config = load_config(path)
    assert check_config(config) == []
    wanted = {"Nikon D40 standard daylight", "Nikon D40 2 vivid tungsten", "Canon EOS 5D e standard daylight"}
    assert wanted <= set(config.getColorSpaceNames())


def test_ociocheck_of_this_package_sees_what_is_broken(tmp_path: Path) -> None:
    path = write_config([made_profile()], tmp_path)
    (tmp_path / "luts" / "nikon_d40_vivid_render.clf").unlink()
    findings = check_config(load_config(path))
    assert findings
    assert all(finding.severity == "error" for finding in findings)
    assert any("Nikon D40 vivid daylight, from the reference" in finding.where for finding in findings)
    assert not any("standard" in finding.where for finding in findings)
    assert all("\n" not in str(finding) for finding in findings)


def test_a_config_without_roles_is_warned_about() -> None:
    findings = check_config(OCIO.Config.CreateRaw())
    assert {finding.severity for finding in findings} == {"warning"}


def test_a_style_with_one_direction_only() -> None:
    full = made_profile()
    style = PictureStyle(render=full.styles["standard"].render)
    profile = CameraProfile("One Way", full.matrix, full.white_balances, {"standard": style})
    assert set(config_luts([profile])) == {"one_way_standard_render.clf"}
    assert build_config([profile]).getColorSpace("One Way standard tungsten") is not None


def test_what_cannot_be_built_or_read(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="at least one"):
        build_config([])
    full = made_profile()
    empty = CameraProfile("X", full.matrix, full.white_balances, {"standard": PictureStyle()})
    with pytest.raises(ConfigError, match="holds no model"):
        build_config([empty])
    with pytest.raises(ConfigError, match="choose another"):
        write_config([full], tmp_path / "$HOME")
    (tmp_path / "bad.ocio").write_text("ocio_profile_version: 2\nroles: [\n")
    for name in ("bad.ocio", "none.ocio"):
        with pytest.raises(ConfigError) as caught:
            load_config(tmp_path / name)
        assert "\n" not in str(caught.value)


def test_names() -> None:
    assert space_name("Canon EOS/5D: é, \n+x") == "Canon EOS 5D e x"
    assert space_name("-", "…") == "camera"
    assert file_stem("../../etc/Pass wd") == "etc_pass_wd"
    unique = UniqueNames(("Data",))
    assert [unique("data"), unique("A"), unique("a"), unique("A")] == ["data 2", "A", "a 2", "A 3"]
