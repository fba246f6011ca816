"""Programs that change colours, by the name that they leave in the Software tag, where cameras name their firmware."""

import re

from lutforge.shots.tags import SOFTWARE, Tags

_EDITORS = re.compile(
    "photoshop|lightroom|camera raw|dng converter|gimp|darktable|rawtherapee|^art |capture one|affinity|dxo|luminar|"
    "on1|acdsee|snapseed|picasa|imagemagick|paint|digikam|krita|silkypix|capture nx|viewnx|nx studio|"
    "digital photo professional",
    re.IGNORECASE,
)


def editor_of(tags: Tags) -> str | None:
    """The program that wrote a file, where it is not the camera's firmware."""
    software = str(tags.get(SOFTWARE, "")).strip()
    return software if _EDITORS.search(software) else None


def edited_notes(tags: Tags) -> tuple[str, ...]:
    """What to say of such a file: one line, or none."""
    editor = editor_of(tags)
    return () if editor is None else (f"{editor} wrote this file: its colours may not be those that the camera made",)
