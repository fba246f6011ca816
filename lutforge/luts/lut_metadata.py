"""What is known of a LUT's file besides operations, title and comments: from its reader, or for its writer."""

from dataclasses import dataclass


@dataclass(frozen=True)
class LutMetadata:
    """What a reader found in a file, and what a writer is to state in one; all of it empty of a LUT in memory.

    Of a file that was read. format: its suffix, or the name of the layout of a picture, such as "Hald image"; bits: of
    the integers in it, None for floats; keywords: the first words of the lines before its numbers; problems: those that
    other programs have with the file; warnings: OpenColorIO's.

    For a file that is written. photo_style: the picture style of a Lumix body after which the body applies the LUT,
    such as "STD"; clf_namespace: that of a .clf, where it is not SMPTE ST 2136-1's.
    """

    format: str = ""
    bits: int | None = None
    keywords: tuple[str, ...] = ()
    problems: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    photo_style: str | None = None
    clf_namespace: str | None = None
