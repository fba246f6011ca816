"""Texts of settings: a style's name, adjustments and colour space go into a text, and come back."""

import pytest

from lutforge.settings import Selector, StyleName, parse_selector


@pytest.mark.parametrize(
    ("text", "style"),
    [
        ("standard", StyleName("standard")),
        ("vivid contrast+1 adobe rgb", StyleName("vivid", (("contrast", 1.0),), "adobe rgb")),
        (
            "fine detail color tone-2 saturation+0.333333",
            StyleName("fine detail", (("color tone", -2.0), ("saturation", 0.333333))),
        ),
        ("standard mode 3 adobe rgb", StyleName("standard mode 3", (), "adobe rgb")),
        ("adobe rgb", StyleName("", (), "adobe rgb")),  # of the first EOS cameras
        ("my adobe rgbs", StyleName("my adobe rgbs")),
        ("notadobe rgb", StyleName("notadobe rgb")),
        ("adobe rgb contrast+1", StyleName("adobe rgb", (("contrast", 1.0),))),
        ("contrast+1", StyleName("contrast+1")),
        ("pc 1", StyleName("pc 1")),
        ("", StyleName("")),
    ],
)
def test_a_style_s_text_comes_back(text: str, style: StyleName) -> None:
    assert StyleName.parse(text) == style
    assert str(style) == text


@pytest.mark.parametrize("style", ["standard", "vivid contrast+1", "my adobe rgbs"])
def test_styles_are_in_srgb_unless_they_state_another_space(style: str) -> None:
    assert parse_selector(f"{style}/daylight").colour_space == "srgb"
    assert Selector(f"{style} adobe rgb", "daylight").colour_space == "adobe rgb"
