"""The check sees what is broken in a config, names it in one line, and is quiet about what is sound."""

from pathlib import Path

import numpy as np
import PyOpenColorIO as OCIO  # noqa: N814 - the name that its documentation uses
import pytest

from lutforge.ocio.check import check_config, load_config, round_trips
from tests.cases.profiles import plain_profile
from tests.ocio.test_config import write_config


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return write_config([plain_profile("Nikon D40"), plain_profile("Canon", "vivid")], tmp_path / "ocio")


def said(config: OCIO.Config) -> str:
    findings = [str(finding) for finding in check_config(config)]
    assert all("\n" not in finding for finding in findings)
    return "\n".join(findings)


def test_a_missing_file_is_named_with_what_needs_it(path: Path) -> None:
    (path.parent / "luts" / "canon_vivid_render.clf").unlink()
    found = said(load_config(path))
    assert "error: file canon_vivid_render.clf: missing; colour space Canon vivid daylight needs it" in found
    assert "colour space Canon vivid daylight, from the reference" in found
    assert "view sRGB - Display / Canon vivid" in found
    assert "Nikon D40 standard daylight" not in found


def test_a_broken_file_is_an_error(path: Path) -> None:
    (path.parent / "luts" / "canon_vivid_render.clf").write_text("<ProcessList>")
    assert "error: colour space Canon vivid daylight, from the reference" in said(load_config(path))


def test_a_file_that_nothing_needs_is_a_warning(path: Path) -> None:
    (path.parent / "luts" / "old.cube").write_text("LUT_3D_SIZE 2\n")
    assert said(load_config(path)) == "warning: file old.cube: nothing in the config refers to it"


def test_an_absolute_search_path_is_a_warning(path: Path) -> None:
    config = load_config(path)
    config.setSearchPath(str(path.parent / "luts"))
    assert "is absolute: the config works on one machine" in said(config)


def test_missing_roles_are_warnings() -> None:
    findings = check_config(OCIO.Config.CreateRaw())
    assert {finding.severity for finding in findings} == {"warning"}


def test_a_look_or_view_of_an_unknown_space_is_an_error(path: Path) -> None:
    plain = plain_profile("Nikon D40", balances=("daylight", "shade"))
    both = write_config([plain], path.parent.parent / "both")
    changed = both.with_name("changed.ocio")
    changed.write_text(both.read_text().replace("process_space: Nikon D40 RAW", "process_space: Nikon D50 RAW"))
    assert "Nikon D50 RAW" in said(load_config(changed))


def test_a_space_that_does_not_come_back_is_a_warning(path: Path) -> None:
    config = load_config(path)
    space = OCIO.ColorSpace(name="one way", encoding="sdr-video")
    space.setTransform(
        OCIO.MatrixTransform(np.diag([0.5, 0.5, 0.5, 1]).ravel().tolist()), OCIO.COLORSPACE_DIR_TO_REFERENCE
    )
    space.setTransform(
        OCIO.MatrixTransform(np.diag([1.9, 1.9, 1.9, 1]).ravel().tolist()), OCIO.COLORSPACE_DIR_FROM_REFERENCE
    )
    config.addColorSpace(space)
    assert said(config).startswith("warning: colour space one way: to the reference and back, RGB is off by mean 0.0")
    space.setDescription("Of more colours:\nround trip mean: 0.0002\nround trip max: 0.25")
    config.addColorSpace(space)
    assert said(config).endswith(", max 0.25")
    maximum = next(largest for space, _, largest in round_trips(config) if space == "one way")
    assert maximum == pytest.approx(0.05 * 0.95 * np.sqrt(3), rel=0.05)


def test_spaces_of_one_group_that_differ_are_an_error(path: Path) -> None:
    config = load_config(path)
    for name, gain in (("a", 1.0), ("b", 2.0)):
        matrix = OCIO.MatrixTransform(np.diag([gain, gain, gain, 1]).ravel().tolist())
        config.addColorSpace(OCIO.ColorSpace(name=name, equalityGroup="same", toReference=matrix))
    assert said(config) == "error: equality group same: a and b differ"


def test_pixels_that_are_not_numbers_are_an_error(path: Path) -> None:
    config = load_config(path)
    huge = OCIO.MatrixTransform(np.diag([3e38, 1, 1, 1]).ravel().tolist())
    config.addLook(OCIO.Look(name="huge", processSpace="ACEScg", transform=OCIO.GroupTransform([huge, huge])))
    assert "look +huge" in said(config)


def test_the_built_in_studio_config_has_no_error() -> None:
    config = OCIO.Config.CreateFromBuiltinConfig("cg-config-v1.0.0_aces-v1.3_ocio-v2.1")
    assert [finding for finding in check_config(config) if finding.severity == "error"] == []
