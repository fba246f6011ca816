"""Models: the four fits, with progress and cancel; curves, matrices and residuals as they come out (A.3.1 – A.3.3)."""

from dataclasses import replace
from typing import Any, cast

import numpy as np
import panel as pn
from bokeh.models import ColumnDataSource, Range1d

from lutforge.calibration.options import LARGEST, PRESETS, SMALLEST, CalibrationOptions, Preset
from lutforge.interpolation import INTERPOLATIONS, Interpolation
from lutforge.model.diagnosis import told
from lutforge.report.figures import CHANNELS
from lutforge.studio.elements import WIDTH, Slider, frame, plot, select, table, text
from lutforge.studio.fits import ResidualRow, before, fit_model, residuals
from lutforge.studio.plots import curves
from lutforge.studio.session import Session
from lutforge.studio.workspace import MODELS, FittedModel, Workspace, WorkspaceError

_EARLY = "Samples marked by hand, in groups in effect, or found by any filter do not."
_LATE = (
    "Samples marked by hand or in groups in effect do not, nor what filters find whose limits were moved; the "
    "saturation limit does not count, as saturated colours are what this model is for."
)
TAKES = {
    ("response", False): _EARLY,
    ("response", True): _EARLY,
    ("matrix", False): _EARLY + " The response is fitted anew with them.",
    ("matrix", True): _EARLY + " The response is fitted anew with them.",
    ("rbf", False): _LATE + " Response and matrix are fitted with it: compute them first to use them as they are.",
    ("rbf", True): _LATE + " It stands between the response and the matrix that were computed.",
    ("lattice", False): _LATE + " It follows the samples themselves.",
    ("lattice", True): _LATE + " It follows the samples themselves: response, matrix and gamut map do not enter it.",
}
"""What takes part in a fit, and what it builds on, by model and by whether response and matrix have been computed."""
DASHES = ("solid", "dashed", "dotted")


class ModelsView:
    """The page's second view."""

    def __init__(self, session: Session) -> None:
        self.session = session
        self._quiet = False
        self._before: tuple[Any, FittedModel | None] = (None, None)
        self.kind = select("Model", {title: key for key, title in MODELS.items()}, value="response")
        self.preset = select("Preset", list(PRESETS))
        self.size = Slider("Nodes per axis", 33, start=SMALLEST, end=LARGEST, step=1, digits=0)
        self.nonuniform = select("Node levels", {"follow the error": True, "evenly spaced": False})
        self.interpolation = select("Interpolation", list(INTERPOLATIONS))
        self.compute = session.button("Compute", self._compute, button_type="primary")
        self.takes = text(width=WIDTH)
        self.used = select("Model in use", [""])
        session.watch(self._use, self.used)
        session.watch(self._count, self.kind)
        self.curve = ColumnDataSource({name: [] for name in ("x", "r", "g", "b", "mean")})
        self.response = plot("The response f", 500, 330, y_range=Range1d(0, 1.02))
        self.response.xaxis.axis_label, self.response.yaxis.axis_label = "linear value, 1 = saturation", "JPEG value"
        self.response.line("x", "mean", source=self.curve, color="#8a9097", legend_label="mean of EMoR")
        for key, (name, colour, _), dash in zip("rgb", CHANNELS, DASHES, strict=True):
            self.response.line(
                "x", key, source=self.curve, color=colour, line_dash=dash, line_width=2, legend_label=name
            )
        self.response.legend.location = "bottom_right"
        self.bars = ColumnDataSource({name: [] for name in ("left", "right", "before", "after")})
        self.histogram = plot("Residuals", 500, 270)
        self.histogram.xaxis.axis_label = "RGB distance between the JPEG and what the model renders"
        self.histogram.yaxis.axis_label = "share of samples"
        for key, colour, name in (("before", "#c5cad0", "before any fit"), ("after", "#0072b2", "after")):
            self.histogram.quad(
                left="left", right="right", bottom=0, top=key, source=self.bars, fill_color=colour, fill_alpha=0.65,
                line_color=None, legend_label=name,
            )  # fmt: skip
        self.figures = text(width=490)
        self.numbers = text(width=490, height=400, styles={"overflow": "auto"})
        self.layout = pn.Row(
            pn.Column(
                self.kind, self.preset, self.size, self.nonuniform, self.interpolation, self.compute, self.takes,
                self.used, width=250,
            ),
            pn.Column(self.response, self.histogram),
            pn.Column(self.figures, self.numbers),
        )  # fmt: skip

    def refresh(self) -> None:
        """Everything, from the session's workspace."""
        if self.session.history is None:
            return
        workspace = self.session.workspace
        self._quiet = True
        self.used.options = {MODELS[name]: name for name in workspace.models} or [""]
        self.used.value = workspace.model
        self._quiet = False
        self._count()
        start = self._unfitted(workspace)
        self._draw_curves(workspace.fitted)
        self._draw_residuals(workspace, start)
        self.figures.object = _residual_table(workspace, start)
        self.numbers.object = _numbers(workspace.fitted)

    def _unfitted(self, workspace: Workspace) -> FittedModel | None:
        if self._before[0] is not workspace.samples:
            self._before = (workspace.samples, before(workspace.samples))
        return self._before[1]

    def _count(self) -> None:
        if self.session.history is None:
            return
        workspace = self.session.workspace
        rows = int(workspace.fitting_rows(self.kind.value).sum())
        stages = "matrix" in workspace.models
        self.takes.object = f"<p>{rows:,} samples take part. {TAKES[self.kind.value, stages]}</p>"

    def options(self) -> CalibrationOptions:
        """Return the options that the controls say."""
        return CalibrationOptions(
            model="rbf" if self.kind.value == "rbf" else "lattice",
            preset=cast(Preset, self.preset.value),
            size=int(self.size.value),
            interpolation=cast(Interpolation, self.interpolation.value),
            nonuniform=self.nonuniform.value,
        )

    def _compute(self) -> None:
        workspace, kind = self.session.workspace, self.kind.value
        options = self.options()
        rows = workspace.fitting_rows(kind)

        def done(fitted: FittedModel) -> None:
            now = self.session.workspace
            if now.samples is not workspace.samples:
                raise WorkspaceError("other samples were opened meanwhile: compute again")
            self.session.change(replace(now.with_model(kind, fitted), options=options))
            notes = "; ".join((*told(fitted.profile.diagnoses), *fitted.profile.notes))
            self.session.say(f"{MODELS[kind]}: fitted to {int(rows.sum()):,} samples. {notes}")

        stages = workspace.models["matrix"].profile if "matrix" in workspace.models else None
        self.session.start(MODELS[kind], done, fit_model, kind, workspace.samples, rows, options, stages)

    def _use(self) -> None:
        if not self._quiet and self.session.history is not None and self.used.value:
            workspace = self.session.workspace
            if self.used.value != workspace.model:
                self.session.change(replace(workspace, model=self.used.value))

    def _draw_curves(self, fitted: FittedModel | None) -> None:
        if fitted is None:
            self.curve.data = {name: [] for name in ("x", "r", "g", "b", "mean")}
            return
        linear, values, mean = curves(fitted)
        lattice = self.session.workspace.model == "lattice"
        self.response.title.text = "The grey axis of the lattice" if lattice else "The response f, first style"
        self.curve.data = {"x": linear, "r": values[:, 0], "g": values[:, 1], "b": values[:, 2], "mean": mean}

    def _draw_residuals(self, workspace: Workspace, start: FittedModel | None) -> None:
        edges = np.linspace(0.0, 0.15, 61)
        rows = workspace.fitted_rows
        shares = {}
        for name, fitted in (("before", start), ("after", workspace.fitted)):
            shares[name] = np.zeros(len(edges) - 1)
            if fitted is not None and rows.any():
                distance = np.linalg.norm(fitted.predicted[rows] - workspace.samples.srgb[rows], axis=1)
                distance = distance[np.isfinite(distance)]
                shares[name] = np.histogram(np.minimum(distance, edges[-1]), edges)[0] / max(len(distance), 1)
        top = max(float(share.max()) for share in shares.values())
        frame(self.histogram, (0.0, edges[-1]), (0.0, 1.05 * max(top, 1e-3)))
        self.bars.data = {"left": edges[:-1], "right": edges[1:], **shares}


def _residual_table(workspace: Workspace, start: FittedModel | None) -> str:
    rows = workspace.fitted_rows
    lines: list[ResidualRow | None] = []
    if start is not None:
        lines.append(residuals(start, "before any fit", workspace.samples, rows))
    lines += [residuals(fitted, MODELS[name], workspace.samples, rows) for name, fitted in workspace.models.items()]
    cells = [
        (line.model, *(f"{value:.4f}" for value in (line.mean, line.median, line.p95, line.maximum)),
         "–" if line.held_out is None else f"{line.held_out:.4f}")
        for line in lines if line is not None
    ]  # fmt: skip
    header = ("model", "mean", "median", "95 %", "max", "held out")
    return table(header, cells, f"Residuals, RAW → JPEG, on {int(rows.sum()):,} samples")


def _numbers(fitted: FittedModel | None) -> str:
    if fitted is None:
        return "<p>The matrix and the white balances stand here once a model is fitted.</p>"
    profile = fitted.profile
    matrix = [
        (f"sRGB {name}", *(f"{value:.4f}" for value in row)) for name, row in zip("RGB", profile.matrix, strict=True)
    ]
    parts = [table(("", "camera R", "camera G", "camera B"), matrix, "Matrix: white-balanced camera RGB → linear sRGB")]
    balances = []
    for name, balance in profile.white_balances.items():
        kelvin = "–" if balance.kelvin is None else f"{balance.kelvin:.0f} K"
        balances.append((name, *(f"{value:.4f}" for value in balance.multipliers), kelvin, f"{balance.spread:.1%}"))
    parts.append(table(("white balance", "R", "G", "B", "about", "spread"), balances, "Multipliers"))
    return "".join(parts)
