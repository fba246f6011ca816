"""As-shot white balance out of each maker's tags, where a finished picture carries it: multipliers or temperature.

Layouts: exiftool.org/TagNames, exiv2.org/tags.html; Canon's ColorData by its length. A new maker is a few rows here.
"""

import numpy as np
from numpy.typing import NDArray

from lutforge.shots.exif import Tags, Value

Array = NDArray[np.float64]
Key = tuple[str, int]

_CANON_AS_SHOT = {
    582: 25, 653: 24, 5120: 71, 1816: 71, 1820: 71, 1824: 71, 2024: 85, 3656: 85, 3973: 105, 3778: 105,
    796: 63, 674: 63, 692: 63, 702: 63, 1227: 63, 1250: 63, 1251: 63, 1337: 63, 1338: 63, 1346: 63, 1273: 63,
    1275: 63, 1312: 63, 1313: 63, 1316: 63, 1506: 63, 1560: 63, 1592: 63, 1353: 63, 1602: 63,
}  # fmt: skip
"""Length of Canon's ColorData (tag 0x4001) in 16-bit words → where the four as-shot levels (R, G, G, B) begin."""

_KELVIN: tuple[Key, ...] = (
    ("CanonPr", 9),
    ("Sony", 0xB021),
    ("Fujifilm", 0x1005),
    ("OlympusCs", 0x0501),
    ("Panasonic", 0x0044),
    ("Pentax", 0x0050),
    ("Nikon", 0x004F),
)
"""The colour temperature that was dialled in; it counts only where the white balance is set to a temperature."""


def multipliers_of(tags: Tags) -> Array | None:
    """As-shot multipliers (3,) with green = 1; None where no tag tells them, or tells what no camera sets."""
    for found in (_dng(tags), _canon(tags), _nikon(tags), _pentax(tags), _olympus(tags), _panasonic(tags)):
        if found is None:
            continue
        red, green, blue = found
        if min(found) > 0 and 0.05 < red / green < 20 and 0.05 < blue / green < 20 and not red == green == blue:
            return np.array([red / green, 1.0, blue / green])
    return None


def kelvin_of(tags: Tags) -> float | None:
    """The temperature of a white balance that was set as one; None where no tag tells it."""
    for key in _KELVIN:
        values = _numbers(tags.get(key))
        if values and 1500 <= values[0] <= 25000:
            return float(values[0])
    return None


def _numbers(value: Value | None) -> tuple[int, ...]:
    return value if isinstance(value, tuple) else ()


def _ratios(value: Value | None) -> list[float]:
    parts = _numbers(value)
    return [a / b for a, b in zip(parts[::2], parts[1::2], strict=False) if b]


def _dng(tags: Tags) -> tuple[float, float, float] | None:
    neutral = _ratios(tags.get(("Image", 0xC628)))  # AsShotNeutral
    return (1 / neutral[0], 1 / neutral[1], 1 / neutral[2]) if len(neutral) == 3 and min(neutral) > 0 else None


def _canon(tags: Tags) -> tuple[float, float, float] | None:
    words = _numbers(tags.get(("Canon", 0x4001)))
    start = _CANON_AS_SHOT.get(len(words))
    if start is None:
        return None
    red, green, green2, blue = words[start : start + 4]
    return (red, (green + green2) / 2, blue) if abs(green - green2) <= 0.1 * green else None


def _nikon(tags: Tags) -> tuple[float, float, float] | None:
    levels = _ratios(tags.get(("Nikon", 0x000C)))  # red, blue, green, green
    if len(levels) < 2:
        return None
    return levels[0], (levels[2] if len(levels) > 2 else 1.0) or 1.0, levels[1]


def _pentax(tags: Tags) -> tuple[float, float, float] | None:
    levels = _numbers(tags.get(("Pentax", 0x0201)))
    return (levels[0], (levels[1] + levels[2]) / 2, levels[3]) if len(levels) == 4 else None


def _olympus(tags: Tags) -> tuple[float, float, float] | None:
    levels = _numbers(tags.get(("OlympusIp", 0x0100)))
    if len(levels) >= 2:
        return levels[0], 256.0, levels[1]
    red, blue = (_numbers(tags.get(("Olympus", tag))) for tag in (0x1017, 0x1018))
    return (red[0], 256.0, blue[0]) if red and blue else None


def _panasonic(tags: Tags) -> tuple[float, float, float] | None:
    for key in (("Panasonic", 0x8004), ("Image", 0x0024)):  # maker note; RW2's own directory
        red, green, blue = (_numbers(tags.get((key[0], key[1] + step))) for step in range(3))
        if red and green and blue:
            return red[0], green[0], blue[0]
    return None
