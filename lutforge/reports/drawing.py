"""Drawings: rows of panels with marks, each mark an array of numbers with a colour.

A drawing is data: `matplotlib_figure` draws it in files, the studio on its pages.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lutforge.arrays import Array

CHANNELS = (("Red", "#d0432f", "solid"), ("Green", "#2f9e63", "dashed"), ("Blue", "#4f83e0", "dotted"))
"""Name, colour and line style of each channel: the line style distinguishes them without colours."""
MAP = "cividis"
"""The colour scale of values: even in lightness, and the same to colour-blind people."""
ERROR_SCALE = 0.1
"""The error with the brightest colour, as a norm of RGB, 1 = full scale."""
GREY = "#8c8c8c"
"""A grey that is visible on white and on black."""


@dataclass(frozen=True, eq=False)
class Line:
    """A curve through points x, y (n,). label: in the legend, "" for none."""

    x: Array
    y: Array
    colour: str = GREY
    dash: str = "solid"
    width: float = 1.5
    label: str = ""


@dataclass(frozen=True, eq=False)
class Lines:
    """Many curves of one colour, each (k, 2)."""

    curves: Sequence[Array]
    colour: str = GREY


@dataclass(frozen=True, eq=False)
class Dots:
    """Points (n, 2): all in one colour, each in its own encoded RGB (n, 3), or by values (n,) on the panel's scale."""

    points: Array
    colour: str | Array = GREY
    values: Array | None = None
    marker: str = "circle"
    size: float = 4.0
    label: str = ""


@dataclass(frozen=True, eq=False)
class Arrows:
    """Arrows from points (n, 2) to points (n, 2), coloured by values (n,) on the panel's scale."""

    start: Array
    end: Array
    values: Array


@dataclass(frozen=True, eq=False)
class Raster:
    """A picture (h, w, 3), encoded, or values (h, w) on the panel's scale, grey where NaN; the first row is on top.

    size: its width and height on the axes; None: in pixels.
    """

    values: Array
    size: tuple[float, float] | None = None


@dataclass(frozen=True, eq=False)
class Bars:
    """Rectangles: left, right, bottom, top (n,) each."""

    left: Array
    right: Array
    bottom: Array
    top: Array
    colour: str = GREY
    label: str = ""


Mark = Line | Lines | Dots | Arrows | Raster | Bars


@dataclass(frozen=True, eq=False)
class Panel:
    """One pair of axes with marks.

    x, y: the names of the axes; x_range, y_range: None for the range of the marks; equal: one unit is as long on both
    axes; scale: the lowest and the highest value of the colours; scale_name: of these values, "" for no colour bar;
    bare: without axes.
    """

    title: str
    marks: tuple[Mark, ...]
    x: str = ""
    y: str = ""
    x_range: tuple[float, float] | None = None
    y_range: tuple[float, float] | None = None
    equal: bool = False
    scale: tuple[float, float] = (0.0, 1.0)
    scale_name: str = ""
    bare: bool = False


@dataclass(frozen=True, eq=False)
class Drawing:
    """Rows of panels. width, height: of the drawing and of a row, in inches, for files."""

    rows: tuple[tuple[Panel, ...], ...]
    height: float = 3.4
    width: float = 9.0

    @property
    def panels(self) -> tuple[Panel, ...]:
        """All panels in order."""
        return tuple(panel for row in self.rows for panel in row)


def thinned(count: int, most: int = 6000) -> NDArray[np.intp]:
    """The indices of at most `most` of `count` rows, chosen at random, so that figures stay small and legible."""
    return np.sort(np.random.default_rng(0).permutation(count)[:most])
