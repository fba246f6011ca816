"""Kinds of colour charts: the places of their patches and their published colours.

Layouts and sources are in data/charts.json; colours of ColorCheckers come with colour-science.
"""

import json
import re
from dataclasses import dataclass
from importlib.resources import files
from typing import Any

import numpy as np

from lutforge.arrays import Array
from lutforge.errors import CalibrationError, alternatives

CIE_D50 = "D50"
"""The illuminant of published colours, by its name in colour-science."""


@dataclass(frozen=True, eq=False)
class ChartKind:
    """A kind of chart, upright. columns, rows: centres of its patches, in pitches from the outer edge of the first.

    detector: OpenCV's name of its detector, "" where it has none; source: of the colours. The colours are given row by
    row, by one of these: lab (n, 3) under D50; colours: name in colour-science, under D50; spectra: name in
    colour-science, of reflectances.
    """

    name: str
    columns: Array
    rows: Array
    source: str = ""
    detector: str = ""
    lab: Array | None = None
    colours: str = ""
    spectra: str = ""

    @property
    def outline(self) -> Array:
        """The outer corners (4, 2) of the upright chart in pitches, clockwise from the first patch."""
        width, height = self.columns[-1] + 0.5, self.rows[-1] + 0.5
        return np.array([[0.0, 0.0], [width, 0.0], [width, height], [0.0, height]])

    @property
    def centres(self) -> Array:
        """The centres (n, 2) of the patches in pitches, row by row."""
        return np.stack(np.meshgrid(self.columns, self.rows), axis=-1).reshape(-1, 2)

    @property
    def places(self) -> Array:
        """The centres (n, 2) of the patches, row by row, −1 … 1 from edge to edge of the upright chart."""
        return np.asarray(self.centres / (self.outline[2] / 2) - 1.0)

    def linear_srgb(self, light: str = CIE_D50) -> Array:
        """Colours (n, 3) of the patches under an illuminant, adapted to it: a perfect diffuser is 1, 1, 1.

        light: the illuminant, such as "5500K", "D55", "A" or "LED-B3". A chart without published reflectances has its
        colours under D50, whatever the illuminant. Raises CalibrationError on an unknown illuminant.
        """
        import colour  # a second to import

        from lutforge.colour.spectra import linear_srgb_under, reflectances, spectrum_of

        spectrum = spectrum_of(light)
        if self.spectra:
            return linear_srgb_under(reflectances(self.spectra), spectrum)
        white = colour.CCS_ILLUMINANTS["CIE 1931 2 Degree Standard Observer"][CIE_D50]
        xyz: Any
        if self.lab is not None:
            xyz = colour.Lab_to_XYZ(self.lab, white)
        else:
            published: Any = colour.CCS_COLOURCHECKERS[self.colours]
            white = published.illuminant
            xyz = colour.xyY_to_XYZ(np.array(list(published.data.values())))
        return np.asarray(colour.XYZ_to_RGB(xyz, "sRGB", white, "Bradford", apply_cctf_encoding=False))


def chart_names() -> tuple[str, ...]:
    """The charts in data/charts.json."""
    return tuple(_chart_entries())


def _chart_entries() -> dict[str, Any]:
    """The entries of data/charts.json by name."""
    return dict(json.loads(files(__package__).joinpath("data", "charts.json").read_text(encoding="utf-8")))


def chart_kind(word: str) -> ChartKind:
    """A chart by its name in data/charts.json. Raises CalibrationError."""
    entries = _chart_entries()
    entry = entries.get(word.lower())
    if entry is None:
        raise CalibrationError(
            f'no chart "{word[:60]}"; {alternatives(word, entries)}; '
            "a Passport, Nano or Mega shows a classic, or a classic2014 if made after November 2014"
        )
    arrays = {key: np.array(entry[key], dtype=np.float64) for key in ("columns", "rows", "lab") if key in entry}
    words = {key: entry[key] for key in ("name", "source", "detector", "colours", "spectra") if key in entry}
    return ChartKind(**words, **arrays)  # type: ignore[arg-type]


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
