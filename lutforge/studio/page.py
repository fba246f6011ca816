"""The page of one visitor: the steps, what to do in each, undo and redo, and the keys that work in all."""

import re
from importlib import import_module
from pathlib import Path
from typing import Any, Literal

import panel as pn
import panel_material_ui as pmui
from panel.custom import JSComponent

from lutforge.studio import ui
from lutforge.studio.controls import remember_controls
from lutforge.studio.folders import Folders
from lutforge.studio.results import open_files
from lutforge.studio.session import Session
from lutforge.studio.theme import BESIDE, TEMPLATE, THEME
from lutforge.studio.ui import HERE
from lutforge.studio.workspace import WorkspaceError

StepProgress = Literal["to do", "done", "stale"]
PAGE_NAMES = ("Shots", "Samples", "Model", "Look", "Export")
ICONS = {"done": "check_circle", "to do": "radio_button_unchecked", "stale": "sync_problem"}


class Page:
    """The page of a visitor, with its five steps.

    A step is made when it is first looked at, and drawn again when the session has changed since.
    """

    def __init__(self, folders: Folders, inputs: tuple[Path, ...], session: Session | None = None) -> None:
        """Make the page of a visitor.

        session: one that goes on, whose own page is closed.
        """
        is_continued = session is not None
        self.session = Session(folders) if session is None else session
        if is_continued:
            self.session.attach()
        self.pages: dict[str, Any] = {}
        self.shown = self.session.step
        self.is_ready = False  # whether a browser has loaded the page, and what is done in it is heard
        self._stale = set(PAGE_NAMES)
        self.session.page.on_change = lambda: self._refresh(*PAGE_NAMES)
        self.session.page.on_look = self._tell
        self.steps = pmui.StepperMenu(non_linear=True, sizing_mode="stretch_width", margin=(6, 12, 6, 24))
        self.session.page.watch(lambda: self.show(PAGE_NAMES[self.steps.active]), self.steps, of="active")
        self.undo = self.session.page.button("Undo", self.session.undo, variant="text")
        self.redo = self.session.page.button("Redo", self.session.redo, variant="text")
        self.next = ui.text(margin=(6, 12))
        self.offer = ui.text(visible=False)
        keys = Keys(self)
        bar = pn.Row(self.steps, sizing_mode="stretch_width")
        actions = pn.Row(self.next, self.undo, self.redo, keys, sizing_mode="stretch_width")
        status = self.session.page.status
        news = pn.Row(
            status.pane, status.progress, self.session.work.cancel_button, sizing_mode="stretch_width", height=40
        )
        self.controls = pn.Column(sizing_mode="stretch_width")
        self.body = pn.Column(**ui.FILL)
        watchers = _watchers_of_busy()
        self.layout = pmui.Page(
            title="LutForge studio", header=[bar], sidebar=[self.controls],
            main=[pn.Column(self.offer, actions, news, self.body, **ui.FILL)], sidebar_variant="permanent",
            sidebar_width=290, sidebar_resizable=False, busy_indicator=None, theme="dark", theme_toggle=False,
            theme_config=THEME, template=TEMPLATE, stylesheets=[BESIDE],
        )  # fmt: skip
        for watcher in _watchers_of_busy() - watchers:  # by which Panel would keep each page for ever
            pn.state.param.unwatch(watcher)
        self.show(self.shown)
        if inputs and not is_continued:
            self.session.page.guarded(open_files)(self.session, inputs)

    def show(self, name: str) -> None:
        """Look at a step."""
        self.shown = self.session.step = name
        self.session.page.forget_errors()
        is_new = name not in self.pages
        if is_new:  # imported here: the first paint does not wait for what only later steps draw
            module = import_module(f"lutforge.studio.{name.lower()}_page")
            self.pages[name] = getattr(module, f"{name}Page")(self.session)
        shown = self.pages[name]
        self.controls[:] = shown.controls
        self.body[:] = [shown.main]
        if self.steps.active != PAGE_NAMES.index(name):
            self.steps.active = PAGE_NAMES.index(name)
        self._refresh()
        if is_new and remember_controls(self.session, name, shown.remembered):  # once lists have their options
            self._refresh(name)

    def _refresh(self, *stale: str) -> None:
        """Draw what is shown, if it has changed since, and note the steps that have."""
        self._stale.update(stale)
        self._tell()
        if self.shown in self._stale or self.shown == "Export":
            self._stale.discard(self.shown)
            with self.session.page.setting():
                self.pages[self.shown].refresh()

    def _tell(self) -> None:
        """Show how far each step is, and what to do in this one."""
        progress = progress_of(self.session)
        self.steps.items = [
            {"label": f"{step}: {progress[step]}", "icon": ICONS[progress[step]]} for step in PAGE_NAMES
        ]
        self.offer.visible = self.offer.visible and self.session.is_empty
        form = "<span data-ready><b>{}.</b> {}</span>" if self.is_ready else "<b>{}.</b> {}"
        self.next.object = ui.html(form, self.shown, NEXT[self.shown])
        last = self.session.history.last(self.shown)
        following = self.session.history.next(self.shown)
        self.undo.param.update(disabled=last is None, label="Undo" if last is None else f"Undo {last.name}"[:70])
        self.redo.param.update(
            disabled=following is None, label="Redo" if following is None else f"Redo {following.again}"[:70]
        )

    def ready(self) -> None:
        """Note that a browser has loaded the page."""
        self.is_ready = True
        self._tell()

    def offer_to_continue(self, abandoned: Session | None) -> None:
        """Ask whether to go on with a session that was left, where there is one and nothing is open here."""
        if abandoned is not None and abandoned is not self.session and self.session.is_empty:
            self.offer.param.update(object=offer_of(abandoned), visible=True)

    def reset(self, name: str) -> None:
        """Set a slider of the step that is seen, by its name, to what it was made with."""
        widget = self._slider(name)
        if hasattr(widget, "usual"):
            widget.value = widget.usual
            self.session.history.end_move()

    def put(self, name: str, written: str) -> None:
        """Set a slider of the step that is seen, by its name, to what was typed. Raises WorkspaceError: no number."""
        widget = self._slider(name)
        if widget is None:
            return
        numbers = [float(number) for number in re.findall(r"[-+]?(?:\d+\.?\d*|\.\d+)", written.replace("−", "-"))]
        present = widget.value if isinstance(widget.value, tuple) else (widget.value,)
        if len(numbers) != len(present):
            example = " .. ".join(f"{end:g}" for end in present)
            raise WorkspaceError(f"{name}: {written[:40]!r} is no value of it; write one like {example}")
        inside = sorted(min(max(number, widget.start), widget.end) for number in numbers)
        widget.value = tuple(inside) if isinstance(widget.value, tuple) else inside[0]
        self.session.history.end_move()

    def _slider(self, name: str) -> Any:
        """The slider of the step that is seen whose label a name begins with; None where none can be moved."""
        seen = [*self.controls.select(pmui.FloatSlider), *self.controls.select(pmui.RangeSlider)]
        seen += self.body.select(pmui.FloatSlider)
        named = (slider for slider in seen if slider.label and name.startswith(slider.label))
        return next((slider for slider in named if not slider.disabled), None)


class Keys(JSComponent):  # type: ignore[misc]  # Panel's classes are seen as Any
    """The keys of every step, Ctrl+Z and Ctrl+Shift+Z; resets and typed values of sliders; files that are dropped."""

    _esm = (HERE / "keys.js").read_text(encoding="utf-8")

    def __init__(self, page: "Page") -> None:
        super().__init__(width=0, height=0, margin=0)
        undo, redo, reset, put = (
            page.session.page.guarded(action) for action in (page.session.undo, page.session.redo, page.reset, page.put)
        )
        self._undo = undo
        self._redo = redo
        self._reset = reset
        self._put = put
        self._dropped = page.session.page.guarded(lambda: page.session.page.say(DROP_ELSEWHERE, wrong=True))

    def _handle_msg(self, data: Any) -> None:
        """Run the action of a keyboard shortcut."""
        match data:
            case {"do": "undo"}:
                self._undo()
            case {"do": "redo"}:
                self._redo()
            case {"do": "drop"}:
                self._dropped()
            case {"do": "reset", "name": str(name)}:
                self._reset(name)
            case {"do": "set", "name": str(name), "value": str(value)}:
                self._put(name, value)


def _watchers_of_busy() -> set[Any]:
    return set(pn.state.param.watchers.get("busy", {}).get("value", ()))


def offer_of(abandoned: Session) -> ui.Html:
    """The question whether to continue a session, with the link that does."""
    return ui.html("<p><b><a href='?continue'>Continue where you were</a></b>: {}</p>", str(abandoned))


DROP_ELSEWHERE = "this step takes no files: drop shots under Shots, a photograph under Look"

NEXT = {
    "Shots": "Drop RAW files with their JPEGs here, or choose a folder; then press Sample.",
    "Samples": "Keep saturated and clipped colours from the response by the filters, or mark samples with the lasso.",
    "Model": "Press Compute: the lattice is what most want; or fit stage by stage.",
    "Look": "Choose a photograph, and the style and white balance that you want.",
    "Export": "Write what your program needs: a kit, a LUT, a config. Each line can be run again as a command.",
}
"""Advice for each step."""


def progress_of(session: Session) -> dict[str, StepProgress]:
    """How far each step is."""
    workspace = session.workspace
    profile = session.profile
    stale = session.is_stale
    old = any(map(session.is_old, session.written.values()))
    chosen = session.state.look_chosen or session.photograph is not None
    seen = chosen and not session.is_unseen and profile is not None
    return {
        "Shots": "to do" if workspace is None and profile is None else "done",
        "Samples": "to do" if workspace is None else "done",
        "Model": "stale" if stale else "to do" if profile is None else "done",
        "Look": "to do" if not seen else "stale" if stale else "done",
        "Export": "to do" if not session.written else "stale" if old else "done",
    }  # fmt: skip
