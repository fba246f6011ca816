"""The LUT files of a config: CLF, as small as text can be without a visible loss.

A config is loaded by every program at every start, so its files hold 4096 entries a curve and numbers of six decimals
and five digits, without the spaces that line them up: an error below 1e-5 of the encoded scale.
"""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lutforge.interpolation import through
from lutforge.luts.formats import clf
from lutforge.luts.formats.text import write_text
from lutforge.model.lattice import grid
from lutforge.model.node_levels import snap_levels
from lutforge.ocio.lattice_lut import LatticeLut as Lut

Array = NDArray[np.float64]

CURVE_SIZE = 4096
"""Entries of a curve or shaper in the files of a config."""
DECIMALS, DIGITS = 6, 5


def compact(lut: Lut) -> Lut:
    """The LUT as its file holds it: node levels and curves on CURVE_SIZE points, numbers rounded; no gain."""
    if not lut.is_uniform and lut.shaper_size != CURVE_SIZE:
        r, g, b = (snap_levels(axis, CURVE_SIZE) for axis in lut.levels)
        at_nodes = lut.inner(grid((r, g, b)))
        lut = replace(lut, levels=(r, g, b), cube=at_nodes, shaper_size=CURVE_SIZE)
    even = np.repeat(np.linspace(0.0, 1.0, CURVE_SIZE)[:, None], 3, axis=1)
    if lut.curve is not None:
        lut = replace(lut, curve=through(lut.curve, even))
    if lut.response is not None:
        table = lut.response if len(lut.response) <= CURVE_SIZE else through(lut.response, even)
        lut = replace(lut, response=rounded(table))
    return replace(lut, cube=rounded(lut.cube))


def rounded(values: Array) -> Array:
    """Numbers to DECIMALS decimals, or DIGITS significant digits where that is less."""
    magnitude = np.floor(np.log10(np.maximum(np.abs(values), 1e-12))) + 1
    decimals = np.clip(DIGITS - magnitude, 0, DECIMALS)
    scale = 10.0**decimals
    return np.asarray(np.rint(values * scale) / scale)


def write_compact(lut: Lut, path: Path) -> None:
    """Write a compact LUT as CLF, atomically; the same bytes for the same LUT. Raises LutError."""
    write_text(path, _squeezed(clf.text_of(lut.as_lut())), "utf-8")


def _squeezed(text: str) -> str:
    """The tables of a CLF with one space between numbers, and those without idle zeros."""

    def table(found: re.Match[str]) -> str:
        numbers = re.sub(r"\d*\.\d+(?:e-\d+)?", _shortest, found[2])
        return found[1] + re.sub(r"[ \t]*\n[ \t]*", "\n", re.sub(r"[ \t]+", " ", numbers)) + found[3]

    return re.sub(r"(<Array[^>]*>)([^<]*)(</Array>)", table, text)


def _shortest(found: re.Match[str]) -> str:
    text = f"{float(found[0]):.{DECIMALS}f}".rstrip("0").rstrip(".")
    return (text.removeprefix("0") if text != "0" else text) or "0"
