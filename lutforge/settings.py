"""Selectors of camera settings: "standard/daylight", "vivid/5200K", "standard/auto", "standard/2.10,1,1.43"."""

import math
import re
from dataclasses import dataclass

from lutforge.errors import SettingsError

KELVIN_RANGE = (1500.0, 25000.0)
"""Correlated colour temperatures that a selector may name, in kelvin."""


@dataclass(frozen=True)
class Kelvin:
    """A white balance named by its correlated colour temperature."""

    kelvin: float


@dataclass(frozen=True)
class Multipliers:
    """A white balance given as multipliers of camera RGB, green = 1."""

    rgb: tuple[float, float, float]


@dataclass(frozen=True)
class Selector:
    """A picture style and a white balance: a name of the profile, a temperature, or explicit multipliers.

    `white_balance` is lower case where it is a name; "auto" asks for the multipliers of the image's metadata.
    """

    style: str
    white_balance: str | Kelvin | Multipliers

    def __str__(self) -> str:
        match self.white_balance:
            case Kelvin(kelvin):
                return f"{self.style}/{kelvin:g}K"
            case Multipliers(rgb):
                return f"{self.style}/" + ",".join(f"{value:g}" for value in rgb)
            case name:
                return f"{self.style}/{name}"


def setting_name(text: str) -> str:
    """The form in which a style's or white balance's name is kept: lower case, one space between words, no separators.

    A selector "STYLE/WB" can name whatever this returns.
    """
    return " ".join(re.sub(r"[/,]", "-", text.lower()).split()) or "unnamed"


def parse_selector(text: str) -> Selector:
    """Read "STYLE/WB".

    WB is a name, a temperature ("5200K"), or three multipliers "r,g,b" (scaled here so that green = 1).
    Raises SettingsError on anything else.
    """
    style, slash, balance = (part.strip() for part in text.lower().partition("/"))
    if not slash or not style or not balance:
        raise SettingsError(f'"{text}" is not STYLE/WB; write for example "standard/daylight" or "vivid/5200K"')
    if re.fullmatch(r"\d+(\.\d+)?k", balance):
        kelvin = float(balance[:-1])
        if not KELVIN_RANGE[0] <= kelvin <= KELVIN_RANGE[1]:
            raise SettingsError(
                f'"{text}": a colour temperature lies between {KELVIN_RANGE[0]:g}K and {KELVIN_RANGE[1]:g}K'
            )
        return Selector(style, Kelvin(kelvin))
    if "," in balance:
        return Selector(style, Multipliers(_parse_multipliers(text, balance)))
    return Selector(style, balance)


def _parse_multipliers(text: str, balance: str) -> tuple[float, float, float]:
    try:
        r, g, b = (float(part) for part in balance.split(","))
    except ValueError:
        raise SettingsError(f'"{text}": multipliers are three numbers r,g,b, for example 2.10,1,1.43') from None
    if not all(math.isfinite(value) and value > 0 for value in (r, g, b)):
        raise SettingsError(f'"{text}": multipliers are positive numbers')
    return (r / g, 1.0, b / g)
