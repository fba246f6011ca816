"""What a camera did beyond its fixed rendering, for a report: lens falloffs that it corrects, tone of single shots."""

from collections.abc import Iterator, Sequence

import numpy as np
from matplotlib.figure import Figure

from lutforge.evaluation.error_shares import ErrorShares
from lutforge.model.falloff import Falloff
from lutforge.model.shot_tone import ShotTone
from lutforge.report.page import Block, Picture
from lutforge.report.tables import Table, share_table
from lutforge.settings import setting_name


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


def tone_blocks(tones: Sequence[ShotTone], shares: Sequence[ErrorShares]) -> Iterator[Block]:
    """The shots that depart, maps of those that depart locally, and what the error consists of."""
    if tones:
        rows = tuple(
            (
                *(tone.shot, tone.style),
                *(f"{value:+.2f}" for value in (tone.exposure, tone.shadows, tone.highlights)),
                *(f"{tone.local:.2f}", f"{min(tone.significance):.1g}"),
            )
            for tone in tones
        )
        header = ("shot", "style", "exposure", "shadows", "highlights", "from place to place", "odds by chance")
        yield Table("What the camera did to single shots beyond its fixed rendering, in EV", header, rows)
    for tone in tones:
        if tone.local:
            caption = f"{tone.shot}: brightened by so many EV, from place to place. The shot is left out of the fit."
            yield Picture(f"local_tone_{setting_name(tone.shot)}", _local_figure(tone), caption)
    if shares:
        yield share_table(shares)


def _local_figure(tone: ShotTone) -> Figure:
    figure = Figure(figsize=(6, 2.4), layout="compressed")
    reach, drawn = max(abs(value) for part in tone.maps for value in part), None
    axes = figure.subplots(1, 2)
    for axis, part, title in zip(axes, tone.maps, ("dark tones", "bright tones"), strict=True):
        drawn = axis.imshow(np.reshape(part, (3, 3)), cmap="RdBu", vmin=-reach, vmax=reach, aspect=2 / 3)
        axis.set(xticks=[], yticks=[])
        axis.set_title(title, fontsize=9)
    if drawn is not None:
        figure.colorbar(drawn, ax=axes, label="EV")
    return figure


def _falloff_figure(falloffs: Sequence[Falloff]) -> Figure:
    radius = np.linspace(0.0, 1.0, 101)
    figure = Figure(figsize=(6, 3.4), layout="constrained")
    axis = figure.subplots()
    for falloff in falloffs:
        axis.plot(radius, falloff.stops(np.column_stack([radius, 0 * radius]) + falloff.centre), label=falloff.setting)
    axis.set(xlabel="distance from the centre, half the diagonal = 1", ylabel="EV", ylim=(0, None))
    axis.legend(frameon=False, loc="upper left")
    return figure
