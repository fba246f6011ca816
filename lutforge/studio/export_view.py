"""Export: samples, profile, LUTs, config, report and the workspace, as files of the command line."""

from collections.abc import Callable
from html import escape
from pathlib import Path

import panel as pn

from lutforge.atomic_write import require_writable
from lutforge.samples.table import write_samples
from lutforge.studio.elements import NARROW, Slider, button, text
from lutforge.studio.export import (
    KINDS,
    LUT_SUFFIXES,
    as_text,
    bake_command,
    config_command,
    report_command,
    run,
)
from lutforge.studio.preview_view import PreviewView
from lutforge.studio.session import Session
from lutforge.studio.workspace_file import SUFFIX, save_workspace

MOST_LINES = 60


class ExportView:
    """The page's last view."""

    def __init__(self, session: Session, preview: PreviewView) -> None:
        self.session, self.preview = session, preview
        options = {"width": 236, **NARROW}
        self.name = pn.widgets.TextInput(name="Name of the files", value="camera", **options)
        self.kind = pn.widgets.Select(name="Transform of the LUT", options=list(KINDS), value="refinish", **options)
        self.source = pn.widgets.TextInput(name="From STYLE/WB", **options)
        self.target = pn.widgets.TextInput(name="To STYLE/WB", **options)
        self.ev = Slider(label="Exposure", value=0, start=-3, end=3, step=0.05, unit=" EV", **options)
        self.suffix = pn.widgets.Select(name="LUT file", options=list(LUT_SUFFIXES), **options)
        self.lines: list[str] = []
        self.log = text(width=960, height=600, styles={"overflow": "auto", "background": "#ffffff", "padding": "6px"})
        actions: list[tuple[str, Callable[[], None]]] = [
            ("Save workspace", self._workspace),
            ("Save samples in the fit", self._samples),
            ("Save profile", self._save_profile),
            ("Bake LUT", self._bake),
            ("Write config", self._config),
            ("Write report", self._report),
        ]
        buttons = [self._button(name, action) for name, action in actions]
        root = escape(str(session.folders.roots[0]))
        self.layout = pn.Row(
            pn.Column(
                text(
                    f"<p>Files go to <b>{root}</b>, or where their name says.</p>", width=236),
                self.name, *buttons[:3], self.kind, self.source, self.target, self.ev, self.suffix, *buttons[3:],
                width=256, height=628, scroll=True,
            ),
            self.log,
        )  # fmt: skip
        self._tell("Each export is a command that can be run again; the lines appear here.")

    def _button(self, name: str, action: Callable[[], None]) -> pn.widgets.Button:
        return button(name, width=200, on_click=self.session.guarded(lambda event: action()))

    def refresh(self) -> None:
        """From and To as the preview has them, where they are empty or no longer known."""
        if not self.session.has_profile:
            return
        self.source.value = self.preview.source.value
        self.target.value = self.preview.target()
        self.ev.value = self.preview.ev.value

    def _tell(self, line: str) -> None:
        self.lines = [*self.lines, line][-MOST_LINES:]
        self.log.object = "<h2>Written</h2>" + "".join(f"<p><code>{escape(entry)}</code></p>" for entry in self.lines)

    def _path(self, suffix: str) -> Path:
        path = self.session.folders.inside((self.name.value_input or self.name.value) + suffix)
        require_writable(path)
        return path

    def _workspace(self) -> None:
        path = self._path(SUFFIX)
        save_workspace(self.session.workspace, path)
        self._said(f"{path}: the whole workspace")

    def _samples(self) -> None:
        workspace = self.session.workspace
        samples = workspace.samples.select(workspace.fitted_rows)
        path = self._path(".parquet")
        write_samples(path, samples)
        self._said(f"{path}: {len(samples):,} samples, as the model in use was fitted to")

    def _save_profile(self) -> None:
        path = self._write_profile()
        self._said(f"{path}: profile of {self.session.profile.camera}")

    def _write_profile(self) -> Path:
        path = self._path(".npz")
        self.session.profile.save(path)
        return path

    def _bake(self) -> None:
        source = self.source.value_input or self.source.value
        target = self.target.value_input or self.target.value
        output = self._path(f"_{self.kind.value}{self.suffix.value}")
        self._run(bake_command(self._write_profile(), self.kind.value, source, target, self.ev.value, output))

    def _config(self) -> None:
        self._run(config_command(self._write_profile(), self._path(".ocioz")))

    def _report(self) -> None:
        samples = None
        output = self._path(".html")
        profile = self._write_profile()
        if self.session.history is not None:
            samples = self._path(".parquet")
            workspace = self.session.workspace
            write_samples(samples, workspace.samples.select(workspace.fitted_rows))
        self._run(report_command(profile, samples, output))

    def _run(self, command: list[str]) -> None:
        def done(lines: tuple[str, ...]) -> None:
            self._tell("$ " + as_text(command))
            for line in lines[:20]:
                self._tell(line)
            self.session.say(f"{command[0]}: written")

        self.session.start(f"lutforge {command[0]}", done, run, command)

    def _said(self, line: str) -> None:
        self._tell(line)
        self.session.say(line)
