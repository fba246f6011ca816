"""A colour temperature for every white balance: of the light that its multipliers make neutral, seen through Ts.

Ts takes white-balanced RAW to colours adapted to D65, so it says how lights differ from each other, not which light one
of them is: a setting whose name tells its temperature anchors the others (nearest to daylight, where Ts is best known).
"""

import re
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from lutforge.arrays import Array
from lutforge.colour.colour_temperature import COOLEST, HOTTEST, camera_from_xyz, temperature_and_tint, white_of
from lutforge.model.white_balance import NAMED_KELVIN, WhiteBalance

AMBIGUOUS = ("auto", "kelvin")
END = 1.02
"""Estimates this near the ends of the locus may lie beyond them."""


def named_temperature(name: str) -> float | None:
    """The temperature in kelvin that a setting's name tells: "daylight", "5600k"; None where it tells none."""
    number = re.fullmatch(r"(\d{4,5}) ?k(?:elvin)?", name)
    if number and COOLEST <= float(number[1]) <= HOTTEST:
        return float(number[1])
    return NAMED_KELVIN.get(name)


def with_temperatures(balances: Mapping[str, WhiteBalance], matrix: Array) -> dict[str, WhiteBalance]:
    """The white balances with the temperature that their name tells, else their multipliers through Ts.

    matrix: Ts (3, 3). None stays where the setting follows the scene, where the light lies far from the locus, and
    where no name tells the temperature of any setting.
    """
    told = {name: replace(balance, kelvin=named_temperature(name)) for name, balance in balances.items()}
    anchors = [(balance.kelvin, name) for name, balance in told.items() if balance.kelvin is not None]
    natural = [anchor for anchor in anchors if "fluorescent" not in anchor[1]]
    if not natural:
        return told
    kelvin, anchor = min(natural, key=lambda entry: abs(1e6 / entry[0] - 1e6 / NAMED_KELVIN["daylight"]))
    from_xyz = camera_from_xyz(matrix, np.array(told[anchor].multipliers), kelvin)
    return {
        name: balance if balance.kelvin is not None else replace(balance, kelvin=_estimate(name, balance, from_xyz))
        for name, balance in told.items()
    }


def _estimate(name: str, balance: WhiteBalance, from_xyz: Array) -> float | None:
    # Settings whose multipliers change by more from shot to shot, as auto's do, stand for no one light
    if name in AMBIGUOUS or balance.spread > 0.05:
        return None
    uv = white_of(np.array(balance.multipliers), from_xyz)
    if not np.all(np.isfinite(uv)):
        return None
    kelvin, tint = temperature_and_tint(uv)
    # Lights further from the locus (0.02 in CIE 1960 u, v) have no colour temperature worth the name
    if abs(tint) > 60.0 or not COOLEST * END < kelvin < HOTTEST / END:
        return None
    return float(round(kelvin))
