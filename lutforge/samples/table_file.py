"""Files of sample tables, columns by name: .csv, and .npz for large ones, read with validation, written atomically."""

import csv
import math
import re
import zipfile
from collections.abc import Iterator
from itertools import islice
from pathlib import Path
from typing import Any, cast

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from lutforge.atomic_write import atomic_path
from lutforge.boundary import opened_archive, reading, require_file
from lutforge.errors import SampleError
from lutforge.samples.columns import (
    MAX_ROWS,
    MAX_TEXT,
    NUMBER_COLUMNS,
    REQUIRED_COLUMNS,
    known_columns,
    problem_in,
)

MAX_HEADER = 1 << 16
ROWS_AT_A_TIME = 50_000
"""Rows of a .csv whose cells are kept as text until their columns are arrays."""

NUMBER_CELL = re.compile(r"\s*([+-]?((\d+\.?\d*|\.\d+)(e[+-]?\d+)?|nan|inf(inity)?))?\s*", re.ASCII | re.IGNORECASE)
"""A cell that is a number, or empty."""

Columns = dict[str, NDArray[Any]]
"""Arrays (n,) of text or float64 by the names of their columns."""


def read_columns(path: Path) -> Columns:
    """Read the known columns of a table, text and float64. Raises SampleError, in one line, on anything else."""
    suffix = _suffix(path)
    require_file(path, "a sample table", SampleError, most=8 << 30)
    with reading(path, "a sample table", SampleError):
        return _read_csv(path) if suffix == ".csv" else _read_npz(path)


def write_columns(path: Path, columns: Columns) -> None:
    """Write the columns of a table. Raises SampleError on another suffix or without rows."""
    suffix = _suffix(path)
    if not len(columns["camera"]):
        raise SampleError(f"{path}: there are no samples to write")
    with atomic_path(path) as temporary:
        if suffix == ".npz":
            with temporary.open("wb") as file:
                np.savez_compressed(file, **cast(dict[str, Any], columns))
            return
        cells: list[list[str]] = []
        for name, values in columns.items():
            if name not in NUMBER_COLUMNS:
                cells.append(values.tolist())
            elif name == "exposure_s":
                cells.append(["" if math.isnan(value) else f"{value:.12g}" for value in values.tolist()])
            else:
                cells.append(["" if math.isnan(value) else repr(value) for value in np.round(values, 10).tolist()])
        # A file name that is not UTF-8 is not text either: its bytes are written as escapes.
        with temporary.open("w", encoding="utf-8", errors="backslashreplace", newline="") as text:
            writer = csv.writer(text, lineterminator="\n")
            writer.writerow(columns)
            writer.writerows(zip(*cells, strict=True))


def is_table(path: str | Path) -> bool:
    """True for a sample table: any .csv, and an .npz that holds no profile."""
    path = Path(path)
    if path.suffix.lower() != ".npz" or not zipfile.is_zipfile(path):
        return path.suffix.lower() == ".csv"
    with reading(path, "a sample table", SampleError), opened_archive(path, SampleError) as archive:
        return "raw_r.npy" in (name.strip().lower() for name in archive.namelist())


def _suffix(path: Path) -> str:
    suffix = path.suffix.lower()
    if suffix not in (".csv", ".npz"):
        raise SampleError(f"{path}: a sample table is a .csv or .npz file")
    return suffix


def _read_npz(path: Path) -> Columns:
    """The known columns. Each header is checked before its array is allocated."""
    if not zipfile.is_zipfile(path):
        raise SampleError(f"{path}: not a NumPy file (.npz); write it anew, or save the table as .csv")
    with opened_archive(path, SampleError) as archive:
        entries = archive.namelist()
        if "profile.json" in entries:
            raise SampleError(f"{path}: a camera profile; name sample tables (.csv, .npz) or RAW files instead")
        names = [entry.removesuffix(".npy").strip().lower() for entry in entries]
        columns: Columns = {}
        rows = None
        for name in known_columns(path, names):
            columns[name] = _read_column(archive, entries[names.index(name)], name, rows)
            rows = len(columns[name])
    if (problem := problem_in(columns)) is not None:
        raise SampleError(f"{path}: row {problem[0] + 1}: {problem[1]}")
    return columns


def _read_column(archive: zipfile.ZipFile, entry: str, name: str, rows: int | None) -> NDArray[Any]:
    with archive.open(entry) as stream:
        if npy.read_magic(stream) != (1, 0):
            raise SampleError(f"column {name} has an unknown header; write it by numpy.savez_compressed")
        shape, _, dtype = npy.read_array_header_1_0(stream)
        kinds, width = ("fiu", 8) if name in NUMBER_COLUMNS else ("U", 4 * MAX_TEXT)
        if dtype.kind not in kinds or dtype.itemsize > width:
            kind = "numbers" if name in NUMBER_COLUMNS else f"text of at most {MAX_TEXT} characters"
            raise SampleError(f"column {name} holds {dtype}; write it as {kind}")
        if len(shape) != 1 or (rows is not None and shape[0] != rows):
            raise SampleError(f"column {name} has shape {shape}; each column holds one value a row")
        if shape[0] > MAX_ROWS:
            raise SampleError(f"{shape[0]} rows, more than {MAX_ROWS}; split the table")
        size = shape[0] * dtype.itemsize
        if archive.getinfo(entry).file_size != stream.tell() + size:
            raise SampleError(f"column {name} is not as long as it says; write it anew")
        values: NDArray[Any] = np.frombuffer(stream.read(size), dtype)
    return values.astype(np.float64 if name in NUMBER_COLUMNS else dtype.newbyteorder("="), copy=False)


def _read_csv(path: Path) -> Columns:
    """The known columns, text and float64 (NaN: an empty cell)."""
    header = _csv_header(path)
    places = {name: header.index(name) for name in known_columns(path, header)}
    parts: dict[str, list[NDArray[Any]]] = {
        name: [np.zeros(0, np.float64 if name in NUMBER_COLUMNS else np.str_)] for name in places
    }
    rows = 0
    records = _csv_records(path)
    while part := list(islice(records, ROWS_AT_A_TIME)):
        for name, values in _columns_of(path, part, len(header), places).items():
            parts[name].append(values)
        rows += len(part)
        if rows > MAX_ROWS:
            raise SampleError(f"{path}: more than {MAX_ROWS} rows; split the table")
    return {name: np.concatenate(values) for name, values in parts.items()}


def _columns_of(path: Path, part: list[tuple[int, list[str]]], width: int, places: dict[str, int]) -> Columns:
    """The columns of some records, each with the number of its line. Raises SampleError on what no table may hold."""
    for line, record in part:
        if len(record) != width:
            raise SampleError(
                f"{path}: line {line}: {len(record)} cells where the header has {width}; write one cell a column, and "
                "quote text that holds a comma"
            )
    cells = list(zip(*(record for _, record in part), strict=True))
    columns: Columns = {}
    for name, place in places.items():
        texts = cells[place]
        column_text = "\n".join(texts)
        problem = ""
        if max(map(len, texts)) > MAX_TEXT or "\0" in column_text:
            row = next(row for row, text in enumerate(texts) if len(text) > MAX_TEXT or "\0" in text)
            problem = f"holds {len(texts[row])} characters; a cell has at most {MAX_TEXT}, none of them zero"
        elif name not in NUMBER_COLUMNS:
            columns[name] = np.array([text.strip() for text in texts], dtype=np.str_)
        else:
            try:
                if "_" in column_text or not column_text.isascii():
                    raise ValueError
                columns[name] = np.array([float(text) if text and not text.isspace() else math.nan for text in texts])
            except ValueError:
                row = next(row for row, text in enumerate(texts) if not NUMBER_CELL.fullmatch(text))
                problem = f"is {texts[row].strip()[:40]!r}, not a number; write it with a decimal point, as 0.25"
        if problem:
            raise SampleError(f"{path}: line {part[row][0]}: {name} {problem}")
    if (wrong := problem_in(columns, lambda name, row: cells[places[name]][row].strip())) is not None:
        raise SampleError(f"{path}: line {part[wrong[0]][0]}: {wrong[1]}")
    return columns


def _csv_header(path: Path) -> list[str]:
    """The column names, lower case, checked to be those of a comma-separated text file."""
    with path.open("rb") as file:
        head = file.read(MAX_HEADER)
    if head.startswith((b"\xff\xfe", b"\xfe\xff")) or b"\0" in head:
        line_number = head.partition(b"\0")[0].count(b"\n") + 1
        raise SampleError(f"{path}: line {line_number}: not UTF-8 text; save the table as a comma-separated UTF-8 file")
    line, newline, _ = head.partition(b"\n")
    if not newline and b"\r" in line:
        raise SampleError(f"{path}: lines end with CR alone; save the table with LF or CRLF line ends")
    if not newline and len(head) == MAX_HEADER:
        raise SampleError(f"{path}: line 1: no header within {MAX_HEADER} bytes; is this a sample table?")
    try:
        text = line.decode("utf-8-sig").rstrip("\r")
        header = [name.strip().lower() for name in next(csv.reader([text], strict=True), [])]
    except UnicodeDecodeError as error:
        raise SampleError(
            f"{path}: line 1: byte {error.start + 1} is not UTF-8; save the table as comma-separated UTF-8"
        ) from error
    except csv.Error as error:
        raise SampleError(f"{path}: line 1: header cannot be read ({error}); write plain column names") from error
    for sign, name in ((";", "semicolons"), ("\t", "tabs")):
        if len(header) < len(REQUIRED_COLUMNS) <= text.count(sign) + 1:
            raise SampleError(f"{path}: line 1: separated by {name}; save it comma separated, with decimal points")
    return header


def _csv_records(path: Path) -> Iterator[tuple[int, list[str]]]:
    """Each record after the header with the number of the line it starts on; empty rows are skipped."""
    line = 1
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            reader = csv.reader(file)
            next(reader)
            line = reader.line_num + 1
            for record in reader:
                if any(record) and any(cell.strip() for cell in record):
                    yield line, record
                line = reader.line_num + 1
    except UnicodeDecodeError as error:
        raise SampleError(f"{path}: after line {line}: not UTF-8 text; save the table as a UTF-8 file") from error
    except csv.Error as error:
        problem = f"{path}: after line {line}: not CSV ({error}); save the table as comma-separated text"
        raise SampleError(problem) from error
