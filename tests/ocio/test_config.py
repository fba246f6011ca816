"""Configs: valid for OpenColorIO's own checker, and each conversion is the profile's own transform."""

import copy
import gc
import re
import shutil
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import PyOpenColorIO as OCIO  # noqa: N814 - the name that its documentation uses
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from lutforge.calibration.curve_basis import gamma_response
from lutforge.colour.rgb_spaces import from_linear_srgb
from lutforge.errors import ConfigError
from lutforge.luts.check import check_lut, report_lines
from lutforge.luts.reading import read_lut
from lutforge.luts.sequence import Lut
from lutforge.model.camera_profile import CameraProfile
from lutforge.model.lattice import Lattice, grid, uniform_levels
from lutforge.model.profile import PictureStyle
from lutforge.model.provenance import ReferenceRaw
from lutforge.model.response_profile import profile_of_response
from lutforge.model.white_balance import WhiteBalance
from lutforge.ocio import config as written_config
from lutforge.ocio.cameras import file_stem, name_cameras, part_name
from lutforge.ocio.check import check_config, load_config
from lutforge.ocio.common import DISPLAYS, common_config
from tests.cases.profiles import MATRIX, plain_profile, small_profile
from tests.cases.same_bytes import same_bytes
from tests.conftest import Refused

GAINS = {"daylight": (2.0, 1.0, 1.4), "tungsten": (1.2, 1.0, 2.4)}
KELVIN = {"daylight": 5200.0, "tungsten": 3200.0}


def made_profile(camera: str = "Nikon D40", nodes: int = 17) -> CameraProfile:
    """Two styles whose directions were fitted apart, as real ones are."""
    axis = np.round(np.linspace(0, 1, nodes) ** 2 * 4095) / 4095
    raw = (axis, axis, axis)
    jpeg = uniform_levels(nodes)
    mixed = 0.9 * np.eye(3) + 0.1 / 3
    standard = PictureStyle(
        Lattice(raw, (grid(raw) @ mixed.T) ** 0.45, "tetrahedral"),
        Lattice(jpeg, grid(jpeg) ** 2.2 @ np.linalg.inv(mixed).T, "tetrahedral"),
        errors={"render_mean": 0.0123, "linearize_mean": 0.0045},
    )
    vivid = PictureStyle(Lattice(raw, grid(raw) ** 0.4, "tetrahedral"), Lattice(jpeg, grid(jpeg) ** 2.5))
    balances = {name: WhiteBalance(gain, KELVIN[name]) for name, gain in GAINS.items()}
    return CameraProfile(camera, MATRIX, balances, {"standard": standard, "vivid": vivid})


SMALL = 9


def write_config(profiles: Sequence[CameraProfile], target: Path, **options: Any) -> Path:
    """As the package does, with a JPEG → scene that takes a tenth of the time."""
    return written_config.write_config(profiles, target, inverse_size=SMALL, **options)


def build_config(profiles: Sequence[CameraProfile], **options: Any) -> OCIO.Config:
    """As the package does, with a JPEG → scene that takes a tenth of the time."""
    return written_config.build_config(profiles, inverse_size=SMALL, **options)


Written = tuple[CameraProfile, OCIO.Config, Path, dict[str, Lut]]


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Written:
    profile = made_profile()
    path = written_config.write_config([profile], tmp_path_factory.mktemp("config"), inverse_size=33)
    luts = {file.name: read_lut(file) for file in (path.parent / "luts").iterdir()}
    return profile, load_config(path), path, luts


def convert(config: OCIO.Config, *arguments: object, pixels: NDArray[Any] | None = None) -> NDArray[np.float32]:
    values = colours() if pixels is None else pixels.astype(np.float32)
    config.getProcessor(*arguments).getOptimizedCPUProcessor(OCIO.OPTIMIZATION_LOSSLESS).applyRGB(values)
    return values


def assert_renders(got: NDArray[Any], profile: CameraProfile, selector: str, raw: NDArray[Any], lut: Lut) -> None:
    """As the LUT does to float32, and as the model does within the error that the LUT states."""
    np.testing.assert_allclose(got, np.clip(lut(raw * GAINS[selector.split("/")[1]]), 0.0, 1.0), atol=3e-5)
    error = np.linalg.norm(got - profile.render(selector)(raw), axis=1)
    (stated,) = re.finditer(r"against the model: mean (\S+), max (\S+)", "\n".join(lut.comments))
    assert error.mean() < 0.002
    assert error.max() <= float(stated[2]) + 3e-5


def colours() -> NDArray[np.float32]:
    return np.random.default_rng(3).random((4000, 3), dtype=np.float32)


@pytest.mark.parametrize("balance", ["daylight", "tungsten"])
@pytest.mark.parametrize("style", ["standard", "vivid"])
def test_raw_to_jpeg_is_the_render_and_back_the_linearization(written: Written, style: str, balance: str) -> None:
    profile, config, _, luts = written
    raw, jpeg, selector = "Nikon D40 RAW unbalanced", f"Nikon D40 JPEG {style} {balance}", f"{style}/{balance}"
    render = luts[f"nikon_d40_{style}_render.clf"]
    assert_renders(convert(config, raw, jpeg), profile, selector, colours(), render)
    back = luts[f"nikon_d40_{style}_linearize.clf"](colours()) / GAINS[balance]
    np.testing.assert_allclose(convert(config, jpeg, raw), back, atol=1e-5)
    assert np.linalg.norm(back - profile.linearize(selector)(colours()), axis=1).mean() < 0.005


@pytest.mark.parametrize("style", ["standard", "vivid"])
def test_a_jpeg_comes_back_from_the_reference(written: Written, style: str) -> None:
    """On what the camera makes of any scene, other than the colours that the inverse was fitted on."""
    profile, config, _, _ = written
    jpeg = profile.render(f"{style}/tungsten")(np.random.default_rng(8).random((20000, 3)))
    space = f"Nikon D40 JPEG {style} tungsten"
    there = convert(config, space, "ACES2065-1", pixels=jpeg)
    error = np.linalg.norm(convert(config, "ACES2065-1", space, pixels=there) - jpeg, axis=1)
    assert error.mean() < 0.002
    assert error.max() < 0.02


def test_jpeg_to_scene_linear_spaces_agree(written: Written) -> None:
    _, config, _, luts = written
    raw = luts["nikon_d40_standard_linearize.clf"](colours()) / GAINS["daylight"]
    for space, known in (("ACEScg", "acescg"), ("ACES2065-1", "aces2065-1"), ("lin_rec709", "linear-srgb")):
        expected = raw @ (from_linear_srgb(known) @ MATRIX * GAINS["daylight"]).T
        np.testing.assert_allclose(convert(config, "nikon_d40_jpeg_standard_daylight", space), expected, atol=3e-5)


def test_from_jpeg_to_jpeg_is_a_refinish(written: Written) -> None:
    profile, config, _, luts = written
    raw = luts["nikon_d40_standard_linearize.clf"](colours()) / GAINS["tungsten"]
    got = convert(config, "Nikon D40 JPEG standard tungsten", "Nikon D40 JPEG vivid daylight")
    assert_renders(got, profile, "vivid/daylight", raw, luts["nikon_d40_vivid_render.clf"])
    model = profile.refinish("standard/tungsten", "vivid/daylight")(colours())
    assert np.linalg.norm(got - model, axis=1).mean() < 0.01


def look(config: OCIO.Config, name: str, space: str) -> NDArray[np.float32]:
    return convert(config, OCIO.LookTransform(src=space, dst=space, looks=name), OCIO.TRANSFORM_DIR_FORWARD)


def test_a_look_changes_the_white_balance_of_any_style(written: Written) -> None:
    _, config, _, _ = written
    for style in ("standard", "vivid"):
        source, target = f"Nikon D40 JPEG {style} tungsten", f"Nikon D40 JPEG {style} daylight"
        got = look(config, "Nikon D40 scene tungsten → daylight", source)
        np.testing.assert_allclose(got, convert(config, source, target), atol=2e-5)


def test_a_look_of_a_style_refinishes_photographs_and_back(written: Written) -> None:
    profile, config, _, _ = written
    for style in ("standard", "vivid"):
        name, source = f"Nikon D40 JPEG {style} tungsten → daylight", f"Nikon D40 JPEG {style} tungsten"
        expected = np.clip(profile.refinish(f"{style}/tungsten", f"{style}/daylight")(colours()), 0.0, 1.0)
        assert np.linalg.norm(look(config, name, source) - expected, axis=1).mean() < 0.002
        expected = np.clip(profile.refinish(f"{style}/daylight", f"{style}/tungsten")(colours()), 0.0, 1.0)
        assert np.linalg.norm(look(config, f"-{name}", source) - expected, axis=1).mean() < 0.002


def test_a_look_changes_the_style(written: Written) -> None:
    _, config, _, _ = written
    before, after = "Nikon D40 JPEG standard daylight", "Nikon D40 JPEG vivid daylight"
    name = f"{before} → vivid daylight"
    np.testing.assert_allclose(look(config, name, before), convert(config, before, after), atol=2e-5)
    np.testing.assert_allclose(look(config, f"-{name}", before), convert(config, after, before), atol=2e-5)


def test_daylight_neutral_is_neutral_in_scene_linear(written: Written) -> None:
    """What daylight makes neutral has equal ACES values, as RAW before and after any white balance."""
    _, config, _, _ = written
    grey = 0.18 / np.array([GAINS["daylight"]])
    for name, multipliers in (("RAW unbalanced", (1, 1, 1)), *((f"RAW {name}", gain) for name, gain in GAINS.items())):
        pixels = (grey * np.array(multipliers)).astype(np.float32)
        config.getProcessor(f"Nikon D40 {name}", "ACES2065-1").getDefaultCPUProcessor().applyRGB(pixels)
        np.testing.assert_allclose(pixels, 0.18, atol=1e-3)


def test_displays_agree_with_the_studio_config() -> None:
    """The same CIE XYZ on each display as OpenColorIO's own config shows it."""
    studio = OCIO.Config.CreateFromBuiltinConfig("studio-config-v5.0.0_aces-v2.1_ocio-v2.6")
    config = build_config([plain_profile("X")])
    for display in DISPLAYS:
        ours = convert(config, "cie_xyz_d65_interchange", display)
        theirs = convert(studio, "cie_xyz_d65_interchange", display)
        inside = np.all((theirs > 0) & (theirs < 1), axis=1)
        np.testing.assert_allclose(ours[inside], theirs[inside], atol=2e-5)


def test_any_footage_is_seen_through_the_camera(written: Written) -> None:
    """On the sRGB display as the camera's JPEG; on the others the same colour."""
    _, config, _, _ = written
    view, forward = "Nikon D40 standard", OCIO.TRANSFORM_DIR_FORWARD
    jpeg = convert(config, "Nikon D40 RAW unbalanced", "Nikon D40 JPEG standard daylight")
    shown = convert(config, "Nikon D40 RAW unbalanced", "sRGB - Display", view, forward)
    np.testing.assert_allclose(shown, jpeg, atol=1e-4)
    for display in DISPLAYS:
        on_display = convert(config, "Nikon D40 RAW unbalanced", display, view, forward)
        np.testing.assert_allclose(on_display, convert(config, "sRGB - Display", display, pixels=jpeg), atol=1e-3)
        assert list(config.getViews(display)) == ["Nikon D40 standard", "Nikon D40 vivid", "Un-tone-mapped", "Raw"]


def test_what_a_colour_space_says_of_itself(written: Written) -> None:
    _, config, _, _ = written
    space = config.getColorSpace("Nikon D40 JPEG standard tungsten")
    assert space.getFamily() == "Input/Nikon D40"
    assert space.getEncoding() == "sdr-video"
    assert list(space.getCategories()) == ["file-io", "texture"]  # offered for textures
    assert "held-out error of the profile: render mean 0.0123; linearize mean 0.0045\n" in space.getDescription()
    assert "render LUT against the model: mean" in space.getDescription()
    assert "round trip mean" in space.getDescription()
    assert "not measured" in config.getColorSpace("Nikon D40 JPEG vivid daylight").getDescription()
    assert "multipliers 1.2000, 1.0000, 2.4000" in config.getColorSpace("Nikon D40 RAW tungsten").getDescription()
    assert config.getColorSpace("Nikon D40 RAW unbalanced").getEncoding() == "scene-linear"


def test_equality_groups_hold_what_is_equal() -> None:
    """Flash and daylight with the same multipliers are one space by another name."""
    profile = plain_profile("X")
    balance = profile.white_balances["daylight"]
    both = CameraProfile("X", MATRIX, {"daylight": balance, "flash": balance}, profile.styles)
    config = build_config([both])
    names = ("RAW daylight", "RAW flash", "RAW unbalanced", "JPEG standard daylight", "JPEG standard flash")
    groups = {name: config.getColorSpace(f"X {name}").getEqualityGroup() for name in names}
    assert groups["RAW daylight"] == groups["RAW flash"] != groups["RAW unbalanced"]
    assert groups["JPEG standard daylight"] == groups["JPEG standard flash"] != groups["RAW daylight"]


def test_roles_are_complete(written: Written) -> None:
    _, config, _, _ = written
    roles = dict(config.getRoles())
    assert roles["scene_linear"] == "ACEScg"
    assert roles["aces_interchange"] == "ACES2065-1"
    expected = {"cie_xyz_d65_interchange", "data", "color_picking", "texture_paint", "compositing_log", "matte_paint"}
    assert expected | {"default_byte", "default_float", "default_sequencer"} <= set(roles)
    assert config.getColorSpace(roles["data"]).isData()


@pytest.mark.parametrize(
    ("path", "space"),
    [
        ("shots/Nikon D40 JPEG standard tungsten/DSC_0001.JPG", "Nikon D40 JPEG standard tungsten"),
        ("DSC_0001_nikon_d40_raw_tungsten.v002.exr", "Nikon D40 RAW tungsten"),
        ("nikon_d40_raw_unbalanced.1001.exr", "Nikon D40 RAW unbalanced"),
        ("plate_acescct.exr", "ACEScct"),
        ("plate_lin_rec709.0001.EXR", "Linear Rec.709 (sRGB)"),
        ("scan.png", "sRGB Encoded Rec.709 (sRGB)"),
        ("DSC_0001.JPG", "sRGB Encoded Rec.709 (sRGB)"),
        ("unknown.exr", "ACEScg"),  # as `apply --space acescg` writes it
        ("DSC_0001.NEF", "Raw"),
        ("raw/nonlinear/a.jpg", "sRGB Encoded Rec.709 (sRGB)"),  # words of everyday that are aliases, or parts of one
        ("aces/srgb/none/a.exr", "ACEScg"),
        ("nikon_d40_jpeg_standard_tungstens.png", "sRGB Encoded Rec.709 (sRGB)"),
    ],
)
def test_file_rules(written: Written, path: str, space: str) -> None:
    assert written[1].getColorSpaceFromFilepath(path)[0] == space


def test_luts_are_shared_by_all_spaces_of_a_style_and_named_relative_to_the_config(written: Written) -> None:
    _, _, path, luts = written
    ways = ("render", "linearize", "calibrated", "daylight_to_tungsten", "tungsten_to_daylight")
    assert set(luts) == {f"nikon_d40_{style}_{way}.clf" for style in ("standard", "vivid") for way in ways}
    assert str(path.parent) not in path.read_text()


@pytest.mark.parametrize(
    ("way", "takes", "gives"),
    [
        ("render", "linear camera RAW behind white balance", "the camera's JPEG"),
        ("linearize", "the camera's JPEG", "linear camera RAW behind white balance"),
        ("calibrated", "the camera's JPEG", "linear camera RAW behind white balance"),
        (
            "daylight_to_tungsten", "linear camera RAW behind white balance daylight",
            "linear camera RAW behind white balance tungsten",
        ),
    ],
)  # fmt: skip
def test_luts_say_what_they_take_and_give(written: Written, way: str, takes: str, gives: str) -> None:
    profile, _, path, luts = written
    name = f"nikon_d40_vivid_{way}.clf"
    comments = luts[name].comments
    for line in (
        "LutForge ", f"input: {takes}", f"output: {gives}", "range: full", "place: an OpenColorIO config",
        f"camera and settings: {profile.camera}, vivid", "licence: CC0",
    ):  # fmt: skip
        assert any(comment.startswith(line) for comment in comments), line
    text = (path.parent / "luts" / name).read_text(encoding="utf-8").replace("&apos;", "'")
    assert f"<InputDescriptor>{takes}" in text
    assert f"<OutputDescriptor>{gives}" in text
    shown = report_lines(check_lut(path.parent / "luts" / name))
    assert any("licence: CC0" in line for line in shown)


@pytest.mark.slow
def test_the_same_profiles_make_the_same_bytes(tmp_path: Path) -> None:
    profiles = [plain_profile("A"), plain_profile("B", "vivid")]
    one, two = (write_config(profiles, tmp_path / name) for name in ("one", "two"))
    for file in one.parent.rglob("*.*"):
        assert same_bytes(file, two.parent / file.relative_to(one.parent))
    archives = [write_config(profiles, tmp_path / f"{name}.ocioz") for name in "ab"]
    assert same_bytes(archives[0], archives[1])
    assert load_config(archives[0]).serialize() == load_config(one).serialize()


def ociocheck(path: Path) -> str:
    """What OpenColorIO's own checker says."""
    tool = shutil.which("ociocheck", path=str(Path(sys.executable).parent))
    if tool is None:
        pytest.skip("ociocheck is not in this environment")
    run = subprocess.run([tool, "--iconfig", str(path)], capture_output=True, text=True)
    assert run.returncode == 0, run.stdout + run.stderr
    assert "Validation: passed" in run.stdout
    return run.stdout + run.stderr


def is_clean(output: str) -> bool:
    """Whether the checker has neither warned nor found an error."""
    return not re.search("warning|error", output, re.IGNORECASE)


@pytest.mark.parametrize("form", ["cameras.ocioz", "cameras"])
def test_ociocheck_passes_without_warnings(tmp_path: Path, form: str) -> None:
    profiles = [plain_profile("Nikon D40", balances=("daylight", "shade")), plain_profile("Canon EOS/5D, é", "vivid")]
    path = write_config(profiles, tmp_path / form)
    assert is_clean(ociocheck(path))
    config = load_config(path)
    assert (config.getMajorVersion(), config.getMinorVersion()) == (2, 1)
    assert check_config(config) == []
    expected = {
        "Nikon D40 JPEG standard daylight", "Nikon D40 JPEG standard shade", "Canon EOS 5D e JPEG vivid daylight",
    }  # fmt: skip
    assert expected <= set(config.getColorSpaceNames())


def test_a_style_with_one_direction_only(tmp_path: Path) -> None:
    full = made_profile()
    style = PictureStyle(render=full.styles["standard"].render)
    profile = CameraProfile("One Way", full.matrix, full.white_balances, {"standard": style})
    path = write_config([profile], tmp_path / "ocio")
    assert [file.name for file in (path.parent / "luts").iterdir()] == ["one_way_standard_render.clf"]
    assert load_config(path).getColorSpace("One Way JPEG standard tungsten") is not None


def test_what_cannot_be_built_or_read(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="at least one"):
        build_config([])
    full = made_profile()
    empty = CameraProfile("X", full.matrix, full.white_balances, {"standard": PictureStyle()})
    with pytest.raises(ConfigError, match="holds no model"):
        build_config([empty])
    with pytest.raises(ConfigError, match="choose another"):
        write_config([full], tmp_path / "$HOME")
    with pytest.raises(ConfigError, match="given twice"):
        build_config([full, plain_profile("Y"), made_profile()])
    (tmp_path / "bad.ocio").write_text("ocio_profile_version: 2\nroles: [\n")
    for name in ("bad.ocio", "none.ocio"):
        with pytest.raises(ConfigError) as caught:
            load_config(tmp_path / name)
        assert "\n" not in str(caught.value)


def test_a_folder_in_use_is_not_written_into(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("mine")
    with pytest.raises(ConfigError, match="not empty"):
        write_config([plain_profile("A")], tmp_path)
    path = write_config([plain_profile("A")], tmp_path / "ocio")
    with pytest.raises(ConfigError, match="config already"):
        write_config([plain_profile("B")], tmp_path / "ocio")
    (tmp_path / "ocio" / "notes.txt").write_text("mine")
    write_config([plain_profile("B")], tmp_path / "ocio", replace=True)
    luts = {file.name for file in (tmp_path / "ocio" / "luts").iterdir()}
    assert luts == {"b_standard_render.clf", "b_standard_linearize.clf"}
    assert check_config(load_config(path)) == []
    assert (tmp_path / "ocio" / "notes.txt").read_text() == "mine"
    with pytest.raises(ConfigError, match="is a file"):
        write_config([plain_profile("A")], tmp_path / "notes.txt")


def test_two_responses_of_one_camera_are_two_profiles() -> None:
    """Profiles of a response alone have no held-out errors, and no matrix of their own, to tell them apart by."""
    first, second = (
        profile_of_response(gamma_response(gamma), "A camera", "standard", "daylight") for gamma in (2.0, 2.2)
    )
    assert [camera.name for camera in name_cameras([first, second])] == ["A camera", "A camera 2"]
    with pytest.raises(ConfigError, match="given twice"):
        name_cameras([first, replace(first, notes=("a note",))])


def test_spaces_of_a_camera_without_raw_are_of_the_light_of_its_jpegs() -> None:
    """A camera that was calibrated through another camera's RAW: no space claims to be RAW."""
    own = small_profile()
    profile = replace(own, provenance=ReferenceRaw("Reference", np.diag([0.9, 1.0, 1.1])))
    config = build_config([profile])
    names = [space.getName() for space in config.getColorSpaces()]
    assert not any("RAW" in name for name in names if own.camera in name)
    assert any("linear" in name for name in names if own.camera in name)
    assert any("daylight" in name and "linear" not in name for name in names if own.camera in name)


@pytest.mark.slow
def test_a_config_in_memory_converts_as_the_written_one(tmp_path: Path) -> None:
    """Also copies of it, once nothing else holds it, and beside another camera of the same name."""
    profile = made_profile()
    darker = replace(profile, styles=dict.fromkeys(profile.styles, profile.styles["vivid"]))
    path = write_config([profile], tmp_path / "ocio")
    written, copies = load_config(path), [copy.deepcopy(build_config([camera])) for camera in (profile, darker)]
    gc.collect()
    names = ("Nikon D40 JPEG standard tungsten", "ACEScg")
    for pair in (names, names[::-1]):
        assert np.array_equal(convert(copies[0], *pair), convert(written, *pair))
        assert np.abs(convert(copies[1], *pair) - convert(written, *pair)).max() > 0.01
    assert check_config(copies[0]) == []
    assert copies[0].serialize() == written.serialize()


def test_a_merged_config_in_memory_has_the_files_of_its_base(tmp_path: Path) -> None:
    base = write_config([plain_profile("Canon", "vivid")], tmp_path / "base")
    archive = write_config([plain_profile("Canon", "vivid")], tmp_path / "base.ocioz")
    for merge in (base, archive):
        config = build_config([plain_profile("Nikon D40")], merge=merge)
        assert check_config(config) == []
        pair = ("Canon JPEG vivid daylight", "ACEScg")
        assert np.array_equal(convert(config, *pair), convert(load_config(base), *pair))


def many_settings(styles: int, balances: int) -> CameraProfile:
    """A profile whose white balances all render differently."""
    profile = made_profile(nodes=3)
    style = profile.styles["standard"]
    names = ["standard", *(f"style {number}" for number in range(1, styles))]
    known = {
        f"light {number}" if number else "daylight": WhiteBalance((2.0 - 0.1 * number, 1.0, 1.4 + 0.1 * number))
        for number in range(balances)
    }
    return replace(profile, white_balances=known, styles=dict.fromkeys(names, style))


def look_names(config: OCIO.Config) -> set[str]:
    return {name.removeprefix("Nikon D40 ") for name in config.getLookNames()}


@pytest.mark.slow
@pytest.mark.parametrize("asked", [False, True])
def test_looks_of_every_style_and_ten_balances_are_below_a_hundred(asked: bool) -> None:
    profile = many_settings(4, 10)
    names = look_names(build_config([profile], looks=list(profile.white_balances) if asked else ()))
    assert len(names) < 100
    for style, balance in product(profile.styles, list(profile.white_balances)[1:]):
        assert f"JPEG {style} {balance} → daylight" in names


def test_looks_for_the_white_balances_asked_for() -> None:
    names = look_names(build_config([many_settings(2, 4)], looks=("Light 2", "daylight")))
    there, back = "light 2 → daylight", "daylight → light 2"
    pairs = {f"{kind} {way}" for kind in ("JPEG standard", "JPEG style 1", "scene") for way in (there, back)}
    styles = {"JPEG standard light 2 → style 1 light 2", "JPEG style 1 light 2 → standard light 2"}
    assert names == pairs | styles


def test_unknown_white_balances_and_versions_are_one_line(tmp_path: Path, refused: Refused) -> None:
    profile = tmp_path / "camera.npz"
    plain_profile("Nikon D40", balances=("daylight", "tungsten")).save(profile)
    command = ("config", profile, "-o", tmp_path / "ocio")
    assert "known: daylight, tungsten" in refused(tmp_path, *command, "--looks", "daylight,candle")
    assert "two white balances" in refused(tmp_path, *command, "--looks", "daylight")
    assert "known: 2.1, 2.5" in refused(tmp_path, *command, "--profile-version", "3")


def test_version_2_5_has_interoperability_ids_and_rules_of_views() -> None:
    old, new = (build_config([made_profile()], profile_version=version) for version in ("2.1", "2.5"))
    assert (new.getMajorVersion(), new.getMinorVersion()) == (2, 5)
    assert check_config(new) == []
    assert new.getColorSpace("ACEScg").getInteropID() == "lin_ap1_scene"
    assert old.getColorSpace("ACEScg").getInteropID() == ""
    assert "Nikon D40 standard" in list(new.getViews("sRGB - Display", "ACEScg"))
    finished = list(new.getViews("sRGB - Display", "Nikon D40 JPEG standard daylight"))
    assert "Nikon D40 standard" not in finished and "Un-tone-mapped" in finished
    pair = ("Nikon D40 JPEG standard daylight", "ACEScg")
    assert np.array_equal(convert(new, *pair), convert(old, *pair))


@pytest.mark.parametrize(
    "name", ["sRGB", "Linear", "Linear Rec.709", "Non-Color", "Raw", "Linear ACES", "Linear ACEScg"]
)
def test_the_spaces_that_blender_files_name_are_there(written: Written, name: str) -> None:
    """sRGB is its curve, what is linear a matrix, and data are data."""
    _, config, _, _ = written
    space = config.getColorSpace(name)
    assert space is not None
    assert space.isData() == (name in ("Non-Color", "Raw"))
    if space.isData():
        return
    linear = convert(config, name, "Linear Rec.709 (sRGB)", pixels=np.full((1, 3), 0.5))
    np.testing.assert_allclose(linear, 0.21404 if name == "sRGB" else 0.5, atol=1e-4)


@pytest.mark.parametrize(("role", "name"), [("default_byte", "sRGB"), ("default_sequencer", "sRGB"), ("data", "Raw")])
def test_roles_are_as_blender_has_them(written: Written, role: str, name: str) -> None:
    config = written[1]
    assert config.getColorSpace(role).getName() == config.getColorSpace(name).getName()


@pytest.fixture(scope="module")
def of_two(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("two") / "ocio"
    return write_config([plain_profile("Nikon D40"), plain_profile("Canon", "vivid")], folder).parent


@pytest.fixture
def path(of_two: Path, tmp_path: Path) -> Path:
    """A config of two cameras, for a test to break."""
    return shutil.copytree(of_two, tmp_path / "ocio") / "config.ocio"


def said(config: OCIO.Config) -> str:
    problems = check_config(config)
    assert all("\n" not in str(problem) for problem in problems)
    return "\n".join(map(str, problems))


def test_a_missing_file_is_named_with_what_needs_it(path: Path) -> None:
    (path.parent / "luts" / "canon_vivid_render.clf").unlink()
    found = said(load_config(path))
    assert "file canon_vivid_render.clf: missing; colour space Canon JPEG vivid daylight needs it" in found
    assert "colour space Canon JPEG vivid daylight, from the reference" in found
    assert "view sRGB - Display / Canon vivid" in found
    assert "Nikon D40 JPEG standard daylight" not in found


def test_a_broken_file_is_an_error(path: Path) -> None:
    (path.parent / "luts" / "canon_vivid_render.clf").write_text("<ProcessList>")
    assert "colour space Canon JPEG vivid daylight, from the reference" in said(load_config(path))


def test_a_look_or_view_of_an_unknown_space_is_an_error(path: Path) -> None:
    plain = plain_profile("Nikon D40", balances=("daylight", "shade"))
    both = write_config([plain], path.parent.parent / "both")
    changed = both.with_name("changed.ocio")
    changed.write_text(
        both.read_text().replace("process_space: Nikon D40 RAW unbalanced", "process_space: Nikon D50 RAW")
    )
    assert "Nikon D50 RAW" in said(load_config(changed))


def test_pixels_that_are_not_numbers_are_an_error(path: Path) -> None:
    config = load_config(path)
    huge = OCIO.MatrixTransform(np.diag([3e38, 1, 1, 1]).ravel().tolist())
    config.addLook(OCIO.Look(name="huge", processSpace="ACEScg", transform=OCIO.GroupTransform([huge, huge])))
    assert "look +huge" in said(config)


def test_the_built_in_studio_config_has_no_error() -> None:
    config = OCIO.Config.CreateFromBuiltinConfig("cg-config-v1.0.0_aces-v1.3_ocio-v2.1")
    assert check_config(config) == []


ROLES = {role.lower() for role in common_config().getRoleNames()}


def test_parts() -> None:
    assert part_name("Canon EOS/5D: é, \n+x") == "Canon EOS 5D e x"
    assert part_name("…") == "unnamed"
    assert part_name("富士フイルム X-T5") == "富士フイルム X-T5"
    assert part_name("Зенит ЕТ") == "Зенит ЕТ"
    assert part_name("x" * 200) == "x" * 64


def test_stems_are_ascii_and_keep_every_script() -> None:
    assert file_stem("../../etc/Pass wd") == "etc_pass_wd"
    assert file_stem("富士 X") != file_stem("佳能 X")
    for text in ("富士", "Зенит", "กล้อง", "x" * 300, "é/…", ""):
        assert re.fullmatch(r"[a-z0-9]+(_[a-z0-9]+)*", file_stem(text)), text
        assert len(file_stem(text)) <= 100


ROLES = {role.lower() for role in common_config().getRoleNames()}


def names(longest: int) -> st.SearchStrategy[str]:
    """What a profile takes as a name."""
    return st.text(max_size=longest).filter(str.isprintable)


@settings(max_examples=60)
@given(st.lists(names(80), min_size=1, max_size=3), names(30), names(30))
def test_any_names_give_spaces_of_their_own(cameras: list[str], style: str, balance: str) -> None:
    profiles = [
        replace(plain_profile(name, style, (balance,)), matrix=MATRIX + 0.01 * k) for k, name in enumerate(cameras)
    ]
    spaces = [name for camera in name_cameras(profiles) for name in camera.spaces()]
    assert len({name.lower() for name in spaces}) == len(spaces)
    assert not {name.lower() for name in spaces} & ROLES


HOSTILE = [
    *("Nikon  D40 ", "NIKON d40", 'Canon EOS/5D: "mark" {3}, [é] #%$&\'*!|>', "富士フイルム X-T5", "Зенит"),
    *("scene_linear", "data", "Raw", "ACEScg", "x" * 200, "x" * 199, "../../etc/passwd", "${HOME}", "a: b"),
    *("- no", "…"),
]
BALANCES = ("daylight", "default", "(as shot)", "to/from")


@pytest.mark.slow
def test_a_config_of_hostile_names_is_sound(tmp_path: Path) -> None:
    """Spaces, slashes, signs of YAML and of OpenColorIO, other scripts, 200 letters, roles, the same but for case."""
    profiles = [
        replace(plain_profile(name, style, BALANCES), matrix=MATRIX + 0.001 * k)
        for k, (name, style) in enumerate(zip(HOSTILE, HOSTILE[::-1], strict=True))
    ]
    path = write_config(profiles, tmp_path / "ocio")
    assert is_clean(ociocheck(path))
    config = load_config(path)
    assert check_config(config) == []
    names = list(config.getColorSpaceNames())
    assert len(names) == len({name.lower() for name in names})
    assert any("フイルム" in name for name in names)
    assert any("Зенит" in name for name in names)
    for name in ("scene_linear", "data"):
        assert config.getColorSpace(name).getName() in ("ACEScg", "Raw")  # still the roles
    for file in path.parent.rglob("*.clf"):
        assert file.resolve().is_relative_to((tmp_path / "ocio" / "luts").resolve())


@pytest.mark.parametrize("names", [("A b", "c d", "A", "b c d"), ("A", "b", "A b", "b")])
def test_names_that_run_together_stay_apart(names: tuple[str, str, str, str]) -> None:
    """Camera "A b" with style "c d" beside camera "A" with style "b c d": one text, two cameras."""
    first = plain_profile(names[0], names[1])
    second = replace(plain_profile(names[2], names[3]), matrix=MATRIX * 1.01)
    spaces = [name for camera in name_cameras([first, second]) for name in camera.spaces()]
    assert len(set(spaces)) == len(spaces)
    assert np.all([name.startswith("A") for name in spaces])
