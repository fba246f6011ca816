"""The fine tuning of a white-balance setting, out of each maker's tags: a setting with it is another setting.

Codes: exiftool.org/TagNames and exiv2.org/tags.html. The numbers are the maker's own, whose signs and steps differ.
"""

from lutforge.shots.exif import Tags, Value

Key = tuple[str, int]

_SHIFTS: tuple[tuple[Key, ...], ...] = (
    (("CanonPr", 12), ("CanonPr", 13)),
    (("Nikon", 0x000B),),
    (("Sony", 0x2026),),
    (("Sony", 0x2014),),
    (("Sony", 0x0112),),
    (("Fujifilm", 0x100A),),
    (("OlympusCs", 0x0502),),
    (("Panasonic", 0x0046), ("Panasonic", 0x0047)),
)
"""Tags that hold the shift along amber and blue, and along green and magenta: one of two numbers, or two of one."""

_MOST = 10000
"""Larger numbers mean something else; Sony's are thousandths of a step."""


def shift_of(tags: Tags) -> str:
    """The shift in words, "shift+2-1"; "" where there is none."""
    for keys in _SHIFTS:
        numbers = [number for key in keys for number in _signed(tags.get(key))[: 3 - len(keys)]]
        if any(numbers) and all(abs(number) <= _MOST for number in numbers):
            return "shift" + "".join(f"{number:+d}" for number in numbers)
    return ""


def _signed(value: Value | None) -> list[int]:
    """The numbers, where they were stored without a sign too: in 16 bits or 32."""
    return [_of_bits(number) for number in value] if isinstance(value, tuple) else []


def _of_bits(number: int) -> int:
    for bits in (16, 32):
        if 1 << (bits - 1) <= number < 1 << bits:
            return number - (1 << bits)
    return number
