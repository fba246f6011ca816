"""Model: response, matrix, gamut map and lattice, with their options, the exposure pairs, and what was found."""

from dataclasses import replace
from typing import Any, cast

import numpy as np
import panel as pn
import panel_material_ui as pmui

from lutforge.calibration.options import LARGEST, PRESETS, SMALLEST, CalibrationOptions, PhysicalOptions, Preset
from lutforge.interpolation import INTERPOLATIONS, Interpolation
from lutforge.studio.comparison_view import ComparisonView
from lutforge.studio.elements import FILL, NOTHING, TOGETHER, WIDE, sections, select, slider, text, ticks
from lutforge.studio.error_map_view import ErrorMapView
from lutforge.studio.fit_view import FitView
from lutforge.studio.maps_view import GamutView, LatticeView
from lutforge.studio.session import Session
from lutforge.studio.workspace import MODELS, Workspace

VIEWS = ("Fit", "Gamut map", "Lattice", "Comparison", "Error maps")
SMOOTHNESS = {"by held-out shots": None, **{f"{rho:g}": rho for rho in (1e-10, 1e-9, 1e-8, 1e-7, 1e-6, 1e-5)}}


class ModelPage:
    """The third step."""

    def __init__(self, session: Session) -> None:
        self.session = session
        self.kind = select("Model", {title: key for key, title in MODELS.items()}, value="lattice")
        self.own_stages = pmui.Checkbox(label="Build on the fitted response and matrix", value=True, **WIDE)
        self.used = select("Model in use", NOTHING)
        self.takes = text()
        compute = session.button("Compute", self._compute, variant="contained", **WIDE)
        session.watch(self._use, self.used)
        session.watch(self._set_options, self.own_stages)
        session.watch(self._count, self.kind)
        folds = sections(
            Options=self._lattice_options(),
            Response_and_gamut_map=self._physical_options(),
            Exposure_pairs=self._pairs(),
        )
        self.controls = [self.kind, compute, self.own_stages, self.takes, self.used, folds]
        views = (make(session) for make in (FitView, GamutView, LatticeView, ComparisonView, ErrorMapView))
        self.views: dict[str, Any] = dict(zip(VIEWS, views, strict=True))
        self.shown = pmui.RadioButtonGroup(label="View", options=list(VIEWS), value="Fit", size="small", margin=(2, 8))
        session.watch(self._show, self.shown)
        self.body = pn.Column(self.views["Fit"].layout, **FILL)
        self.main = pn.Column(self.shown, self.body, **FILL)

    def _lattice_options(self) -> pn.Column:
        self.preset = select("Preset", list(PRESETS))
        self.size = slider("Nodes per axis", 33, SMALLEST, LARGEST, 1)
        self.nonuniform = select("Node levels", {"follow the error": True, "evenly spaced": False})
        self.interpolation = select("Interpolation", list(INTERPOLATIONS))
        widgets = (self.preset, self.size, self.nonuniform, self.interpolation)
        self.session.watch(self._set_options, *widgets)
        return pn.Column(*widgets, **TOGETHER)

    def _physical_options(self) -> pn.Column:
        self.beta = slider("β, saturation of inliers", 0.3, 0.05, 1.0, 0.05)
        self.curves = slider("Number of curves", 15, 1, 15, 1)
        self.weighting = slider("Data weighting: samples 0, tones 1", 0.5, 0.0, 1.0, 0.05)
        self.centres = slider("Centres, at most", 4000, 50, 5000, 50)
        self.rho = select("ρ, smoothness", SMOOTHNESS)
        widgets = (self.beta, self.curves, self.weighting, self.centres, self.rho)
        self.session.watch(self._set_options, *widgets)
        return pn.Column(*widgets, **TOGETHER)

    def _pairs(self) -> pn.Column:
        self.pairs = ticks("Brightness-transfer pairs, with their ratios")
        self.session.watch(self._tick, self.pairs)
        buttons = (
            self.session.button("Tick all", lambda: self._tick_all(True)),
            self.session.button("None", lambda: self._tick_all(False)),
        )
        return pn.Column(pn.Row(*buttons, **WIDE), self.pairs, **TOGETHER)

    # --- what is shown ---------------------------------------------------------------------------------------------

    def refresh(self) -> None:
        """Everything, from the session's workspace."""
        if self.session.history is not None:
            workspace = self.session.workspace
            names = {MODELS[name] + (" (stale)" if workspace.is_stale(name) else ""): name for name in workspace.models}
            self.used.options = names or NOTHING
            self.used.value = workspace.model
            self._set_controls(workspace)
            self._count()
        self.views[self.shown.value].refresh()

    def _show(self) -> None:
        view = self.views[self.shown.value]
        self.body[:] = [view.layout]
        view.refresh()

    def _set_controls(self, workspace: Workspace) -> None:
        options, physical = workspace.options, workspace.options.physical
        self.preset.value, self.size.value, self.nonuniform.value = options.preset, options.size, options.nonuniform
        self.interpolation.value, self.own_stages.value = options.interpolation, workspace.own_stages
        self.beta.value, self.curves.value, self.weighting.value = physical.beta, physical.curves, physical.weighting
        self.centres.value, self.rho.value = physical.centres, physical.rho
        listed = pairs_listed(workspace)
        self.pairs.options = list(listed)
        self.pairs.value = [label for label, names in listed.items() if names not in workspace.unticked]

    def _count(self) -> None:
        if self.session.history is None:
            return
        workspace, kind = self.session.workspace, self.kind.value
        rows = int(workspace.fitting_rows(kind).sum())
        early = "Samples marked by hand, in groups in effect, or found by any filter do not."
        late = (
            "Samples marked by hand or in groups in effect do not, nor what filters find whose limits were moved; the "
            "saturation limit does not count, as saturated colours are what this model is for."
        )
        stands = ""
        if kind != "matrix":
            stands = (
                " It stands on the response, matrix and white balances that were fitted."
                if workspace.task(kind).stages is not None else " Response and matrix are fitted with it."
            )  # fmt: skip
        self.takes.object = f"<p>{rows:,} samples take part. {early if kind == 'matrix' else late}{stands}</p>"

    # --- what is done ----------------------------------------------------------------------------------------------

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
    number = pairs.of_shots
    listed = {}
    for place in np.unique(number):
        rows = number == place
        names = pairs.shots[place // len(pairs.shots)], pairs.shots[place % len(pairs.shots)]
        ratio = float(np.exp(pairs.log_ratio[rows][0]))
        listed[f"× {ratio:.2f}, {int(rows.sum())} samples: {names[0]} – {names[1]}"] = names
    return listed
