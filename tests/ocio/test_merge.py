"""Cameras in a studio's config: what was there stays bit for bit, what is new works, what cannot be is said."""

import copy
import zipfile
from pathlib import Path

import numpy as np
import PyOpenColorIO as OCIO  # noqa: N814 - the name that its documentation uses
import pytest

from lutforge.errors import ConfigError
from lutforge.model.camera_profile import CameraProfile
from lutforge.ocio.check import check_config, load_config
from tests.cases.profiles import MATRIX, plain_profile
from tests.ocio.test_config import build_config, convert, ociocheck, write_config

STUDIO = "studio-config-v5.0.0_aces-v2.1_ocio-v2.6"
ANY = (OCIO.SEARCH_REFERENCE_SPACE_ALL, OCIO.COLORSPACE_ALL)


def two_cameras() -> list[CameraProfile]:
    return [plain_profile("Nikon D40", balances=("daylight", "shade")), plain_profile("Canon EOS 5D", "vivid")]


def assert_kept(base: OCIO.Config, config: OCIO.Config, skip: tuple[str, ...] = ()) -> None:
    """Every colour space as a text and as bits of pixels; roles; named transforms; views; rules; looks."""
    reference = "aces_interchange"
    for space in base.getColorSpaces(*ANY):
        name = space.getName()
        assert str(config.getColorSpace(name)) == str(space), name
        if name in skip or space.isData():
            continue
        for pair in ((name, reference), (reference, name)):
            assert np.array_equal(convert(base, *pair), convert(config, *pair)), pair
    assert set(base.getRoles()) <= set(config.getRoles())
    assert list(base.getLookNames()) == list(config.getLookNames())[: len(list(base.getLookNames()))]
    assert list(base.getNamedTransformNames()) == list(config.getNamedTransformNames())
    for display in base.getDisplays():
        views = list(base.getViews(display))
        assert [view for view in config.getViews(display) if view in views] == views
    assert config.getDefaultView(base.getDefaultDisplay()) == base.getDefaultView(base.getDefaultDisplay())
    for path in ("a.exr", "b.mov", "c.jpg", "d"):
        assert base.getColorSpaceFromFilepath(path)[0] == config.getColorSpaceFromFilepath(path)[0]


@pytest.mark.slow
def test_the_studio_config_with_two_cameras(tmp_path: Path) -> None:
    path = write_config(two_cameras(), tmp_path / "studio", merge=STUDIO)
    output = ociocheck(path)
    assert "ERROR" not in output.upper()
    (tmp_path / "base.ocio").write_text(OCIO.Config.CreateFromBuiltinConfig(STUDIO).serialize())
    warnings_of_base = [line for line in ociocheck(tmp_path / "base.ocio").splitlines() if "WARNING" in line.upper()]
    # There is one warning, on an interoperability ID of the base.
    assert [line for line in output.splitlines() if "WARNING" in line.upper()] == warnings_of_base
    config, base = load_config(path), OCIO.Config.CreateFromBuiltinConfig(STUDIO)
    assert_kept(base, config)
    assert check_config(config) == check_config(base)  # ADX16, by a table of OpenColorIO's own
    assert list(config.getRoles()) == list(base.getRoles())
    forward = OCIO.TRANSFORM_DIR_FORWARD
    jpeg = two_cameras()[0].render("standard/daylight")(np.random.default_rng(3).random((4000, 3), dtype=np.float32))
    for display in ("sRGB - Display", "Gamma 2.2 Rec.709 - Display"):
        shown = convert(config, "Nikon D40 RAW unbalanced", display, "Nikon D40 standard", forward)
        np.testing.assert_allclose(shown, convert(config, "sRGB - Display", display, pixels=jpeg), atol=2e-4)
    assert "Nikon D40 standard" not in config.getViews("Rec.2100-PQ - Display")


BUILT_IN = [entry[0] for entry in OCIO.BuiltinConfigRegistry().getBuiltinConfigs()]
SOME = (min(name for name in BUILT_IN if name.startswith("cg-")), STUDIO)
"""The oldest and the newest."""


@pytest.mark.parametrize(
    "name", [name if name in SOME else pytest.param(name, marks=pytest.mark.slow) for name in BUILT_IN]
)
def test_every_built_in_config_keeps_its_own(name: str) -> None:
    base = OCIO.Config.CreateFromBuiltinConfig(name)
    config = build_config(two_cameras(), merge=f"ocio://{name}")
    for space in base.getColorSpaces(*ANY):
        assert str(config.getColorSpace(space.getName())) == str(space)
    assert (config.getMajorVersion(), config.getMinorVersion()) == (base.getMajorVersion(), base.getMinorVersion())
    assert convert(config, "Nikon D40 RAW unbalanced", "aces_interchange").shape == (4000, 3)


@pytest.mark.slow
def test_cameras_added_to_cameras(tmp_path: Path) -> None:
    """Files of the base come along, from a folder or an archive; the same name twice becomes two cameras."""
    folder = write_config([plain_profile("Nikon D40")], tmp_path / "one")
    archive = write_config([plain_profile("Nikon D40")], tmp_path / "one.ocioz")
    other = plain_profile("Nikon D40")
    other = CameraProfile("Nikon D40", MATRIX * 1.01, other.white_balances, other.styles)
    for base, name in ((folder, "both"), (archive, "both.ocioz")):
        path = write_config([other, plain_profile("Canon")], tmp_path / name, merge=base)
        ociocheck(path)
        config = load_config(path)
        assert_kept(load_config(folder), config)
        assert check_config(config) == []
        expected = {
            "Nikon D40 JPEG standard daylight",
            "Nikon D40 2 JPEG standard daylight",
            "Canon JPEG standard daylight",
        }
        assert expected <= set(config.getColorSpaceNames())
        packed = write_config([other], tmp_path / f"packed {base.suffix}.ocioz", merge=base)
        assert check_config(load_config(packed)) == []


def test_a_base_with_another_reference(tmp_path: Path) -> None:
    """The merger puts the change of reference between: the camera's colours are the same in any base."""
    linear = OCIO.Config()
    linear.setVersion(2, 1)
    for name in ("ACEScg", "ACES2065-1"):
        space = OCIO.ColorSpace(name=name)
        if name == "ACES2065-1":
            space.setTransform(OCIO.BuiltinTransform("ACEScg_to_ACES2065-1"), OCIO.COLORSPACE_DIR_FROM_REFERENCE)
        linear.addColorSpace(space)
    for role in ("scene_linear", "default"):
        linear.setRole(role, "ACEScg")
    linear.setRole("aces_interchange", "ACES2065-1")
    linear.addDisplayView("screen", "plain", "ACEScg", "")
    (tmp_path / "linear.ocio").write_text(linear.serialize())
    profile = plain_profile("Nikon D40")
    own = load_config(write_config([profile], tmp_path / "alone"))
    for merge in (tmp_path / "linear.ocio", "cg-config-v1.0.0_aces-v1.3_ocio-v2.1"):
        path = write_config([profile], tmp_path / f"to {Path(merge).stem}", merge=merge)
        config = load_config(path)
        for pair in (("Nikon D40 RAW unbalanced", "ACEScg"), ("Nikon D40 JPEG standard daylight", "ACEScg")):
            np.testing.assert_allclose(convert(config, *pair), convert(own, *pair), atol=2e-5)
        assert check_config(config) == []


def write_base(folder: Path, change: str = "") -> Path:
    config = OCIO.Config.CreateFromBuiltinConfig("cg-config-v1.0.0_aces-v1.3_ocio-v2.1")
    if change == "no role":
        config.setRole("aces_interchange", None)
    if change == "clash":
        for name, aliases in (
            ("Nikon D40 RAW unbalanced", []),
            ("mine", ["nikon_d40_jpeg_standard_daylight", "Camera RAW"]),
        ):
            config.addColorSpace(OCIO.ColorSpace(name=name, aliases=aliases))
        config.addLook(OCIO.Look(name="Canon scene shade → daylight", processSpace="ACEScg"))
        config.addViewTransform(
            OCIO.ViewTransform(
                referenceSpace=OCIO.REFERENCE_SPACE_SCENE, name="Canon vivid", fromReference=OCIO.MatrixTransform()
            )
        )
    text = config.serialize()
    if change == "leaves":
        text = text.replace('search_path: ""', "search_path: ../shared")
    path = folder / "base.ocio"
    path.write_text(text)
    return path


def test_clashing_names_are_numbered_and_the_base_keeps_its_own(tmp_path: Path) -> None:
    path = write_base(tmp_path, "clash")
    profiles = [plain_profile("Nikon D40"), plain_profile("Canon", "vivid", ("daylight", "shade"))]
    config = build_config(profiles, merge=path)
    base = load_config(path)
    for name in ("Nikon D40 RAW unbalanced", "mine", "ACEScg"):
        assert str(config.getColorSpace(name)) == str(base.getColorSpace(name))
    assert "Nikon D40 2 JPEG standard daylight" in set(config.getColorSpaceNames())
    assert {"Canon scene shade → daylight", "Canon scene shade → daylight 2"} <= set(config.getLookNames())
    assert {"Canon vivid", "Canon vivid 2"} <= set(config.getViewTransformNames())


def test_a_config_of_context_variables_and_file_rules_is_merged_into(tmp_path: Path) -> None:
    """As earlier versions made them: a look between spaces that variables name, and a rule for a camera's files."""
    before, after = (" ".join(f"${{LUTFORGE_{to}{word}}}" for word in ("CAMERA", "WB")) for to in ("", "TO_"))
    base = build_config([plain_profile("Twin", balances=("daylight", "shade"))])
    for variable, value in (("CAMERA", "Twin JPEG standard"), ("WB", "shade")):
        base.addEnvironmentVar(f"LUTFORGE_{variable}", value)
        base.addEnvironmentVar(f"LUTFORGE_TO_{variable}", value)
    as_shot = OCIO.ColorSpaceTransform(src=before, dst="aces_interchange")
    base.addColorSpace(OCIO.ColorSpace(name="Camera (as shot)", family="Input/Any camera", toReference=as_shot))
    refinish = OCIO.ColorSpaceTransform(src=before, dst=after)
    base.addLook(OCIO.Look(name="Camera refinish", processSpace="Camera (as shot)", transform=refinish))
    rules = base.getFileRules()
    rules.insertRule(0, "Twin RAW", "Twin RAW unbalanced", r"^twin_raw[.]exr$")
    base.setFileRules(rules)
    folder = tmp_path / "base"
    write_config([plain_profile("Twin", balances=("daylight", "shade"))], folder)
    (folder / "config.ocio").write_text(base.serialize())
    base = load_config(folder / "config.ocio")
    config = load_config(write_config([plain_profile("Canon")], tmp_path / "out", merge=folder / "config.ocio"))
    assert_kept(base, config)
    assert config.getColorSpaceFromFilepath("twin_raw.exr")[0] == "Twin RAW unbalanced"
    assert check_config(config) == []
    context = copy.deepcopy(config.getCurrentContext())
    context["LUTFORGE_TO_WB"] = "daylight"
    look = OCIO.LookTransform(src="Camera (as shot)", dst="Camera (as shot)", looks="Camera refinish")
    got = convert(config, context, look, OCIO.TRANSFORM_DIR_FORWARD)
    np.testing.assert_allclose(
        got, convert(config, "Twin JPEG standard shade", "Twin JPEG standard daylight"), atol=2e-5
    )


def test_a_base_of_the_first_version_becomes_the_oldest_that_cameras_need(tmp_path: Path) -> None:
    base = OCIO.Config()
    base.setVersion(2, 0)
    base.addColorSpace(OCIO.ColorSpace(name="AP0"))
    base.addColorSpace(OCIO.ColorSpace(name="off", isData=True))
    base.addDisplayView("screen", "raw", "off", "")
    for role, space in (("aces_interchange", "AP0"), ("default", "off")):
        base.setRole(role, space)
    path = tmp_path / "base.ocio"
    path.write_text(base.serialize())
    config = build_config([plain_profile("X")], merge=path)
    assert (config.getMajorVersion(), config.getMinorVersion()) == (2, 1)


def test_what_cannot_be_merged_is_one_line(tmp_path: Path) -> None:
    profile = plain_profile("X")
    (tmp_path / "old.ocio").write_text("ocio_profile_version: 1\nroles: {default: a}\ndisplays:\n  d:\n    - !<View> {name: v, colorspace: a}\ncolorspaces:\n  - !<ColorSpace>\n    name: a\n")  # fmt: skip  # noqa: E501 - one file
    (tmp_path / "bad.ocio").write_text("ocio_profile_version: 2\nroles: [\n")
    with zipfile.ZipFile(tmp_path / "evil.ocioz", "w") as archive:
        archive.writestr("../../evil.clf", "x")
    with zipfile.ZipFile(tmp_path / "empty.ocioz", "w") as archive:
        archive.writestr("luts/a.clf", "x")
    cases = [
        (tmp_path / "none.ocio", "no such config"),
        (tmp_path / "old.ocio", "OpenColorIO 1"),
        (tmp_path / "bad.ocio", "cannot read"),
        (tmp_path / "evil.ocioz", "outside of itself"),
        (tmp_path / "empty.ocioz", "no config.ocio"),
    ]
    for path, message in cases:
        with pytest.raises(ConfigError, match=message) as caught:
            build_config([profile], merge=path)
        assert "\n" not in str(caught.value)
    with pytest.raises(ConfigError, match="aces_interchange"):
        build_config([profile], merge=write_base(tmp_path, "no role"))
    with pytest.raises(ConfigError, match="leaves its folder"):
        write_config([profile], tmp_path / "out", merge=write_base(tmp_path, "leaves"))


@pytest.mark.slow
def test_a_base_whose_file_never_ends_is_one_line(tmp_path: Path) -> None:
    """OpenColorIO 2.6 looks for the end of metadata for ever, and takes memory with each line."""
    (tmp_path / "endless.csp").write_text("CSPLUTV100\n3D\n\nBEGIN METADATA\nx\n")
    path = write_base(tmp_path)
    base = OCIO.Config.CreateFromFile(str(path))
    base.addColorSpace(OCIO.ColorSpace(name="its", toReference=OCIO.FileTransform("$KIND.csp")))
    base.addEnvironmentVar("KIND", "endless")
    path.write_text(base.serialize())
    with pytest.raises(ConfigError, match=r"base\.ocio: \$KIND\.csp: it takes more than") as caught:
        build_config([plain_profile("X")], merge=path)
    assert "\n" not in str(caught.value)
