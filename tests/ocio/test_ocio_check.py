"""The check sees what is broken in a config, names it in one line, and is quiet about what is sound."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import PyOpenColorIO as OCIO  # noqa: N814 - the name that its documentation uses
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lutforge.ocio.base_config import base_config
from lutforge.ocio.cameras import file_stem, name_cameras, part_name
from lutforge.ocio.check import check_config, load_config
from tests.cases.profiles import MATRIX, plain_profile
from tests.ocio.test_config import is_clean, ociocheck, write_config


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return write_config([plain_profile("Nikon D40"), plain_profile("Canon", "vivid")], tmp_path / "ocio")


def said(config: OCIO.Config) -> str:
    problems = check_config(config)
    assert all("\n" not in problem for problem in problems)
    return "\n".join(problems)


def test_a_missing_file_is_named_with_what_needs_it(path: Path) -> None:
    (path.parent / "luts" / "canon_vivid_render.clf").unlink()
    found = said(load_config(path))
    assert "file canon_vivid_render.clf: missing; colour space Canon vivid daylight needs it" in found
    assert "colour space Canon vivid daylight, from the reference" in found
    assert "view sRGB - Display / Canon vivid" in found
    assert "Nikon D40 standard daylight" not in found


def test_a_broken_file_is_an_error(path: Path) -> None:
    (path.parent / "luts" / "canon_vivid_render.clf").write_text("<ProcessList>")
    assert "colour space Canon vivid daylight, from the reference" in said(load_config(path))


def test_a_look_or_view_of_an_unknown_space_is_an_error(path: Path) -> None:
    plain = plain_profile("Nikon D40", balances=("daylight", "shade"))
    both = write_config([plain], path.parent.parent / "both")
    changed = both.with_name("changed.ocio")
    changed.write_text(both.read_text().replace("process_space: Nikon D40 RAW", "process_space: Nikon D50 RAW"))
    assert "Nikon D50 RAW" in said(load_config(changed))


def test_pixels_that_are_not_numbers_are_an_error(path: Path) -> None:
    config = load_config(path)
    huge = OCIO.MatrixTransform(np.diag([3e38, 1, 1, 1]).ravel().tolist())
    config.addLook(OCIO.Look(name="huge", processSpace="ACEScg", transform=OCIO.GroupTransform([huge, huge])))
    assert "look +huge" in said(config)


def test_the_built_in_studio_config_has_no_error() -> None:
    config = OCIO.Config.CreateFromBuiltinConfig("cg-config-v1.0.0_aces-v1.3_ocio-v2.1")
    assert check_config(config) == []


# --- Names from strangers: every camera keeps colour spaces that can be told apart, written, and found again ---------


ROLES = {role.lower() for role in base_config().getRoleNames()}


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


def names(longest: int) -> st.SearchStrategy[str]:
    """What a profile takes as a name."""
    return st.text(max_size=longest).filter(str.isprintable)


@settings(max_examples=200, deadline=None)
@given(st.lists(names(80), min_size=1, max_size=3), names(30), names(30))
def test_any_names_give_spaces_of_their_own(cameras: list[str], style: str, balance: str) -> None:
    profiles = [
        replace(plain_profile(name, style, (balance,)), matrix=MATRIX + 0.01 * k) for k, name in enumerate(cameras)
    ]
    spaces = [name for camera in name_cameras(profiles) for name in camera.spaces()]
    assert len({name.lower() for name in spaces}) == len(spaces)
    assert not {name.lower() for name in spaces} & {role.lower() for role in base_config().getRoleNames()}


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
