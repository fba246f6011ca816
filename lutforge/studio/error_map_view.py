"""Error maps over the picture of a shot that was left out, both ways, by four models (thesis, Figs. 5.5 and 5.6)."""

from html import escape
from typing import Any

import numpy as np
import panel as pn
from bokeh.models import ColumnDataSource, DataRange1d, HoverTool, LinearColorMapper

from lutforge.arrays import Array
from lutforge.report.error_maps import DIRECTIONS, ErrorMaps, maps_of_file
from lutforge.samples.sample_set import with_setting_names
from lutforge.studio.elements import FILL, LINE, NOTHING, offer, plot, select, text
from lutforge.studio.maps_view import PALETTE
from lutforge.studio.session import Session
from lutforge.studio.workspace import WorkspaceError


class ErrorMapView:
    """Two rows of pictures: the JPEG and what predicts it, the RAW and what predicts that; they zoom together."""

    def __init__(self, session: Session) -> None:
        self.session = session
        self.shot = select("Shot", NOTHING, sizing_mode="fixed", width=330)
        draw = session.button("Draw its errors", self._compute)
        self.told = text("<p>Every model is fitted without the shot, and predicts it.</p>")
        ranges = {"x_range": DataRange1d(range_padding=0), "y_range": DataRange1d(range_padding=0)}
        self.drawings = [[self._drawing(ranges, scale * bool(place)) for place in range(5)] for _, scale in DIRECTIONS]
        rows = [pn.Row(*(drawing for drawing, _ in row), **FILL) for row in self.drawings]
        self.layout = pn.Column(pn.Row(self.shot, draw, self.told, sizing_mode="stretch_width"), *rows, **FILL)

    def _drawing(self, ranges: dict[str, Any], scale: float) -> tuple[Any, ColumnDataSource]:
        """A map of errors up to a scale; a picture where that is 0."""
        drawing = plot(" \n \n ", "pan,wheel_zoom,reset,save", match_aspect=True, **ranges)
        drawing.axis.visible = drawing.grid.visible = False
        source = ColumnDataSource({"image": [], "width": [], "height": []})
        place = {"image": "image", "x": 0, "y": 0, "dw": "width", "dh": "height", "source": source}
        if scale:
            mapper = LinearColorMapper(palette=PALETTE, low=0.0, high=scale, nan_color=LINE)
            drawing.image(color_mapper=mapper, **place)
            drawing.add_tools(HoverTool(tooltips=[("error", "@image{0.0000}")]))
        else:
            drawing.image_rgba(**place)
        return drawing, source

    def refresh(self) -> None:
        """The shots whose files are at hand."""
        session = self.session
        there = [] if session.history is None else [str(name) for name in np.unique(session.workspace.samples.shot)]
        offer(self.shot, [name for name in there if name in session.opened.files])

    def _compute(self) -> None:
        workspace, profile, shot = self.session.workspace, self.session.profile, self.shot.value
        if not shot:
            raise WorkspaceError("no shot's files are open: open the folder of the shots, not a table of samples")
        samples = with_setting_names(workspace.samples.select(workspace.fitted_rows))
        if shot not in samples.shot:
            raise WorkspaceError(f"{shot}: none of its samples takes part in the fit; choose another shot")
        file = self.session.opened.files[shot]
        self.session.start(f"errors of {shot}", self._done, maps_of_file, profile, samples, shot, file)

    def _done(self, maps: ErrorMaps) -> None:
        for row, shown in zip(self.drawings, maps.rows, strict=True):
            _show(*row[0], shown.name + (2 - shown.name.count("\n")) * "\n ", _packed(shown.picture))
            for place, (drawing, source) in enumerate(row[1:]):
                drawing.visible = place < len(shown.errors)
                if drawing.visible:
                    method, error = list(shown.errors.items())[place]
                    _show(drawing, source, f"{shown.title}\n{method}\nmean {np.nanmean(error):.4f}", error)
        seen = "no model has seen it" if maps.held_out else "the models have seen it"
        scales = ", ".join(f"{direction} {scale:g}" for direction, scale in DIRECTIONS)
        self.told.object = (
            f"<p>{escape(f'{maps.shot}, {maps.setting}')}: {seen}. Norm of RGB; brightest: {scales}; grey: clipped, or "
            "outside the RAW.</p>"
        )
        self.session.say(f"{maps.shot}: errors drawn")


def _show(drawing: Any, source: ColumnDataSource, title: str, image: Array) -> None:
    """Show an image (h, w), of errors or of packed colours, whose first row is the top one."""
    height, width = image.shape
    drawing.title.text = title
    source.data = {"image": [image[::-1]], "width": [width], "height": [height]}


def _packed(picture: Array) -> Any:
    """Encoded colours (h, w, 3) as the RGBA words (h, w) of Bokeh."""
    codes = np.full((*picture.shape[:2], 4), 255, dtype=np.uint8)
    codes[..., :3] = np.rint(np.clip(picture, 0.0, 1.0) * 255)
    return codes.view(np.uint32)[..., 0]
