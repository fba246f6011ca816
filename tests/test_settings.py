"""Selectors of camera settings."""

import pytest

from lutforge.errors import SettingsError
from lutforge.settings import Kelvin, Multipliers, parse_selector


def test_a_name_is_lower_cased_and_trimmed() -> None:
    selector = parse_selector(" Standard / Daylight ")
    assert (selector.style, selector.white_balance) == ("standard", "daylight")
    assert str(selector) == "standard/daylight"


def test_a_temperature_and_multipliers() -> None:
    assert parse_selector("vivid/5200K").white_balance == Kelvin(5200.0)
    assert parse_selector("vivid/5200k").white_balance == Kelvin(5200.0)
    assert parse_selector("standard/4.2,2,3").white_balance == Multipliers((2.1, 1.0, 1.5))


@pytest.mark.parametrize("text", ["standard/auto", "vivid/5200K", "standard/2.1,1,1.43"])
def test_a_selector_reads_back_what_it_prints(text: str) -> None:
    assert parse_selector(str(parse_selector(text))) == parse_selector(text)


@pytest.mark.parametrize(
    "text",
    [
        *("", "standard", "/daylight", "standard/", "standard/900K", "standard/99999K", "standard/1,2"),
        *("standard/1,2,3,4", "standard/1,x,2", "standard/1,0,2", "standard/1,-1,2", "standard/1,nan,2"),
        *("standard/inf,1,2", "standard/1e300,1,1", "standard/1e5,1,1", "standard/1,1,1e-4"),
    ],
)
def test_anything_else_is_refused_in_one_line(text: str) -> None:
    with pytest.raises(SettingsError) as caught:
        parse_selector(text)
    assert "\n" not in str(caught.value)


def test_a_tint_follows_the_temperature() -> None:
    assert parse_selector("standard/5200K+10").white_balance == Kelvin(5200.0, 10.0)
    assert parse_selector("standard/5200 K -7.5").white_balance == Kelvin(5200.0, -7.5)
    assert str(parse_selector("standard/5200k-7.5")) == "standard/5200K-7.5"
    assert parse_selector(str(parse_selector("standard/5200K+10"))) == parse_selector("standard/5200K+10")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("vivid/1e9K", "between 1500K and 25000K"),
        ("vivid/5200K+", "5200K+10"),
        ("vivid/5200K+x", "5200K+10"),
        ("vivid/5200K+nan", "tint"),
        ("vivid/5200K+900", "tint"),
        ("vivid/5.2.0K", "5200K"),
    ],
)
def test_a_wrong_temperature_says_what_is_right(text: str, message: str) -> None:
    with pytest.raises(SettingsError, match=message.replace("+", r"\+")):
        parse_selector(text)


@pytest.mark.parametrize("rgb", [(2.0, 0.0, 1.0), (4.2, 2.0, 3.0), (-1.0, 1.0, 1.0), (float("nan"), 1.0, 1.0)])
def test_multipliers_that_are_no_white_balance_are_refused(rgb: tuple[float, float, float]) -> None:
    with pytest.raises(SettingsError, match="multipliers"):
        Multipliers(rgb)
