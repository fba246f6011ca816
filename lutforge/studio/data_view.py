"""Data and outliers: linked plots of the samples, filters, marks by hand, named groups (thesis A.3, A.3.1)."""

import re
from dataclasses import replace
from html import escape

import numpy as np
import panel as pn
from bokeh.models import ColumnDataSource
from numpy.typing import NDArray

from lutforge.arrays import Array, Mask
from lutforge.report.figures import chromaticity_outlines
from lutforge.samples.sample_set import SampleSet
from lutforge.studio.brushed_plot import BrushedPlot
from lutforge.studio.elements import NARROW, WIDTH, Slider, entry, frame, select, text
from lutforge.studio.plots import (
    COLOURS,
    PLOTS,
    Points,
    chromaticities,
    cube_edges,
    hex_colours,
    points,
    projected,
    tristimulus,
)
from lutforge.studio.session import Session
from lutforge.studio.thumbnails import shot_picture
from lutforge.studio.workspace import Filters, Workspace, WorkspaceError
from lutforge.studio.workspace_file import OPENED_SUFFIXES


def find_rows(samples: SampleSet, words: str) -> Mask:
    """(n,) rows by number ("12, 40-60"), else by the name of their shot or patch. Raises WorkspaceError: none."""
    words, count = words.strip(), len(samples)
    rows = np.zeros(count, dtype=np.bool_)
    if re.fullmatch(r"[\d\s,-]{1,2000}", words):
        for first, last in re.findall(r"(\d{1,12})(?:\s*-\s*(\d{1,12}))?", words):
            rows[int(first) : int(last or first) + 1] = True
    elif words:
        rows = (samples.shot == words) | (samples.patch == words)
    if not rows.any():
        raise WorkspaceError(f"{words[:60] or 'nothing'}: no such row, shot or patch; rows count from 0 to {count - 1}")
    return rows


class DataView:
    """The page's first view."""

    def __init__(self, session: Session) -> None:
        self.session = session
        self._quiet = False
        self.layout = pn.Row(self._controls(), pn.Column(*self._plots()))
        self.list_files()

    def _controls(self) -> pn.Column:
        """Files, filters, marks by hand and groups."""
        session = self.session
        self.listed, self.path = select("File in the folders", [""]), entry("or its path")
        self.saturation = Slider("Saturation limit", 1.0, start=0.02, greatest="off")
        self.darkest = Slider("Darkest JPEG code", 1, end=60, step=1, digits=0)
        self.brightest = Slider("Brightest JPEG code", 254, start=180, end=255, step=1, digits=0)
        self.raw_white = Slider("RAW saturated from", 0.98, start=0.5)
        self.residual = Slider(
            "Residual distance", 0.25, start=0.005, end=0.25, step=0.005, digits=3,
            greatest="off",
        )  # fmt: skip
        filters = (self.saturation, self.darkest, self.brightest, self.raw_white, self.residual)
        session.watch(self._filter, *filters)
        self.group = entry("Outlier group", placeholder="name", width=130)
        self.groups = pn.widgets.CheckBoxGroup(name="Groups in effect", options=[], width=WIDTH, **NARROW)
        session.watch(self._groups, self.groups)
        self.delete = session.button("Delete group", self._delete)
        self.counts = text(width=WIDTH)
        return pn.Column(
            self.listed, self.path,
            pn.Row(
                session.button("Open", self._open, button_type="primary"),
                session.button("List again", self.list_files),
            ),
            *filters,
            pn.Row(
                session.button("Mark outliers", lambda: self._mark(True)),
                session.button("Keep", lambda: self._mark(False)),
                session.button("Unmark", self._unmark),
            ),
            pn.Row(self.group, session.button("Save group", self._save_group, margin=(21, 3, 3, 3))),
            self.groups, self.delete, self.counts, width=250, height=628, scroll=True,
        )  # fmt: skip

    def _plots(self) -> tuple[pn.Row, ...]:
        """What is plotted, two plots of the samples, and their colours in space."""
        session, plots = self.session, {title: key for key, title in PLOTS.items()}
        self.first = select("Left plot", plots, value="srgb_btf", width=240)
        self.second = select("Right plot", plots, value="srgb_raw", width=240)
        self.channel = select("Channel", {"Red": 0, "Green": 1, "Blue": 2}, value=1, width=100)
        self.by = select("Colour by", list(COLOURS), width=130)
        self.words = entry("Select row, shot or patch", width=200)
        session.watch(self._find, self.words)
        session.watch(self.refresh, self.first, self.second, self.channel, self.by)
        self.left, self.right = (BrushedPlot(session, "", 500, 290) for _ in range(2))
        self.chromaticity = BrushedPlot(session, "CIE xy: inliers ●, outliers ×", 320, 262)
        frame(self.chromaticity.figure, (-0.08, 0.92), (-0.03, 0.87))
        self.space = BrushedPlot(session, "CIE XYZ", 300, 218)
        frame(self.space.figure, (-1.1, 1.1), (-0.85, 0.85))
        self.chromaticity.framed = self.space.framed = None
        self._outlines()
        turn = {"step": 5, "digits": 0, "unit": "°", "width": 136}
        self.azimuth = Slider("Turn", -35, start=-180, end=180, **turn)
        self.elevation = Slider("Tilt", 20, start=-90, end=90, **turn)
        session.watch(self._turn, self.azimuth, self.elevation)
        self.selection = text(width=360, height=258, styles={"overflow": "auto"})
        space = pn.Column(pn.Row(self.azimuth, self.elevation), self.space.figure)
        return (
            pn.Row(self.first, self.second, self.channel, self.by, self.words),
            pn.Row(self.left.figure, self.right.figure),
            pn.Row(self.chromaticity.figure, space, self.selection),
        )

    # --- what is shown ---------------------------------------------------------------------------------------------

    def list_files(self) -> None:
        """The files that can be opened, as they are now."""
        self.listed.options = ["", *self.session.folders.files(OPENED_SUFFIXES)]

    def refresh(self) -> None:
        """Everything, from the session's workspace."""
        if self.session.history is None:
            return
        workspace = self.session.workspace
        self._set_controls(workspace)
        for drawing, choice in ((self.left, self.first), (self.right, self.second)):
            all_points = points(workspace, choice.value, self.channel.value)
            drawing.show(
                workspace, all_points, self.by.value, key=(choice.value, self.channel.value, workspace.samples)
            )
            drawing.figure.title.text = all_points.missing or PLOTS[choice.value]
        row = np.arange(len(workspace.samples))
        xy = chromaticities(workspace.samples.srgb)
        by = "residual" if self.by.value == "residual" else "own colour"
        self.chromaticity.show(workspace, _space_points(xy, row), by, 4.0)
        self._turn()
        self.mark()

    def _turn(self) -> None:
        if self.session.history is None:
            return
        workspace = self.session.workspace
        angles = (self.azimuth.value, self.elevation.value)
        view = projected(tristimulus(workspace.samples.srgb), *angles)
        self.space.show(workspace, _space_points(view, np.arange(len(view))), "own colour", 4.0)
        first, second = (projected(tristimulus(ends), *angles) for ends in cube_edges())
        self.cube.data = {
            "xs": [[a[0], b[0]] for a, b in zip(first, second, strict=True)],
            "ys": [[a[1], b[1]] for a, b in zip(first, second, strict=True)],
        }

    def mark(self) -> None:
        """The selection, in all plots and in words."""
        for drawing in (self.left, self.right, self.chromaticity, self.space):
            drawing.mark()
        self.selection.object = self._describe()

    def _outlines(self) -> None:
        locus, triangle = chromaticity_outlines()
        self.chromaticity.figure.line(*locus.T, color="#7a7f85", width=0.8)
        self.chromaticity.figure.line(*triangle.T, color="#1c2024", width=0.8)
        self.cube = ColumnDataSource({"xs": [], "ys": []})
        self.space.figure.multi_line("xs", "ys", source=self.cube, color="#7a7f85", width=0.8)
        self.space.figure.axis.visible = False
        self.space.figure.grid.visible = False

    def _describe(self) -> str:
        rows = np.flatnonzero(self.session.selected)
        if len(rows) == 0:
            return "<h2>No sample selected</h2><p>Draw a lasso or a box in any plot, click a point, or name a row.</p>"
        samples, workspace = self.session.workspace.samples, self.session.workspace
        out = int(workspace.outliers[rows].sum())
        lines = [f"<h2>{len(rows):,} selected, {out:,} of them outliers</h2>"]
        for row in rows[:5]:
            colour = hex_colours(samples.srgb[row : row + 1])[0]
            codes = ", ".join(f"{255 * value:.0f}" for value in samples.srgb[row])
            raw = ", ".join(f"{value:.3f}" for value in samples.raw[row])
            where = f"row {row}, shot {samples.shot[row]}, patch {samples.patch[row]}"
            setting = f"{samples.style[row]}/{samples.white_balance[row]}"
            swatch = f"<span style='float:left;width:26px;height:26px;margin:2px 6px 0 0;background:{colour}'>"
            lines.append(
                f"<p>{swatch}</span>{escape(str(where))}<br>{escape(str(setting))}: JPEG {codes}; RAW {raw}</p>"
            )
        if len(rows) > 5:
            lines.append(f"<p>and {len(rows) - 5:,} more</p>")
        lines.append(shot_picture(samples, self.session.selected, str(samples.shot[rows[0]]), self.session.files))
        return "".join(lines)

    def _set_controls(self, workspace: Workspace) -> None:
        self._quiet = True
        limits = workspace.filters
        self.saturation.value, self.raw_white.value = limits.saturation, limits.raw_saturated
        self.darkest.value, self.brightest.value = round(255 * limits.darkest), round(255 * limits.brightest)
        self.residual.value = self.residual.end if limits.residual is None else limits.residual
        self.groups.options = list(workspace.groups)
        self.groups.value = [name for name, group in workspace.groups.items() if group.active]
        found = ", ".join(f"{name} {int(rows.sum()):,}" for name, rows in workspace.filtered.items())
        kept = int((~workspace.outliers).sum())
        self.counts.object = (
            f"<p>{kept:,} of {len(workspace.samples):,} samples are inliers. "
            f"Found by {found}; by hand and groups {int(workspace.removed.sum()):,}.</p>"
        )
        self._quiet = False

    # --- what is done ----------------------------------------------------------------------------------------------

    def _open(self) -> None:
        named = self.path.value_input or self.path.value or self.listed.value
        self.session.open((self.session.folders.inside(named),))

    def _filter(self) -> None:
        if self._quiet or self.session.history is None:
            return
        far = self.residual.value
        filters = Filters(
            saturation=self.saturation.value,
            darkest=self.darkest.value / 255,
            brightest=self.brightest.value / 255,
            raw_saturated=self.raw_white.value,
            residual=None if far >= self.residual.end else far,
        )
        if filters != self.session.workspace.filters:
            self.session.change(replace(self.session.workspace, filters=filters))

    def _picked(self) -> Mask:
        workspace = self.session.workspace
        if not self.session.selected.any():
            raise WorkspaceError("no samples selected: draw a lasso in a plot, or name rows")
        assert len(self.session.selected) == len(workspace.samples)
        return self.session.selected

    def _mark(self, outlier: bool) -> None:
        rows = self._picked()
        self.session.change(self.session.workspace.mark(rows, outlier))
        self.session.say(f"{int(rows.sum()):,} samples {'marked as outliers' if outlier else 'kept by hand'}")

    def _unmark(self) -> None:
        self.session.change(self.session.workspace.unmark(self._picked()))

    def _save_group(self) -> None:
        workspace = self.session.workspace
        rows = self.session.selected if self.session.selected.any() else workspace.outliers
        name = self.group.value_input or self.group.value
        self.session.change(workspace.with_group(name, rows))
        self.session.say(f"outlier group {name}: {int(rows.sum()):,} samples, in effect")

    def _groups(self) -> None:
        if not self._quiet and self.session.history is not None:
            self.session.change(self.session.workspace.with_active_groups(self.groups.value))

    def _delete(self) -> None:
        name = self.group.value_input or self.group.value
        self.session.change(self.session.workspace.without_group(name))
        self.session.say(f"outlier group {name} deleted")

    def _find(self) -> None:
        if self.words.value:
            self.session.select(find_rows(self.session.workspace.samples, self.words.value))


def _space_points(at: Array, row: NDArray[np.intp]) -> Points:
    return Points(at[:, 0], at[:, 1], row, row, np.full(len(row), -1, dtype=np.intp))
