"""Styles of a profile, looked at from Python: a line for each, and an error that lists them."""

import copy
import pickle
from dataclasses import replace

import pytest

from lutforge.errors import SettingsError
from tests.cases.profiles import small_profile


def test_a_style_prints_as_one_short_line() -> None:
    profile = small_profile()
    for style in profile.styles.values():
        text = repr(style)
        assert text.startswith("PictureStyle(") and "\n" not in text and len(text) < 200
    assert "array(" not in repr(profile.styles)


@pytest.mark.parametrize("name", ["no such style", "Standard", ""])
def test_an_unknown_style_is_an_error_that_lists_the_known(name: str) -> None:
    profile = small_profile()
    for one in (profile, replace(profile, notes=("changed",)), copy.deepcopy(profile)):
        with pytest.raises(SettingsError) as raised:
            one.styles[name]
        assert all(known in str(raised.value) for known in profile.styles)
        assert one.styles.get(name) is None and name not in one.styles


def test_styles_go_to_other_processes() -> None:
    styles = pickle.loads(pickle.dumps(small_profile().styles))
    assert list(styles) == list(small_profile().styles)
    with pytest.raises(SettingsError):
        styles["no such style"]
