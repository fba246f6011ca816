"""Measured colours of a chart, from the text files that programs of spectrophotometers write (ANSI CGATS.17).

A table has a row for each patch: reflectances in columns such as SPEC_380 (ArgyllCMS, https://www.argyllcms.com/doc/
cgats.html), SPECTRAL_NM380 (i1Profiler) or nm380 (ProfileMaker), or CIE Lab or XYZ under D50.
"""

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lutforge.arrays import Array
from lutforge.boundary import reading, require_file
from lutforge.errors import CalibrationError

SPECTRAL = re.compile(r"(?:SPECTRAL_NM_?|SPECTRAL_|SPEC_|NM_?|R_?)(\d{3})(?:NM)?|(\d{3})_?NM")


@dataclass(frozen=True, eq=False)
class Grid:
    """Patches in columns and rows. order: (columns × rows,) the table's rows, from left to right, then downwards."""

    columns: int
    rows: int
    order: NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class MeasuredPatches:
    """Colours (n, 3) or (n, 81) of patches in the table's order.

    spectral: they are reflectances at `colour.spectra.WAVELENGTHS`, else XYZ under D50, with 1 for a perfect diffuser.
    grid: where the patches are, told by names such as A1; None where they do not tell it.
    """

    grid: Grid | None
    spectral: bool
    colours: Array


def read_cgats(path: Path) -> MeasuredPatches:
    """Read a table of patches; reflectances go before colours under D50.

    Raises CalibrationError where it is no such table, or tells no colours.
    """
    import colour  # a second to import

    from lutforge.colour.spectra import WAVELENGTHS

    require_file(path, "a CGATS table", CalibrationError, most=1 << 24)
    with reading(path, "a CGATS table", CalibrationError):
        fields, table = _table(path.read_text(encoding="utf-8", errors="replace"))
        names = [table[:, fields.index(key)] for key in ("SAMPLE_NAME", "SAMPLE_LOC", "SAMPLE_ID") if key in fields]
        grid = next((grid for grid in map(_grid, names) if grid is not None), None)

        def numbers(columns: list[str]) -> Array:
            cells = table[:, [fields.index(column) for column in columns]]
            values = np.char.replace(cells, ",", ".").astype(np.float64)
            if not np.isfinite(values).all():
                raise CalibrationError("a colour is no number; measure that patch again, or leave out its row")
            return np.asarray(values)

        bands = {int(found[1] or found[2]): name for name in fields if (found := SPECTRAL.fullmatch(name))}
        if bands:
            nanometres = sorted(bands)
            if nanometres[0] > 420 or nanometres[-1] < 680 or len(nanometres) < 16:
                raise CalibrationError(
                    f"{len(nanometres)} reflectances from {nanometres[0]} to {nanometres[-1]} nm; 16 from 420 to 680 "
                    "nm are needed"
                )
            values = numbers([bands[at] for at in nanometres])
            values = values / 100.0 if values.max() > 2.0 else values  # some programs write per cent
            # Beyond the last bands light hardly counts, and reflectances are held there.
            return MeasuredPatches(grid, True, np.array([np.interp(WAVELENGTHS, nanometres, row) for row in values]))
        if {"LAB_L", "LAB_A", "LAB_B"} <= set(fields):
            white = colour.CCS_ILLUMINANTS["CIE 1931 2 Degree Standard Observer"]["D50"]
            xyz = colour.Lab_to_XYZ(numbers(["LAB_L", "LAB_A", "LAB_B"]), white)
            return MeasuredPatches(grid, False, np.asarray(xyz, dtype=np.float64))
        if {"XYZ_X", "XYZ_Y", "XYZ_Z"} <= set(fields):
            return MeasuredPatches(grid, False, numbers(["XYZ_X", "XYZ_Y", "XYZ_Z"]) / 100.0)
        raise CalibrationError("no reflectances, LAB or XYZ in this table; export one of these")


def _table(text: str) -> tuple[list[str], NDArray[np.str_]]:
    """The names of columns in capitals, and the cells (n, columns) without their quotes."""
    head = re.search(r"^\s*BEGIN_DATA_FORMAT\s(.*?)\sEND_DATA_FORMAT\b", text, re.DOTALL | re.MULTILINE)
    body = re.search(r"^\s*BEGIN_DATA\s(.*?)\sEND_DATA\b", text, re.DOTALL | re.MULTILINE)
    if head is None or body is None:
        raise CalibrationError("no table between BEGIN_DATA_FORMAT and END_DATA")
    fields = ["SAMPLE_ID" if name == "SAMPLEID" else name for name in head[1].upper().split()]
    cells = [word.strip('"') for word in re.findall(r'"[^"]*"|\S+', body[1])]
    if not fields or not cells or len(cells) % len(fields):
        raise CalibrationError(f"{len(cells)} cells do not fill {len(fields)} columns")
    return fields, np.array(cells).reshape(-1, len(fields))


def _grid(names: NDArray[np.str_]) -> Grid | None:
    """Tell by names such as A1 … F4 where patches lie; None where these do not fill a rectangle.

    Whether letters count columns or rows differs from chart to chart; the longer side of a chart runs across.
    """
    found = [re.fullmatch(r"([A-Z])(\d{1,3})", name.upper()) for name in names]
    places = [(ord(match[1]), int(match[2])) for match in found if match]
    if len(places) < max(2, len(names)):
        return None
    both = np.array(places) - np.min(places, axis=0)
    letters, numbers = both.max(axis=0) + 1
    across, down = (0, 1) if letters >= numbers else (1, 0)
    columns, rows = (int(count) for count in both.max(axis=0)[[across, down]] + 1)
    index = both[:, down] * columns + both[:, across]
    order = np.argsort(index)
    filled = len(index) == columns * rows and np.array_equal(index[order], np.arange(len(index)))
    return Grid(columns, rows, order) if filled else None
