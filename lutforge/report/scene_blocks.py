"""What a camera did beyond its fixed rendering, for a report: lens falloffs that it corrects, tone of single shots."""

from collections.abc import Iterator, Sequence

import numpy as np

from lutforge.calibration.shots.departures import Departure
from lutforge.model.falloff import Falloff
from lutforge.report.drawing import Drawing, Line, Panel
from lutforge.report.page import Block, Picture
from lutforge.report.tables import Table


def falloff_blocks(falloffs: Sequence[Falloff]) -> Iterator[Block]:
    """A table and a plot of the falloffs; nothing where there are none."""
    if not falloffs:
        return
    rows = tuple(
        (falloff.setting, f"{falloff.corner_ev:.2f}", *(f"{100 * value:.1f} %" for value in falloff.centre))
        for falloff in falloffs
    )
    header = ("lens setting", "corners, EV", "centre right", "centre down")
    yield Table("Lens falloff that the camera corrects in its JPEGs only", header, rows)
    yield Picture(
        "falloff",
        _falloff_figure(falloffs),
        "How much brighter than the RAW the JPEGs are, against the distance from the middle. The profile renders the "
        "middle; RAW is brightened by this first. Centres: in per cent of half the diagonal.",
    )


def departure_blocks(departures: Sequence[Departure]) -> Iterator[Block]:
    """A table of the shots that depart from the fixed rendering; nothing where there are none."""
    if departures:
        yield Table(
            "Shots that depart from the fixed rendering, with standard errors",
            ("shot", "exposure, EV", "contrast", "saturation"),
            [(each.shot, *each.cells) for each in departures],
        )


def _falloff_figure(falloffs: Sequence[Falloff]) -> Drawing:
    """Draw the falloffs over the distance from their centres."""
    radius = np.linspace(0.0, 1.0, 101)
    along = np.column_stack([radius, 0 * radius])
    lines = tuple(
        Line(radius, falloff.stops(along + falloff.centre), f"C{index % 10}", label=falloff.setting)
        for index, falloff in enumerate(falloffs)
    )
    return Drawing(((Panel("", lines, "distance from the centre, half the diagonal = 1", "EV"),),), 3.4, 6.0)
