"""As-shot multipliers and temperatures, where a finished picture has them in its maker's tags.

Layouts: exiftool.org/TagNames, exiv2.org/tags.html; Canon's ColorData by its length, in data/settings.json.
"""

from collections.abc import Iterator

import numpy as np

from lutforge.arrays import Array
from lutforge.shots.tags import Tags, element, key_of, maker_table


def multipliers_of(tags: Tags) -> Array | None:
    """As-shot multipliers (3,) with green = 1; None where no tag states them, or states what no camera sets."""
    for levels in _levels(tags):
        red, green, blue = levels
        if min(levels) > 0 and 0.05 < red / green < 20 and 0.05 < blue / green < 20 and not red == green == blue:
            return np.array([red / green, 1.0, blue / green])
    return None


def kelvin_of(tags: Tags) -> float | None:
    """The temperature of a white balance that was set as one; None where no tag states it."""
    for text in maker_table("settings")["kelvin"]["tags"]:
        kelvin = element(tags.get(key_of(text)), 0)
        if kelvin is not None and 1500 <= kelvin <= 25000:
            return float(kelvin)
    return None


def _levels(tags: Tags) -> Iterator[tuple[float, float, float]]:
    """The red, green and blue levels that each maker's tags state."""

    def numbers(group: str, tag: int) -> tuple[int, ...]:
        value = tags.get((group, tag))
        return value if isinstance(value, tuple) else ()

    def ratios(group: str, tag: int) -> list[float]:
        parts = numbers(group, tag)
        return [a / b for a, b in zip(parts[::2], parts[1::2], strict=False) if b]

    neutral = ratios("Image", 0xC628)  # DNG's AsShotNeutral
    if len(neutral) == 3 and min(neutral) > 0:
        yield 1 / neutral[0], 1 / neutral[1], 1 / neutral[2]
    words = numbers("Canon", 0x4001)
    start = maker_table("settings")["canon_as_shot"]["starts"].get(str(len(words)))
    if start is not None:
        red, green, green2, blue = words[start : start + 4]
        if abs(green - green2) <= 0.1 * green:
            yield red, (green + green2) / 2, blue
    nikon = ratios("Nikon", 0x000C)  # red, blue, green, green
    if len(nikon) >= 2:
        yield nikon[0], (nikon[2] if len(nikon) > 2 else 1.0) or 1.0, nikon[1]
    pentax = numbers("Pentax", 0x0201)
    if len(pentax) == 4:
        yield pentax[0], (pentax[1] + pentax[2]) / 2, pentax[3]
    olympus = numbers("OlympusIp", 0x0100)
    older = numbers("Olympus", 0x1017)[:1] + numbers("Olympus", 0x1018)[:1]
    if len(olympus) >= 2 or len(older) == 2:
        red, blue = (olympus if len(olympus) >= 2 else older)[:2]
        yield red, 256.0, blue
    for group, first in (("Panasonic", 0x8004), ("Image", 0x0024)):  # maker note; RW2's own directory
        channels = [numbers(group, first + step)[:1] for step in range(3)]
        if all(channels):
            yield channels[0][0], channels[1][0], channels[2][0]
