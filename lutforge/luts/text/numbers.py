"""The numbers in the text of a LUT file, and how many of them a row or a header line has.

OpenColorIO, like most readers, takes the beginning of a word for the number ("0,5" is 0, "1e" is 1) and skips what it
does not expect. The checks raise an error that names the line.
"""

import re
from pathlib import Path

from lutforge.errors import LutError, one_line

NUMBER = r"[+-]?(?:[0-9]++\.?[0-9]*+|\.[0-9]++)(?:[eE](?:-[0-9]{1,3}+|\+?0*[0-3]?[0-9]))?+"
"""A number up to 1e39, which is more than a float32 holds; neither hexadecimal nor "nan"."""


def row_of(width: int) -> str:
    """The pattern of a row of so many numbers."""
    return rf"\s*+{NUMBER}(?:\s++{NUMBER}){{{width - 1}}}\s*+"


ROW = re.compile(rf"\s*{NUMBER}(?:\s++{NUMBER})*+\s*+")
"""A row of one number or more."""
ROW_OF_3 = re.compile(row_of(3))
ROW_START = re.compile(r"\s*[+-]*(?:\.?\d|nan\b|inf\b|infinity\b)", re.IGNORECASE)
"""The beginning of a row of a table, even of one that holds words which are no numbers."""
_HEADING = re.compile(r"\s*(?:1D|3D|3DMESH)\s*\{?\s*")
"""Lines that begin with a digit and are no rows."""

_ELEMENTS = "Array|Slope|Offset|Power|Saturation|minInValue|maxInValue|minOutValue|maxOutValue"
_NUMBERS_OF_XML = re.compile(rf"<(?:\w+:)?({_ELEMENTS})\b([^>]*)>([^<]*)<")
"""Elements of XML files that hold numbers only, with their attributes and text."""

_HEADERS = {
    ".cube": {
        "LUT_1D_SIZE": 1, "LUT_3D_SIZE": 1, "DOMAIN_MIN": 3, "DOMAIN_MAX": 3,
        "LUT_1D_INPUT_RANGE": 2, "LUT_3D_INPUT_RANGE": 2,
    },
    ".itx": {"LUT_3D_SIZE": 1},
    ".vlt": {"LUT_3D_SIZE": 1},
    ".3dl": {"Mesh": 2, "gamma": 1},
    ".spi1d": {"Version": 1, "From": 2, "Length": 1, "Components": 1},
    ".lut": {"Version": 1, "From": 2, "To": 2, "Black": 1, "White": 1},
    ".vf": {"grid_size": 3, "global_transform": 16},
    ".mga": {"in": 1, "out": 1},
    ".m3d": {"in": 1, "out": 1},
}  # fmt: skip
"""Header lines by suffix: their first word, and how many numbers follow it."""
_SIZES = {"LUT_1D_SIZE", "LUT_3D_SIZE", "Length", "Components", "grid_size", "Mesh"}
"""Words of headers that whole numbers follow."""
_WIDTHS = {".cube": 3, ".itx": 3, ".vlt": 3, ".cub": 3, ".vf": 3, ".mga": 4, ".m3d": 4}
"""Numbers in a row, of formats in which all rows have the same number."""


def are_numbers(words: list[str]) -> bool:
    """True where all words are numbers."""
    return all(ROW.fullmatch(word) for word in words)


def size_of(word: str, number: int, path: Path) -> int:
    """The size that a number on a line states. Raises LutError where it is not whole: readers cut "5.7" to 5."""
    size = float(word)
    if not size.is_integer():
        raise LutError(
            f'{path}: line {number}: the size "{one_line(word, 40)}" is no whole number: make or copy it again'
        )
    return int(size)


def require_numbers(lines: list[str], suffix: str, path: Path) -> None:
    """Raise LutError where a row or a header holds a word that is no number, or too few or too many numbers."""
    headers = _HEADERS.get(suffix, {})
    width = _WIDTHS.get(suffix)
    if suffix == ".lut" and lines[0].startswith("LUT:"):
        width = 1  # a LUT of Discreet, one number a line
    row = ROW if width is None else ROW_OF_3 if width == 3 else re.compile(row_of(width))

    in_metadata = False  # of a .csp
    for number, line in enumerate(lines, 1):
        if row.fullmatch(line):
            continue
        if suffix == ".csp" and line.strip() in ("BEGIN METADATA", "END METADATA"):
            in_metadata = line.strip().startswith("BEGIN")
        if in_metadata or _HEADING.fullmatch(line):
            continue

        # All words of a row should be numbers, and those after the first word of a header. Other lines are free.
        words = line.split()
        is_size = False
        if suffix == ".lut" and words and words[-1] == "}":
            words.pop()  # a LUT of Houdini may close a table behind its last number
        expected = width
        if not ROW_START.match(line):
            if not words or words[0] not in headers:
                continue
            expected = headers[words[0]]
            is_size = words[0] in _SIZES
            words = words[1:]

        for word in words:
            if not ROW.fullmatch(word):
                raise LutError(f"{path}: line {number}: {_no_number(word)}")
            if is_size:
                size_of(word, number, path)
        if expected is not None and len(words) != expected:
            raise LutError(
                f"{path}: line {number}: {len(words)} numbers, where {expected} belong: {one_line(line, 60)!r}; "
                "make or copy the file again"
            )


def _no_number(word: str) -> str:
    """The reason why a word is no number, and what to do."""
    if re.fullmatch(r"[+-]?\d*,\d+(?:[eE][+-]?\d+)?", word):
        return f'"{word}" has a decimal comma; numbers have decimal points: replace each "," by "."'
    if re.fullmatch(r"[+-]?(?:nan|inf|infinity)", word, re.IGNORECASE):
        return f'"{word}" is not finite; make the file anew'
    return f'"{one_line(word, 40)}" is no number; the file is damaged: make or copy it again'


def require_numbers_of_xml(text: str, path: Path) -> None:
    """Raise LutError on an element of numbers that holds something else, which OpenColorIO takes for a number."""
    for element in _NUMBERS_OF_XML.finditer(text):
        if ROW.fullmatch(element[3]) or not element[3].strip():
            continue
        for word in re.finditer(r"\S+", element[3]):
            if not ROW.fullmatch(word[0]):
                number = text.count("\n", 0, element.start(3) + word.start()) + 1
                raise LutError(f"{path}: line {number}, in <{element[1]}>: {_no_number(word[0])}")
