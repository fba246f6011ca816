"""samples.csv → the wanted columns, and the line of the first fault."""

import csv
from collections.abc import Iterator, Mapping
from pathlib import Path

import polars as pl

from lutforge.errors import SampleError
from lutforge.samples.columns import MAX_ROWS, REQUIRED_COLUMNS, column_type, row_problem, wanted_columns

MAX_HEADER = 1 << 16


def read_csv(path: Path) -> pl.DataFrame:
    """The wanted columns, text as String and numbers as Float64 (null = empty cell). Raises SampleError."""
    header = _csv_header(path)
    wanted = wanted_columns(path, header)
    typed = {name: column_type(name) for name in wanted}
    try:
        frame = _polars_csv(path, header, typed)
    except (pl.exceptions.PolarsError, pl.exceptions.PanicException):
        # Cells with blanks around the number, or quoted: slower, as text.
        try:
            frame = _polars_csv(path, header, dict.fromkeys(wanted, pl.String()))
            frame = frame.with_columns(pl.col(name).cast(kind) for name, kind in typed.items())
        except (pl.exceptions.PolarsError, pl.exceptions.PanicException) as error:
            reason = " ".join(str(error).split())[:100]
            raise first_csv_problem(path, f"cannot be read as CSV ({reason})") from error
    return frame.filter(~pl.all_horizontal(pl.all().is_null()))


def _polars_csv(path: Path, header: list[str], types: Mapping[str, pl.DataType]) -> pl.DataFrame:
    names = [name if name in types else f"ignored {i}" for i, name in enumerate(header)]
    frame = pl.read_csv(
        path,
        has_header=False,
        skip_lines=1,
        schema={name: types.get(name, pl.String()) for name in names},
        columns=[i for i, name in enumerate(names) if name in types or i == len(names) - 1],
        glob=False,
        n_rows=MAX_ROWS + 1,
        raise_if_empty=False,
    )
    if frame.height > MAX_ROWS:
        raise SampleError(f"{path}: more than {MAX_ROWS} rows; split the table")
    # Polars fills up rows that end early, which is how a cut-off number looks: only those have no last cell.
    if frame[names[-1]].null_count() and _any_short_line(path, len(names)):
        problem = _scan_csv(path)
        if problem:
            raise problem
    frame = frame.select(name for name in names if name in types)
    return frame.with_columns(pl.selectors.string().str.strip_chars().replace("", None))


def _any_short_line(path: Path, count: int) -> bool:
    """Whether a line has fewer commas than the header: a short row, or part of a cell of several lines."""
    lines = pl.read_csv(path, has_header=False, separator="\x1f", quote_char=None, new_columns=["line"])
    text = lines["line"].drop_nulls().str.strip_chars()
    return bool(((text != "") & (text.str.count_matches(",", literal=True) < count - 1)).any())


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
    with path.open(encoding="utf-8-sig", newline="") as file:
        reader = csv.reader(file)
        next(reader)
        line = reader.line_num + 1
        for record in reader:
            if any(cell.strip() for cell in record):
                yield line, record
            line = reader.line_num + 1


def first_csv_problem(path: Path, otherwise: str) -> SampleError:
    """Return the first problem of a table that polars refused, in words; `otherwise` where none is found."""
    return _scan_csv(path) or SampleError(f"{path}: {otherwise}; save the table as comma-separated UTF-8 text")


def _scan_csv(path: Path) -> SampleError | None:
    """The first offence in the file, found by reading it again slowly; None where there is none."""
    header = _csv_header(path)
    wanted = wanted_columns(path, header)
    line = 1
    try:
        for line, record in _csv_records(path):
            if len(record) != len(header):
                return SampleError(
                    f"{path}: line {line}: {len(record)} cells where the header has {len(header)};"
                    " write one cell a column, and quote text that holds a comma"
                )
            cells = {name: record[header.index(name)].strip() for name in wanted}
            if problem := row_problem(cells):
                return SampleError(f"{path}: line {line}: {problem}")
    except UnicodeDecodeError:
        return SampleError(f"{path}: after line {line}: not UTF-8 text; save the table as a UTF-8 file")
    except csv.Error as error:
        return SampleError(f"{path}: after line {line}: not CSV ({error}); save the table as comma-separated text")
    return None
