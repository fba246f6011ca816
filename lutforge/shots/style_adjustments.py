"""Contrast, saturation, tone and so on where they are not a style's own, out of each maker's tags.

Each set of adjustments is a style of its own: it renders differently. Sharpness changes no flat colour and does not
count. Codes: exiftool.org/TagNames and exiv2.org/tags.html.
"""

from collections.abc import Iterator

from lutforge.shots.exif import Tags, Value

Key = tuple[str, int]

_SIGNED: dict[Key, tuple[str, int]] = {
    ("CanonCs", 13): ("contrast", 1),
    ("CanonCs", 14): ("saturation", 1),
    ("CanonCs", 42): ("color tone", 1),
    ("Sony", 0x2004): ("contrast", 1),
    ("Sony", 0x2005): ("saturation", 1),
    ("Sony", 0x2032): ("shadows", 1),
    ("Sony", 0x2033): ("highlights", 1),
    ("Sony", 0x2034): ("fade", 1),
    ("OlympusCs", 0x0523): ("contrast", 1),
    ("OlympusCs", 0x0521): ("saturation", 1),
    ("Panasonic", 0x0039): ("contrast", 1),
    ("Panasonic", 0x0040): ("saturation", 1),
    ("Fujifilm", 0x1041): ("highlights", -16),
    ("Fujifilm", 0x1040): ("shadows", -16),
    ("Fujifilm", 0x1048): ("color chrome", 32),
    ("Fujifilm", 0x104E): ("color chrome blue", 32),
}
"""Signed numbers: what they adjust, and how much of the number is one step."""

_PENTAX = {0: -2, 2: 2, 3: -1, 4: 1, 5: -3, 6: 3, 7: -4, 8: 4}

_CODED: dict[Key, tuple[str, dict[int, int]]] = {
    ("Fujifilm", 0x1003): ("saturation", {0x080: 1, 0x100: 2, 0x180: -1, 0x400: -2, 0x0C0: 3, 0x0E0: 4}),
    ("Pentax", 0x0020): ("contrast", _PENTAX),
    ("Pentax", 0x001F): ("saturation", _PENTAX),
}

_GENERAL: dict[Key, tuple[str, dict[int, int]]] = {
    ("Photo", 0xA408): ("contrast", {1: -1, 2: 1}),
    ("Photo", 0xA409): ("saturation", {1: -1, 2: 1}),
}
"""EXIF's own tags: they repeat, more coarsely, what a maker's say, and count only without those."""

_WORDS: dict[Key, tuple[str, dict[str, int]]] = {
    ("Nikon", 0x0081): ("contrast", {"low": -2, "med.l": -1, "med.h": 1, "high": 2}),
    ("Nikon", 0x00AA): ("saturation", {"moderate": -1, "enhanced": 1}),
}

_NIKON_PICTURE_CONTROL = {51: "contrast", 52: "brightness", 53: "saturation"}
_NIKON_STEPS = ("NikonPc", 0)
"""How many numbers are one step of the menu: 1, and 4 since the D5."""

_MOST = 9
"""More steps than any menu has: such a number means something else."""


def adjustments(tags: Tags, style_is_named: bool) -> Iterator[tuple[str, float]]:
    """What was adjusted, and by how many steps of the camera's menu."""
    for key, (what, unit) in _SIGNED.items():
        number = _signed(tags.get(key))
        if number and abs(number / unit) <= _MOST:
            yield what, number / unit
    steps = _first(tags.get(_NIKON_STEPS)) or 1
    for index, what in _NIKON_PICTURE_CONTROL.items():
        code = _first(tags.get(("NikonPc", index)))
        if code is not None and code != 0x80 and abs(code - 0x80) <= _MOST * steps:
            yield what, (code - 0x80) / steps
    for key, (what, words) in _WORDS.items():
        text = tags.get(key)
        if isinstance(text, str) and text.strip().lower() in words:
            yield what, words[text.strip().lower()]
    for key, (what, codes) in _CODED.items() if style_is_named or ("CanonCs", 14) in tags else _everything():
        code = _first(tags.get(key))
        if code is not None and code in codes:
            yield what, codes[code]


def _everything() -> Iterator[tuple[Key, tuple[str, dict[int, int]]]]:
    yield from _CODED.items()
    yield from _GENERAL.items()


def _first(value: Value | None) -> int | None:
    return value[0] if isinstance(value, tuple) and value else None


def _signed(value: Value | None) -> int:
    """The first number, where it was stored without a sign too: in 16 bits or 32."""
    number = _first(value) or 0
    for bits in (16, 32):
        if 1 << (bits - 1) <= number < 1 << bits:
            return number - (1 << bits)
    return number
