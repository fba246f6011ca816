"""Selectors of camera settings."""

import re

import pytest

from lutforge.errors import SettingsError
from lutforge.settings import Kelvin, Multipliers, parse_selector


@pytest.mark.parametrize(
    ("text", "balance", "printed"),
    [
        (" Standard / Daylight ", "daylight", "standard/daylight"),
        ("standard/5200k", Kelvin(5200.0), "standard/5200K"),
        ("standard/5200K+10", Kelvin(5200.0, 10.0), "standard/5200K+10"),
        ("standard/5200 K -7.5", Kelvin(5200.0, -7.5), "standard/5200K-7.5"),
        ("standard/4.2,2,3", Multipliers((2.1, 1.0, 1.5)), "standard/2.1,1,1.5"),
    ],
)
def test_a_selector_is_read_and_reads_back_what_it_prints(text: str, balance: object, printed: str) -> None:
    selector = parse_selector(text)
    assert (selector.style, selector.white_balance, str(selector)) == ("standard", balance, printed)
    assert parse_selector(printed) == selector


@pytest.mark.parametrize(
    ("text", "message"),
    [
        *((text, "STYLE/WB") for text in ("", "standard", "/daylight", "standard/")),
        *((f"standard/{text}", "1500K") for text in ("900K", "99999K")),
        *((f"standard/{text}", "multipliers") for text in ("1,2", "1,2,3,4", "1,x,2", "1,0,2", "1,-1,2", "1,nan,2")),
        *((f"standard/{text}", "multipliers") for text in ("inf,1,2", "1e300,1,1", "1e5,1,1", "1,1,1e-4")),
        ("vivid/1e9K", "between 1500K and 25000K"),
        ("vivid/5200K+", "5200K+10"),
        ("vivid/5200K+x", "5200K+10"),
        ("vivid/5200K+nan", "tint"),
        ("vivid/5200K+900", "tint"),
        ("vivid/5.2.0K", "5200K"),
    ],
)
def test_anything_else_is_refused_in_one_line_that_says_what_is_right(text: str, message: str) -> None:
    with pytest.raises(SettingsError, match=re.escape(message)) as caught:
        parse_selector(text)
    assert "\n" not in str(caught.value)
    for rgb in ((2.0, 0.0, 1.0), (4.2, 2.0, 3.0), (-1.0, 1.0, 1.0), (float("nan"), 1.0, 1.0)):
        with pytest.raises(SettingsError, match="multipliers"):
            Multipliers(rgb)
