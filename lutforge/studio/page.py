"""The page of one visitor: a bar with five views, of which one is shown; laid out for 1280 × 720 pixels."""

from functools import partial
from pathlib import Path
from typing import Any

import panel as pn

from lutforge.studio.data_view import DataView
from lutforge.studio.elements import NARROW, text
from lutforge.studio.export_view import ExportView
from lutforge.studio.folders import Folders
from lutforge.studio.maps_view import MapsView
from lutforge.studio.models_view import ModelsView
from lutforge.studio.preview_view import PreviewView
from lutforge.studio.session import Session

VIEWS = ("Data & outliers", "Models", "Maps", "Preview", "Export")


class Page:
    """Views are drawn when they are looked at, and again when the workspace has changed since."""

    def __init__(self, folders: Folders, inputs: tuple[Path, ...]) -> None:
        self.session = Session(folders)
        data, preview = DataView(self.session), PreviewView(self.session)
        self.views: dict[str, Any] = {
            "Data & outliers": data,
            "Models": ModelsView(self.session),
            "Maps": MapsView(self.session),
            "Preview": preview,
            "Export": ExportView(self.session, preview),
        }
        self._stale = set(VIEWS)
        self.shown = VIEWS[0]
        self.session.on_change = self._changed
        self.session.on_select = data.mark
        self.tabs = {name: self.session.button(name, partial(self.show, name)) for name in VIEWS}
        self.undo = self.session.button("Undo", self.session.undo)
        self.redo = self.session.button("Redo", self.session.redo)
        heading = text("<b>LutForge studio</b>", width=130, margin=(9, 4, 4, 10))
        self.body = pn.Column(self.views[self.shown].layout, margin=0)
        bar = pn.Row(heading, *self.tabs.values(), pn.Spacer(width=30), self.undo, self.redo, **NARROW)
        news = pn.Row(self.session.status, self.session.progress, self.session.cancel, width=1260, height=30)
        self.layout = pn.Column(bar, news, self.body, width=1270, margin=0)
        self._buttons()
        if inputs:
            self.session.guarded(self.session.open)(inputs)

    def show(self, name: str) -> None:
        """Look at a view."""
        self.shown = name
        for other, tab in self.tabs.items():
            tab.button_type = "primary" if other == name else "default"
        self.body[:] = [self.views[name].layout]
        self._refresh()

    def _changed(self) -> None:
        self._stale = set(VIEWS)
        self._refresh()

    def _refresh(self) -> None:
        self._buttons()
        # The preview's settings are taken over by the export, whenever that is looked at.
        if self.shown in self._stale or self.shown in ("Preview", "Export"):
            self._stale.discard(self.shown)
            self.views[self.shown].refresh()

    def _buttons(self) -> None:
        history = self.session.history
        self.undo.disabled = history is None or not history.past
        self.redo.disabled = history is None or not history.future
        self.tabs[self.shown].button_type = "primary"
