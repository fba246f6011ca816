"""What a fit found: response, residuals, matrix and white balances (thesis A.3.1, A.3.2)."""

from html import escape

import numpy as np
import panel as pn
from bokeh.models import ColumnDataSource, Range1d

from lutforge.arrays import Array
from lutforge.model.camera_profile import CameraProfile
from lutforge.model.diagnosis import told
from lutforge.model.emor import mean_response
from lutforge.report.tables import Table, balance_table, matrix_table
from lutforge.studio.elements import CHANNELS, FILL, LINE, frame, plot, table, text
from lutforge.studio.fits import before, held_out_error, residuals
from lutforge.studio.session import Session
from lutforge.studio.workspace import MODELS, Workspace


class FitView:
    """Curves and figures of the model in use, beside those of the others."""

    def __init__(self, session: Session) -> None:
        self.session = session
        self._before: tuple[object, Array] = (None, np.zeros((0, 3)))
        self.curve = ColumnDataSource({name: [] for name in ("x", "r", "g", "b", "mean")})
        self.response = plot(
            "The response f",
            y_range=Range1d(0, 1.02),
            x_axis_label="linear value, 1 = saturation",
            y_axis_label="JPEG value",
        )
        self.response.line("x", "mean", source=self.curve, color=LINE, legend_label="mean of EMoR")
        for key, (name, colour, dash) in zip("rgb", CHANNELS, strict=True):
            self.response.line(
                "x", key, source=self.curve, color=colour, line_dash=dash, line_width=2, legend_label=name
            )
        self.response.legend.location = "bottom_right"
        self.bars = ColumnDataSource({name: [] for name in ("left", "right", "before", "after")})
        distance = "RGB distance between the JPEG and what the model renders"
        self.histogram = plot("Residuals", x_axis_label=distance, y_axis_label="share of samples")
        for key, colour, name in (("before", LINE, "before any fit"), ("after", "#4f83e0", "after")):
            self.histogram.quad(
                left="left", right="right", bottom=0, top=key, source=self.bars, fill_color=colour, fill_alpha=0.6,
                line_color=None, legend_label=name,
            )  # fmt: skip
        self.numbers = text(sizing_mode="stretch_both", styles={"overflow": "auto"})
        self.layout = pn.Row(pn.Column(self.response, self.histogram, **FILL), self.numbers, **FILL)

    def refresh(self) -> None:
        """Everything, from the session's workspace."""
        if self.session.history is None:
            profile = self.session.profile if self.session.has_profile else None
            self._draw_curves(profile)
            self.histogram.title.text = "Residuals: of samples, of which none are open"
            self.numbers.object = "" if profile is None else _numbers(profile)
            return
        workspace = self.session.workspace
        if self._before[0] is not workspace.samples:
            self._before = (workspace.samples, before(workspace.samples))
        self._draw_curves(None if workspace.fitted is None else workspace.fitted.profile)
        self.histogram.title.text = "Residuals"
        self._draw_residuals(workspace)
        fitted = workspace.fitted
        self.numbers.object = self._residual_table(workspace) + (
            _numbers(fitted.profile) if fitted else "<p>The matrix and the white balances stand here after a fit.</p>"
        )

    def _draw_curves(self, profile: CameraProfile | None) -> None:
        if profile is None:
            self.curve.data = {name: [] for name in ("x", "r", "g", "b", "mean")}
            return
        style = next(iter(profile.styles.values()))
        self.response.title.text = "The response f, first style" if style.physical else "The grey axis of the lattice"
        linear = np.linspace(0.0, 1.0, 257)
        values, mean = style.tones(linear), mean_response(linear)
        self.curve.data = {"x": linear, "r": values[:, 0], "g": values[:, 1], "b": values[:, 2], "mean": mean}

    def _draw_residuals(self, workspace: Workspace) -> None:
        edges, rows = np.linspace(0.0, 0.15, 61), workspace.fitted_rows
        found = {"before": self._before[1]}
        if workspace.fitted is not None:
            found["after"] = workspace.fitted.predicted
        shares = {name: np.zeros(len(edges) - 1) for name in ("before", "after")}
        for name, predicted in found.items():
            distance = np.linalg.norm(predicted[rows] - workspace.samples.srgb[rows], axis=1)
            distance = distance[np.isfinite(distance)]
            shares[name] = np.histogram(np.minimum(distance, edges[-1]), edges)[0] / max(len(distance), 1)
        top = max(float(share.max()) for share in shares.values())
        frame(self.histogram, (0.0, edges[-1]), (0.0, 1.05 * max(top, 1e-3)))
        self.bars.data = {"left": edges[:-1], "right": edges[1:], **shares}

    def _residual_table(self, workspace: Workspace) -> str:
        rows = workspace.fitted_rows
        found = {"before any fit": (self._before[1], None)} | {
            MODELS[name] + (" (stale)" if workspace.is_stale(name) else ""): (
                fitted.predicted,
                held_out_error(fitted.profile),
            )
            for name, fitted in workspace.models.items()
        }
        cells = []
        for name, (predicted, held_out) in found.items():
            figures = residuals(predicted, workspace.samples, rows)
            if figures:
                left_out = "–" if held_out is None else f"{held_out:.4f}"
                cells.append((name, *(f"{value:.4f}" for value in figures), left_out))
        header = ("model", "mean", "median", "95 %", "max", "held out")
        return table(Table(f"Residuals, RAW → JPEG, on {int(rows.sum()):,} samples", header, cells))


def _numbers(profile: CameraProfile) -> str:
    """Matrix, multipliers and notes of a profile."""
    parts = [table(matrix_table(profile)), table(balance_table(profile))]
    notes = (*told(profile.diagnoses), *profile.notes)
    parts += ["<h2>Notes</h2>"] * bool(notes) + [f"<p>{escape(note)}</p>" for note in notes]
    return "".join(parts)
