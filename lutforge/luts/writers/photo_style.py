"""The line of a LUT file that names the picture style of a Lumix body after which the body applies the LUT."""

from lutforge.luts.op_sequence import OpSequence


def photo_style(lut: OpSequence) -> list[str]:
    """The line that names a LUT's picture style, where it has one.

    It has no blank after "#", and is the second line of a file; without it bodies apply the LUT to V-Log.
    """
    style = lut.metadata.photo_style
    return [] if style is None else [f"#LUMIXPHOTOSTYLE {style}"]
