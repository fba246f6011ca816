"""The page of one visitor: five steps with their states, of which one is shown, in the whole window."""

from importlib import import_module
from pathlib import Path
from typing import Any

import panel as pn
import panel_material_ui as pmui

from lutforge.studio.elements import FILL, text
from lutforge.studio.folders import Folders
from lutforge.studio.session import Session
from lutforge.studio.steps import STEPS, states_of
from lutforge.studio.theme import BESIDE, TEMPLATE, THEME

ICONS = {"done": "check_circle", "to do": "radio_button_unchecked", "stale": "sync_problem"}


# Imported when first shown: the first paint does not wait for what only later steps draw.
PAGES = {step: (f"lutforge.studio.{step.lower()}_page", f"{step}Page") for step in STEPS}


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
        self.steps.param.watch(self.session.guarded(lambda event: self.show(STEPS[event.new])), "active")
        on_dark = {"variant": "text", "sx": {"&.Mui-disabled": {"color": "#8f8f8f"}}}  # the bar is dark in both themes
        self.undo = self.session.button("Undo", self.session.undo, **on_dark)
        self.redo = self.session.button("Redo", self.session.redo, **on_dark)
        self.next = text(margin=(6, 12))
        bar = pn.Row(self.steps, self.undo, self.redo, sizing_mode="stretch_width")
        news = pn.Row(
            self.session.status, self.session.progress, self.session.cancel, sizing_mode="stretch_width", height=40
        )
        self.controls = pn.Column(sizing_mode="stretch_width")
        self.body = pn.Column(**FILL)
        self.layout = pmui.Page(
            title="LutForge studio", header=[bar], sidebar=[self.controls],
            main=[pn.Column(self.next, news, self.body, **FILL)], sidebar_variant="permanent", sidebar_width=290,
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
        if name not in self.pages:
            module, page = PAGES[name]
            self.pages[name] = getattr(import_module(module), page)(self.session)
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
        if self.session.opened.bracket is not None:  # what these showed of other samples is gone
            for step in {"Samples", "Model"} - {self.shown}:
                self.pages.pop(step, None)
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
        self.next.object = f"<b>{self.shown}.</b> {states[self.shown][1]}"
        history = self.session.history
        self.undo.disabled = history is None or not history.past
        self.redo.disabled = history is None or not history.future
