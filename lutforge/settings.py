"""Selectors of camera settings: "standard/daylight", "vivid/5200K", "vivid/5200K+10", "standard/2.10,1,1.43"."""

import math
import re
from dataclasses import dataclass
from typing import Literal, SupportsFloat

from lutforge.errors import SettingsError

KELVIN_RANGE = (1500.0, 25000.0)
"""Correlated colour temperatures that a selector may name, in kelvin."""

LARGEST_TINT = 150.0
"""Largest tint to either side: the range of the sliders of raw converters."""

UNKNOWN_CAMERA = "unknown camera"
"""The name of the camera of files that state none."""

LARGEST_MULTIPLIER = 1000.0
"""The largest multiplier with green = 1; no camera sets more, nor less than its reciprocal."""


@dataclass(frozen=True)
class Kelvin:
    """A white balance named by its correlated colour temperature and its tint.

    The tint is 3000 times the distance from the locus in CIE 1960 (u, v), as raw converters count it; a positive one
    makes the picture more magenta.
    """

    kelvin: float
    tint: float = 0.0

    def __str__(self) -> str:
        return f"{self.kelvin:g}K{f'{self.tint:+g}' if self.tint else ''}"


@dataclass(frozen=True)
class Multipliers:
    """A white balance given as multipliers of camera RGB, green = 1, and a factor common to all: the gain of a setting.

    Raises SettingsError where green is not 1, or where red or blue is not positive or is larger or smaller than any
    camera sets.
    """

    rgb: tuple[float, float, float]
    gain: float = 1.0

    def __post_init__(self) -> None:
        red, green, blue = self.rgb
        if not all(1 / LARGEST_MULTIPLIER <= value <= LARGEST_MULTIPLIER for value in (red, blue)):
            raise SettingsError(
                f"multipliers {red:g},{green:g},{blue:g}: with green = 1, a white balance's lie between "
                f"{1 / LARGEST_MULTIPLIER:g} and {LARGEST_MULTIPLIER:g}"
            )
        if not abs(green - 1) < 1e-6:
            raise SettingsError(f"multipliers {red:g},{green:g},{blue:g}: divide them by green, which is 1")

    def __str__(self) -> str:
        return ",".join(f"{value:g}" for value in self.rgb)


ColourSpace = Literal["srgb", "adobe rgb"]
"""The colour spaces that cameras encode their JPEGs in."""


@dataclass(frozen=True)
class StyleName:
    """A picture style as a camera's settings name it: its name, adjustments in steps, and the JPEG's colour space.

    Its text is "vivid contrast+1 adobe rgb": adjustments and colour space follow the name, sRGB is not mentioned.
    """

    name: str
    adjustments: tuple[tuple[str, float], ...] = ()
    colour_space: ColourSpace = "srgb"

    def __str__(self) -> str:
        space = () if self.colour_space == "srgb" else (self.colour_space,)
        words = [self.name, *(f"{part}{steps:+g}" for part, steps in self.adjustments), *space]
        return " ".join(word for word in words if word)

    @classmethod
    def parse(cls, text: str) -> "StyleName":
        """The record of a text, whatever it is: what is no adjustment or colour space belongs to the name."""
        space: ColourSpace = "srgb"
        if (ending := re.search(r"(?:^| )adobe rgb$", text)) is not None:
            text, space = text[: ending.start()], "adobe rgb"

        adjustments = list[tuple[str, float]]()
        while (adjusted := _ADJUSTMENT.search(text)) is not None:
            adjustments.insert(0, (adjusted[1], float(adjusted[2])))
            text = text[: adjusted.start()]
        return cls(text, tuple(adjustments), space)


_ADJUSTMENT = re.compile(r"(?<=\S) (color tone|[a-z]+)([+-]\d+(?:\.\d+)?)$")
"""The last adjustment of a style's text; "color tone" is the one of two words."""


@dataclass(frozen=True)
class Selector:
    """A picture style and a white balance: a name of the profile, a temperature, or explicit multipliers.

    `white_balance` is lower case where it is a name. "auto" is the profile's entry for automatic white balance; `apply`
    takes it for the white balance of the image's own metadata.
    """

    style: str
    white_balance: str | Kelvin | Multipliers

    def __str__(self) -> str:
        return f"{self.style}/{self.white_balance}"

    @property
    def colour_space(self) -> ColourSpace:
        """The colour space of JPEGs in the style."""
        return StyleName.parse(self.style).colour_space


@dataclass(frozen=True)
class Shift:
    """A step from a white balance to another: along the locus of natural light, in kelvin or mired, and across it."""

    kelvin: float = 0.0
    mired: float = 0.0
    tint: float = 0.0


def split_shift(text: str) -> tuple[str, Shift] | None:
    """Split "as-shot+500K", "daylight-20mired" or "as-shot+10" into the name and the step; None where there is none.

    Raises SettingsError where the step is out of range.
    """
    parts = re.fullmatch(r"(.+?)\s*([+-]\d+(?:\.\d+)?)\s*(k|mired)?", text.lower())
    if parts is None:
        return None
    step = float(parts[2])
    if parts[3] is None:
        return parts[1], Shift(tint=checked_tint(step))
    limit = KELVIN_RANGE[1] if parts[3] == "k" else 500.0
    if not abs(step) <= limit:
        raise SettingsError(f'"{text}": a shift lies within {limit:g} {"K" if parts[3] == "k" else "mired"}')
    return parts[1], Shift(kelvin=step) if parts[3] == "k" else Shift(mired=step)


def setting_name(text: str) -> str:
    """The form in which a style's or white balance's name is kept: lower case, one space between words, no separators.

    A selector "STYLE/WB" can name whatever this returns.
    """
    return " ".join(re.sub(r"[/,]", "-", text.lower()).split()) or "unnamed"


def camera_key(camera: str) -> str:
    """A camera's name in lower case without spaces and hyphens, which firmware and programs write in different ways."""
    return re.sub(r"[\s_-]+", "", camera).lower()


def parse_selector(text: str) -> Selector:
    """Read "STYLE/WB". Raises SettingsError on anything else.

    WB is a name, a temperature ("5200K") with a tint or none ("5200K+10"), or three multipliers "r,g,b" (scaled here so
    that green = 1).
    """
    if not isinstance(text, str):
        raise SettingsError(f'{text!r:.80} is not STYLE/WB, a text such as "standard/daylight"')
    style, slash, balance = (part.strip() for part in text.lower().partition("/"))
    if not slash or not style or not balance:
        raise SettingsError(f'"{text}" is not STYLE/WB, a picture style and a white balance, such as "vivid/daylight"')
    if (number := re.match(r"([\d.]+(?:e\d+)?)\s*k\s*([+-].*)?$", balance)) is not None:
        try:
            kelvin, tint = float(number[1]), float(number[2] or "0")
        except ValueError:
            raise SettingsError(f'"{text}": a temperature is written 5200K, with a tint 5200K+10') from None
        if not KELVIN_RANGE[0] <= kelvin <= KELVIN_RANGE[1]:
            limits = f"{KELVIN_RANGE[0]:g}K and {KELVIN_RANGE[1]:g}K"
            raise SettingsError(f'"{text}": a colour temperature lies between {limits}')
        return Selector(style, Kelvin(kelvin, checked_tint(tint)))
    if "," in balance:
        try:
            r, g, b = (float(part) for part in balance.split(","))
        except ValueError:
            raise SettingsError(f'"{text}": multipliers are three numbers r,g,b, for example 2.10,1,1.43') from None
        if not all(math.isfinite(value) and value > 0 for value in (r, g, b)):
            raise SettingsError(f'"{text}": multipliers are positive numbers')
        return Selector(style, Multipliers((r / g, 1.0, b / g)))
    return Selector(style, balance)


def require_exposure(ev: SupportsFloat) -> None:
    """Raise SettingsError where an exposure change in stops is no number, or out of range."""
    if not isinstance(ev, SupportsFloat) or not -20.0 <= float(ev) <= 20.0:
        raise SettingsError(f"exposure change {ev!s:.80} EV is not a number within ±20 stops")


def checked_tint(tint: float) -> float:
    """The tint. Raises SettingsError where it is out of range."""
    if not abs(tint) <= LARGEST_TINT:
        raise SettingsError(f"tint {tint:g}: a tint lies between -{LARGEST_TINT:g} and +{LARGEST_TINT:g}")
    return tint
