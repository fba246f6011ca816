"""Checks of the text of LUT files before a reader gets it: its encoding, its numbers, and how many a row has.

OpenColorIO, like most readers, takes the beginning of a word for the number ("0,5" is 0, "1e" is 1) and skips what it
does not expect. The checks raise an error that names the line.
"""

import codecs
import re
from collections.abc import Collection
from dataclasses import dataclass
from itertools import pairwise
from math import prod
from pathlib import Path

from lutforge.errors import LutError, one_line

NUMBER = r"[+-]?(?:[0-9]++\.?[0-9]*+|\.[0-9]++)(?:[eE](?:-[0-9]{1,3}+|\+?0*[0-3]?[0-9]))?+"
"""A number up to 1e39, which is more than a float32 holds; neither hexadecimal nor "nan"."""


def _row_of(width: int) -> str:
    return rf"\s*+{NUMBER}(?:\s++{NUMBER}){{{width - 1}}}\s*+"


_ROW = re.compile(rf"\s*{NUMBER}(?:\s++{NUMBER})*+\s*+")
_ROW_OF_3 = re.compile(_row_of(3))
_BEGINS = re.compile(r"\s*[+-]*(?:\.?\d|nan\b|inf\b|infinity\b)", re.IGNORECASE)
"""The beginning of a row of a table."""
_HEADING = re.compile(r"\s*(?:1D|3D|3DMESH)\s*\{?\s*")
"""Lines that begin with a digit and are no rows."""

_ELEMENTS = "Array|Slope|Offset|Power|Saturation|minInValue|maxInValue|minOutValue|maxOutValue"
_NUMBERS_OF_XML = re.compile(rf"<(?:\w+:)?({_ELEMENTS})\b([^>]*)>([^<]*)<")
"""Elements of XML files that hold numbers only, with their attributes and text."""

TEXTS = (".cube", ".itx", ".3dl", ".csp", ".spi1d", ".spi3d", ".spimtx", ".cub", ".lut", ".mga", ".m3d", ".vf", ".vlt")
"""Suffixes of formats that are lines of text."""
XML = (".clf", ".ctf", ".cc", ".ccc", ".cdl")
"""Suffixes of formats that are XML."""

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
_RANGES = {"LUT_1D_INPUT_RANGE", "LUT_3D_INPUT_RANGE"}
"""Header lines of DaVinci Resolve's dialect of .cube."""
_WIDTHS = {".cube": 3, ".itx": 3, ".vlt": 3, ".cub": 3, ".vf": 3, ".mga": 4, ".m3d": 4}
"""Numbers in a row, of formats in which all rows have the same number."""


@dataclass(frozen=True)
class LutText:
    """The text of a LUT file for its reader.

    rewritten: the text where it differs from the file's bytes, else none; problems: that other readers have with it.
    """

    rewritten: str | None = None
    problems: tuple[str, ...] = ()


def checked_text(path: Path) -> LutText:
    """Decode a LUT file and check its numbers; files of formats that are no text are not read.

    Raises LutError, with the number of the line and what to do, on the first word that is no number where one is
    expected, and on a row of too few or too many.
    """
    suffix = path.suffix.lower()
    if suffix not in TEXTS + XML:
        return LutText()
    data = path.read_bytes()
    try:
        text, problem = decoded(data)
    except UnicodeDecodeError:
        raise LutError(f"{path}: its text in UTF-16 is cut short or damaged: copy it again") from None
    problems = [problem] if problem else []
    if suffix in XML or text.lstrip()[:1] == "<":
        _require_numbers_of_xml(text, path)
        if not problem or data.startswith(codecs.BOM_UTF8):
            return LutText()
        return LutText(re.sub(r"(<\?xml[^>]*encoding=)([\"'])[^\"']*\2", r"\1\2UTF-8\2", text, count=1), (problem,))

    lines = re.split(r"\r\n|\n|\r", text)
    if "\r" in text and "\n" not in text:
        problems.append("lines end in carriage returns alone, which OpenColorIO does not read: save it with line feeds")
    lines, oddities = _without_oddities(lines, suffix)
    problems += oddities

    if suffix == ".cube":
        _require_cube(lines, path)
    _require_numbers(lines, suffix, path)
    if suffix == ".csp":
        _require_csp(lines, path)
    elif suffix == ".spi3d":
        _require_spi3d(lines, path)
        lines = [line for line in lines if line.strip()]
    elif suffix == ".3dl":
        _require_3dl(lines, path)
    elif suffix == ".cube":
        lines, mixed = _of_one_dialect(lines, path)
        problems += mixed
    return LutText("\n".join(lines) + "\n" if problems else None, tuple(problems))


def decoded(data: bytes) -> tuple[str, str]:
    """The text of a file, and the problem with its encoding, or "". Raises UnicodeDecodeError on damaged UTF-16."""
    if data.startswith(codecs.BOM_UTF8):
        problem = "begins with a byte order mark, which OpenColorIO refuses: save it as UTF-8 without one"
        return data.decode("utf-8-sig", "replace"), problem
    problem = "is text in UTF-16, which other programs do not read: save it as UTF-8"
    if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return data.decode("utf-16"), problem
    # UTF-16 without a byte order mark: every second byte of ASCII text is 0.
    if len(data) > 3 and data[1] == data[3] == 0 != data[0]:
        return data.decode("utf-16-le"), problem
    if len(data) > 3 and data[0] == data[2] == 0 != data[1]:
        return data.decode("utf-16-be"), problem
    return data.decode("utf-8", "replace"), ""


def _without_oddities(lines: list[str], suffix: str) -> tuple[list[str], list[str]]:
    """The lines without what OpenColorIO refuses, each with its old line number, and the problems that they had."""
    problems = []
    if lines[-1].endswith(("\x1a", "\0")):
        lines = [*lines[:-1], lines[-1].rstrip("\x1a\0")]
        problems.append("ends in bytes that are no text, which some programs take for a row: delete them")
    if any((line[:1] in " \t" and line.lstrip()[:1].isalpha()) or line[:2] in (" #", "\t#") for line in lines[:64]):
        lines = [line.strip() for line in lines]
        problems.append("spaces before the words of its header, which OpenColorIO refuses: delete them")
    if suffix in (".cube", ".csp", ".spi1d", ".spi3d", ".lut"):
        first = next((n for n, line in enumerate(lines) if _BEGINS.match(line)), len(lines))
        shaped = suffix != ".cube" or _is_resolve_cube({line.partition(" ")[0] for line in lines[:64]})
        last = max((n for n, line in enumerate(lines) if _BEGINS.match(line)), default=0)
        between = {n for n, line in enumerate(lines[first:last], first) if line.startswith("#")}
        if shaped and between:
            lines = ["" if n in between else line for n, line in enumerate(lines)]
            problems.append("comments between its numbers, which OpenColorIO refuses: delete them, or move them up")
    return lines, problems


def _require_cube(lines: list[str], path: Path) -> None:
    """Raise LutError where a .cube holds more or fewer rows than its header states."""
    expected = 0
    for line in lines:
        match line.split():
            case [("LUT_1D_SIZE" | "LUT_3D_SIZE") as word, size] if re.fullmatch("[0-9]{1,6}", size):
                expected += int(size) ** (3 if "3D" in word else 1)
    rows = [(number, line) for number, line in enumerate(lines, 1) if _BEGINS.match(line)]
    if rows and rows[-1][0] == len(lines) and not _ROW_OF_3.fullmatch(rows[-1][1]):
        rows.pop()  # the last line is cut
    if len(rows) < expected:
        raise LutError(f"{path}: the file ends after {len(rows)} of {expected} colours: make or copy it again")
    if len(rows) > expected > 0:
        raise LutError(f"{path}: line {rows[expected][0]}: rows continue after the {expected} that the header states")


def _require_numbers(lines: list[str], suffix: str, path: Path) -> None:
    """Raise LutError where a row or a header holds a word that is no number, or too few or too many numbers."""
    headers = _HEADERS.get(suffix, {})
    width = _WIDTHS.get(suffix)
    if suffix == ".lut" and lines[0].startswith("LUT:"):
        width = 1  # Discreet's
    row = _ROW if width is None else _ROW_OF_3 if width == 3 else re.compile(_row_of(width))
    inside = False  # the metadata of a .csp
    for number, line in enumerate(lines, 1):
        if row.fullmatch(line):
            continue
        if suffix == ".csp" and line.strip() in ("BEGIN METADATA", "END METADATA"):
            inside = line.strip().startswith("BEGIN")
        if inside or _HEADING.fullmatch(line):
            continue

        # The words that should be numbers: all of a row, those after the first of a header.
        words = line.split()
        expected = width
        if not _BEGINS.match(line):
            if not words or words[0] not in headers:
                continue
            expected = headers[words[0]]
            words = words[1:]

        for word in words:
            if not _ROW.fullmatch(word):
                raise LutError(f"{path}: line {number}: {_no_number(word)}")
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


def _require_numbers_of_xml(text: str, path: Path) -> None:
    """Raise LutError on an element of numbers that holds something else, which OpenColorIO takes for a number."""
    for element in _NUMBERS_OF_XML.finditer(text):
        if _ROW.fullmatch(element[3]) or not element[3].strip():
            continue
        at = element.start(3)
        for word in re.finditer(r"\S+", element[3]):
            if not _ROW.fullmatch(word[0]):
                number = text.count("\n", 0, at + word.start()) + 1
                raise LutError(f"{path}: line {number}, in <{element[1]}>: {_no_number(word[0])}")


def _require_csp(lines: list[str], path: Path) -> None:
    """Raise LutError where a .csp holds more or fewer rows than its sizes state."""
    text = "\n".join(lines)
    table = re.sub(r"BEGIN METADATA.*?END METADATA", lambda part: "\n" * part[0].count("\n"), text, flags=re.DOTALL)
    rows = [(n, line.split()) for n, line in enumerate(table.split("\n"), 1) if line.strip()]
    if len(rows) < 2 or rows[1][1] not in (["1D"], ["3D"]) or not all(_are_numbers(words) for _, words in rows[2:]):
        return  # its reader says what is wrong
    dimensions = rows[1][1][0][0]

    # Three preluts: a line with the length, one with the inputs and one with the outputs.
    table_rows = rows[2:]
    for channel in ("red", "green", "blue"):
        if len(table_rows) < 3 or len(table_rows[0][1]) != 1:
            raise LutError(f"{path}: the prelut of {channel} is not a line with its length and two lines of numbers")
        length = int(float(table_rows[0][1][0]))
        for number, words in table_rows[1:3]:
            if len(words) != length:
                raise LutError(f"{path}: line {number}: {len(words)} numbers, where the prelut has {length}")
        table_rows = table_rows[3:]

    if not table_rows:
        raise LutError(f"{path}: the file ends before its table: make or copy it again")
    number, words = table_rows[0]
    sizes = [int(float(word)) for word in words]
    if len(sizes) != int(dimensions):
        raise LutError(f"{path}: line {number}: {len(sizes)} numbers are no size of a {dimensions}D table")
    _require_rows(table_rows[1:], prod(sizes), 3, path)


def _require_3dl(lines: list[str], path: Path) -> None:
    """Raise LutError where the mesh of a .3dl is not that of its table, or a line is neither a row nor a heading."""
    rows = [(n, line.split()) for n, line in enumerate(lines, 1) if line.strip() and line.lstrip()[0] not in "#<"]
    for number, words in rows:
        if not _are_numbers(words) and words[0] not in ("3DMESH", "Mesh", "LUT8", "gamma"):
            raise LutError(f"{path}: line {number}: {one_line(' '.join(words), 60)!r} is no row of numbers")
    numbers = [(number, [float(word) for word in words]) for number, words in rows if _are_numbers(words)]
    if not numbers or len(numbers[0][1]) <= 3:
        return
    number, mesh = numbers[0]
    if any(after <= before for before, after in pairwise(mesh)):
        raise LutError(f"{path}: line {number}: the levels of the axes do not rise")
    _require_rows([row for row in rows if row[0] > number and _are_numbers(row[1])], len(mesh) ** 3, 3, path)


def _require_spi3d(lines: list[str], path: Path) -> None:
    """Raise LutError where a .spi3d does not hold each of its nodes once."""
    rows = [(n, line.split()) for n, line in enumerate(lines, 1) if line.strip() and not line.startswith("#")]
    if len(rows) < 3 or len(rows[2][1]) != 3 or not _are_numbers(rows[2][1]):
        return  # its reader says what is wrong
    number, words = rows[1]
    if words != ["3", "3"]:
        raise LutError(f'{path}: line {number}: a .spi3d has the line "3 3" there, not {" ".join(words)[:60]!r}')
    r, g, b = (int(float(word)) for word in rows[2][1])
    _require_rows(rows[3:], r * g * b, 6, path)
    nodes: set[tuple[str, ...]] = set()
    for number, words in rows[3:]:
        node = tuple(words[:3])
        if not all(word.isdecimal() and int(word) < size for word, size in zip(node, (r, g, b), strict=True)):
            raise LutError(f"{path}: line {number}: {' '.join(node)} is no node of {r} × {g} × {b}")
        if node in nodes:
            raise LutError(f"{path}: line {number}: the node {' '.join(node)} comes twice; another is missing")
        nodes.add(node)


def _require_rows(rows: list[tuple[int, list[str]]], expected: int, width: int, path: Path) -> None:
    """Raise LutError where there are not `expected` rows, each of `width` numbers."""
    for number, words in rows:
        if len(words) != width:
            raise LutError(f"{path}: line {number}: {len(words)} numbers, where {width} belong")
    if len(rows) < expected:
        raise LutError(f"{path}: the file ends after {len(rows)} of {expected} colours: make or copy it again")
    if len(rows) > expected:
        raise LutError(f"{path}: line {rows[expected][0]}: rows continue after the {expected} that the header states")


def _are_numbers(words: list[str]) -> bool:
    """True where all words are numbers."""
    return all(_ROW.fullmatch(word) for word in words)


def _is_resolve_cube(words: Collection[str]) -> bool:
    """True where these words of a .cube's header are those of DaVinci Resolve's dialect."""
    return not _RANGES.isdisjoint(words) or {"LUT_1D_SIZE", "LUT_3D_SIZE"} <= {*words}


def _of_one_dialect(lines: list[str], path: Path) -> tuple[list[str], list[str]]:
    """The lines of a .cube without those of a second dialect, and the problem with the lines that are left out.

    Resolve's dialect has input ranges, or a shaper, and neither TITLE nor DOMAIN lines; the Adobe Cube LUT
    Specification 1.0 has these and no ranges. LUTCalc and others write both into one file. Raises LutError where the
    two contradict each other.
    """
    heads: dict[str, int] = {}
    for number, line in enumerate(lines):
        if line[:1].isalpha():
            heads.setdefault(line.split(maxsplit=1)[0], number)
    resolve = _RANGES & heads.keys()
    has_shaper = {"LUT_1D_SIZE", "LUT_3D_SIZE"} <= heads.keys()
    adobe = [word for word in ("TITLE", "DOMAIN_MIN", "DOMAIN_MAX") if word in heads]
    if not _is_resolve_cube(heads.keys()) or not adobe:
        return lines, []
    for word, end in (("DOMAIN_MIN", 0), ("DOMAIN_MAX", 1)):
        if word not in heads:
            continue
        ends = {float(value) for value in lines[heads[word]].split()[1:]}
        ranges = {float(lines[heads[name]].split()[1 + end]) for name in resolve} or {float(end)}
        if ends != ranges:
            raise LutError(
                f"{path}: line {heads[word] + 1}: {word} states another range than "
                f"{' and '.join(sorted(resolve)) or 'a shaper has'}: delete the line that is wrong"
            )
    left_out = {heads[word] for word in adobe}
    resolve_words = "LUT_1D_SIZE and LUT_3D_SIZE" if has_shaper else " and ".join(sorted(resolve))
    problem = f"{', '.join(adobe)} together with {resolve_words}, which OpenColorIO and Nuke refuse: delete the line"
    return [line for number, line in enumerate(lines) if number not in left_out], [problem + "s" * (len(adobe) > 1)]
