"""Samples: linked plots, filters, marks by hand, named groups of outliers (thesis A.3, A.3.1)."""

import re
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import panel as pn
import panel_material_ui as pmui
from bokeh.models import Range1d

from lutforge.arrays import Mask
from lutforge.colour.srgb import chromaticities
from lutforge.reports.drawing import GREY, Dots, Drawing, Panel, Raster, thinned
from lutforge.reports.figures import chromaticity_outlines, cube_edges
from lutforge.samples.sample_set import SampleSet
from lutforge.studio import ui
from lutforge.studio.brushed_plot import MOST_DRAWN, BrushedPlot
from lutforge.studio.controls import bind
from lutforge.studio.filter_columns import FILTER_COLUMNS
from lutforge.studio.sample_plots import (
    BY_COLOUR,
    BY_PAIR,
    COLOURS,
    PLOTS,
    SPACES_OF,
    Points,
    Rows,
    colours_in_space,
    points,
    tristimulus,
)
from lutforge.studio.session import Session
from lutforge.studio.workspace import KEPT_BY_HAND, OUTLIER_BY_HAND, UNMARKED, HandMark, Workspace, WorkspaceError

NEWS_OF_MARK: dict[HandMark, str] = {
    OUTLIER_BY_HAND: "marked as outliers",
    KEPT_BY_HAND: "kept by hand",
    UNMARKED: "no longer marked",
}

BRACKET_FIT = (
    "Limits and groups choose what is drawn of a bracket: its response is fitted to all colours of the pictures that "
    "are ticked under Shots."
)
SELECTED_FRAME = "#00e5ff"
OUTLIER_FRAME = "#ff8c00"
INLIER_FRAME = "#ffffff"
"""The colours of frames round samples in the picture of their shot."""


class SamplesPage:
    """The page of the second step: plots of samples, filters, marks and groups of outliers."""

    def __init__(self, session: Session) -> None:
        self.session = session
        session.page.on_select = self.show_selection
        self._samples: SampleSet | None = None  # those of which the plots were last chosen

        plots = {plot.title: key for key, plot in PLOTS.items()}
        self.first = ui.select("Left plot", plots, value="srgb_btf")
        self.second = ui.select("Right plot", plots, value="srgb_raw")
        self.channel = ui.select("Channel", {"Red": 0, "Green": 1, "Blue": 2}, value=1)
        self.channel.param.update(sizing_mode="fixed", width=105)
        self.by = ui.select("Colour by", list(COLOURS))
        self.inliers = ui.checkbox("Inliers only")
        self.space_of = ui.select("In xy and XYZ", list(SPACES_OF))
        self.picture_of = ui.select("Picture of the shot", ui.NOTHING)
        views = (self.first, self.second, self.channel, self.by, self.space_of, self.picture_of, self.inliers)
        session.page.watch(self.refresh, *views)

        self.words = ui.entry("Select row, shot or patch")
        session.page.watch(self._select_words, self.words)
        self.counts = ui.text()
        self.group = ui.entry("Outlier group", placeholder="name")
        self.groups = pmui.CheckBoxGroup(label="Groups in effect", options=[], **ui.FULL_WIDTH)
        self.remembered = (*views, self.words, self.group)
        limits = {name: self._limit_slider(name) for name in FILTER_COLUMNS}
        self.bound = [bind(session, self.groups, lambda now: now.active_groups, Workspace.with_active_groups)]
        for name, slider in limits.items():
            read = partial(Workspace.limits_of, name=name)
            put = partial(Workspace.with_limits, name=name)
            self.bound.append(bind(session, slider, read, put))

        mark_buttons = self._buttons(
            {
                "Outliers": partial(self._mark, OUTLIER_BY_HAND),
                "Keep": partial(self._mark, KEPT_BY_HAND),
                "Unmark": partial(self._mark, UNMARKED),
            }
        )
        group_buttons = self._buttons({"Save group": self._save_group, "Delete group": self._delete_group})
        coloured = pn.Row(self.channel, self.by, sizing_mode="stretch_width")
        more_views = (self.space_of, self.picture_of, self.inliers)
        self.controls = [
            pn.Column(self.first, self.second, coloured, *more_views, **ui.TOGETHER),
            pn.Column(self.words, mark_buttons, **ui.TOGETHER),
            pn.Column(*limits.values(), self.counts, **ui.TOGETHER),
            pn.Column(self.group, group_buttons, self.groups, **ui.TOGETHER),
        ]

        self.left, self.right = BrushedPlot(session), BrushedPlot(session)
        ranges = {"x_range": Range1d(-0.08, 0.92), "y_range": Range1d(-0.03, 0.87)}
        self.chromaticity = BrushedPlot(session, "CIE xy: inliers ●, outliers ×", **ranges)
        for outline in chromaticity_outlines():
            self.chromaticity.figure.line(*outline.T, color=GREY, width=1.0)
        self.space = ui.Space()
        self.picture = ui.Figures()
        self.selection = ui.text(styles={"overflow": "auto"}, height=110)
        chosen = pn.Column(self.picture.layout, self.selection, **ui.FILL)
        self.main = pn.Column(
            pn.Row(self.left.figure, self.right.figure, **ui.FILL),
            pn.Row(self.chromaticity.figure, self.space.layout, chosen, **ui.FILL), **ui.FILL,
        )  # fmt: skip

    def _limit_slider(self, name: str) -> pmui.RangeSlider:
        """A slider of the limits of a column."""
        column = FILTER_COLUMNS[name]
        start, end = column.reach
        return pmui.RangeSlider(
            label=column.title, value=column.reach, start=start, end=end, step=column.step, size="small",
            **ui.FULL_WIDTH,
        )  # fmt: skip

    def _buttons(self, actions: dict[str, Callable[[], None]]) -> pn.Row:
        """A row of small buttons, by their labels."""
        small: dict[str, Any] = {"sizing_mode": "stretch_width", "margin": 2}
        buttons = (self.session.page.button(label, action, **small) for label, action in actions.items())
        return pn.Row(*buttons, **ui.FULL_WIDTH)

    def refresh(self) -> None:
        """Draw the session's workspace."""
        workspace = self.session.workspace
        if workspace is None:
            return
        if self._samples is not workspace.samples:
            self._samples = workspace.samples
            self._choose_plots(workspace)
        self._show_controls(workspace)
        self._show_plots(workspace)
        self._show_colours(workspace)
        self.show_selection()

    def _choose_plots(self, workspace: Workspace) -> None:
        """Begin with plots that say something of these samples: without exposure pairs, what the filters cut."""
        if self.first.value in ("srgb_btf", "saturation"):
            paired = workspace.pairs is not None
            self.first.value, self.by.value = ("srgb_btf", BY_PAIR) if paired else ("saturation", BY_COLOUR)
        if not workspace.has_raw:
            self.second.value = "saturation"

    def _show_controls(self, workspace: Workspace) -> None:
        """The shots, groups and limits, and how many samples they leave."""
        accounts = self.session.opened.accounts
        ui.offer(self.picture_of, [account.shot for account in accounts if account.cells is not None])
        self.groups.options = list(workspace.groups)
        self.groups.visible = bool(workspace.groups)
        for show in self.bound:
            show(workspace)
        outside = "; ".join(f"{FILTER_COLUMNS[name].title}: {out.sum():,}" for name, out in workspace.filtered.items())
        self.counts.object = ui.paragraphs(
            f"{int((~workspace.outliers).sum()):,} of {len(workspace.samples):,} samples are inliers. Left out by each "
            f"limit: {outside}. By hand, by groups and with shots: {int(workspace.excluded.sum()):,}.",
            *([] if workspace.has_raw else [BRACKET_FIT]),
        )

    def _show_plots(self, workspace: Workspace) -> None:
        """The two plots that are chosen."""
        channel = self.channel.value
        for plot, choice in ((self.left, self.first.value), (self.right, self.second.value)):
            shown = points(workspace, choice, channel)
            plot.figure.title.text = shown.missing or PLOTS[choice].title
            plot.show(workspace, shown, self.by.value, self.inliers.value)
            plot.frame((choice, channel, workspace.samples))

    def _show_colours(self, workspace: Workspace) -> None:
        """The colours of the samples in CIE xy, and in CIE XYZ within the cube of sRGB."""
        linear, row = colours_in_space(workspace, self.space_of.value)
        x, y = chromaticities(linear).T
        no_pair = np.full(len(row), -1, dtype=np.intp)
        in_xy = Points(x, y, row, row, no_pair, "x", "y")
        self.chromaticity.show(workspace, in_xy, BY_COLOUR, self.inliers.value, 4.0)

        drawn = thinned(len(row), MOST_DRAWN)
        xyz = tristimulus(linear[drawn])
        drawn_row = row[drawn]
        out = workspace.outliers[drawn_row]
        inside = ui.dots_in_space(xyz[~out], ui.hex_colours(workspace.samples.srgb[drawn_row[~out]]))
        traces = [ui.lines_in_space(tristimulus(cube_edges())), inside]
        if not self.inliers.value:
            traces.append(ui.dots_in_space(xyz[out], "#e0503c", symbol="x"))
        self.space.show("CIE XYZ: outliers red", traces, ("X", "Z", "Y"))

    def show_selection(self) -> None:
        """Show the selection in all plots, in the picture of its shot, and in words."""
        for plot in (self.left, self.right, self.chromaticity):
            plot.mark()
        workspace = self.session.workspace
        if workspace is not None:
            self.selection.object = describe(workspace, np.flatnonzero(self.session.selected))
            self._show_picture(workspace, self._shot_of_selection(workspace))

    def _shot_of_selection(self, workspace: Workspace) -> str:
        """The shot that is chosen, else that of the first selected sample, which becomes the chosen one."""
        selected = self.session.selected
        shot = workspace.samples.shot
        chosen = str(self.picture_of.value)
        if not selected.any() or (selected & (shot == chosen)).any():
            return chosen
        chosen = str(shot[np.flatnonzero(selected)[0]])
        if chosen in self.picture_of.options:
            with self.session.page.setting():
                self.picture_of.value = chosen
        return chosen

    def _show_picture(self, workspace: Workspace, shot: str) -> None:
        """The picture of a shot with a frame round each of its samples."""
        selected = self.session.selected
        account = {account.shot: account for account in self.session.opened.accounts}.get(shot)
        rows = workspace.samples.shot == shot
        out = workspace.outliers
        if account is None or account.cells is None or len(account.places) != rows.sum():
            self.picture.show(None, "Open the folder of the shots to see where samples are.")
            return
        picture = account.cells.picture / 255
        places = (account.places * [1, -1] + [0, 1]) * picture.shape[1::-1]
        kinds = ((~out & ~selected, INLIER_FRAME, 5.0), (out, OUTLIER_FRAME, 7.0), (selected, SELECTED_FRAME, 11.0))
        frames = [Dots(places[which[rows]], colour, marker="square", size=size) for which, colour, size in kinds]
        self.picture.show(Drawing(((Panel(shot, (Raster(picture), *frames), bare=True, equal=True),),)))

    def _select_words(self) -> None:
        """Select the rows, the shot or the patch that the visitor has named."""
        samples = self.session.require_workspace().samples
        self.session.select(find_rows(samples, self.words.value))

    def _mark(self, mark: HandMark) -> None:
        """Mark the selected samples by hand."""
        workspace = self.session.require_workspace()
        rows = self.session.selected
        if not workspace.has_raw:
            raise WorkspaceError("the colours of a bracket are not chosen by hand: leave pictures out under Shots")
        if not rows.any():
            raise WorkspaceError("no samples selected: draw a lasso in a plot, or name rows")
        news = f"{int(rows.sum()):,} samples {NEWS_OF_MARK[mark]}"
        self.session.change_workspace(workspace.mark(rows, mark), news)

    def _save_group(self) -> None:
        """Save the selected samples, or else all outliers, as the named group."""
        workspace = self.session.require_workspace()
        name = ui.written(self.group)
        rows = self.session.selected if self.session.selected.any() else workspace.outliers
        news = f"outlier group {name}: {int(rows.sum()):,} samples, in effect"
        self.session.change_workspace(workspace.with_group(name, rows), news)

    def _delete_group(self) -> None:
        """Delete the named group; its samples take part again."""
        name = ui.written(self.group)
        workspace = self.session.require_workspace().without_group(name)
        self.session.change_workspace(workspace, f"outlier group {name} deleted")


def describe(workspace: Workspace, rows: Rows) -> ui.Html:
    """Selected samples in words."""
    samples = workspace.samples
    if len(rows) == 0:
        return ui.paragraphs(
            "No sample selected: draw a lasso or a box in a plot, click a point, or name a row. In the picture "
            "outliers have orange frames, selected samples blue ones."
        )
    out = int(workspace.outliers[rows].sum())
    lines = [ui.html("<h2>{} selected, {} of them outliers</h2>", f"{len(rows):,}", f"{out:,}")]
    for row in rows[:8]:
        codes = ", ".join(f"{255 * value:.0f}" for value in samples.srgb[row])
        raw = "" if not workspace.has_raw else "; RAW " + ", ".join(f"{value:.3f}" for value in samples.raw[row])
        where = f"row {row}, shot {samples.shot[row]}, patch {samples.patch[row]}"
        setting = f"{samples.style[row]}/{samples.white_balance[row]}: JPEG {codes}{raw}"
        (colour,) = ui.hex_colours(samples.srgb[row : row + 1])
        lines.append(ui.html("<p><i class=colour style='background:{}'></i>{}<br>{}</p>", colour, where, setting))
    lines += [ui.html("<p>and {} more</p>", f"{len(rows) - 8:,}")] if len(rows) > 8 else []
    return ui.Html("".join(lines))


def find_rows(samples: SampleSet, words: str) -> Mask:
    """(n,) rows by number ("12, 40-60"), else by the name of their shot or patch. Raises WorkspaceError: none of these.

    Without words there is nothing to find, and no row is selected.
    """
    words = words.strip()
    count = len(samples)
    rows = np.zeros(count, dtype=np.bool_)
    if re.fullmatch(r"[\d\s,-]{1,2000}", words):
        for first, last in re.findall(r"(\d{1,12})(?:\s*-\s*(\d{1,12}))?", words):
            rows[int(first) : int(last or first) + 1] = True
    else:
        rows = (samples.shot == words) | (samples.patch == words)
    if words and not rows.any():
        raise WorkspaceError(f"{words[:60]}: no such row, shot or patch; rows count from 0 to {count - 1}")
    return rows
