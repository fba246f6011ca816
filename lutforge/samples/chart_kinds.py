"""Colour charts: where their patches are, and what colours these have under a light.

Layouts and sources are in data/charts.json; colours of ColorCheckers come with colour-science. A user's own chart is a
CGATS table of patches that are named A1, A2 ….
"""

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lutforge.arrays import Array
from lutforge.boundary import reading, require_file
from lutforge.errors import CalibrationError, alternatives

D50 = "D50"
CGATS_SUFFIXES = (".txt", ".cgats", ".cie", ".ti3")


@dataclass(frozen=True, eq=False)
class ChartKind:
    """A kind of chart, upright. columns, rows: centres of its patches, in pitches from the outer edge of the first.

    detector: OpenCV's name of its detector, "" where it has none; source: of the colours. One of these says them, row
    by row: xyz (n, 3) under D50, 1 a perfect diffuser; lab (n, 3), the same; colours: name in colour-science, under
    D50; spectra: the same, reflectances; measured: reflectances (n, 81) at `colour.spectra.WAVELENGTHS`.
    """

    name: str
    columns: Array
    rows: Array
    source: str = ""
    detector: str = ""
    lab: Array | None = None
    xyz: Array | None = None
    colours: str = ""
    spectra: str = ""
    measured: Array | None = None

    @property
    def outline(self) -> Array:
        """The outer corners (4, 2) of the upright chart in pitches, clockwise from the first patch."""
        width, height = self.columns[-1] + 0.5, self.rows[-1] + 0.5
        return np.array([[0.0, 0.0], [width, 0.0], [width, height], [0.0, height]])

    @property
    def centres(self) -> Array:
        """The centres (n, 2) of the patches in pitches, row by row."""
        return np.stack(np.meshgrid(self.columns, self.rows), axis=-1).reshape(-1, 2)

    def linear_srgb(self, light: str = D50) -> Array:
        """Colours (n, 3) of the patches under a light, adapted to it: a perfect diffuser is 1, 1, 1.

        light: such as "5500K", "D55", "A" or "LED-B3". What is only known under D50 keeps those colours. Raises
        CalibrationError on an unknown light.
        """
        import colour  # a second to import

        from lutforge.colour.spectra import linear_srgb_under, reflectances, spectrum_of

        spectrum = spectrum_of(light)
        if self.spectra:
            return linear_srgb_under(reflectances(self.spectra), spectrum)
        if self.measured is not None:
            return linear_srgb_under(self.measured, spectrum)
        white = colour.CCS_ILLUMINANTS["CIE 1931 2 Degree Standard Observer"][D50]
        xyz: Any
        if self.xyz is not None:
            xyz = self.xyz
        elif self.lab is not None:
            xyz = colour.Lab_to_XYZ(self.lab, white)
        else:
            published: Any = colour.CCS_COLOURCHECKERS[self.colours]
            white = published.illuminant
            xyz = colour.xyY_to_XYZ(np.array(list(published.data.values())))
        return np.asarray(colour.XYZ_to_RGB(xyz, "sRGB", white, "Bradford", apply_cctf_encoding=False))


def chart_names() -> tuple[str, ...]:
    """The charts in data/charts.json."""
    return tuple(_known())


def _known() -> dict[str, Any]:
    return dict(json.loads(files(__package__).joinpath("data", "charts.json").read_text(encoding="utf-8")))


def srgb_codes(name: str) -> Array:
    """Return the sRGB codes (n, 3) of a chart of data/charts.json: what colour-science's XYZ_to_sRGB gives, rounded."""
    return np.array(_known()[name]["srgb_codes"], dtype=np.float64)


def chart_kind(word: str) -> ChartKind:
    """A chart by its name in data/charts.json, or of a CGATS table. Raises CalibrationError."""
    known = _known()
    entry = known.get(word.lower())
    if entry is not None:
        arrays = {key: np.array(entry[key], dtype=np.float64) for key in ("columns", "rows", "lab") if key in entry}
        words = {key: entry[key] for key in ("name", "source", "detector", "colours", "spectra") if key in entry}
        return ChartKind(**words, **arrays)  # type: ignore[arg-type]
    path = Path(word)
    if path.suffix.lower() not in CGATS_SUFFIXES:
        raise CalibrationError(
            f'no chart "{word[:60]}"; {alternatives(word, known)}, or a CGATS table ({", ".join(CGATS_SUFFIXES)}); '
            "a Passport, Nano or Mega shows a classic, or a classic2014 if made after November 2014"
        )
    return _of_table(path)


def parse_corners(text: str) -> Array:
    """Four corners (4, 2) of a text such as "120,80 900,85 905,640 118,630". Raises CalibrationError."""
    numbers = re.findall(r"-?\d+(?:\.\d+)?", text)
    if len(numbers) != 8:
        raise CalibrationError(
            f'corners "{text[:60]}": give four points x,y in pixels, clockwise from the first patch\'s outer corner'
        )
    corners = np.array(numbers, dtype=np.float64).reshape(4, 2)
    sides = np.roll(corners, -1, axis=0) - corners
    turns = sides[:, 0] * np.roll(sides[:, 1], -1) - sides[:, 1] * np.roll(sides[:, 0], -1)
    if not np.all(turns > 0):  # y runs downwards
        raise CalibrationError(f'corners "{text[:60]}": these are not four corners of a chart, clockwise')
    return corners


# --- Measured colours of a chart, as programs of spectrophotometers write them (ANSI CGATS.17) -----------------------
# A table has a row for each patch: reflectances in columns such as SPEC_380 (ArgyllCMS, https://www.argyllcms.com/doc/
# cgats.html), SPECTRAL_NM380 (i1Profiler) or nm380 (ProfileMaker), or CIE Lab or XYZ under D50.


SPECTRAL = re.compile(r"(?:SPECTRAL_NM_?|SPECTRAL_|SPEC_|NM_?|R_?)(\d{3})(?:NM)?|(\d{3})_?NM")


def _of_table(path: Path) -> ChartKind:
    """A chart of a CGATS table, whose patches' names tell its columns and rows.

    Raises CalibrationError where it is no such table, or tells no colours or places.
    """
    require_file(path, "a CGATS table", CalibrationError, most=1 << 24)
    with reading(path, "a CGATS table", CalibrationError):
        text = path.read_text(encoding="utf-8", errors="replace")
        head = re.search(r"^\s*BEGIN_DATA_FORMAT\s(.*?)\sEND_DATA_FORMAT\b", text, re.DOTALL | re.MULTILINE)
        body = re.search(r"^\s*BEGIN_DATA\s(.*?)\sEND_DATA\b", text, re.DOTALL | re.MULTILINE)
        if head is None or body is None:
            raise CalibrationError("no table between BEGIN_DATA_FORMAT and END_DATA")
        fields = ["SAMPLE_ID" if name == "SAMPLEID" else name for name in head[1].upper().split()]
        cells = [word.strip('"') for word in re.findall(r'"[^"]*"|\S+', body[1])]
        if not fields or not cells or len(cells) % len(fields):
            raise CalibrationError(f"{len(cells)} cells do not fill {len(fields)} columns")
        table = dict(zip(fields, np.array(cells).reshape(-1, len(fields)).T, strict=True))
        colours = _colours(table)
    grids = (_grid(table[key]) for key in ("SAMPLE_NAME", "SAMPLE_LOC", "SAMPLE_ID") if key in table)
    grid = next((grid for grid in grids if grid is not None), None)
    if grid is None:
        raise CalibrationError(f"{path}: its patches are not named A1, A2 … of a whole rectangle; name them so")
    sides, order = grid
    columns, rows = (np.arange(side, dtype=np.float64) + 0.5 for side in sides)
    known: dict[str, Any] = {name: values[order] for name, values in colours.items()}
    return ChartKind(path.stem[:200], columns, rows, f"measured, {path.name}"[:200], **known)


def _colours(table: Mapping[str, NDArray[np.str_]]) -> dict[str, Array]:
    """The colours of a table's patches as fields of ChartKind: reflectances go before colours under D50."""

    def numbers(columns: Sequence[str]) -> Array:
        cells = np.stack([table[column] for column in columns], axis=1)
        values = np.char.replace(cells, ",", ".").astype(np.float64)
        if not np.isfinite(values).all():
            raise CalibrationError("a colour is no number; measure that patch again, or leave out its row")
        return np.asarray(values)

    bands = {int(found[1] or found[2]): name for name in table if (found := SPECTRAL.fullmatch(name))}
    if bands:
        from lutforge.colour.spectra import WAVELENGTHS

        nanometres = sorted(bands)
        if nanometres[0] > 420 or nanometres[-1] < 680 or len(nanometres) < 16:
            raise CalibrationError(
                f"{len(nanometres)} reflectances from {nanometres[0]} to {nanometres[-1]} nm; 16 from 420 to 680 "
                "nm are needed"
            )
        values = numbers([bands[at] for at in nanometres])
        values = values / 100.0 if values.max() > 2.0 else values  # some programs write per cent
        # Beyond the last bands light hardly counts, and reflectances are held there.
        return {"measured": np.array([np.interp(WAVELENGTHS, nanometres, row) for row in values])}
    if {"LAB_L", "LAB_A", "LAB_B"} <= set(table):
        return {"lab": numbers(["LAB_L", "LAB_A", "LAB_B"])}
    if {"XYZ_X", "XYZ_Y", "XYZ_Z"} <= set(table):
        return {"xyz": numbers(["XYZ_X", "XYZ_Y", "XYZ_Z"]) / 100.0}
    raise CalibrationError("no reflectances, LAB or XYZ in this table; export one of these")


def _grid(names: NDArray[np.str_]) -> tuple[tuple[int, int], NDArray[np.intp]] | None:
    """Columns and rows of patches with names such as A1 … F4, and the order that has them row by row.

    None where they do not fill a rectangle. Whether letters count columns or rows differs from chart to chart; the
    longer side of a chart runs across.
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
    return ((columns, rows), order) if filled else None
