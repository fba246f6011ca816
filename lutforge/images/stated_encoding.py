"""The encoding that a picture's file states by other means than an ICC profile, where it is not sRGB.

Each function returns it in a few words, or "" for sRGB and for encodings that look the same on a usual screen.
"""

import numpy as np

from lutforge.colour.rgb_spaces import CHROMATICITIES
from lutforge.colour.srgb import SRGB_CHROMATICITIES

PQ, HLG = 16, 18
"""Transfer characteristics of HDR pictures (ITU-T H.273, table 3)."""

_TRANSFERS = {5: "gamma 2.80", 8: "linear light", PQ: "PQ", HLG: "HLG"}
_PRIMARIES = {9: "the primaries of BT.2020", 11: "the primaries of DCI-P3", 12: "the primaries of Display P3"}
"""Codes of H.273 (tables 2 and 3) for other colours than sRGB's. The primaries of television are near those of sRGB."""

_NAMED_SPACES = {"Display P3": "linear-p3", "BT.2020": "linear-rec2020", "Adobe RGB": "linear-adobe-rgb"}
_EQUAL_GAMMA, _EQUAL_XY = 0.05, 0.01
"""Relative difference of exponents, and difference of chromaticities, up to which libpng treats two as equal."""


def of_codes(primaries: int, transfer: int, is_full_range: bool = True) -> str:
    """The encoding that code points of ITU-T H.273 state."""
    if transfer in _TRANSFERS:
        return _TRANSFERS[transfer]
    if primaries in _PRIMARIES:
        return _PRIMARIES[primaries]
    return "" if is_full_range else "video levels, 16 to 235"


def of_interchange_name(name: str) -> str:
    """The encoding that a colorInteropID of OpenEXR names, of pictures for a screen; "" for linear light and sRGB."""
    return {"pq": "PQ", "hlg": "HLG"}.get(name.partition("_")[0].lower(), "")


def of_gamma_and_primaries(exponent: float, chromaticities: tuple[float, ...]) -> str:
    """The encoding that an exponent and primaries state, such as those of a PNG or a TIFF.

    exponent: of the encoding, 0 for none; chromaticities: x and y of white, red, green and blue, empty for none.
    """
    if exponent and abs(exponent * 2.2 - 1) > _EQUAL_GAMMA:
        return "linear light" if abs(exponent - 1) <= _EQUAL_GAMMA else f"gamma {1 / exponent:.2f}"
    if not chromaticities:
        return ""
    white, *primaries = np.reshape(chromaticities, (4, 2))
    for name, known in (
        ("", SRGB_CHROMATICITIES),
        *((name, CHROMATICITIES[space]) for name, space in _NAMED_SPACES.items()),
    ):
        if np.abs(np.array([*primaries, white]) - known).max() <= _EQUAL_XY:
            return f"the primaries of {name}" if name else ""
    return "other primaries than sRGB's"
