"""The metadata of a LUT besides its title and comments: what its reader found, and what its writer states."""

from dataclasses import dataclass


@dataclass(frozen=True)
class LutMetadata:
    """What the reader of a file found in it, and what the writer of a file states; a new LUT has neither.

    The first five fields are of a file that was read. format: its suffix, or the name of a picture's layout, such as
    "Hald image"; bits: of its integers, None for floats; keywords: the first words of the lines before its numbers;
    problems: those that other programs have with the file; warnings: OpenColorIO's.

    The others are for a file that is written. photo_style: the picture style of a Lumix body after which the body
    applies the LUT, such as "STD"; clf_namespace: that of a .clf, where it is not SMPTE ST 2136-1's.
    """

    format: str = ""
    bits: int | None = None
    keywords: tuple[str, ...] = ()
    problems: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    photo_style: str | None = None
    clf_namespace: str | None = None
