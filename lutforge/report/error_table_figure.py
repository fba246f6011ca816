"""The error table as boxes: quartiles, mean and maximum of each method, both directions (thesis, chapter 5)."""

from collections.abc import Sequence

from matplotlib.figure import Figure
from matplotlib.ticker import FormatStrFormatter, LogLocator, NullFormatter

from lutforge.evaluation.errors_table import ErrorFigures


def error_boxes(directions: Sequence[tuple[str, Sequence[tuple[str, ErrorFigures]]]], own: str) -> Figure:
    """directions: title and, by method, its figures; the method `own` is drawn in colour. The scale is logarithmic."""
    rows = max(len(methods) for _, methods in directions)
    figure = Figure(figsize=(9, 1.0 + 0.36 * rows), layout="constrained")
    for axis, (title, methods) in zip(figure.subplots(1, len(directions), squeeze=False)[0], directions, strict=True):
        for position, (name, values) in enumerate(reversed(methods)):
            colour = "#2f5fb3" if name == own else "0.6"
            axis.plot((values.q3, values.maximum), (position, position), color=colour, linewidth=0.8)
            axis.barh(position, values.q3 - values.q1, left=values.q1, height=0.55, color=colour, alpha=0.75)
            axis.plot((values.median, values.median), (position - 0.27, position + 0.27), color="white", linewidth=1.5)
            axis.plot(values.mean, position, "D", color="black", markersize=4)
            axis.plot(values.maximum, position, "|", color=colour, markersize=9)
            axis.text(values.mean, position + 0.33, f"{values.mean:.4f}", ha="center", va="bottom", fontsize=7)
        axis.set_yticks(range(len(methods)), [name for name, _ in reversed(methods)])
        axis.set(title=title, xscale="log", xlabel="RGB error, 1 = full scale")
        axis.set_ylim(-0.6, len(methods) - 0.2)
        axis.xaxis.set_major_locator(LogLocator(subs=(1.0, 3.0)))
        axis.xaxis.set_major_formatter(FormatStrFormatter("%g"))
        axis.xaxis.set_minor_formatter(NullFormatter())
        axis.grid(axis="x", color="0.9", linewidth=0.6)
        axis.set_axisbelow(True)
    return figure
