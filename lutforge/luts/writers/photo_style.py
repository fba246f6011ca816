"""The picture style of a Lumix body that a LUT lies on, as its file names it."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from lutforge.luts.sequence import Lut  # which is written by these functions

PHOTO_STYLE = "photo style"
"""The key of a LUT's metadata that names the picture style of a Lumix body on which it lies, such as "STD"."""


def photo_style(lut: Lut) -> list[str]:
    """The line that names the picture style that a LUT lies on in a Lumix body, where it is made for one.

    It has no blank behind "#", and is the second line; without it bodies take V-Log for the base.
    """
    style = lut.metadata.get(PHOTO_STYLE)
    return [] if style is None else [f"#LUMIXPHOTOSTYLE {style}"]
