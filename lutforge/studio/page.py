"""The page of one visitor: five steps with their states, of which one is shown, in the whole window."""

from importlib import import_module
from pathlib import Path
from typing import Any, Literal

import panel as pn
import panel_material_ui as pmui

from lutforge.studio.elements import html, text
from lutforge.studio.folders import Folders
from lutforge.studio.session import Session
from lutforge.studio.theme import BESIDE, TEMPLATE, THEME

State = Literal["to do", "done", "stale"]
STEPS = ("Shots", "Samples", "Model", "Look", "Export")
ICONS = {"done": "check_circle", "to do": "radio_button_unchecked", "stale": "sync_problem"}


class Page:
    """Steps are made when they are first looked at, and drawn again when the session has changed since."""

    def __init__(self, folders: Folders, inputs: tuple[Path, ...]) -> None:
        self.session = Session(folders)
        self.pages: dict[str, Any] = {}
        self.shown = STEPS[0]
        self._stale = set(STEPS)
        self.session.on_change, self.session.on_look = self._changed, self._tell
        self.session.on_select = self._selected
        self.steps = pmui.StepperMenu(non_linear=True, sizing_mode="stretch_width", margin=(6, 12))
        self.session.watch(lambda: self.show(STEPS[self.steps.active]), self.steps, of="active")
        on_dark = {"variant": "text", "sx": {"&.Mui-disabled": {"color": "#8f8f8f"}}}  # the bar is dark in both themes
        self.undo = self.session.button("Undo", self.session.undo, **on_dark)
        self.redo = self.session.button("Redo", self.session.redo, **on_dark)
        self.next = text(margin=(6, 12))
        bar = pn.Row(self.steps, self.undo, self.redo, sizing_mode="stretch_width")
        news = pn.Row(
            self.session.status, self.session.progress, self.session.cancel, sizing_mode="stretch_width", height=40
        )
        fill = {"sizing_mode": "stretch_both", "margin": 0}
        self.controls = pn.Column(sizing_mode="stretch_width")
        self.body = pn.Column(**fill)
        self.layout = pmui.Page(
            title="LutForge studio", header=[bar], sidebar=[self.controls],
            main=[pn.Column(self.next, news, self.body, **fill)], sidebar_variant="permanent", sidebar_width=290,
            sidebar_resizable=False, busy_indicator=None, theme="dark", theme_config=THEME, template=TEMPLATE,
            stylesheets=[BESIDE],
        )  # fmt: skip
        self.layout.param.watch(self.session.guarded(lambda event: self._theme()), "dark_theme")
        self.show(self.shown)
        if inputs:
            self.session.guarded(self.session.open)(inputs)

    def show(self, name: str) -> None:
        """Look at a step."""
        self.shown = name
        self.session.forget_error()
        if name not in self.pages:  # imported here: the first paint does not wait for what only later steps draw
            module = import_module(f"lutforge.studio.{name.lower()}_page")
            self.pages[name] = getattr(module, f"{name}Page")(self.session)
            self._theme()
        shown = self.pages[name]
        self.controls[:], self.body[:] = shown.controls, [shown.main]
        if self.steps.active != STEPS.index(name):
            self.steps.active = STEPS.index(name)
        self._refresh()

    def _theme(self) -> None:
        if "Look" in self.pages:
            self.pages["Look"].view.theme = "dark" if self.layout.dark_theme else "light"

    def _changed(self) -> None:
        self._stale = set(STEPS)
        self._refresh()

    def _selected(self) -> None:
        if "Samples" in self.pages:
            self.pages["Samples"].mark()

    def _refresh(self) -> None:
        self._tell()
        if self.shown in self._stale or self.shown == "Export":
            self._stale.discard(self.shown)
            with self.session.setting():
                self.pages[self.shown].refresh()

    def _tell(self) -> None:
        """The steps' states, and what to do next in this one."""
        states = states_of(self.session)
        self.steps.items = [{"label": f"{step}: {states[step][0]}", "icon": ICONS[states[step][0]]} for step in STEPS]
        self.next.object = html("<b>{}.</b> {}", self.shown, states[self.shown][1])
        history = self.session.history
        self.undo.disabled = history is None or not history.past
        self.redo.disabled = history is None or not history.future


def states_of(session: Session) -> dict[str, tuple[State, str]]:
    """Each step's state, and in a sentence what to do next there."""
    open_, bracket = session.history is not None, session.opened.bracket
    stale = session.is_stale
    model: State = "stale" if stale else "done" if session.has_profile else "to do"
    chosen: State = "to do" if not session.look_chosen or model == "to do" else "stale" if stale else "done"
    old = any(map(session.is_old, session.written.values()))
    export: State = "to do" if not session.written else "stale" if old else "done"
    shots: State = "done" if open_ or session.has_profile else "to do"
    sentences = {
        "Shots": {
            "to do": "Drop RAW files with their JPEGs here, or choose a folder; then press Sample.",
            "done": "Untick a shot to leave it out; then look at the samples.",
        }[shots] if bracket is None
        else "Name the chart, if the pictures show one, and press Fit response." if session.response is None
        else "Untick a picture to leave it out, and fit again; or go on to Export.",
        "Samples": (
            "Open shots or a sample table first." if not open_
            else "The colours that two exposures share: how they follow the exposure, and which leave the curve."
            if bracket is not None
            else "Keep saturated and clipped colours from the response by the filters, or mark samples with the lasso."
        ),
        "Model": {
            "to do": "Press Compute: the lattice is what most want; or fit stage by stage.",
            "done": "The model is up to date: see its errors here, then choose a look.",
            "stale": "Samples or options have changed since: press Compute.",
        }[model],
        "Look": {
            "to do": "Choose a photograph and the style and white balance that you want.",
            "done": (
                "The look is what the exports hold." if session.look.source
                else "A kit is made for this look; a picture needs “Taken as”, too: choose what it was taken as."
            ),
            "stale": "The model is not up to date: compute it again under Model.",
        }[chosen],
        "Export": {
            "to do": (
                "Name the files, and write what your program needs: a kit, a LUT, a config." if session.has_profile
                else "Compute a model under Model first, or open a profile under Shots."
            ),
            "done": "Written as below; each line can be run again as a command.",
            "stale": "Model or look have changed since: write again what you need.",
        }[export],
    }  # fmt: skip
    states: dict[str, State] = {
        "Shots": shots, "Samples": "done" if open_ else "to do", "Model": model, "Look": chosen, "Export": export,
    }  # fmt: skip
    return {step: (states[step], sentences[step]) for step in STEPS}
