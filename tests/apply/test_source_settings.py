"""Which settings a picture is taken for, and what is said where its file says otherwise."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lutforge.apply.profile_recipe import source_selector
from lutforge.errors import SettingsError, in_common
from lutforge.pipeline.grading import Grading
from lutforge.settings import parse_selector
from lutforge.shots.metadata import ShotMetadata
from tests.cases.profiles import small_profile


@pytest.mark.parametrize(
    ("style", "balance", "asked", "told"),
    [
        ("vivid", "daylight", "standard/tungsten", "vivid/daylight"),
        ("standard", "daylight", "standard/tungsten", "standard/daylight"),
        ("vivid", "daylight", "standard/as-shot", "vivid/daylight"),
        ("standard", "shade", "standard/tungsten", "standard/shade"),
        ("standard", "tungsten", "standard/tungsten", ""),
        ("standard", "tungsten", "standard/1.3,1,2.6", ""),
        ("unknown", "unknown", "standard/tungsten", ""),
        ("vivid", "daylight", None, ""),
    ],
)
def test_settings_that_contradict_the_file_are_noted(style: str, balance: str, asked: str | None, told: str) -> None:
    camera = small_profile()
    settings = ShotMetadata(camera.camera, style, balance, None)
    given, notes = source_selector(Path("a.jpg"), settings, camera, parse_selector(asked or "as-shot/as-shot"))
    assert notes == ((f"the file says {told}; it is taken for {given}, as --from says",) if told else ())


def test_multipliers_of_the_file_count_as_what_it_says() -> None:
    camera = small_profile()
    settings = ShotMetadata(camera.camera, "standard", "auto", np.array([1.31, 1.0, 2.58]))
    assert source_selector(Path("a.jpg"), settings, camera, parse_selector("standard/tungsten"))[1] == ()
    assert (
        "the file says standard/auto"
        in source_selector(Path("a.jpg"), settings, camera, parse_selector("standard/daylight"))[1][0]
    )


def test_notes_that_files_share_are_one_line() -> None:
    notes = [
        (f"IMG_{n}.CRW", f"passed over: shots/IMG_{n}.JPG: does not match, by {n}.5 pixels") for n in range(10, 14)
    ]
    assert list(in_common([*notes, ("IMG_10.CRW", "D-Lighting was on"), notes[0]], "shots")) == [
        f"4 shots, such as IMG_10.CRW: {notes[0][1]}",
        "IMG_10.CRW: D-Lighting was on",
    ]


def test_automatic_white_balance_without_multipliers_is_refused_with_what_to_do() -> None:
    camera = small_profile()
    settings = ShotMetadata(camera.camera, "standard", "auto", None)
    wanted = (
        r'a\.jpg: its white balance is "auto", and .* multipliers .*; put its RAW file beside it, name it with --from '
        r"standard/WB, where WB is .*, a temperature from \d+K to \d+K; `lutforge studio`"
    )
    with pytest.raises(SettingsError, match=wanted):
        source_selector(Path("a.jpg"), settings, camera)


@pytest.mark.parametrize(
    ("grade", "options", "why"),
    [
        ("config.ocio", {"ev": 1.0}, "--ev goes with a profile"),
        ("a.cube", {"ev": 1.0}, "--ev with a profile"),
        ("config.ocio", {"interpolation": "trilinear"}, "--interpolation goes with a LUT"),
        ("camera.npz", {"interpolation": "trilinear"}, "--interpolation goes with a LUT"),
    ],
)
def test_options_that_would_do_nothing_are_refused(grade: str, options: dict[str, Any], why: str) -> None:
    with pytest.raises(SettingsError, match=why):
        _ = Grading((Path(grade), Path("a.jpg")), Path("out"), **options).recipe
