"""samples.parquet → the wanted columns."""

from pathlib import Path

import polars as pl

from lutforge.boundary import reading, silent_stderr
from lutforge.errors import SampleError
from lutforge.samples.columns import MAX_ROWS, NUMBER_COLUMNS, column_type, wanted_columns


def read_parquet(path: Path) -> pl.DataFrame:
    """The wanted columns, text as String and numbers as Float64 (null = unknown). Raises SampleError."""
    with path.open("rb") as file:
        if file.read(4) != b"PAR1":
            raise SampleError(f"{path}: not a Parquet file; write it anew, or save the table as .csv")
    # The Parquet reader panics on damaged files, and prints what it panics about.
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
