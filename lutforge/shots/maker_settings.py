"""Picture style, white balance with its multipliers, and scene-dependent processing, out of each maker's tags.

The tags' meaning is in data/settings.json: a new maker is a few rows there. Names are lower-case words.
"""

import re
from collections.abc import Iterator
from typing import Any

from lutforge.settings import StyleName
from lutforge.shots.maker_multipliers import kelvin_of
from lutforge.shots.tags import MAKE, MAKER_NOTE, SOFTWARE, TOOLS, Tags, Value, element, key_of, maker_table

_NO_STYLE = ("", "none", "n/a", "unknown", "unset", "auto ", "off", "color", "normal ")
_EDITORS = re.compile(
    "photoshop|lightroom|camera raw|dng converter|gimp|darktable|rawtherapee|^art |capture ?one|affinity|dxo|luminar|"
    "on1|acdsee|picasa|imagemagick|graphicsmagick|paint|digikam|krita|silkypix|capture nx|viewnx|nx studio|"
    "digital photo professional|pixelmator|photo ?lab|photo editor|photo viewer|photoscape|faststone|irfanview|xnview|"
    "zoner|topaz|iridient|exposure x|^aperture|iphoto|^photos |canva|"
    "snapseed|vsco|instagram|picsart|polarr|facetune|meitu|airbrush|afterlight|retouch|b612|prequel",
    re.IGNORECASE,
)
"""Programs that change colours, by the name that they leave in the Software tag, where cameras name their firmware."""
_NAMING_MAKES = ("canon", "nikon", "fuji", "olympus", "om digital", "panasonic", "pentax", "ricoh", "sigma", "gopro")
"""Their own tags name the style, on all cameras but the oldest. (Sony's telephones have none.)"""


def style_of(tags: Tags) -> StyleName | None:
    """Picture style, adjustments and colour space; None where no tag states it."""
    name = _named_style(tags)
    adjusted = dict(_adjustments(tags, name is not None))
    if name is None:
        # Makers' own adjustments, of cameras that had no styles yet, or EXIF's, mean that the style is the only one.
        of_maker = any(key in tags for key in (("CanonCs", 14), ("Nikon", 0x0081), ("Fujifilm", 0x1003)))
        # EXIF's saturation repeats a maker's style coarsely. It is not all that there is where a maker's note is of a
        # kind that is not read here, nor where a program dropped it.
        read = any(group not in ("Image", "Photo", "Iop") for group, _ in tags)
        unread = MAKER_NOTE in tags or str(tags.get(MAKE, "")).lower().startswith(_NAMING_MAKES)
        if not of_maker and (("Photo", 0xA409) not in tags or (unread and not read)):
            return None
        name = "standard"
    if name in ("standard", "custom") and str(tags.get(("Nikon", 0x008D), "")).lower().startswith("mode3"):
        name += " mode 3"  # the colour mode of the D70's time, for greens
    return StyleName(name, tuple(adjusted.items()), "adobe rgb" if in_adobe_rgb(tags) else "srgb")


def white_balance_of(tags: Tags) -> str | None:
    """The white-balance setting with its shift, "5200k", "daylight shift+2+0"; None where no tag speaks of it."""
    name = _white_balance_word(tags)
    kelvin = kelvin_of(tags) if name == "kelvin" else None
    if kelvin is not None:
        name = f"{kelvin:g}k"
    # The multipliers of these differ from shot to shot anyway: a shift makes no other setting of them.
    if not name or name in ("auto", "custom", "kelvin"):
        return name
    # Signs and steps are the maker's own. Numbers beyond 10,000 mean something else; Sony's are thousandths of a step.
    for texts in _table("shifts"):
        numbers = [number for text in texts for number in _signed(tags.get(key_of(text)))[: 3 - len(texts)]]
        if any(numbers) and all(abs(number) <= 10000 for number in numbers):
            return f"{name} shift" + "".join(f"{number:+d}" for number in numbers)
    return name


def in_adobe_rgb(tags: Tags) -> bool:
    """True where the camera stored its picture in Adobe RGB."""
    stated = ((tags.get(key_of(text)), adobe) for text, adobe in _table("adobe_rgb").items())
    return any((value if isinstance(value, str) else element(value, 0)) == adobe for value, adobe in stated)


def notes_of(tags: Tags) -> Iterator[str]:
    """Notes on settings that make the rendering depend on the scene, and on a JPEG that is not sRGB."""
    if in_adobe_rgb(tags):
        yield "the JPEG is Adobe RGB, not sRGB: a style of its own, whose linear light is off; set the camera to sRGB"
    depends = "was on: the rendering depends on the scene, which the calibration does not model"
    for text, row in _table("scene_dependent").items():
        code = element(tags.get(key_of(text)), row["element"])
        if code is not None and (code in row["on"] if "on" in row else code not in row["off"]):
            yield f"{row['name']} {depends}"
    if str(tags.get(("Nikon", 0x0081), "")).strip().lower() == "auto" and ("NikonPc", 4) not in tags:
        yield f"automatic contrast {depends}"
    if _named_style(tags) in ("auto", "i-enhance"):
        yield "the picture style was automatic: the rendering depends on the scene"


def edited_notes(tags: Tags) -> tuple[str, ...]:
    """A note on a file that a program wrote, and not the camera's firmware; else none."""
    by_exif = str(tags.get(SOFTWARE, "")).strip()
    by_xmp = str(tags.get(TOOLS, "")).strip()
    software = by_exif if _EDITORS.search(by_exif) else by_xmp[:80]
    wrote = f"{software} wrote this file: its colours may not be those that the camera made"
    return (wrote,) if _EDITORS.search(by_exif) or _EDITORS.search(by_xmp) else ()


def _table(name: str) -> Any:
    return maker_table("settings")[name]["tags"]


def _named_style(tags: Tags) -> str | None:
    """The picture style that a tag names, in lower-case words; None where none does."""
    for text in _table("style_texts"):
        stated_text = tags.get(key_of(text))
        if isinstance(stated_text, str):
            name = " ".join(stated_text.lower().split())
            if name not in _NO_STYLE:
                return {"normal": "standard", "sd": "standard"}.get(name, name)
    for table in ("effects", "styles"):
        for text, names in _table(table).items():
            code = element(tags.get(key_of(text)), 0)
            if code is not None and hex(code) in names:
                return str(names[hex(code)])
    profile = tags.get(("Image", 0xC6F8))  # DNG's ProfileName: cameras that write DNG name the style here
    if isinstance(profile, str) and profile.strip() and not re.search(r"adobe|embedded|camera", profile.lower()):
        return " ".join(profile.lower().split())
    return _described(tags, "PictureStyle")


def _adjustments(tags: Tags, style_is_named: bool) -> Iterator[tuple[str, float]]:
    """The adjustments of a style, in steps of the menu, nine at most; sharpness changes no flat colour."""
    for text, (part, unit) in _table("signed_adjustments").items():
        number = next(iter(_signed(tags.get(key_of(text)))), 0)
        if number and abs(number / unit) <= 9:
            yield part, number / unit
    steps = element(tags.get(("NikonPc", 0)), 0) or 1
    for text, part in _table("nikon_picture_control").items():
        code = element(tags.get(key_of(text)), 0)
        if code is not None and code != 0x80 and abs(code - 0x80) <= 9 * steps:
            yield part, (code - 0x80) / steps
    for text, (part, words) in _table("worded_adjustments").items():
        stated_text = tags.get(key_of(text))
        if isinstance(stated_text, str) and stated_text.strip().lower() in words:
            yield part, words[stated_text.strip().lower()]
    of_maker = style_is_named or ("CanonCs", 14) in tags
    coded = _table("coded_adjustments") if of_maker else _table("coded_adjustments") | _table("general_adjustments")
    for text, (part, codes) in coded.items():
        code = element(tags.get(key_of(text)), 0)
        if code is not None and hex(code) in codes:
            yield part, codes[hex(code)]


def _white_balance_word(tags: Tags) -> str | None:
    """The white-balance setting without its shift; None where no tag states it."""
    stated_text = tags.get(("Nikon", 0x0005), tags.get(("Sigma", 0x0007)))
    if isinstance(stated_text, str) and stated_text.strip():
        words = stated_text.lower()
        for part, name in maker_table("settings")["white_balance_words"]["words"].items():
            if part in words:
                return str(name)
        return re.sub(r"[^a-z0-9]+", " ", words).strip()
    automatic = element(tags.get(("Photo", 0xA403)), 0) == 0
    for text, names in _table("white_balances").items():
        if automatic and key_of(text) == ("Photo", 0x9208):
            continue  # the light that the camera found, not a setting
        code = element(tags.get(key_of(text)), 0)
        if code is not None and (name := names.get(hex(code & 0xFFFF))) and name != "unknown":
            return str(name)
    return _described(tags, "WhiteBalance")


def _described(tags: Tags, part: str) -> str | None:
    """A setting out of a description such as "PictureStyle=vivid; WhiteBalance=daylight" (the simulated camera's)."""
    text = tags.get(("Image", 0x010E))
    stated = re.search(rf"\b{part}=([^;=]+)", text) if isinstance(text, str) else None
    return stated[1].strip().lower() if stated else None


def _signed(value: Value | None) -> list[int]:
    """The numbers, where they were stored without a sign too: in 16 bits or 32."""
    numbers = value if isinstance(value, tuple) else ()
    spans = [next((1 << bits for bits in (16, 32) if 1 << bits - 1 <= n < 1 << bits), 0) for n in numbers]
    return [n - span for n, span in zip(numbers, spans, strict=True)]
