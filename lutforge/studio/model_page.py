"""Model: response, matrix, gamut map and lattice, with their options, the exposure pairs, and what was found."""

from collections.abc import Callable, Iterable
from dataclasses import fields, replace
from typing import Any

import numpy as np
import panel as pn
import panel_material_ui as pmui

from lutforge.calibration.options import LARGEST_LATTICE, SMALLEST_LATTICE, CalibrationOptions
from lutforge.interpolation import INTERPOLATIONS
from lutforge.model.camera_profile import CameraProfile
from lutforge.model.gamut_map import GamutMap
from lutforge.model.inverse_gamut_map import SolvedInverse
from lutforge.reports import figures
from lutforge.reports.drawing import CHANNELS, Drawing
from lutforge.reports.tables import TITLES, Table, balance_table, matrix_table
from lutforge.studio import ui
from lutforge.studio.controls import bind
from lutforge.studio.models import BASE_MODEL, LATTICE_MODEL, MODEL_TITLES
from lutforge.studio.results import fit_in_turn
from lutforge.studio.session import Session
from lutforge.studio.workspace import Workspace
from lutforge.thesis.options import ThesisOptions

WAYS = {title: direction for direction, title in TITLES.items()}
NO_PROFILE = "Compute a model, or open a profile."
BRACKET_ALONE = (
    "Pictures without RAW give a response alone. Fit response, under Shots, takes all colours of the pictures that are "
    "ticked there; what is chosen here does not reach it."
)


def with_preset(now: Workspace, preset: type[CalibrationOptions] | type[ThesisOptions]) -> Workspace:
    """The workspace with the options of another calibration, which keep the numbers that both have."""
    shared_names = {field.name for field in fields(CalibrationOptions)}
    return replace(now, options=preset(**{name: getattr(now.options, name) for name in shared_names}))


class ModelPage:
    """The page of the third step: fits with their options, and views of what they found."""

    def __init__(self, session: Session) -> None:
        self.session = session
        self.kind = ui.select("Model", {title: key for key, title in MODEL_TITLES.items()}, value=LATTICE_MODEL)
        session.page.watch(self._count, self.kind)
        self.builds_on_stages = ui.checkbox("Build on the fitted response and matrix", True)
        self.used = ui.select("Model in use", ui.NOTHING)
        self.takes = ui.text()
        compute = session.page.button("Compute", self._compute, variant="contained", **ui.FULL_WIDTH)
        self.preset = ui.select("Preset", {"LutForge": CalibrationOptions, "the thesis": ThesisOptions})
        self.options = {  # by their names in the options of the calibration
            "size": ui.slider("Nodes per axis", 33, SMALLEST_LATTICE, LARGEST_LATTICE, 1),
            "nonuniform": ui.select("Node levels", {"follow the error": True, "evenly spaced": False}),
            "interpolation": ui.select("Interpolation", list(INTERPOLATIONS)),
        }
        self.numbers = {  # the same, of the camera model
            "beta": ui.slider("β, saturation of inliers", 0.3, 0.05, 1.0, 0.05),
            "curves": ui.slider("Number of curves", 15, 1, 15, 1),
            "centres": ui.slider("Centres, at most", 4000, 50, 5000, 50),
        }
        self.pairs = pmui.CheckBoxGroup(
            label="Brightness-transfer pairs, with their ratios", options=[], **ui.FULL_WIDTH
        )
        self.bound = [
            bind(session, self.used, lambda now: now.model, lambda now, name: replace(now, model=name)),
            bind(session, self.preset, lambda now: type(now.options), with_preset),
            bind(session,
                self.builds_on_stages, lambda now: now.builds_on_stages,
                lambda now, on: replace(now, builds_on_stages=on),
            ),
            bind(session, self.pairs, ticked_pairs, with_ticked_pairs),
            *(self._bind_option(name, widget) for name, widget in {**self.options, **self.numbers}.items()),
        ]  # fmt: skip
        all_or_none = pn.Row(
            session.page.button("Tick all", lambda: self.pairs.param.update(value=list(self.pairs.options.values()))),
            session.page.button("None", lambda: self.pairs.param.update(value=[])), **ui.FULL_WIDTH,
        )  # fmt: skip
        folds = {
            "Options": (self.preset, *self.options.values()),
            "Response and gamut map": self.numbers.values(),
            "Exposure pairs": (all_or_none, self.pairs),
        }
        columns = [(title, pn.Column(*widgets, **ui.TOGETHER)) for title, widgets in folds.items()]
        folded = pmui.Accordion(*columns, disable_gutters=True, **{**ui.FULL_WIDTH, "margin": (4, 4)})
        self.controls = [self.kind, compute, self.builds_on_stages, self.takes, self.used, folded]
        views = (FitView, GamutView, LatticeView)
        self.views: dict[str, View] = {view.title: view(session) for view in views}
        self.shown = pmui.RadioButtonGroup(
            label="View", options=list(self.views), value=FitView.title, size="small", margin=(2, 8)
        )
        session.page.watch(self._show, self.shown)
        self.remembered = (
            self.kind,
            self.shown,
            *(control for view in self.views.values() for control in view.controls),
        )
        self.body = pn.Column(**ui.FILL)
        self.main = pn.Column(self.shown, self.body, **ui.FILL)

    def _bind_option(self, name: str, widget: Any) -> Callable[[Workspace], None]:
        """Let a control show and change one option of the fit; a whole number stays one."""

        def given(now: Workspace) -> Any:
            return getattr(now.options, name)

        def put(now: Workspace, value: Any) -> Workspace:
            change: dict[str, Any] = {name: int(value) if name in ("size", "curves", "centres") else value}
            return replace(now, options=replace(now.options, **change))

        return bind(self.session, widget, given, put)

    def refresh(self) -> None:
        """Draw the controls and the view of the session's workspace."""
        workspace = self.session.workspace
        if workspace is not None:
            names = {
                MODEL_TITLES[name] + (" (stale)" if workspace.is_stale(name) else ""): name for name in workspace.models
            }
            self.used.options = names or ui.NOTHING
            self.pairs.options = pairs_listed(workspace)
            for show in self.bound:
                show(workspace)
            self._count()
        self._show()

    def _show(self) -> None:
        view = self.views[self.shown.value]
        if list(self.body) != [view.layout]:
            self.body[:] = [view.layout]
        view.draw()

    def _count(self) -> None:
        """Show how many samples the chosen fit takes, and what it builds on."""
        workspace = self.session.workspace
        kind = self.kind.value
        if workspace is None:
            return
        for control in (self.builds_on_stages, self.preset, self.pairs, *self.options.values(), *self.numbers.values()):
            control.disabled = not workspace.has_raw
        if not workspace.has_raw:
            self.takes.object = ui.paragraphs(BRACKET_ALONE)
            return
        rows = int(workspace.fitting_rows(kind).sum())
        count = len(workspace.samples)
        left_out = "all outliers" if kind == BASE_MODEL else "outliers, but for saturated colours, which it needs"
        words = f"Fitted to {rows:,} of {count:,} samples: without {left_out}."
        if kind != BASE_MODEL and workspace.task(kind).stages is not None:
            words += " It builds on the response and matrix that you fitted."
        elif kind != BASE_MODEL:
            words += " Response and matrix are fitted along with it."
        self.takes.object = ui.paragraphs(words)

    def _compute(self) -> None:
        """Fit the chosen model."""
        fit_in_turn(self.session, self.kind.value)


def pairs_listed(workspace: Workspace) -> dict[str, tuple[str, str]]:
    """The pairs of shots by a label with the exposure ratio and the number of samples."""
    pairs = workspace.pairs
    listed = dict[str, tuple[str, str]]()
    if pairs is None:
        return listed
    for place in np.unique(pairs.shot_pair):
        rows = pairs.shot_pair == place
        first, second = (pairs.shots[number] for number in divmod(place, len(pairs.shots)))
        ratio = float(np.exp(pairs.log_ratio[rows][0]))
        listed[f"× {ratio:.2f}, {int(rows.sum())} samples: {first} – {second}"] = first, second
    return listed


def ticked_pairs(workspace: Workspace) -> list[tuple[str, str]]:
    """The pairs of shots from which the response is fitted."""
    return [names for names in pairs_listed(workspace).values() if names not in workspace.unticked_pairs]


def with_ticked_pairs(workspace: Workspace, ticked: Iterable[tuple[str, str]]) -> Workspace:
    """The workspace in which just these pairs of shots are ticked."""
    return replace(workspace, unticked_pairs=frozenset(pairs_listed(workspace).values()).difference(ticked))


class View:
    """Controls above figures, which are drawn when the view is shown, when a control moves, and after changes."""

    title = ""

    def __init__(self, session: Session, *controls: Any, beside: Any = None) -> None:
        self.session = session
        self.controls = controls
        self.figures = ui.Figures()
        session.page.watch(
            self.draw, *(control for control in controls if isinstance(control, pmui.Select | pmui.FloatSlider))
        )
        drawn = self.figures.layout if beside is None else pn.Row(self.figures.layout, beside, **ui.FILL)
        self.layout = pn.Column(pn.Row(*controls, sizing_mode="stretch_width"), drawn, **ui.FILL)

    def draw(self) -> None:
        """Draw the session's workspace and profile."""


class FitView(View):
    """The response and the residuals of the model in use, its matrix and white balances (thesis A.3.1, A.3.2)."""

    title = "Fit"

    def __init__(self, session: Session) -> None:
        self.numbers = ui.text(**ui.SCROLLED)
        super().__init__(session, beside=self.numbers)

    def draw(self) -> None:
        """Draw the session's workspace and profile."""
        response = None
        words = ui.paragraphs("The matrix and the white balances stand here after a fit.")
        profile = self.session.profile
        workspace = self.session.workspace
        if profile is not None:
            curves = figures.response_figure(next(iter(profile.styles.values()))).panels
            response = Drawing((curves[:1],))
            notes = (*map(str, profile.diagnoses), *profile.notes)
            title = ui.Html("<h2>Notes</h2>" if notes else "")
            tables = ui.table(matrix_table(profile)), ui.table(balance_table(profile))
            words = ui.html("{}{}{}{}", *tables, title, ui.paragraphs(*notes))
        if workspace is not None and workspace.has_raw and workspace.fitted is not None:
            words = ui.Html(ui.table(residuals(workspace)) + words)
        self.figures.show(response, NO_PROFILE)
        self.numbers.object = words


def residuals(workspace: Workspace) -> Table:
    """Tabulate RGB distances of what models render, on the samples in the fit."""
    rows = workspace.fitted_rows
    srgb = workspace.samples.srgb
    cells = []
    for name, model in workspace.models.items():
        distance = np.linalg.norm(model.predicted.rendered[rows] - srgb[rows], axis=1)
        finite = distance[np.isfinite(distance)]
        if len(finite):
            error = held_out_error(model.profile)
            numbers = (finite.mean(), *np.percentile(finite, [50, 95, 100]))
            left_out = "–" if error is None else f"{error:.4f}"
            stale = " (stale)" if workspace.is_stale(name) else ""
            cells.append((MODEL_TITLES[name] + stale, *(f"{value:.4f}" for value in numbers), left_out))
    header = ("model", "mean", "median", "95 %", "max", "held out")
    return Table(f"Residuals, RAW → JPEG, on {int(rows.sum()):,} samples", header, cells)


def held_out_error(profile: CameraProfile) -> float | None:
    """The mean error of a profile on shots left out, over its styles; None where it was not measured."""
    measured = [style.errors["render_mean"] for style in profile.styles.values() if "render_mean" in style.errors]
    return float(np.mean(measured)) if measured else None


class GamutView(View):
    """Where the gamut map takes a slice of constant luminance: a surface in 3D (thesis, Fig. A.11)."""

    title = "Gamut map"

    def __init__(self, session: Session) -> None:
        self.direction = ui.select("Direction", WAYS, **ui.NARROW)
        self.luminance = ui.slider("Luminance Y of the slice", 0.25, 0.02, 0.9, **ui.NARROW)
        self.style = ui.select("Style", ui.NOTHING, **ui.NARROW)
        self.space = ui.Space()
        super().__init__(session, self.direction, self.luminance, self.style)

    def draw(self) -> None:
        """Draw the gamut map of the session's profile, or of the last one that has any."""
        profile = self.session.profile
        workspace = self.session.workspace
        maps = dict[str, GamutMap | SolvedInverse]()
        level = self.luminance.value
        if workspace is not None and LATTICE_MODEL in workspace.models:
            profile = workspace.models[LATTICE_MODEL].profile
        for name, style in () if profile is None else profile.styles.items():
            for model in style.models[:1]:
                if len(model.gamut_map.centres) > 1:  # one centre: it changes nothing
                    maps[name] = model.gamut_map if self.direction.value == "render" else model.inverse_gamut_map
        self.layout[1] = self.space.layout if maps else self.figures.layout
        ui.offer(self.style, maps)
        if not maps:
            self.figures.show(None, "No gamut map: compute the model “Lattice”.")
            return

        # Where h takes the slice, its outline, and the control points near it, in the cube of linear sRGB
        name = self.style.value
        order = [0, 2, 1]  # R to the right, B to the back, G up: the slice lies nearly flat
        before = figures.slice_grid(level)
        gamut_map = maps[name]
        after = gamut_map(before)
        x, y, z = (after[..., channel].tolist() for channel in order)
        change = np.linalg.norm(after - before, axis=2)
        surface = {
            "type": "surface", "x": x, "y": y, "z": z, "surfacecolor": change.tolist(), "colorscale": "Cividis",
            "cmin": 0.0, "cmax": max(0.02, float(change.max())), "colorbar": {"title": {"text": "change"}, "len": 0.7},
        }  # fmt: skip
        traces = [
            surface,
            ui.lines_in_space(figures.cube_edges()[..., order]),
            ui.lines_in_space(before[-1:][..., order], "#4f83e0", 5.0),
            ui.dots_in_space(figures.centres_near(gamut_map, level)[:, order], CHANNELS[0][1]),
        ]
        drawn = "gamut map" if self.direction.value == "render" else "inverse gamut map"
        title = f"{name}, Y = {level:.2f}: where the {drawn} takes this slice"
        self.space.show(title, traces, ("R", "B", "G"))


class LatticeView(View):
    """A lattice: its node levels, grey axis and coverage, and where a plane goes."""

    title = "Lattice"

    def __init__(self, session: Session) -> None:
        self.direction = ui.select("Direction", WAYS, **ui.NARROW)
        self.style = ui.select("Style", ui.NOTHING, **ui.NARROW)
        channels = {name: place for place, (name, _, _) in enumerate(CHANNELS)}
        self.channel = ui.select("Plane of", channels, value=2, **ui.NARROW)
        self.level = ui.slider("at its level", 0.4, 0.0, 1.0, **ui.NARROW)
        super().__init__(session, self.direction, self.style, self.channel, self.level)

    def draw(self) -> None:
        """Draw the session's workspace and profile."""
        direction = self.direction.value
        channel = int(self.channel.value)
        profile = self.session.profile
        ui.offer(self.style, () if profile is None else profile.styles)
        style = None if profile is None else profile.styles[self.style.value]
        lattice = None if style is None else style.lattices.get(direction)
        if style is None or lattice is None:
            self.figures.show(None, NO_PROFILE if style is None else "This model has no lattice: compute one.")
            return
        levels, grey, *coverage = figures.lattice_figure(style, [direction]).panels
        plane = figures.plane_figure(lattice, figures.ENDS[direction][1], {channel: self.level.value}).panels
        self.figures.show(Drawing(((levels, grey), (*coverage, *plane))))
