"""Samples: linked plots, filters, marks by hand, named groups of outliers (thesis A.3, A.3.1)."""

import re
from dataclasses import replace
from html import escape

import numpy as np
import panel as pn
import panel_material_ui as pmui
from bokeh.models import ColumnDataSource

from lutforge.arrays import Array, Mask
from lutforge.colour.srgb import srgb_decode
from lutforge.report.figures import chromaticity_outlines
from lutforge.samples.sample_set import SampleSet
from lutforge.studio.brushed_plot import BrushedPlot
from lutforge.studio.colours_in_space import chromaticities, cube_edges, projected, tristimulus
from lutforge.studio.elements import FILL, LINE, TOGETHER, WIDE, entry, frame, select, slider, text, ticks, written
from lutforge.studio.plots import COLOURS, PLOTS, Points, hex_colours, points
from lutforge.studio.session import Session
from lutforge.studio.workspace import Filters, Workspace, WorkspaceError

SPACES = {"JPEG colours": "jpeg", "transformed RAW": "raw", "both": "both"}


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


class SamplesPage:
    """The studio's second step: plots of the samples, filters and marks."""

    def __init__(self, session: Session) -> None:
        self.session = session
        self._seen: SampleSet | None = None
        self.controls = [self._view(), self._filters(), self._hand()]
        self.main = self._plots()

    def _view(self) -> pn.Column:
        """What is plotted."""
        plots = {title: key for key, title in PLOTS.items()}
        self.first = select("Left plot", plots, value="srgb_btf")
        self.second = select("Right plot", plots, value="srgb_raw")
        self.channel = select("Channel", {"Red": 0, "Green": 1, "Blue": 2}, value=1)
        self.by = select("Colour by", list(COLOURS))
        self.inliers = pmui.Checkbox(label="Inliers only", **WIDE)
        self.space_of = select("In xy and XYZ", SPACES)
        self.session.watch(self.refresh, self.first, self.second, self.channel, self.by, self.inliers, self.space_of)
        return pn.Column(self.first, self.second, self.channel, self.by, self.space_of, self.inliers, **TOGETHER)

    def _filters(self) -> pn.Column:
        """The limits of the filters, and what they find."""
        self.saturation = slider("Saturation limit", 1.0, 0.02, 1.0)
        self.darkest = slider("Darkest JPEG code", 1, 0, 60, 1)
        self.brightest = slider("Brightest JPEG code", 254, 180, 255, 1)
        self.raw_white = slider("RAW saturated from", 0.98, 0.5, 1.0)
        self.residual = slider("Residual distance, 0: any", 0.0, 0.0, 0.25, 0.005)
        limits = (self.saturation, self.darkest, self.brightest, self.raw_white, self.residual)
        self.session.watch(self._filter, *limits)
        self.counts = text()
        return pn.Column(*limits, self.counts, **TOGETHER)

    def _hand(self) -> pn.Column:
        """Selection by words, marks by hand and groups."""
        session, small = self.session, {"sizing_mode": "stretch_width", "margin": 2}
        self.words = entry("Select row, shot or patch")
        session.watch(self._find, self.words)
        self.group = entry("Outlier group", placeholder="name")
        self.groups = ticks("Groups in effect")
        session.watch(self._groups, self.groups)
        marks = (("Outliers", lambda: self._mark(True)), ("Keep", lambda: self._mark(False)), ("Unmark", self._unmark))
        named = (("Save group", self._save_group), ("Delete group", self._delete))
        return pn.Column(
            self.words, pn.Row(*(session.button(label, action, **small) for label, action in marks), **WIDE),
            self.group, pn.Row(*(session.button(label, action, **small) for label, action in named), **WIDE),
            self.groups, **WIDE,
        )  # fmt: skip

    def _plots(self) -> pn.Column:
        """Two plots of the samples, their colours in space, and the selection."""
        self.left, self.right = (BrushedPlot(self.session) for _ in range(2))
        self.chromaticity = BrushedPlot(self.session, "CIE xy: inliers ●, outliers ×")
        frame(self.chromaticity.figure, (-0.08, 0.92), (-0.03, 0.87))
        self.space = BrushedPlot(self.session, "CIE XYZ")
        frame(self.space.figure, (-1.1, 1.1), (-0.85, 0.85))
        self.chromaticity.framed = self.space.framed = None
        self._outlines()
        turn = {"margin": (0, 12), "sizing_mode": "stretch_width"}
        self.azimuth = slider("Turn", -35, -180, 180, 5, **turn)
        self.elevation = slider("Tilt", 20, -90, 90, 5, **turn)
        self.session.watch(self._turn, self.azimuth, self.elevation)
        self.selection = text(styles={"overflow": "auto"}, sizing_mode="stretch_both")
        space = pn.Column(pn.Row(self.azimuth, self.elevation, sizing_mode="stretch_width"), self.space.figure, **FILL)
        return pn.Column(
            pn.Row(self.left.figure, self.right.figure, **FILL),
            pn.Row(self.chromaticity.figure, space, self.selection, **FILL), **FILL,
        )  # fmt: skip

    # --- what is shown ---------------------------------------------------------------------------------------------

    def refresh(self) -> None:
        """Everything, from the session's workspace."""
        if self.session.history is None:
            return
        workspace = self.session.workspace
        if self._seen is not workspace.samples:
            self._seen = workspace.samples
            if self.first.value in ("srgb_btf", "saturation"):  # without pairs, what the filters cut
                paired = workspace.pairs is not None
                self.first.value, self.by.value = ("srgb_btf", COLOURS[0]) if paired else ("saturation", COLOURS[1])
        self._set_controls(workspace)
        for drawing, choice in ((self.left, self.first), (self.right, self.second)):
            shown = points(workspace, choice.value, self.channel.value)
            key = (choice.value, self.channel.value, workspace.samples)
            drawing.show(workspace, self._chosen(workspace, shown), self.by.value, key=key)
            drawing.figure.title.text = shown.missing or PLOTS[choice.value]
        by = "residual" if self.by.value == "residual" else "own colour"
        xy = tuple(chromaticities(values) for values in self._space(workspace))
        self.chromaticity.show(workspace, self._chosen(workspace, _space_points(xy)), by, 4.0)
        self._turn()
        self.mark()

    def _chosen(self, workspace: Workspace, shown: Points) -> Points:
        """The points, those of inliers alone where that is ticked."""
        if not self.inliers.value:
            return shown
        return shown.select(~(workspace.outliers[shown.row] | workspace.outliers[shown.partner]))

    def _space(self, workspace: Workspace) -> list[Array]:
        """Linear sRGB (n, 3) of the JPEG, of the transformed RAW, or of both."""
        parts = [] if self.space_of.value == "raw" else [srgb_decode(np.clip(workspace.samples.srgb, 0.0, 1.0))]
        if self.space_of.value != "jpeg" and workspace.fitted is not None:
            parts.append(workspace.fitted.scene)
        return parts or [np.zeros((0, 3))]

    def _turn(self) -> None:
        if self.session.history is None:
            return
        workspace, angles = self.session.workspace, (self.azimuth.value, self.elevation.value)
        parts = tuple(projected(tristimulus(values), *angles) for values in self._space(workspace))
        self.space.show(workspace, self._chosen(workspace, _space_points(parts)), "own colour", 4.0)
        first, second = (projected(tristimulus(ends), *angles) for ends in cube_edges())
        self.cube.data = {
            "xs": [[a[0], b[0]] for a, b in zip(first, second, strict=True)],
            "ys": [[a[1], b[1]] for a, b in zip(first, second, strict=True)],
        }

    def mark(self) -> None:
        """The selection, in all plots and in words."""
        for drawing in (self.left, self.right, self.chromaticity, self.space):
            drawing.mark()
        if self.session.history is not None:
            self.selection.object = self._describe()

    def _outlines(self) -> None:
        locus, triangle = chromaticity_outlines()
        self.chromaticity.figure.line(*locus.T, color=LINE, width=0.8)
        self.chromaticity.figure.line(*triangle.T, color=LINE, width=1.2)
        self.cube = ColumnDataSource({"xs": [], "ys": []})
        self.space.figure.multi_line("xs", "ys", source=self.cube, color=LINE, width=0.8)
        self.space.figure.axis.visible = False
        self.space.figure.grid.visible = False

    def _describe(self) -> str:
        rows = np.flatnonzero(self.session.selected)
        if len(rows) == 0:
            return "<h2>No sample selected</h2><p>Draw a lasso or a box in any plot, click a point, or name a row.</p>"
        samples, workspace = self.session.workspace.samples, self.session.workspace
        out = int(workspace.outliers[rows].sum())
        lines = [f"<h2>{len(rows):,} selected, {out:,} of them outliers</h2>"]
        for row in rows[:8]:
            colour = hex_colours(samples.srgb[row : row + 1])[0]
            codes = ", ".join(f"{255 * value:.0f}" for value in samples.srgb[row])
            raw = ", ".join(f"{value:.3f}" for value in samples.raw[row])
            where = f"row {row}, shot {samples.shot[row]}, patch {samples.patch[row]}"
            setting = f"{samples.style[row]}/{samples.white_balance[row]}"
            swatch = f"<span style='float:left;width:26px;height:26px;margin:2px 6px 0 0;background:{colour}'>"
            lines.append(
                f"<p>{swatch}</span>{escape(str(where))}<br>{escape(str(setting))}: JPEG {codes}; RAW {raw}</p>"
            )
        lines += [f"<p>and {len(rows) - 8:,} more</p>"] if len(rows) > 8 else []
        return "".join(lines)

    def _set_controls(self, workspace: Workspace) -> None:
        limits = workspace.filters
        self.saturation.value, self.raw_white.value = limits.saturation, limits.raw_saturated
        self.darkest.value, self.brightest.value = round(255 * limits.darkest), round(255 * limits.brightest)
        self.residual.value = limits.residual or 0.0
        self.groups.options = list(workspace.groups)
        self.groups.value = [name for name, group in workspace.groups.items() if group.active]
        found = ", ".join(f"{name} {int(rows.sum()):,}" for name, rows in workspace.filtered.items())
        kept = int((~workspace.outliers).sum())
        self.counts.object = (
            f"<p>{kept:,} of {len(workspace.samples):,} samples are inliers. "
            f"Found by {found}; by hand, groups and shots {int(workspace.removed.sum()):,}.</p>"
        )

    # --- what is done ----------------------------------------------------------------------------------------------

    def _filter(self) -> None:
        if self.session.history is None:
            return
        now = self.session.workspace.filters
        filters = Filters(
            saturation=self.saturation.value,
            darkest=_limit(now.darkest, self.darkest.value),
            brightest=_limit(now.brightest, self.brightest.value),
            raw_saturated=self.raw_white.value,
            residual=self.residual.value or None,
        )
        if filters != now:
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
        name = written(self.group)
        self.session.change(workspace.with_group(name, rows))
        self.session.say(f"outlier group {name}: {int(rows.sum()):,} samples, in effect")

    def _groups(self) -> None:
        if self.session.history is None:
            return
        workspace = self.session.workspace
        if set(self.groups.value) != {name for name, group in workspace.groups.items() if group.active}:
            self.session.change(workspace.with_active_groups(self.groups.value))

    def _delete(self) -> None:
        name = written(self.group)
        self.session.change(self.session.workspace.without_group(name))
        self.session.say(f"outlier group {name} deleted")

    def _find(self) -> None:
        if self.words.value:
            self.session.select(find_rows(self.session.workspace.samples, self.words.value))


def _limit(now: float, code: float) -> float:
    """The limit of a slider of whole codes; one that it does not show otherwise stays as it is."""
    return now if round(255 * now) == code else code / 255


def _space_points(parts: tuple[Array, ...]) -> Points:
    """The points of one or two places (n, 2) of each sample."""
    at = np.concatenate(parts)
    row = np.tile(np.arange(len(parts[0])), len(parts))
    shown = Points(at[:, 0], at[:, 1], row, row, np.full(len(row), -1, dtype=np.intp))
    return shown.select(np.asarray(np.isfinite(at).all(axis=1)))
