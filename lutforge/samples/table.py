"""Sample tables on disk: samples.csv and samples.parquet, read with validation, written atomically."""

import math
from pathlib import Path

import numpy as np
import polars as pl

from lutforge.arrays import Array
from lutforge.atomic_write import atomic_path
from lutforge.boundary import reading, require_file
from lutforge.errors import SampleError
from lutforge.samples.columns import (
    LENS_COLUMNS,
    MAX_TEXT,
    NUMBER_COLUMNS,
    ORIGIN_COLUMNS,
    POSITION_COLUMNS,
    RAW_COLUMNS,
    RAW_RANGE,
    SRGB_COLUMNS,
    TEXT_COLUMNS,
    WB_COLUMNS,
    is_valid,
    row_problem,
)
from lutforge.samples.read_csv import first_csv_problem, read_csv
from lutforge.samples.read_parquet import read_parquet, write_parquet
from lutforge.samples.sample_set import SampleSet, Text


def read_samples(path: str | Path) -> SampleSet:
    """Read a sample table, .csv or .parquet.

    Columns may stand in any order, unknown ones are ignored. Optional are `wb_*`, `raw_camera`, `x` and `y`, `lens`,
    `focal_mm`, `aperture`, `raw_space`, `developer`, `encoder`; an empty cell of these, or of the exposure, means
    unknown. RAW lies in [-0.05, 1], sRGB in [0, 1]; multipliers are scaled to green = 1. Raises SampleError, which
    names file, line or row, column and text.
    """
    path = Path(path)
    suffix = _suffix(path)
    require_file(path, "a sample table", SampleError, most=8 << 30)
    with reading(path, "a sample table", SampleError):
        return _read(path, suffix)


def _read(path: Path, suffix: str) -> SampleSet:
    frame = read_csv(path) if suffix == ".csv" else read_parquet(path)
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

    Optional columns of which nothing is known are left out, and `raw_camera` where no reference camera stands in.
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
            write_parquet(frame, temporary)


def _suffix(path: Path) -> str:
    suffix = path.suffix.lower()
    if suffix not in (".csv", ".parquet"):
        raise SampleError(f"{path}: a sample table is a .csv or .parquet file")
    return suffix


def _number_array(series: pl.Series) -> Array:
    values: Array = series.fill_null(math.nan).to_numpy()
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
        return first_csv_problem(path, "holds values that cannot be read")
    for row, cells in enumerate(frame.iter_rows(named=True), start=1):
        text = {name: "" if value is None else str(value) for name, value in cells.items()}
        if problem := row_problem(text):
            return SampleError(f"{path}: row {row}: {problem}")
    return SampleError(f"{path}: holds values that cannot be read; write it anew")


def _sample_set(texts: dict[str, Text], numbers: dict[str, Array]) -> SampleSet:
    def stack(names: tuple[str, ...]) -> Array:
        return np.stack([numbers[name] for name in names], axis=1)

    camera = texts["camera"]
    raw_camera = texts.get("raw_camera", camera)
    wb = stack(WB_COLUMNS) if "wb_g" in numbers else np.full((len(camera), 3), math.nan)
    nothing = np.zeros(0, dtype=np.str_)
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
        position=stack(POSITION_COLUMNS) if "x" in numbers else np.zeros((0, 2)),
        lens=texts.get("lens", nothing),
        raw_space=texts.get("raw_space", nothing),
        developer=texts.get("developer", nothing),
        encoder=texts.get("encoder", nothing),
        focal_mm=numbers.get("focal_mm", np.zeros(0)),
        aperture=numbers.get("aperture", np.zeros(0)),
    )


def _frame(samples: SampleSet) -> pl.DataFrame:
    columns: dict[str, pl.Series] = {}
    for name in TEXT_COLUMNS:
        columns[name] = _series(getattr(samples, name))
    columns["exposure_s"] = pl.Series(samples.exposure_s)
    groups: list[tuple[tuple[str, ...], Array]] = [(RAW_COLUMNS, samples.raw), (SRGB_COLUMNS, samples.srgb)]
    if np.isfinite(samples.wb).any():
        groups.append((WB_COLUMNS, samples.wb))
    if np.isfinite(samples.position).any():
        groups.append((POSITION_COLUMNS, samples.position))
    lens = {name: getattr(samples, name)[:, None] for name in LENS_COLUMNS}
    groups.extend(((name,), values) for name, values in lens.items() if np.isfinite(values).any())
    for names, values in groups:
        columns |= {name: pl.Series(np.ascontiguousarray(values[:, i])) for i, name in enumerate(names)}
    if np.any(samples.raw_camera != samples.camera):
        columns["raw_camera"] = _series(samples.raw_camera)
    for name in ("lens", *ORIGIN_COLUMNS):
        if np.any(getattr(samples, name) != ""):
            columns[name] = _series(getattr(samples, name))
    return pl.DataFrame(columns).with_columns(pl.selectors.float().fill_nan(None))


def _series(values: Text) -> pl.Series:
    try:
        return pl.Series(values.tolist(), dtype=pl.String)
    except UnicodeEncodeError:  # a file name that is not UTF-8, so not text either
        names = (str(value).encode("utf-8", "backslashreplace").decode() for value in values)
        return pl.Series(list(names), dtype=pl.String)
