"""As-shot white balance out of each maker's tags, where a finished picture carries it: multipliers or temperature.

Layouts: exiftool.org/TagNames, exiv2.org/tags.html; Canon's ColorData by its length, in data/settings.json.
"""

import numpy as np

from lutforge.arrays import Array
from lutforge.shots.tags import Tags, Value, key_of, maker_table


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
    for text in maker_table("settings")["kelvin"]["tags"]:
        values = _numbers(tags.get(key_of(text)))
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
    start = maker_table("settings")["canon_as_shot"]["starts"].get(str(len(words)))
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
