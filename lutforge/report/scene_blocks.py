"""What a camera did beyond its fixed rendering, for a report: the lens falloffs that it corrects in its JPEGs."""

from collections.abc import Iterator, Sequence

import numpy as np
from matplotlib.figure import Figure

from lutforge.model.falloff import Falloff
from lutforge.report.page import Block, Picture, Table


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


def _falloff_figure(falloffs: Sequence[Falloff]) -> Figure:
    radius = np.linspace(0.0, 1.0, 101)
    figure = Figure(figsize=(6, 3.4), layout="constrained")
    axis = figure.subplots()
    for falloff in falloffs:
        axis.plot(radius, falloff.stops(np.column_stack([radius, 0 * radius]) + falloff.centre), label=falloff.setting)
    axis.set(xlabel="distance from the centre, half the diagonal = 1", ylabel="EV", ylim=(0, None))
    axis.legend(frameon=False, loc="upper left")
    return figure
