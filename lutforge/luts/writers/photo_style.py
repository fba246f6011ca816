"""The line of a LUT file that names the picture style of a Lumix body after which the body applies the LUT."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from lutforge.luts.sequence import Lut  # which is written by these functions


def photo_style(lut: Lut) -> list[str]:
    """The line that names a LUT's picture style, where it has one.

    It has no blank after "#", and is the second line of a file; without it bodies apply the LUT to V-Log.
    """
    style = lut.metadata.photo_style
    return [] if style is None else [f"#LUMIXPHOTOSTYLE {style}"]
