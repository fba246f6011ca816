"""The columns of a sample table: their names, their ranges, and the check of their values."""

import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lutforge.errors import SampleError

TEXT_COLUMNS = ("camera", "style", "white_balance", "shot", "patch")
RAW_COLUMNS = ("raw_r", "raw_g", "raw_b")
SRGB_COLUMNS = ("srgb_r", "srgb_g", "srgb_b")
WB_COLUMNS = ("wb_r", "wb_g", "wb_b")
REQUIRED_COLUMNS = (*TEXT_COLUMNS, "exposure_s", *RAW_COLUMNS, *SRGB_COLUMNS)
POSITION_COLUMNS = ("x", "y")
XYZ_COLUMNS = tuple(f"{channel}_{axis}" for channel in ("red", "green", "blue") for axis in "xyz")
SHOT_COLUMNS = ("focal_mm", "aperture", "d65_r", "d65_b")
OPTIONAL_COLUMNS = (
    *WB_COLUMNS, *POSITION_COLUMNS, *SHOT_COLUMNS, *XYZ_COLUMNS, "raw_camera", "lens", "raw_space", "developer",
    "chart", "chart_light", "dng_camera",
)  # fmt: skip
NUMBER_COLUMNS = (
    "exposure_s", *RAW_COLUMNS, *SRGB_COLUMNS, *WB_COLUMNS, *POSITION_COLUMNS, *SHOT_COLUMNS, *XYZ_COLUMNS,
)  # fmt: skip
COLUMNS_OF = {
    "raw": RAW_COLUMNS, "srgb": SRGB_COLUMNS, "wb": WB_COLUMNS, "position": POSITION_COLUMNS, "from_xyz": XYZ_COLUMNS,
}  # fmt: skip
"""The columns of a table that one array of a SampleSet holds; the others are arrays of their own."""

COLOUR_ROUNDING = 1e-6
"""A colour may lie this far outside its range through rounding; it is set to the end of the range."""
RAW_RANGE = (-0.05, 1.0)
"""RAW after black subtraction: noise of dark surfaces falls a little below 0 and is kept."""
MULTIPLIER_RANGE = (1e-3, 1e3)
"""White-balance multipliers relative to green that any camera could have."""
LARGEST_MATRIX_ENTRY = 1e5
"""Entries of a matrix from XYZ to RAW are below this: LibRaw's and those of DNG files are of the order of 1 or 1e4."""
MAX_ROWS = 50_000_000
"""Rows of a table, at most."""
MOST_COLUMNS = 1000
"""Columns of a table, at most."""
MAX_TEXT = 200
"""Characters in a cell."""


def known_columns(path: Path, names: list[str]) -> list[str]:
    """The known columns among these. Raises SampleError on missing, doubled or too many columns."""
    if len(names) > MOST_COLUMNS:
        raise SampleError(f"{path}: {len(names)} columns; a sample table has at most {MOST_COLUMNS}")
    doubled = sorted({name for name in names if name and names.count(name) > 1})
    if doubled:
        raise SampleError(f"{path}: column {doubled[0]!r} occurs twice; keep one of them")
    missing = [name for name in REQUIRED_COLUMNS if name not in names]
    for group in (WB_COLUMNS, POSITION_COLUMNS, XYZ_COLUMNS):
        if any(name in names for name in group):
            missing += [name for name in group if name not in names]
    if missing:
        raise SampleError(
            f"{path}: missing column{'s' * (len(missing) > 1)} {', '.join(missing)};"
            " the first line of a sample table names its columns"
        )
    return [name for name in names if name in REQUIRED_COLUMNS or name in OPTIONAL_COLUMNS]


def problem_in(
    columns: Mapping[str, NDArray[Any]], shown: Callable[[str, int], str] | None = None
) -> tuple[int, str] | None:
    """The first row of columns (n,) with a value that is not allowed, and the problem; None where all are allowed.

    shown: column and row → the text of the cell; without it messages have the number.
    """
    text_of = shown or (lambda name, row: f"{columns[name][row]:.10g}" if name in NUMBER_COLUMNS else "")
    problems: list[tuple[int, str]] = []
    for name, values in columns.items():
        if name in NUMBER_COLUMNS:
            low, high = _limits(name)
            may_be_unknown = name == "exposure_s" or name in OPTIONAL_COLUMNS
            wrong = ~((values >= low) & (values <= high) | np.isnan(values) & may_be_unknown)
        else:
            wrong = (values == "") & (name in TEXT_COLUMNS and name != "patch")
        if wrong.any():
            row = int(np.argmax(wrong))
            problems.append((row, _cell_problem(name, text_of(name, row))))
    if "wb_g" in columns:
        wb = np.stack([columns[name] for name in WB_COLUMNS], axis=1)
        with np.errstate(all="ignore"):
            ratio = wb / wb[:, 1:2]
        plausible = (ratio >= MULTIPLIER_RANGE[0]) & (ratio <= MULTIPLIER_RANGE[1])
        wrong = ~(np.isnan(wb).all(axis=1) | plausible.all(axis=1))
        if wrong.any():
            row = int(np.argmax(wrong))
            partly = "give all three, or leave all three empty"
            problem = partly if np.isnan(wb[row]).any() else "no camera has such multipliers"
            cells = ",".join(text_of(name, row) for name in WB_COLUMNS)
            problems.append((row, f"wb_r,wb_g,wb_b is {cells!r}; {problem}"))
    return min(problems, key=lambda problem: problem[0], default=None)


def _limits(name: str) -> tuple[float, float]:
    """The lowest and the highest number of a column."""
    if name in RAW_COLUMNS:
        return RAW_RANGE[0] - COLOUR_ROUNDING, RAW_RANGE[1] + COLOUR_ROUNDING
    if name in SRGB_COLUMNS:
        return -COLOUR_ROUNDING, 1 + COLOUR_ROUNDING
    if name in POSITION_COLUMNS:
        return -1.0, 1.0
    if name in XYZ_COLUMNS:
        return -LARGEST_MATRIX_ENTRY, LARGEST_MATRIX_ENTRY
    return math.ulp(0.0), math.nextafter(math.inf, 0.0)


def _cell_problem(name: str, cell: str) -> str:
    """The problem with a cell whose value its column does not allow, in words."""
    if not cell:
        missing = "a number" if name in NUMBER_COLUMNS else f"the {name.replace('_', ' ')} of the sample"
        return f"{name} is empty; write {missing}"
    shown = f"{name} is {cell[:40]}"
    if not math.isfinite(float(cell)):
        return f"{shown}; write a finite number"
    if name in RAW_COLUMNS:
        return f"{shown}; RAW lies in [0, 1]: subtract the black level and divide by (white - black)"
    if name in SRGB_COLUMNS:
        return f"{shown}; sRGB lies in [0, 1]: divide 8-bit JPEG values by 255"
    if name in POSITION_COLUMNS:
        return f"{shown}; positions lie in [-1, 1]: half the picture's diagonal is 1"
    if name in XYZ_COLUMNS:
        return f"{shown}; the matrix from XYZ to RAW has numbers within ±{LARGEST_MATRIX_ENTRY:g}, or empty cells"
    meaning = {"exposure_s": "exposure time in seconds", "focal_mm": "focal length in mm", "aperture": "f-number"}
    return f"{shown}; the {meaning.get(name, 'multiplier')} is positive, or the cell empty where it is unknown"
