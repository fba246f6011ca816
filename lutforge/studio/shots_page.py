"""Shots: files are dropped or chosen, sampled, looked at, and left out or taken in with a click."""

from dataclasses import replace
from html import escape
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import panel as pn
import panel_material_ui as pmui

from lutforge.studio.bracket_view import BracketView
from lutforge.studio.elements import FILL, NOTHING, WIDE, entry, select, text, written
from lutforge.studio.session import Session
from lutforge.studio.shot_pictures import LEGEND, ShotGrid, cards
from lutforge.studio.workspace import WorkspaceError
from lutforge.studio.workspace_file import OPENED_SUFFIXES

SHOWN = ("JPEG and RAW", "tiles")


class ShotsPage:
    """The first step."""

    def __init__(self, session: Session) -> None:
        self.session = session
        self._dropped: TemporaryDirectory[str] | None = None
        self._drawn: object = None
        self.drop = pmui.FileInput(label="Drop RAW and JPEG files here", multiple=True, **WIDE)
        self.drop.param.watch(session.guarded(lambda event: self._take()), "value")
        self.listed = select("Folder or file", NOTHING)
        self.path = entry("or its path")
        self.shown = select("Shown", list(SHOWN))
        session.watch(self.refresh, self.shown)
        self.notes = text()
        self.grid, self.bracket = ShotGrid(**FILL), BracketView(session)
        self.grid.param.watch(session.guarded(lambda event: self._left_out()), "out")
        sample = session.button("Sample", self._open, variant="contained", **WIDE)
        again = session.button("List again", self.list_files, variant="text", **WIDE)
        self.controls = [
            self.drop, self.listed, self.path, sample, again, self.bracket.controls, self.shown, self.notes
        ]  # fmt: skip
        self.main = pn.Column(self.bracket.layout, self.grid, **FILL)
        self.list_files()

    def list_files(self) -> None:
        """The folders with shots, and the files that can be opened, as they are now."""
        folders = self.session.folders
        names = (*folders.with_shots(), *folders.files(OPENED_SUFFIXES))
        self.listed.options = {**NOTHING, **{name: name for name in names}}

    def _open(self) -> None:
        named = written(self.path) or self.listed.value
        if not named and self._dropped is not None:
            self.session.open((Path(self._dropped.name),))
        else:
            self.session.open((self.session.folders.inside(named),))

    def _take(self) -> None:
        """Keep what was dropped in a folder of this visit, and sample it."""
        names: Any = self.drop.filename
        if not self.drop.value or not names:
            return
        if self._dropped is None:
            self._dropped = TemporaryDirectory(prefix="lutforge_shots_")
        pairs = zip(names, self.drop.value, strict=True) if isinstance(names, list) else [(names, self.drop.value)]
        for name, data in pairs:
            bare = Path(str(name).replace("\\", "/")).name
            if not bare or bare.startswith("."):
                raise WorkspaceError(f"{str(name)[:60]!r}: not a file name")
            (Path(self._dropped.name) / bare).write_bytes(data)
        self.path.value = self.listed.value = ""
        self.session.open((Path(self._dropped.name),))

    def _left_out(self) -> None:
        if self.session.opened.bracket is not None:
            self.session.pictures_out = tuple(self.grid.out)
        if self.session.history is None:
            return
        workspace, out = self.session.workspace, frozenset(self.grid.out)
        if out != workspace.out:
            self.session.change(replace(workspace, out=out))
            self.session.say(f"{len(out)} shots left out" if out else "all shots take part")

    def refresh(self) -> None:
        """The shots of the workspace."""
        self.bracket.refresh()
        self.shown.visible = self.session.opened.bracket is None
        if self.session.history is None:
            bracket, self._drawn = self.session.opened.bracket, None
            self.grid.shots = [] if bracket is None else self.bracket.cards(bracket)
            self.grid.out, self.grid.legend = list(self.session.pictures_out), []
            self.notes.object = "" if bracket is None else f"<p>{escape(str(bracket))}.</p>"
            return
        workspace = self.session.workspace
        profile = self.session.profile if self.session.has_profile else None
        drawn = (workspace.samples, profile, self.shown.value)
        if drawn != self._drawn:
            self._drawn = drawn
            accounts = {account.shot: account for account in self.session.opened.accounts}
            self.grid.shots = cards(workspace.samples, accounts, profile, self.shown.value)
            self.grid.legend = LEGEND if self.shown.value == "tiles" and accounts else []
        if set(self.grid.out) != workspace.out:
            self.grid.out = sorted(workspace.out)
        departures = "" if profile is not None else " Falloff and tone are known once a model is computed."
        failed = "".join(f"<p>not used: {escape(line)}</p>" for line in self.session.opened.left_out[:20])
        self.notes.object = f"<p>A click on a shot leaves it out, another takes it in.{departures}</p>{failed}"
