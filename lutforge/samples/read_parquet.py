"""samples.parquet → the wanted columns."""

import hashlib
import sys
from contextlib import suppress
from pathlib import Path

import polars as pl

from lutforge import child_processes
from lutforge.boundary import reading, silent_stderr
from lutforge.errors import SampleError
from lutforge.samples.columns import MAX_ROWS, NUMBER_COLUMNS, column_type, wanted_columns

_DIGEST = "lutforge.pages"
"""Name of the footer's entry."""


def read_parquet(path: Path) -> pl.DataFrame:
    """The wanted columns, text as String and numbers as Float64 (null = unknown). Raises SampleError."""
    with path.open("rb") as file:
        if file.read(4) != b"PAR1":
            raise SampleError(f"{path}: not a Parquet file; write it anew, or save the table as .csv")
    if not _is_as_written(path):
        _require_readable(path)
    with reading(path, "a Parquet file", SampleError), silent_stderr():
        scan = pl.scan_parquet(path, glob=False)
        schema = scan.collect_schema()
        names = {name.strip().lower(): name for name in schema.names()}
        if len(names) != len(schema):
            raise SampleError(f"{path}: two columns have the same name; keep one of them")
        wanted = wanted_columns(path, list(names))
        rows = int(scan.select(pl.len()).collect().item())
        if rows > MAX_ROWS:
            raise SampleError(f"{path}: {rows} rows, more than {MAX_ROWS}; split the table")
        for name in wanted:
            kind = schema[names[name]]
            if name in NUMBER_COLUMNS and not (kind.is_numeric() or kind == pl.Null):
                raise SampleError(f"{path}: column {name} holds {kind}; write it as numbers")
        types = [pl.col(names[name]).alias(name).cast(column_type(name)) for name in wanted]
        frame = scan.select(types).collect()
        return frame.with_columns(pl.selectors.string().str.strip_chars().replace("", None))


def write_parquet(frame: pl.DataFrame, path: Path) -> None:
    """Write a table whose footer holds the digest of the pages before it. Raises OSError."""
    try:
        frame.write_parquet(path, compression="zstd")
        frame.write_parquet(path, compression="zstd", metadata={_DIGEST: _digest(path)})
    except pl.exceptions.ComputeError:  # an OSError, which polars 2.1 hands on for .csv only
        raise OSError(None, "it was not written as a whole; is the disk full?") from None


def _is_as_written(path: Path) -> bool:
    """True where the pages have the digest that the footer states."""
    with suppress(Exception), silent_stderr():
        return pl.read_parquet_metadata(path).get(_DIGEST) == _digest(path)
    return False


def _digest(path: Path) -> str:
    digest = hashlib.sha256()
    with path.open("rb") as file:
        left = file.seek(-8, 2) - int.from_bytes(file.read(4), "little")
        file.seek(0)
        while left > 0 and (part := file.read(min(left, 1 << 20))):
            digest.update(part)
            left -= len(part)
    return digest.hexdigest()


def _require_readable(path: Path) -> None:
    """Raise SampleError where the Parquet reader does not get through a file, tried in a process of its own.

    Polars 2.1 ends its process where a damaged page claims more memory than there is.
    """
    code = "import sys, polars; polars.read_parquet(sys.argv[1], glob=False)"
    tried = child_processes.run([sys.executable, "-c", code, str(path)], 600)
    if tried.returncode != 0:
        raise SampleError(f"{path}: cannot be read as a Parquet file (it is damaged); write it anew")
