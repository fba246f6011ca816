"""The tables in the text of LUT files: each format's rows, as many as its header states."""

import re
from itertools import pairwise
from math import prod
from pathlib import Path

from lutforge.errors import LutError, one_line
from lutforge.luts.text.numbers import ROW_OF_3, ROW_START, are_numbers, size_of

NumberedRow = tuple[int, list[str]]
"""The number of a line, and its words."""


def require_cube_rows(lines: list[str], path: Path) -> None:
    """Raise LutError where a .cube holds more or fewer rows than its header states."""
    expected = 0
    for line in lines:
        match line.split():
            case [("LUT_1D_SIZE" | "LUT_3D_SIZE") as word, size] if re.fullmatch("[0-9]{1,6}", size):
                expected += int(size) ** (3 if "3D" in word else 1)
    rows = [(number, line) for number, line in enumerate(lines, 1) if ROW_START.match(line)]
    if rows and rows[-1][0] == len(lines) and not ROW_OF_3.fullmatch(rows[-1][1]):
        rows.pop()  # the last line is cut
    if len(rows) < expected:
        raise LutError(f"{path}: the file ends after {len(rows)} of {expected} colours: make or copy it again")
    if len(rows) > expected > 0:
        raise LutError(f"{path}: line {rows[expected][0]}: rows continue after the {expected} that the header states")


def require_csp(lines: list[str], path: Path) -> None:
    """Raise LutError where a .csp holds more or fewer rows than its sizes state."""
    # Metadata are blanked, so that the numbers of lines stay as they are. The first two lines name format and table.
    text = "\n".join(lines)
    table = re.sub(r"BEGIN METADATA.*?END METADATA", lambda part: "\n" * part[0].count("\n"), text, flags=re.DOTALL)
    rows = [(number, line.split()) for number, line in enumerate(table.split("\n"), 1) if line.strip()]
    if len(rows) < 2 or rows[1][1] not in (["1D"], ["3D"]) or not all(are_numbers(words) for _, words in rows[2:]):
        return  # its reader says what is wrong
    dimensions = rows[1][1][0][0]

    # Three preluts: a line with the length, one with the inputs and one with the outputs.
    table_rows = rows[2:]
    for channel in ("red", "green", "blue"):
        if len(table_rows) < 3 or len(table_rows[0][1]) != 1:
            raise LutError(f"{path}: the prelut of {channel} is not a line with its length and two lines of numbers")
        length = size_of(table_rows[0][1][0], table_rows[0][0], path)
        for number, words in table_rows[1:3]:
            if len(words) != length:
                raise LutError(f"{path}: line {number}: {len(words)} numbers, where the prelut has {length}")
        table_rows = table_rows[3:]

    # Then a line with the sizes of the table, and its rows.
    if not table_rows:
        raise LutError(f"{path}: the file ends before its table: make or copy it again")
    number, words = table_rows[0]
    sizes = [size_of(word, number, path) for word in words]
    if len(sizes) != int(dimensions):
        raise LutError(f"{path}: line {number}: {len(sizes)} numbers are no size of a {dimensions}D table")
    _require_rows(table_rows[1:], prod(sizes), 3, path)


def require_3dl(lines: list[str], path: Path) -> None:
    """Raise LutError where the mesh of a .3dl is not that of its table, or a line is neither a row nor a heading."""
    rows = [
        (number, line.split()) for number, line in enumerate(lines, 1) if line.strip() and line.lstrip()[0] not in "#<"
    ]
    for number, words in rows:
        if not are_numbers(words) and words[0] not in ("3DMESH", "Mesh", "LUT8", "gamma"):
            raise LutError(f"{path}: line {number}: {one_line(' '.join(words), 60)!r} is no row of numbers")

    # The first row of more than three numbers is the mesh, the levels of the axes; without it nothing can be counted.
    numbers = [(number, [float(word) for word in words]) for number, words in rows if are_numbers(words)]
    if not numbers or len(numbers[0][1]) <= 3:
        return
    number, mesh = numbers[0]
    if any(after <= before for before, after in pairwise(mesh)):
        raise LutError(f"{path}: line {number}: the levels of the axes do not rise")
    _require_rows([row for row in rows if row[0] > number and are_numbers(row[1])], len(mesh) ** 3, 3, path)


def require_spi3d(lines: list[str], path: Path) -> None:
    """Raise LutError where a .spi3d does not hold each of its nodes once."""
    rows = [(number, line.split()) for number, line in enumerate(lines, 1) if line.strip() and not line.startswith("#")]
    if len(rows) < 3 or len(rows[2][1]) != 3 or not are_numbers(rows[2][1]):
        return  # its reader says what is wrong
    number, words = rows[1]
    if words != ["3", "3"]:
        raise LutError(f'{path}: line {number}: a .spi3d has the line "3 3" there, not {" ".join(words)[:60]!r}')
    r, g, b = (size_of(word, rows[2][0], path) for word in rows[2][1])
    _require_rows(rows[3:], r * g * b, 6, path)

    # A row holds the place of a node on the three axes, and its colour.
    nodes: set[tuple[str, ...]] = set()
    for number, words in rows[3:]:
        node = tuple(words[:3])
        if not all(word.isdecimal() and int(word) < size for word, size in zip(node, (r, g, b), strict=True)):
            raise LutError(f"{path}: line {number}: {' '.join(node)} is no node of {r} × {g} × {b}")
        if node in nodes:
            raise LutError(f"{path}: line {number}: the node {' '.join(node)} comes twice; another is missing")
        nodes.add(node)


def _require_rows(rows: list[NumberedRow], expected: int, width: int, path: Path) -> None:
    """Raise LutError where there are not `expected` rows, each of `width` numbers."""
    for number, words in rows:
        if len(words) != width:
            raise LutError(f"{path}: line {number}: {len(words)} numbers, where {width} belong")
    if len(rows) < expected:
        raise LutError(f"{path}: the file ends after {len(rows)} of {expected} colours: make or copy it again")
    if len(rows) > expected:
        raise LutError(f"{path}: line {rows[expected][0]}: rows continue after the {expected} that the header states")
