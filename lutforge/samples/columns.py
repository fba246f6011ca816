"""What a sample table holds: its columns, their ranges, and what is wrong with a row, in words."""

import math
from pathlib import Path

import numpy as np

from lutforge.arrays import Array
from lutforge.errors import SampleError

TEXT_COLUMNS = ("camera", "style", "white_balance", "shot", "patch")
RAW_COLUMNS = ("raw_r", "raw_g", "raw_b")
SRGB_COLUMNS = ("srgb_r", "srgb_g", "srgb_b")
WB_COLUMNS = ("wb_r", "wb_g", "wb_b")
REQUIRED_COLUMNS = (*TEXT_COLUMNS, "exposure_s", *RAW_COLUMNS, *SRGB_COLUMNS)
POSITION_COLUMNS = ("x", "y")
SHOT_COLUMNS = ("focal_mm", "aperture", "d65_r", "d65_b")
ORIGIN_COLUMNS = ("raw_space", "developer")
OPTIONAL_COLUMNS = (*WB_COLUMNS, "raw_camera", *POSITION_COLUMNS, "lens", *SHOT_COLUMNS, *ORIGIN_COLUMNS)
NUMBER_COLUMNS = ("exposure_s", *RAW_COLUMNS, *SRGB_COLUMNS, *WB_COLUMNS, *POSITION_COLUMNS, *SHOT_COLUMNS)

ROUNDING = 1e-6
"""How far a colour may lie outside its range through rounding; it is set to the end of the range."""
RAW_RANGE = (-0.05, 1.0)
"""RAW after black subtraction: noise of dark surfaces falls a little below 0 and is kept."""
MULTIPLIER_RANGE = (1e-3, 1e3)
"""White-balance multipliers relative to green that any camera could have."""
MAX_ROWS = 50_000_000
MAX_TEXT = 200
"""Characters in a cell."""


def wanted_columns(path: Path, names: list[str]) -> list[str]:
    """The known columns among these. Raises SampleError on missing, doubled or too many columns."""
    if len(names) > 1000:
        raise SampleError(f"{path}: {len(names)} columns; a sample table has at most 1000")
    doubled = sorted({name for name in names if name and names.count(name) > 1})
    if doubled:
        raise SampleError(f"{path}: column {doubled[0]!r} occurs twice; keep one of them")
    missing = [name for name in REQUIRED_COLUMNS if name not in names]
    for group in (WB_COLUMNS, POSITION_COLUMNS):
        if any(name in names for name in group):
            missing += [name for name in group if name not in names]
    if missing:
        raise SampleError(
            f"{path}: missing column{'s' * (len(missing) > 1)} {', '.join(missing)};"
            " the first line of a sample table names its columns"
        )
    return [name for name in names if name in REQUIRED_COLUMNS or name in OPTIONAL_COLUMNS]


def is_valid(numbers: dict[str, Array]) -> bool:
    """Whether the numbers of every row pass `row_problem`, in whole columns."""
    with np.errstate(all="ignore"):
        for name, values in numbers.items():
            low, high = _limits(name)
            unknown = np.isnan(values) if _may_be_unknown(name) else False
            if not np.all(unknown | ((values >= low) & (values <= high))):
                return False
        if "wb_g" not in numbers:
            return True
        wb = np.stack([numbers[name] for name in WB_COLUMNS], axis=1)
        unknown = np.isnan(wb)
        ratio = wb / wb[:, 1:2]
        plausible = (ratio >= MULTIPLIER_RANGE[0]) & (ratio <= MULTIPLIER_RANGE[1])
        return bool(np.all(unknown.all(axis=1) | plausible.all(axis=1)))


def first_problem(exposure_s: Array, raw: Array, srgb: Array, wb: Array) -> str | None:
    """What is wrong with the first row of (n,) and (n, 3) that fails `row_problem`, in words, or None."""
    colours = zip((*RAW_COLUMNS, *SRGB_COLUMNS, *WB_COLUMNS), np.hstack([raw, srgb, wb]).T, strict=True)
    numbers = {"exposure_s": exposure_s, **dict(colours)}
    if is_valid(numbers):
        return None
    rows = ({name: f"{values[row]:.10g}" for name, values in numbers.items()} for row in range(len(raw)))
    return next((f"row {row}: {problem}" for row, cells in enumerate(rows) if (problem := row_problem(cells))), None)


def _may_be_unknown(name: str) -> bool:
    return name == "exposure_s" or name in OPTIONAL_COLUMNS


def _limits(name: str) -> tuple[float, float]:
    if name in RAW_COLUMNS:
        return RAW_RANGE[0] - ROUNDING, RAW_RANGE[1] + ROUNDING
    if name in SRGB_COLUMNS:
        return -ROUNDING, 1 + ROUNDING
    if name in POSITION_COLUMNS:
        return -1.0, 1.0
    return math.ulp(0.0), math.nextafter(math.inf, 0.0)


def row_problem(cells: dict[str, str]) -> str | None:
    """What is wrong with one row, in words, or None."""
    for name, cell in cells.items():
        if len(cell) > MAX_TEXT:
            return f"{name} holds {len(cell)} characters; a cell has at most {MAX_TEXT}"
        if "\0" in cell:
            return f"{name} holds a byte of zero, which is not text; write the table anew"
        problem = _number_problem(name, cell) if name in NUMBER_COLUMNS else None
        if not cell and name in TEXT_COLUMNS and name != "patch":
            problem = f"{name} is empty; write the {name.replace('_', ' ')} of the sample"
        if problem:
            return problem
    multipliers = [cells.get(name, "") for name in WB_COLUMNS]
    known = [cell for cell in multipliers if cell and not math.isnan(float(cell))]
    if known and len(known) < 3:
        return f"wb_r,wb_g,wb_b is {','.join(multipliers)!r}; give all three, or leave all three empty"
    if known:
        r, g, b = (float(cell) for cell in known)
        if not all(MULTIPLIER_RANGE[0] <= value / g <= MULTIPLIER_RANGE[1] for value in (r, b)):
            return f"wb_r,wb_g,wb_b is {','.join(multipliers)!r}; no camera has such multipliers"
    return None


def _number_problem(name: str, cell: str) -> str | None:
    if not cell:
        return None if _may_be_unknown(name) else f"{name} is empty; write a number"
    try:
        value = float(cell)
        if "_" in cell or not cell.isascii():
            raise ValueError
    except ValueError:
        return f"{name} is {cell[:40]!r}, not a number; write it with a decimal point, for example 0.25"
    if math.isnan(value) and _may_be_unknown(name):
        return None
    low, high = _limits(name)
    if low <= value <= high:
        return None
    shown = f"{name} is {cell[:40]}"
    if not math.isfinite(value):
        return f"{shown}; write a finite number"
    if name in RAW_COLUMNS:
        return f"{shown}; RAW lies in [0, 1]: subtract the black level and divide by (white - black)"
    if name in SRGB_COLUMNS:
        return f"{shown}; sRGB lies in [0, 1]: divide 8-bit JPEG values by 255"
    if name in POSITION_COLUMNS:
        return f"{shown}; positions lie in [-1, 1]: half the picture's diagonal is 1"
    meaning = {"exposure_s": "exposure time in seconds", "focal_mm": "focal length in mm", "aperture": "f-number"}
    return f"{shown}; the {meaning.get(name, 'multiplier')} is positive, or the cell empty where it is unknown"
