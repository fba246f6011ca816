"""Picture style, white balance and scene-dependent processing, out of each maker's tags.

Codes: exiftool.org/TagNames and exiv2.org/tags.html. Names are lower-case words; a new maker is a few rows
here.
"""

import re
from collections.abc import Iterator

from lutforge.shots.exif import Tags, Value
from lutforge.shots.maker_multipliers import kelvin_of
from lutforge.shots.style_adjustments import adjustments
from lutforge.shots.white_balance_shift import shift_of

Key = tuple[str, int]

_NO_STYLE = ("", "none", "n/a", "unknown", "unset", "auto ", "off", "color", "normal ")

_STYLES: dict[Key, dict[int, str]] = {
    ("CanonPr", 10): {
        0x01: "standard", 0x02: "portrait", 0x03: "high saturation", 0x04: "adobe rgb",
        0x05: "low saturation", 0x06: "cm set 1", 0x07: "cm set 2", 0x21: "user defined 1",
        0x22: "user defined 2", 0x23: "user defined 3", 0x41: "pc 1", 0x42: "pc 2", 0x43: "pc 3",
        0x81: "standard", 0x82: "portrait", 0x83: "landscape", 0x84: "neutral", 0x85: "faithful",
        0x86: "monochrome", 0x87: "auto", 0x88: "fine detail",
    },
    ("Fujifilm", 0x1401): {
        0x000: "provia", 0x100: "studio portrait", 0x110: "studio portrait enhanced saturation",
        0x120: "astia", 0x130: "studio portrait increased sharpness", 0x200: "velvia",
        0x300: "studio portrait ex", 0x400: "velvia", 0x500: "pro neg. std", 0x501: "pro neg. hi",
        0x600: "classic chrome", 0x700: "eterna", 0x800: "classic negative", 0x900: "bleach bypass",
        0xA00: "nostalgic neg", 0xB00: "reala ace",
    },
    ("OlympusCs", 0x0520): {
        1: "vivid", 2: "natural", 3: "muted", 4: "portrait", 5: "i-enhance", 6: "e-portrait",
        7: "color creator", 9: "color profile 1", 10: "color profile 2", 11: "color profile 3",
        256: "monotone", 512: "sepia",
    },
    ("Panasonic", 0x0089): {
        0: "auto", 1: "standard", 2: "vivid", 3: "natural", 4: "monochrome", 5: "scenery", 6: "portrait",
        8: "cinelike d", 9: "cinelike v", 11: "l. monochrome", 12: "like 709", 15: "l. monochrome d",
        17: "v-log", 18: "cinelike d2", 19: "cinelike v2",
    },
    ("Panasonic", 0x0032): {0: "standard", 1: "natural", 2: "vivid"},
    ("Sigma", 0x002C): {
        1: "sepia", 2: "b&w", 3: "standard", 4: "vivid", 5: "neutral", 6: "portrait", 7: "landscape",
        8: "fov classic blue",
    },
    ("Pentax", 0x004F): {
        0: "natural", 1: "bright", 2: "portrait", 3: "landscape", 4: "vibrant", 5: "monochrome", 6: "muted",
        7: "reversal film", 8: "bleach bypass", 9: "radiant", 10: "cross processing", 11: "flat", 256: "auto",
    },
}  # fmt: skip
"""Style codes; the first of these that is present wins."""

_STYLE_TEXTS: tuple[Key, ...] = (
    ("NikonPc", 4),
    ("Sony", 0xB020),
    ("Nikon", 0x00A9),  # image optimisation, before picture controls
)

_EXTRAS: dict[Key, dict[int, str]] = {
    ("CanonCs", 40): {1: "vivid", 2: "neutral", 3: "smooth", 4: "sepia", 5: "black and white", 6: "custom",
    100: "my colors"},
    ("Panasonic", 0x0028): {2: "warm", 3: "cool", 4: "black and white", 5: "sepia", 6: "happy", 8: "vivid effect"},
    ("Fujifilm", 0x1003): {
        0x300: "monochrome", 0x301: "monochrome red filter", 0x302: "monochrome yellow filter",
        0x303: "monochrome green filter", 0x310: "sepia", 0x500: "acros", 0x501: "acros red filter",
        0x502: "acros yellow filter", 0x503: "acros green filter",
    },
}  # fmt: skip
"""Effects of the older compact cameras, and Fujifilm's monochrome films: they stand in for a style."""

_WHITE_BALANCES: dict[Key, dict[int, str]] = {
    ("CanonSi", 7): {
        0: "auto", 1: "daylight", 2: "cloudy", 3: "tungsten", 4: "fluorescent", 5: "flash", 6: "custom",
        7: "black and white", 8: "shade", 9: "kelvin", 10: "custom", 11: "custom", 12: "custom",
        14: "daylight fluorescent", 15: "custom", 16: "custom", 17: "underwater", 18: "custom", 19: "custom",
        20: "custom", 21: "custom", 23: "auto",
    },
    ("Sony", 0x0115): {
        0x00: "auto", 0x01: "kelvin", 0x10: "daylight", 0x20: "cloudy", 0x30: "shade", 0x40: "tungsten",
        0x50: "flash", 0x60: "fluorescent", 0x70: "custom", 0x80: "underwater",
    },
    ("Sony", 0xB054): {
        0: "auto", 4: "custom", 5: "daylight", 6: "cloudy", 7: "fluorescent", 8: "daylight fluorescent",
        9: "fluorescent", 11: "fluorescent", 14: "tungsten", 15: "flash", 17: "underwater", 20: "shade",
    },
    ("Fujifilm", 0x1002): {
        0x000: "auto", 0x001: "auto", 0x002: "auto", 0x100: "daylight", 0x200: "cloudy",
        0x300: "daylight fluorescent", 0x301: "fluorescent", 0x302: "fluorescent", 0x303: "fluorescent",
        0x304: "fluorescent", 0x400: "tungsten", 0x500: "flash", 0x600: "underwater", 0xF00: "custom",
        0xF01: "custom", 0xF02: "custom", 0xF03: "custom", 0xF04: "custom", 0xFF0: "kelvin",
    },
    ("OlympusCs", 0x0500): {
        0: "auto", 1: "auto", 16: "shade", 17: "cloudy", 18: "daylight", 20: "tungsten", 21: "tungsten",
        22: "auto", 23: "flash", 33: "daylight fluorescent", 34: "fluorescent", 35: "fluorescent",
        36: "fluorescent", 48: "tungsten", 67: "underwater", 256: "custom", 257: "custom", 258: "custom",
        259: "custom", 512: "custom", 513: "custom", 514: "custom", 515: "custom",
    },
    ("Panasonic", 0x0003): {
        1: "auto", 2: "daylight", 3: "cloudy", 4: "tungsten", 5: "custom", 8: "flash", 10: "black and white",
        11: "custom", 12: "shade", 13: "kelvin", 14: "custom", 15: "custom", 16: "custom", 19: "auto",
    },
    ("Pentax", 0x0019): {
        0: "auto", 1: "daylight", 2: "shade", 3: "fluorescent", 4: "tungsten", 5: "custom",
        6: "daylight fluorescent", 7: "fluorescent", 8: "fluorescent", 9: "flash", 10: "cloudy",
        11: "fluorescent", 14: "auto", 15: "auto", 17: "kelvin", 0xFFFE: "unknown", 0xFFFF: "custom",
    },
    ("Photo", 0x9208): {
        1: "daylight", 2: "fluorescent", 3: "tungsten", 4: "flash", 9: "daylight", 10: "cloudy", 11: "shade",
        12: "daylight fluorescent", 13: "fluorescent", 14: "fluorescent", 15: "fluorescent",
        16: "fluorescent", 17: "tungsten", 24: "tungsten",
    },
    ("Photo", 0xA403): {0: "auto", 1: "custom"},
}  # fmt: skip
"""White-balance codes; the first that is present and known wins, the general EXIF tags last."""

_OF_THE_SCENE = ("auto", "custom", "kelvin")
"""Settings whose multipliers differ from shot to shot anyway, so that a shift makes no other setting of them."""

_WB_WORDS = (
    ("auto", "auto"), ("day white", "fluorescent"), ("daylight fluor", "daylight fluorescent"),
    ("sun", "daylight"), ("fine", "daylight"), ("daylight", "daylight"),
    ("cloud", "cloudy"), ("shad", "shade"), ("incandescent", "tungsten"), ("tungsten", "tungsten"),
    ("fluor", "fluorescent"), ("flash", "flash"), ("speedlight", "flash"), ("preset", "custom"),
    ("manual", "custom"), ("custom", "custom"), ("kelvin", "kelvin"), ("color temp", "kelvin"),
    ("natural", "auto"),
)  # fmt: skip

_SCENE_DEPENDENT: dict[Key, tuple[str, frozenset[int], int]] = {
    ("CanonLiOp", 2): ("Auto Lighting Optimizer", frozenset({3}), 0),
    ("CanonContrastInfo", 4): ("i-Contrast", frozenset({0, 0xFFFF}), 0),
    ("CanonHdr", 1): ("HDR", frozenset({0}), 0),
    ("Nikon", 0x0022): ("Active D-Lighting", frozenset({0}), 0),
    ("NikonPc", 51): ("automatic contrast", frozenset(range(1, 256)), 0),
    ("NikonPc", 53): ("automatic saturation", frozenset(range(1, 256)), 0),
    ("Nikon", 0x0035): ("HDR", frozenset({0, 48}), 4),
    ("Sony", 0xB025): ("D-Range Optimizer", frozenset({0}), 0),
    ("Sony", 0x200A): ("HDR", frozenset({0}), 0),
    ("Fujifilm", 0x1403): ("dynamic range expansion", frozenset({0, 100}), 0),
    ("Fujifilm", 0x140B): ("automatic dynamic range", frozenset({0, 100}), 0),
    ("OlympusCs", 0x050F): ("automatic gradation", frozenset({0}), 3),
    ("Panasonic", 0x0079): ("intelligent D-Range", frozenset({0}), 0),
    ("Panasonic", 0x009E): ("HDR", frozenset({0}), 0),
    ("Pentax", 0x0085): ("HDR", frozenset({0}), 0),
    ("Pentax", 0x0069): ("dynamic range expansion", frozenset({0}), 0),
    ("Photo", 0xA401): ("custom rendering", frozenset({0, 1}), 0),
}
"""Processing that depends on the scene: its name, the codes that mean off, and which element of the value to
look at."""


_ADJUSTED = (("CanonCs", 14), ("Nikon", 0x0081), ("Fujifilm", 0x1003))
"""Makers' own adjustments of cameras that had no styles yet."""
_GENERAL_GROUPS = ("Image", "Photo", "Iop")
_NAMING_MAKES = ("canon", "nikon", "fuji", "olympus", "om digital", "panasonic", "pentax", "ricoh", "sigma", "gopro")
"""Their own tags name the style, on all cameras but the oldest. (Sony's telephones have none.)"""

ADOBE_RGB = "adobe rgb"
"""What the name of a style ends in where the JPEG is in Adobe RGB."""

_ADOBE_RGB: dict[Key, int | str] = {
    ("Iop", 0x0001): "R03",
    ("Photo", 0xA001): 2,
    ("Canon", 0x00B4): 2,
    ("Nikon", 0x001E): 2,
    ("Pentax", 0x0037): 1,
    ("OlympusCs", 0x0507): 1,
}
"""Tags that say so where the JPEG is not sRGB (DCF 2.0, "option file", and the makers' own)."""


def style_of(tags: Tags) -> str | None:
    """Picture style with its adjustments, and a colour space but sRGB: "standard", "vivid contrast+1 adobe rgb".

    None where no tag speaks of it.
    """
    name = _named_style(tags)
    adjusted = dict(adjustments(tags, name is not None))
    if name is None:
        if not any(key in tags for key in _ADJUSTED) and not _exif_tells_style(tags):
            return None
        name = "standard"
    if name in ("standard", "custom") and str(tags.get(("Nikon", 0x008D), "")).lower().startswith("mode3"):
        name += " mode 3"  # the colour mode of the D70's time, for greens
    space = [ADOBE_RGB] if in_adobe_rgb(tags) else []
    return " ".join([name, *(f"{what}{steps:+g}" for what, steps in adjusted.items()), *space])


def _exif_tells_style(tags: Tags) -> bool:
    """True where EXIF's saturation, which repeats a maker's style coarsely, is all that there is: not where a maker's
    note is of a kind that is not read here, nor where a program dropped it.
    """
    read = any(group not in _GENERAL_GROUPS for group, _ in tags)
    unread = ("Photo", 0x927C) in tags or str(tags.get(("Image", 0x010F), "")).lower().startswith(_NAMING_MAKES)
    return ("Photo", 0xA409) in tags and (read or not unread)


def white_balance_of(tags: Tags) -> str | None:
    """White-balance setting as words, or the temperature that was set ("5200k"), with its shift ("daylight shift+2+0");
    None where no tag speaks of it.
    """
    name = _white_balance_word(tags)
    kelvin = kelvin_of(tags) if name == "kelvin" else None
    if kelvin is not None:
        name = f"{kelvin:g}k"
    shift = "" if name in _OF_THE_SCENE else shift_of(tags)
    return name if not name or not shift else f"{name} {shift}"


def _white_balance_word(tags: Tags) -> str | None:
    text = tags.get(("Nikon", 0x0005), tags.get(("Sigma", 0x0007)))
    if isinstance(text, str) and text.strip():
        words = text.lower()
        return next((name for part, name in _WB_WORDS if part in words), re.sub(r"[^a-z0-9]+", " ", words).strip())
    automatic = _element(tags.get(("Photo", 0xA403)), 0) == 0
    for key, names in _WHITE_BALANCES.items():
        if automatic and key == ("Photo", 0x9208):
            continue  # the light that the camera found, not a setting
        code = _element(tags.get(key), 0)
        if code is not None and (name := names.get(code & 0xFFFF)) and name != "unknown":
            return name
    return _described(tags, "WhiteBalance")


def in_adobe_rgb(tags: Tags) -> bool:
    """True where the camera stored its picture in Adobe RGB."""
    values = ((tags.get(key), adobe) for key, adobe in _ADOBE_RGB.items())
    return any((value if isinstance(value, str) else _element(value, 0)) == adobe for value, adobe in values)


def notes_of(tags: Tags) -> Iterator[str]:
    """What in the settings makes the rendering depend on the scene, or a JPEG other than sRGB."""
    if in_adobe_rgb(tags):
        yield "the JPEG is Adobe RGB, not sRGB: a style of its own, whose linear light is off; set the camera to sRGB"
    for key, (name, off, index) in _SCENE_DEPENDENT.items():
        code = _element(tags.get(key), index)
        if code is not None and code not in off:
            yield f"{name} was on: the rendering depends on the scene, which the calibration does not model"
    if str(tags.get(("Nikon", 0x0081), "")).strip().lower() == "auto" and ("NikonPc", 4) not in tags:
        yield "automatic contrast was on: the rendering depends on the scene, which the calibration does not model"
    if _named_style(tags) in ("auto", "i-enhance"):
        yield "the picture style was automatic: the rendering depends on the scene"


def _named_style(tags: Tags) -> str | None:
    for key in _STYLE_TEXTS:
        text = tags.get(key)
        if isinstance(text, str):
            name = re.sub(r"\s+", " ", text.lower()).strip()
            if name not in _NO_STYLE:
                return {"normal": "standard", "sd": "standard"}.get(name, name)
    for table in (_EXTRAS, _STYLES):
        for key, names in table.items():
            code = _element(tags.get(key), 0)
            if code is not None and code in names:
                return names[code]
    profile = tags.get(("Image", 0xC6F8))  # DNG's ProfileName: cameras that write DNG name the style here
    if isinstance(profile, str) and profile.strip() and not re.search(r"adobe|embedded|camera", profile.lower()):
        return re.sub(r"\s+", " ", profile.lower()).strip()
    return _described(tags, "PictureStyle")


def _described(tags: Tags, what: str) -> str | None:
    """A setting out of a description such as "PictureStyle=vivid; WhiteBalance=daylight" (the simulated camera's)."""
    text = tags.get(("Image", 0x010E))
    found = re.search(rf"\b{what}=([^;=]+)", text) if isinstance(text, str) else None
    return found[1].strip().lower() if found else None


def _element(value: Value | None, index: int) -> int | None:
    return value[index] if isinstance(value, tuple) and len(value) > index else None
