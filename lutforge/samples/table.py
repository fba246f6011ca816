"""Sample tables on disk: samples.csv and samples.parquet, read with validation, written atomically."""

import csv
import math
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np
import polars as pl

from lutforge.atomic_write import atomic_path
from lutforge.errors import SampleError
from lutforge.samples.columns import (
    MAX_TEXT,
    NUMBER_COLUMNS,
    OPTIONAL_COLUMNS,
    RAW_COLUMNS,
    RAW_RANGE,
    REQUIRED_COLUMNS,
    SRGB_COLUMNS,
    TEXT_COLUMNS,
    WB_COLUMNS,
    is_valid,
    row_problem,
)
from lutforge.samples.sample_set import Numbers, SampleSet, Text

MAX_BYTES = 8 << 30
MAX_ROWS = 50_000_000
MAX_COLUMNS = 1000
MAX_HEADER = 1 << 16


def read_samples(path: str | Path) -> SampleSet:
    """Read a sample table, .csv or .parquet.

    Columns may stand in any order, unknown ones are ignored, `wb_*` and `raw_camera` are optional, and an
    empty exposure or multiplier cell means unknown (NaN). RAW lies in [-0.05, 1], sRGB in [0, 1]; multipliers
    are scaled to green = 1. Raises SampleError, which names file, line or row, column and offending text.
    """
    path = Path(path)
    suffix = _suffix(path)
    try:
        if path.is_dir():
            raise SampleError(f"{path}: a folder, not a sample table; name the .csv or .parquet file in it")
        size = path.stat().st_size
    except OSError as error:
        raise SampleError(f"{path}: cannot be read ({error.strerror}); check the path") from error
    if size == 0:
        raise SampleError(f"{path}: empty file; a sample table has a header line and one sample a line")
    if size > MAX_BYTES:
        raise SampleError(f"{path}: {size >> 30} GB is too large for a sample table; split it")
    frame = _read_csv(path) if suffix == ".csv" else _read_parquet(path)
    if frame.height == 0:
        raise SampleError(f"{path}: a header but no samples; add one sample a line")
    if any(series.dtype == pl.String and (series.str.len_chars().max() or 0) > MAX_TEXT for series in frame):  # type: ignore[operator]  # the maximum of lengths is an integer
        raise _first_problem(path, frame)
    named = (name for name in TEXT_COLUMNS if name != "patch")
    if any(frame[name].null_count() for name in named):
        raise _first_problem(path, frame)
    texts = {series.name: _text_array(series) for series in frame if series.name not in NUMBER_COLUMNS}
    numbers = {series.name: _number_array(series) for series in frame if series.name in NUMBER_COLUMNS}
    if not is_valid(numbers):
        raise _first_problem(path, frame)
    return _sample_set(texts, numbers)


def write_samples(path: str | Path, samples: SampleSet) -> None:
    """Write a sample table, .csv (UTF-8, 10 decimals) or .parquet (float64), atomically.

    `wb_*` is left out where no multiplier is known, `raw_camera` where no reference camera stands in.
    Raises SampleError on another suffix or an empty set, LutForgeError where the folder cannot be written to.
    """
    path = Path(path)
    suffix = _suffix(path)
    if len(samples) == 0:
        raise SampleError(f"{path}: there are no samples to write")
    frame = _frame(samples)
    with atomic_path(path) as temporary:
        if suffix == ".csv":
            colours = pl.col(*(name for name in frame.columns if name in NUMBER_COLUMNS and name != "exposure_s"))
            frame = frame.with_columns(colours.round(10), pl.col("exposure_s").round_sig_figs(12))
            frame.write_csv(temporary, line_terminator="\n")
        else:
            frame.write_parquet(temporary, compression="zstd")


def _suffix(path: Path) -> str:
    suffix = path.suffix.lower()
    if suffix not in (".csv", ".parquet"):
        raise SampleError(f"{path}: a sample table is a .csv or .parquet file")
    return suffix


def _read_csv(path: Path) -> pl.DataFrame:
    """The wanted columns, text as String and numbers as Float64 (null = empty cell)."""
    header = _csv_header(path)
    wanted = _wanted(path, header)
    typed = {name: _type(name) for name in wanted}
    try:
        frame = _polars_csv(path, header, typed)
    except (pl.exceptions.PolarsError, pl.exceptions.PanicException):
        # Cells with blanks around the number, or quoted: slower, as text.
        try:
            frame = _polars_csv(path, header, dict.fromkeys(wanted, pl.String()))
            frame = frame.with_columns(pl.col(name).cast(kind) for name, kind in typed.items())
        except (pl.exceptions.PolarsError, pl.exceptions.PanicException) as error:
            reason = " ".join(str(error).split())[:100]
            raise _first_csv_problem(path, f"cannot be read as CSV ({reason})") from error
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


def _first_csv_problem(path: Path, otherwise: str) -> SampleError:
    return _scan_csv(path) or SampleError(f"{path}: {otherwise}; save the table as comma-separated UTF-8 text")


def _scan_csv(path: Path) -> SampleError | None:
    """The first offence in the file, found by reading it again slowly; None where there is none."""
    header = _csv_header(path)
    wanted = _wanted(path, header)
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


def _read_parquet(path: Path) -> pl.DataFrame:
    """The wanted columns, text as String and numbers as Float64 (null = unknown)."""
    with path.open("rb") as file:
        if file.read(4) != b"PAR1":
            raise SampleError(f"{path}: not a Parquet file; write it anew, or save the table as .csv")
    try:
        scan = pl.scan_parquet(path, glob=False)
        schema = scan.collect_schema()
        names = {name.strip().lower(): name for name in schema.names()}
        if len(names) != len(schema):
            raise SampleError(f"{path}: two columns have the same name; keep one of them")
        wanted = _wanted(path, list(names))
        rows = int(scan.select(pl.len()).collect().item())
        if rows > MAX_ROWS:
            raise SampleError(f"{path}: {rows} rows, more than {MAX_ROWS}; split the table")
        for name in wanted:
            kind = schema[names[name]]
            if name in NUMBER_COLUMNS and not (kind.is_numeric() or kind == pl.Null):
                raise SampleError(f"{path}: column {name} holds {kind}; write it as numbers")
        types = [pl.col(names[name]).alias(name).cast(_type(name)) for name in wanted]
        frame = scan.select(types).collect()
        return frame.with_columns(pl.selectors.string().str.strip_chars().replace("", None))
    except (pl.exceptions.PolarsError, pl.exceptions.PanicException, OSError, ValueError) as error:
        reason = " ".join(str(error).split())[:100]
        raise SampleError(f"{path}: damaged Parquet file ({reason}); write it anew") from error


def _type(name: str) -> pl.DataType:
    return pl.Float64() if name in NUMBER_COLUMNS else pl.String()


def _wanted(path: Path, names: list[str]) -> list[str]:
    """The known columns among these. Raises SampleError on missing, doubled or too many columns."""
    if len(names) > MAX_COLUMNS:
        raise SampleError(f"{path}: {len(names)} columns; a sample table has at most {MAX_COLUMNS}")
    doubled = sorted({name for name in names if name and names.count(name) > 1})
    if doubled:
        raise SampleError(f"{path}: column {doubled[0]!r} occurs twice; keep one of them")
    missing = [name for name in REQUIRED_COLUMNS if name not in names]
    if any(name in names for name in WB_COLUMNS):
        missing += [name for name in WB_COLUMNS if name not in names]
    if missing:
        raise SampleError(
            f"{path}: missing column{'s' * (len(missing) > 1)} {', '.join(missing)};"
            " the first line of a sample table names its columns"
        )
    return [name for name in names if name in REQUIRED_COLUMNS or name in OPTIONAL_COLUMNS]


def _number_array(series: pl.Series) -> Numbers:
    values: Numbers = series.fill_null(math.nan).to_numpy()
    return values


def _text_array(series: pl.Series) -> Text:
    """Names repeat: each distinct one is converted once."""
    series = series.fill_null("")
    if series.name == "patch":
        return np.array(series.to_list(), dtype=np.str_)
    distinct = series.unique(maintain_order=True)
    names = np.array(distinct.to_list(), dtype=np.str_)
    repeated: Text = names[series.cast(pl.Enum(distinct)).to_physical().to_numpy()]
    return repeated


def _first_problem(path: Path, frame: pl.DataFrame) -> SampleError:
    if path.suffix.lower() == ".csv":
        return _first_csv_problem(path, "holds values that cannot be read")
    for row, cells in enumerate(frame.iter_rows(named=True), start=1):
        text = {name: "" if value is None else str(value) for name, value in cells.items()}
        if problem := row_problem(text):
            return SampleError(f"{path}: row {row}: {problem}")
    return SampleError(f"{path}: holds values that cannot be read; write it anew")


def _sample_set(texts: dict[str, Text], numbers: dict[str, Numbers]) -> SampleSet:
    def stack(names: tuple[str, ...]) -> Numbers:
        return np.stack([numbers[name] for name in names], axis=1)

    camera = texts["camera"]
    raw_camera = texts.get("raw_camera", camera)
    wb = stack(WB_COLUMNS) if "wb_g" in numbers else np.full((len(camera), 3), math.nan)
    return SampleSet(
        camera=camera,
        style=texts["style"],
        white_balance=texts["white_balance"],
        shot=texts["shot"],
        patch=texts["patch"],
        exposure_s=numbers["exposure_s"],
        raw=np.clip(stack(RAW_COLUMNS), *RAW_RANGE),
        srgb=np.clip(stack(SRGB_COLUMNS), 0.0, 1.0),
        wb=wb / wb[:, 1:2],
        raw_camera=camera if raw_camera is camera else np.where(raw_camera == "", camera, raw_camera),
    )


def _frame(samples: SampleSet) -> pl.DataFrame:
    columns: dict[str, pl.Series] = {}
    for name in TEXT_COLUMNS:
        columns[name] = _series(getattr(samples, name))
    columns["exposure_s"] = pl.Series(samples.exposure_s)
    groups = [(RAW_COLUMNS, samples.raw), (SRGB_COLUMNS, samples.srgb)]
    if np.isfinite(samples.wb).any():
        groups.append((WB_COLUMNS, samples.wb))
    for names, values in groups:
        columns |= {name: pl.Series(np.ascontiguousarray(values[:, i])) for i, name in enumerate(names)}
    if np.any(samples.raw_camera != samples.camera):
        columns["raw_camera"] = _series(samples.raw_camera)
    return pl.DataFrame(columns).with_columns(pl.selectors.float().fill_nan(None))


def _series(values: Text) -> pl.Series:
    try:
        return pl.Series(values.tolist(), dtype=pl.String)
    except UnicodeEncodeError:  # a file name that is not UTF-8, so not text either
        names = (str(value).encode("utf-8", "backslashreplace").decode() for value in values)
        return pl.Series(list(names), dtype=pl.String)
