"""The model beside a uniform lattice, RBFs and polynomials: figures, and error maps both ways (Figs. 5.5, 5.6)."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import panel as pn
from bokeh.models import ColorBar, ColumnDataSource, LinearColorMapper

from lutforge.arrays import Array
from lutforge.colour.colour_difference import srgb_to_lab
from lutforge.model.camera_profile import CameraProfile
from lutforge.pipeline.evaluation import evaluate
from lutforge.progress import Progress
from lutforge.report.figures import ERROR_SCALE
from lutforge.report.tables import Table
from lutforge.samples.sample_set import SampleSet
from lutforge.studio.elements import FILL, frame, plot, select, table, text
from lutforge.studio.maps_view import DIRECTIONS, PALETTE
from lutforge.studio.session import Session

METHODS = ("nonuniform", "uniform", "rbf", "polynomial of all")
"""How the names of the methods begin whose errors are drawn."""


@dataclass(frozen=True, eq=False)
class MethodErrors:
    """What one method is off on shots left out. ab: CIE a*, b* of the JPEG colours (n, 2); error: (n,) norm of RGB."""

    direction: str
    method: str
    ab: Array
    error: Array


def compare_methods(
    profile: CameraProfile, samples: SampleSet, size: int, progress: Progress
) -> tuple[MethodErrors, ...]:
    """Measure all methods of the thesis's tables on shots left out, lattices with `size` nodes per axis."""
    found = evaluate(profile, samples, progress, tables=True, sizes=(size,))
    errors: dict[tuple[str, str], list[tuple[Array, Array]]] = {}
    for predictions in found.predictions.values():
        data = predictions.data
        ab = srgb_to_lab(data.encoded)[:, 1:]
        for direction, values in predictions.predicted.items():
            for method, predicted in values.items():
                error = np.linalg.norm(np.clip(predicted, 0.0, 1.0) - data.both[direction][1], axis=1)
                known = np.isfinite(error)
                errors.setdefault((direction, method), []).append((ab[known], error[known]))
    return tuple(
        MethodErrors(direction, method, *(np.concatenate(each) for each in zip(*parts, strict=True)))
        for (direction, method), parts in errors.items()
    )


class ComparisonView:
    """A table of all methods, and where the errors of four of them lie, in one direction."""

    def __init__(self, session: Session) -> None:
        self.session = session
        compute = session.button("Compare on shots left out", self._compute)
        self.told = text("<p>Fits every method once for each group of shots left out: this takes a while.</p>")
        self.direction = select("Direction", DIRECTIONS, sizing_mode="fixed", width=230, visible=False)
        session.watch(self._draw, self.direction)
        self.found: tuple[MethodErrors, ...] = ()
        # In rem: letters grow with the window.
        self.table = text(sizing_mode="stretch_height", styles={"overflow": "auto", "width": "27rem"})
        self.mapper = LinearColorMapper(palette=PALETTE, low=0.0, high=ERROR_SCALE)
        self.maps = [self._map() for _ in METHODS]
        drawings = [drawing for drawing, _ in self.maps]
        rows = (pn.Row(*drawings[:2], **FILL), pn.Row(*drawings[2:], **FILL))
        self.result = pn.Row(pn.Column(*rows, **FILL), self.table, visible=False, **FILL)
        controls = pn.Row(compute, self.direction, self.told, sizing_mode="stretch_width")
        self.layout = pn.Column(controls, self.result, **FILL)

    def _map(self) -> tuple[Any, ColumnDataSource]:
        drawing, source = (
            plot("", x_axis_label="a*", y_axis_label="b*"),
            ColumnDataSource({"x": [], "y": [], "error": []}),
        )
        colour = {"field": "error", "transform": self.mapper}
        drawing.scatter("x", "y", source=source, color=colour, size=4)
        frame(drawing, (-80.0, 80.0), (-80.0, 90.0))
        drawing.xaxis.ticker.desired_num_ticks = 4
        drawing.add_layout(ColorBar(color_mapper=self.mapper, width=6), "right")
        return drawing, source

    def refresh(self) -> None:
        """Nothing: what was compared stays until it is compared again."""

    def _compute(self) -> None:
        workspace, profile = self.session.workspace, self.session.profile
        samples = workspace.samples.select(workspace.fitted_rows)
        size = workspace.options.size
        self.session.start("comparison", self._done, compare_methods, profile, samples, size)

    def _done(self, found: tuple[MethodErrors, ...]) -> None:
        self.found = found
        self._draw()
        self.result.visible = self.direction.visible = True
        self.session.say("comparison: done")

    def _draw(self) -> None:
        found = [one for one in self.found if one.direction == self.direction.value]
        rows = []
        for one in found:
            q3, high = np.percentile(one.error, [75, 95])
            figures = (one.error.mean(), q3, high, one.error.max())
            rows.append((one.method, *(f"{value:.4f}" for value in figures)))
        header = ("method", "mean", "Q3", "95 %", "max")
        self.table.object = table(Table("Errors on shots left out, norm of RGB", header, rows))
        for (drawing, source), name in zip(self.maps, METHODS, strict=True):
            drawing.title.text, source.data = f"no {name}", {"x": [], "y": [], "error": []}
            for one in [one for one in found if one.method.startswith(name)][:1]:
                drawing.title.text = one.method
                chosen = np.random.default_rng(0).permutation(len(one.error))[:2000]
                order = chosen[np.argsort(one.error[chosen])]  # the largest errors on top
                source.data = {"x": one.ab[order, 0], "y": one.ab[order, 1], "error": one.error[order]}
