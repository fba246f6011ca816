"""A bracket on the Shots step: its chart and times, the response that it tells, and how exact its exposures were."""

from html import escape
from typing import Any

import numpy as np
import panel as pn
import panel_material_ui as pmui

from lutforge.pipeline.charts import FittedChart
from lutforge.pipeline.response import FittedResponse
from lutforge.report.tables import response_table
from lutforge.samples.chart_kinds import chart_names
from lutforge.studio.brackets import Bracket, BracketRequest, fit_request
from lutforge.studio.elements import CHANNELS, FILL, LINE, TOGETHER, WIDE, entry, plot, select, table, text, written
from lutforge.studio.session import Session
from lutforge.studio.shot_pictures import jpeg_url
from lutforge.studio.workspace import WorkspaceError


class BracketView:
    """Controls of the fit, and what it found."""

    def __init__(self, session: Session) -> None:
        self.session = session
        self.chart = select("Chart in the pictures", {"none": "", **{name: name for name in chart_names()}})
        self.light = entry("Light on the chart", value="D50")
        self.corners = entry("Its corners, where it is not found", placeholder="x,y x,y x,y x,y")
        self.times = entry("Exposure times, where not stated", placeholder="1/60,1/30,1/15")
        self.all_colours = pmui.Checkbox(label="Count saturated colours, too", **WIDE)
        fit = session.button("Fit response", self._fit, variant="contained", **WIDE)
        self.controls = pn.Column(
            self.chart, self.light, self.corners, self.times, self.all_colours, fit, visible=False, **TOGETHER
        )
        session.watch(self._enable, self.chart)
        self.told = text(sizing_mode="stretch_both", styles={"overflow": "auto"})
        self.layout = pn.Row(visible=False, **{**FILL, "min_height": 260})
        self._enable()

    def _enable(self) -> None:
        self.light.disabled = self.corners.disabled = not self.chart.value
        self.all_colours.disabled = bool(self.chart.value)

    def _fit(self) -> None:
        bracket = self.session.opened.bracket
        assert bracket is not None
        files = tuple(file for file in bracket.files if file.name not in self.session.pictures_out)
        times, light, corners = map(written, (self.times, self.light, self.corners))
        request = BracketRequest(files, times, self.all_colours.value, self.chart.value, light, corners)
        if len(request.files) < 2:
            raise WorkspaceError("a response needs two pictures or more: take some in again")

        def done(fitted: FittedResponse | FittedChart) -> None:
            if self.session.opened.bracket is bracket:
                self.session.take_response(request, fitted)

        self.session.start("response", done, fit_request, request)

    def cards(self, bracket: Bracket) -> list[dict[str, Any]]:
        """A card a picture: its exposure as stated and as it was."""
        fitted = None if self.session.response is None else self.session.response[1]
        least = np.nanmin([*bracket.exposure_s, np.inf])
        found = []
        for file, exposure, small in zip(bracket.files, bracket.exposure_s, bracket.small, strict=True):
            facts = [
                f"exposure × {exposure / least:.4g}, as stated" if np.isfinite(exposure) else "exposure not stated"
            ]
            if fitted is not None and file.name in fitted.fit.exposure_error:
                facts.append(f"true / stated: {fitted.fit.exposure_error[file.name]:.3f}")
            if isinstance(fitted, FittedChart):
                facts += ["chart found here"] if file.name in fitted.found else []
                facts += [f"white beside the chart: {fitted.level[file.name]:.3g}"] if file.name in fitted.level else []
            found.append({"name": file.name, "pictures": [("picture", jpeg_url(small))], "facts": facts})
        return found

    def refresh(self) -> None:
        """The controls where a bracket is open, and its response where one was fitted."""
        self.controls.visible = self.session.opened.bracket is not None
        self.layout.visible = self.session.response is not None
        if self.session.response is None:
            return
        fit = self.session.response[1].fit
        labels = {"x_axis_label": "linear value, 1 = saturation", "y_axis_label": "JPEG value"}
        drawing, linear = plot("The response f; thin: sRGB's own curve", **labels), np.linspace(0.0, 1.0, 257)
        values = fit.response.encode(np.repeat(linear[:, None], 3, axis=1))
        for channel, (_, colour, dash) in enumerate(CHANNELS):
            drawing.line(linear, values[:, channel], color=colour, line_dash=dash, line_width=2)
        srgb = next(curve.response for curve in fit.curves if curve.name == "sRGB")
        drawing.line(linear, srgb.encode(np.repeat(linear[:, None], 3, axis=1))[:, 1], color=LINE)
        lines = [*fit.told, fit.verdict.told, *self.session.profile.notes]
        self.told.object = "".join(f"<p>{escape(line)}</p>" for line in lines) + table(response_table(fit))
        self.layout[:] = [drawing, self.told]
