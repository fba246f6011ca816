"""Model: response, matrix, gamut map and lattice, with their options, the exposure pairs, and what was found."""

from dataclasses import replace
from typing import Any, cast

import numpy as np
import panel as pn
import panel_material_ui as pmui

from lutforge.arrays import Array
from lutforge.calibration.options import LARGEST, PRESETS, SMALLEST, CalibrationOptions, PhysicalOptions, Preset
from lutforge.evaluation.next_shots import colour_gaps
from lutforge.interpolation import INTERPOLATIONS, Interpolation
from lutforge.model.camera_profile import CameraProfile
from lutforge.model.gamut_map import GamutMap
from lutforge.model.profile_data import DIRECTIONS as DIRECTION_NAMES
from lutforge.pipeline.evaluation import evaluate
from lutforge.pipeline.predictions import without_a_model
from lutforge.progress import Progress
from lutforge.report.drawing import CHANNELS, Drawing, Panel
from lutforge.report.error_maps import DIRECTIONS, ErrorMaps, maps_of_file
from lutforge.report.figures import (
    ENDS,
    centres_near,
    cube_edges,
    error_over_hue,
    gamut_figure,
    lattice_figure,
    levels_on_errors,
    plane_figure,
    residuals_figure,
    response_figure,
    slice_grid,
)
from lutforge.report.tables import TITLES, Table, balance_table, error_table, matrix_table
from lutforge.samples.sample_set import SampleSet, with_setting_names
from lutforge.studio.bokeh_figure import FILL, Figures, Space, dots_in_space, lines_in_space
from lutforge.studio.elements import (
    NARROW,
    NOTHING,
    TOGETHER,
    WIDE,
    Html,
    checkbox,
    html,
    offer,
    paragraphs,
    sections,
    select,
    slider,
    table,
    text,
    ticks,
)
from lutforge.studio.session import Session
from lutforge.studio.workspace import MODELS, Workspace, WorkspaceError

WAYS = {title: direction for direction, title in TITLES.items()}
SMOOTHNESS = {"by held-out shots": None, **{f"{rho:g}": rho for rho in (1e-10, 1e-9, 1e-8, 1e-7, 1e-6, 1e-5)}}
COMPARED = ("nonuniform", "uniform", "rbf", "polynomial of all")
"""How the names of the methods begin whose errors are drawn."""
NO_PROFILE = "Compute a model, or open a profile."


class ModelPage:
    """The third step."""

    def __init__(self, session: Session) -> None:
        self.session = session
        self.kind = select("Model", {title: key for key, title in MODELS.items()}, value="lattice")
        self.own_stages = checkbox("Build on the fitted response and matrix", True)
        self.used, self.takes = select("Model in use", NOTHING), text()
        compute = session.button("Compute", self._compute, variant="contained", **WIDE)
        self.preset = select("Preset", list(PRESETS))
        self.size = slider("Nodes per axis", 33, SMALLEST, LARGEST, 1)
        self.nonuniform = select("Node levels", {"follow the error": True, "evenly spaced": False})
        self.interpolation = select("Interpolation", list(INTERPOLATIONS))
        self.beta = slider("β, saturation of inliers", 0.3, 0.05, 1.0, 0.05)
        self.curves = slider("Number of curves", 15, 1, 15, 1)
        self.weighting = slider("Data weighting: samples 0, tones 1", 0.5, 0.0, 1.0, 0.05)
        self.centres = slider("Centres, at most", 4000, 50, 5000, 50)
        self.rho = select("ρ, smoothness", SMOOTHNESS)
        self.pairs = ticks("Brightness-transfer pairs, with their ratios")
        lattice = (self.preset, self.size, self.nonuniform, self.interpolation)
        physical = (self.beta, self.curves, self.weighting, self.centres, self.rho)
        session.watch(self._set_options, self.own_stages, *lattice, *physical)
        session.watch(self._use, self.used)
        session.watch(self._count, self.kind)
        session.watch(self._tick, self.pairs)
        all_or_none = pn.Row(
            session.button("Tick all", lambda: self._tick_all(True)),
            session.button("None", lambda: self._tick_all(False)), **WIDE,
        )  # fmt: skip
        folds = sections(
            {
                "Options": pn.Column(*lattice, **TOGETHER),
                "Response and gamut map": pn.Column(*physical, **TOGETHER),
                "Exposure pairs": pn.Column(all_or_none, self.pairs, **TOGETHER),
            }
        )
        self.controls = [self.kind, compute, self.own_stages, self.takes, self.used, folds]
        views = {
            "Fit": FitView, "Gamut map": GamutView, "Lattice": LatticeView, "Comparison": ComparisonView,
            "Error maps": ErrorMapView,
        }  # fmt: skip
        self.views: dict[str, Any] = {name: make(session) for name, make in views.items()}
        self.shown = pmui.RadioButtonGroup(label="View", options=list(views), value="Fit", size="small", margin=(2, 8))
        session.watch(self._show, self.shown)
        self.body = pn.Column(self.views["Fit"].layout, **FILL)
        self.main = pn.Column(self.shown, self.body, **FILL)

    def refresh(self) -> None:
        """Everything, from the session's workspace."""
        if self.session.history is not None:
            workspace = self.session.workspace
            names = {MODELS[name] + (" (stale)" if workspace.is_stale(name) else ""): name for name in workspace.models}
            self.used.options = names or NOTHING
            self.used.value = workspace.model
            options, physical = workspace.options, workspace.options.physical
            self.preset.value, self.size.value, self.nonuniform.value = options.preset, options.size, options.nonuniform
            self.interpolation.value, self.own_stages.value = options.interpolation, workspace.own_stages
            for name in ("beta", "curves", "weighting", "centres", "rho"):
                getattr(self, name).value = getattr(physical, name)
            listed = pairs_listed(workspace)
            self.pairs.options = list(listed)
            self.pairs.value = [label for label, names in listed.items() if names not in workspace.unticked]
            self._count()
        self.views[self.shown.value].refresh()

    def _show(self) -> None:
        view = self.views[self.shown.value]
        self.body[:] = [view.layout]
        view.refresh()

    def _count(self) -> None:
        """What a fit would take, in words."""
        if self.session.history is None:
            return
        workspace, kind = self.session.workspace, self.kind.value
        rows, count = int(workspace.fitting_rows(kind).sum()), len(workspace.samples)
        left_out = "all outliers" if kind == "matrix" else "outliers, but for saturated colours, which it needs"
        words = f"Fitted to {rows:,} of {count:,} samples: without {left_out}."
        if kind != "matrix":
            fitted = workspace.task(kind).stages is not None
            words += " It builds on the response and matrix that you fitted." if fitted else ""
            words += "" if fitted else " Response and matrix are fitted along with it."
        self.takes.object = paragraphs(words)

    def _set_options(self) -> None:
        if self.session.history is None:
            return
        workspace = self.session.workspace
        physical = PhysicalOptions(
            beta=self.beta.value, curves=int(self.curves.value), weighting=self.weighting.value,
            centres=int(self.centres.value), rho=self.rho.value,
        )  # fmt: skip
        options = CalibrationOptions(
            preset=cast(Preset, self.preset.value),
            size=int(self.size.value),
            interpolation=cast(Interpolation, self.interpolation.value),
            nonuniform=self.nonuniform.value,
            physical=physical,
        )
        if (options, self.own_stages.value) != (workspace.options, workspace.own_stages):
            self.session.change(replace(workspace, options=options, own_stages=self.own_stages.value))

    def _tick(self) -> None:
        if self.session.history is None:
            return
        workspace = self.session.workspace
        listed = pairs_listed(workspace)
        unticked = frozenset(names for label, names in listed.items() if label not in self.pairs.value)
        if unticked != workspace.unticked:
            self.session.change(replace(workspace, unticked=unticked))

    def _tick_all(self, ticked: bool) -> None:
        self.pairs.value = list(self.pairs.options) if ticked else []

    def _compute(self) -> None:
        """Fit the chosen model, and before it the stages that it stands on where they are stale."""
        workspace, kind = self.session.workspace, self.kind.value
        stands = kind != "matrix" and workspace.task(kind).stages is not None
        self.session.fit(*(["matrix"] if stands and workspace.is_stale("matrix") else []), kind)

    def _use(self) -> None:
        if self.session.history is not None and self.used.value:
            workspace = self.session.workspace
            if self.used.value != workspace.model:
                self.session.change(replace(workspace, model=self.used.value))


def pairs_listed(workspace: Workspace) -> dict[str, tuple[str, str]]:
    """The pairs of shots by a label with the exposure ratio and the number of samples."""
    pairs = workspace.pairs
    if pairs is None:
        return {}
    listed = {}
    for place in np.unique(pairs.of_shots):
        rows = pairs.of_shots == place
        names = pairs.shots[place // len(pairs.shots)], pairs.shots[place % len(pairs.shots)]
        ratio = float(np.exp(pairs.log_ratio[rows][0]))
        listed[f"× {ratio:.2f}, {int(rows.sum())} samples: {names[0]} – {names[1]}"] = names
    return listed


class FitView:
    """The response and the residuals of the model in use, its matrix and white balances (thesis A.3.1, A.3.2)."""

    def __init__(self, session: Session) -> None:
        self.session = session
        self._before: tuple[object, Array] = (None, np.zeros((0, 3)))
        self.figures, self.numbers = Figures(), text(sizing_mode="stretch_both", styles={"overflow": "auto"})
        self.layout = pn.Row(self.figures.layout, self.numbers, **FILL)

    def refresh(self) -> None:
        """Everything, from the session's workspace."""
        profile = self.session.profile if self.session.has_profile else None
        rows: list[tuple[Panel, ...]] = []
        if profile is not None:
            rows.append(response_figure(next(iter(profile.styles.values()))).rows[0][:1])
        shown = Html()
        if self.session.history is not None and self.session.workspace.has_raw:
            distances = self._distances(self.session.workspace)
            used = [name for name in distances if name == self.session.workspace.model]
            rows.append(residuals_figure({_named(name): distances[name] for name in ["", *used]}).rows[0])
            shown = self._residual_table(self.session.workspace, distances)
        self.figures.show(Drawing(tuple(rows)) if rows else None, NO_PROFILE)
        after = "The matrix and the white balances stand here after a fit."
        self.numbers.object = Html(shown + (paragraphs(after) if profile is None else _numbers(profile)))

    def _distances(self, workspace: Workspace) -> dict[str, Array]:
        """By model, "" for none, the RGB distance between the JPEG and what is rendered, of the samples in the fit."""
        if self._before[0] is not workspace.samples:
            self._before = (workspace.samples, without_a_model(workspace.samples))
        rendered = {"": self._before[1]} | {name: each.predicted.rendered for name, each in workspace.models.items()}
        rows, srgb = workspace.fitted_rows, workspace.samples.srgb
        return {name: np.linalg.norm(values[rows] - srgb[rows], axis=1) for name, values in rendered.items()}

    def _residual_table(self, workspace: Workspace, distances: dict[str, Array]) -> Html:
        cells = []
        for name, values in distances.items():
            known = values[np.isfinite(values)]
            if len(known):
                stale = " (stale)" if name and workspace.is_stale(name) else ""
                error = held_out_error(workspace.models[name].profile) if name else None
                figures = (known.mean(), *np.percentile(known, [50, 95, 100]))
                left_out = "–" if error is None else f"{error:.4f}"
                cells.append((_named(name) + stale, *(f"{value:.4f}" for value in figures), left_out))
        header = ("model", "mean", "median", "95 %", "max", "held out")
        return table(Table(f"Residuals, RAW → JPEG, on {int(workspace.fitted_rows.sum()):,} samples", header, cells))


def _named(model: str) -> str:
    return MODELS[model] if model else "before any fit"


def held_out_error(profile: CameraProfile) -> float | None:
    """The mean error of a profile on shots left out, over its styles; None where it was not measured."""
    known = [style.errors["render_mean"] for style in profile.styles.values() if "render_mean" in style.errors]
    return float(np.mean(known)) if known else None


def _numbers(profile: CameraProfile) -> Html:
    """Matrix, multipliers and notes of a profile."""
    notes = (*map(str, profile.diagnoses), *profile.notes)
    title = Html("<h2>Notes</h2>" if notes else "")
    return html("{}{}{}{}", table(matrix_table(profile)), table(balance_table(profile)), title, paragraphs(*notes))


class GamutView:
    """Slices of the gamut map of constant luminance: arrows, one a style, or the surface of one in 3D (Fig. A.11)."""

    def __init__(self, session: Session) -> None:
        self.session = session
        self.direction = select("Direction", WAYS, **NARROW)
        self.luminance = slider("Luminance Y of the slices", 0.25, 0.02, 0.9, **NARROW)
        self.drawn = select("Drawn as", ["arrows", "surface in 3D"], **NARROW)
        self.style = select("Style", NOTHING, visible=False, **NARROW)
        session.watch(self.refresh, self.direction, self.luminance, self.drawn, self.style)
        self.slices, self.space = Figures(), Space()
        controls = pn.Row(self.direction, self.luminance, self.drawn, self.style)
        self.layout = pn.Column(controls, self.slices.layout, **FILL)

    def refresh(self) -> None:
        """Everything, from the session's profile, or the last one with a gamut map."""
        session, maps = self.session, dict[str, GamutMap]()
        has_map = session.history is not None and "rbf" in session.workspace.models
        profile = (
            session.workspace.models["rbf"].profile if has_map else session.profile if session.has_profile else None
        )
        for name, style in {} if profile is None else profile.styles.items():
            for model in style.physical[:1]:
                one = model.gamut_map if self.direction.value == "render" else model.inverse_gamut_map
                if len(one.centres) > 1:  # one centre: it changes nothing
                    maps[name] = one
        solid, level = self.drawn.value != "arrows" and bool(maps), self.luminance.value
        self.style.visible = solid
        self.layout[1] = self.space.layout if solid else self.slices.layout
        if solid:
            offer(self.style, maps)
            self._draw_surface(self.style.value, maps[self.style.value], level)
        elif maps:
            self.slices.show(Drawing((tuple(panel for row in gamut_figure(maps, [level]).rows for panel in row),)))
        else:
            self.slices.show(None, "No gamut map: compute the model “Gamut map”.")

    def _draw_surface(self, name: str, gamut_map: GamutMap, level: float) -> None:
        """Draw where h takes the slice, its outline, and the control points near it, in the cube of linear sRGB."""
        order = [0, 2, 1]  # R to the right, B to the back, G up, so that the slice lies nearly flat
        before = slice_grid(level)
        after = gamut_map(before)
        x, y, z = (after[..., channel].tolist() for channel in order)
        change = np.linalg.norm(after - before, axis=2)
        surface = {
            "type": "surface", "x": x, "y": y, "z": z, "surfacecolor": change.tolist(), "colorscale": "Cividis",
            "cmin": 0.0, "cmax": max(0.02, float(change.max())), "colorbar": {"title": {"text": "change"}, "len": 0.7},
        }  # fmt: skip
        traces = [
            surface,
            lines_in_space(cube_edges()[..., order]),
            lines_in_space(before[-1:][..., order], "#4f83e0", 5.0),
            dots_in_space(centres_near(gamut_map, level)[:, order], CHANNELS[0][1]),
        ]
        title = f"{name}, Y = {level:.2f}: where the gamut map takes this slice"
        self.space.show(title, traces, ("R", "B", "G"))


class LatticeView:
    """A lattice: its node levels, grey axis and coverage, where a plane goes, and the error that levels follow."""

    def __init__(self, session: Session) -> None:
        self.session = session
        self.direction = select("Direction", WAYS, **NARROW)
        self.style = select("Style", NOTHING, **NARROW)
        self.channel = select("Plane of", {name: place for place, (name, _, _) in enumerate(CHANNELS)}, **NARROW)
        self.channel.value = 2
        self.level = slider("at its level", 0.4, 0.0, 1.0, **NARROW)
        session.watch(self._draw, self.level, self.direction, self.style, self.channel)
        self.gaps, self.figures = text(), Figures()
        controls = pn.Row(self.direction, self.style, self.channel, self.level)
        self.layout = pn.Column(controls, self.gaps, self.figures.layout, **FILL)

    def refresh(self) -> None:
        """Everything, from the session's profile."""
        if self.session.has_profile:
            offer(self.style, self.session.profile.styles)
        if self.session.history is not None:
            workspace = self.session.workspace
            gaps = colour_gaps(workspace.samples.srgb[workspace.fitting_rows("lattice")])
            names = "; ".join(f"{gap.colour} ({gap.unknown:.0%} unseen)" for gap in gaps)
            known = names or "none, the samples come near most real colours"
            self.gaps.object = paragraphs(f"Colours to shoot next: {known}.")
        self._draw()

    def _draw(self) -> None:
        session, direction = self.session, self.direction.value
        style = session.profile.styles.get(self.style.value) if session.has_profile else None
        lattice = None if style is None else style.lattices.get(direction)
        if style is None or lattice is None:
            self.figures.show(None, "This model has no lattice: compute one." if style is not None else NO_PROFILE)
            return
        channel = int(self.channel.value)
        source, target = ENDS[direction]
        below = list(plane_figure(lattice, target, {channel: self.level.value}).panels)
        fitted = None if session.history is None else session.workspace.fitted
        errors = {} if fitted is None else fitted.level_errors
        if (self.style.value, direction) in errors:
            histograms = errors[self.style.value, direction]
            below.append(levels_on_errors(lattice, histograms, source).panels[channel])
        self.figures.show(Drawing((*lattice_figure(style, [direction]).rows, tuple(below))))


class ComparisonView:
    """The model beside a uniform lattice, RBFs and polynomials, on shots left out (Figs. 5.5, 5.6)."""

    def __init__(self, session: Session) -> None:
        self.session = session
        compute = session.button("Compare on shots left out", self._compute)
        words = text(paragraphs("Fits every method once for each group of shots left out: this takes a while."))
        self.direction = select("Direction", WAYS, **NARROW, visible=False)
        session.watch(self._draw, self.direction)
        self.found: dict[str, tuple[Drawing, Table]] = {}
        self.figures, self.table = Figures(), text(sizing_mode="stretch_both", styles={"overflow": "auto"})
        controls = pn.Row(compute, self.direction, words, sizing_mode="stretch_width")
        self.layout = pn.Column(controls, self.figures.layout, self.table, **FILL)

    def refresh(self) -> None:
        """Nothing: what was compared stays until it is compared again."""

    def _compute(self) -> None:
        workspace, profile = self.session.workspace, self.session.profile
        samples = workspace.samples.select(workspace.fitted_rows)
        self.session.start("comparison", self._done, compare_methods, profile, samples, workspace.options.size)

    def _done(self, found: dict[str, tuple[Drawing, Table]]) -> None:
        self.found, self.direction.visible = found, True
        self._draw()
        self.session.say("comparison: done")

    def _draw(self) -> None:
        if self.direction.value in self.found:
            drawing, errors = self.found[self.direction.value]
            self.figures.show(drawing)
            self.table.object = table(errors)


def compare_methods(
    profile: CameraProfile, samples: SampleSet, size: int, progress: Progress
) -> dict[str, tuple[Drawing, Table]]:
    """By direction: where the errors of methods lie, and the errors of all methods of the thesis's tables.

    Lattices have `size` nodes per axis. Raises CalibrationError where no shot can be left out.
    """
    evaluation = evaluate(profile, samples, progress, tables=True, sizes=(size,))
    found: dict[str, tuple[Drawing, Table]] = {}
    for direction in DIRECTION_NAMES:
        parts: dict[str, list[tuple[Array, Array]]] = {}
        for each in evaluation.predictions.values():
            for method, predicted in each.predicted[direction].items():
                error = np.linalg.norm(np.clip(predicted, 0.0, 1.0) - each.data.both[direction][1], axis=1)
                known = np.isfinite(error)
                parts.setdefault(method, []).append((each.data.encoded[known], error[known]))
        panels = []
        for start in COMPARED:
            for method in [method for method in parts if method.startswith(start)][:1]:
                encoded, error = (np.concatenate(values) for values in zip(*parts[method], strict=True))
                panels.append(error_over_hue(method, encoded, error))
        rows = [row for row in evaluation.rows if row.direction == direction and row.shot == "all"]
        found[direction] = Drawing((tuple(panels),)), error_table(f"{TITLES[direction]}, on shots left out", rows)
    return found


class ErrorMapView:
    """Error maps over the picture of a shot that was left out, both ways, by four models (Figs. 5.5 and 5.6)."""

    def __init__(self, session: Session) -> None:
        self.session = session
        self.shot = select("Shot", NOTHING, sizing_mode="fixed", width=330)
        draw = session.button("Draw its errors", self._compute)
        self.words = text(paragraphs("Every model is fitted without the shot, and predicts it."))
        self.figures = Figures()
        controls = pn.Row(self.shot, draw, self.words, sizing_mode="stretch_width")
        self.layout = pn.Column(controls, self.figures.layout, **FILL)

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
        self.figures.show(maps.drawing)
        seen = "no model has seen it" if maps.held_out else "the models have seen it"
        scales = ", ".join(f"{direction} {scale:g}" for direction, scale in DIRECTIONS)
        words = (
            f"{maps.shot}, {maps.setting}: {seen}. Norm of RGB; brightest: {scales}; grey: clipped, or outside the RAW."
        )
        self.words.object = paragraphs(words)
        self.session.say(f"{maps.shot}: errors drawn")
