"""Harmless oddities of LUT files that OpenColorIO refuses: they are removed, and reported."""

from lutforge.luts.text.cube_dialects import is_resolve_cube
from lutforge.luts.text.numbers import ROW_START

HEADER_LINES = 64
"""Lines in which the header of a file is searched for."""


def without_oddities(lines: list[str], suffix: str) -> tuple[list[str], list[str]]:
    """The lines without what OpenColorIO refuses, and the problems that they had; line numbers stay as they are.

    The oddities are bytes after the text, indented headers, and comments between rows.
    """
    problems = []
    if lines[-1].endswith(("\x1a", "\0")):
        lines = [*lines[:-1], lines[-1].rstrip("\x1a\0")]
        problems.append("ends in bytes that are no text, which some programs take for a row: delete them")

    if any(_is_indented(line) for line in lines[:HEADER_LINES]):
        lines = [line.strip() for line in lines]
        problems.append("spaces before the words of its header, which OpenColorIO refuses: delete them")

    words = {line.partition(" ")[0] for line in lines[:HEADER_LINES]}
    refuses_comments = suffix in (".csp", ".spi1d", ".spi3d", ".lut") or (suffix == ".cube" and is_resolve_cube(words))
    comments = _comments_between_rows(lines) if refuses_comments else set()
    if comments:
        lines = ["" if number in comments else line for number, line in enumerate(lines)]
        problems.append("comments between its numbers, which OpenColorIO refuses: delete them, or move them up")
    return lines, problems


def _is_indented(line: str) -> bool:
    """True of a header line or a comment with white space before it."""
    return (line[:1] in " \t" and line.lstrip()[:1].isalpha()) or line[:2] in (" #", "\t#")


def _comments_between_rows(lines: list[str]) -> set[int]:
    """The places of the comments between the first row of numbers and the last."""
    rows = [number for number, line in enumerate(lines) if ROW_START.match(line)]
    if not rows:
        return set()
    return {number for number in range(rows[0], rows[-1]) if lines[number].startswith("#")}
