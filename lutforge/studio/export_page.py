"""Export: profile, LUTs, kits, config, report, as files of the command line, each with its command and its error."""

import re
from html import escape
from itertools import count
from pathlib import Path
from typing import Any

import panel as pn
import panel_material_ui as pmui

from lutforge.atomic_write import require_writable
from lutforge.colour.rgb_spaces import SPACES
from lutforge.pipeline.kits import kits_of
from lutforge.samples.table import write_samples
from lutforge.studio.elements import FILL, TOGETHER, WIDE, entry, select, text
from lutforge.studio.export import (
    ConfigExport,
    Export,
    KitExport,
    LutExport,
    ParametersExport,
    ReportExport,
    calibration_command,
    run,
    wanted_lut,
)
from lutforge.studio.fits import held_out_error
from lutforge.studio.session import Session, Written
from lutforge.studio.workspace import WorkspaceError
from lutforge.studio.workspace_file import SUFFIX, save_workspace

LUT_SUFFIXES = (".clf", ".cube", ".resolve.cube", ".dctl", ".csp", ".spi1d", ".3dl", ".png")


class ExportPage:
    """The last step."""

    def __init__(self, session: Session) -> None:
        self.session = session
        self.proposed = "camera"
        self.name = entry("Name of the files", value=self.proposed)
        self.program = select("Program of the kit", {"choose a look first": ""})
        self.check = pmui.Checkbox(label="Check the kit on the shots", **WIDE)
        self.kind = select("Transform of the LUT", ["refinish", "render", "linearize"])
        self.space = select("Scene of render and linearize", ["raw", *SPACES])
        self.suffix = select("LUT file", list(LUT_SUFFIXES))
        self.written: set[Path] = set()
        self._offered: object = None
        self.asked: list[Path] = []
        self.main = pn.Column(**{**FILL, "styles": {"overflow": "auto"}})

        def button(label: str, action: Any, **more: Any) -> pmui.Button:
            return session.button(label, action, **{**WIDE, **more})

        root = escape(str(session.folders.roots[0]))
        self.controls = [
            text(f"<p>Files go to <b>{root}</b>; the commands are of that folder.</p>"),
            self.name,
            button("Save profile", self._save_profile, variant="contained"),
            pn.Column(self.program, self.check, button("Write kit", self._kit, variant="contained"), **TOGETHER),
            pn.Column(
                self.kind, self.space, self.suffix, button("Bake LUT", self._bake, variant="contained"), **TOGETHER
            ),
            button("Write config", self._config),
            button("Write report", self._report),
            button("Save parameters as text", self._parameters),
            button("Save workspace", self._workspace),
        ]

    def refresh(self) -> None:
        """What was written, and whether it is of the model and look as they are; the programs that a kit can be for."""
        session = self.session
        if session.has_profile and session.look.target:
            self.program.options = kits_of(session.profile, session.look.target)
        if self._offered is not session.response and session.response is not None:  # what a bracket is taken for
            self.kind.value = "linearize"
            self.space.value = "aces2065-1" if session.response[0].chart else "raw"
        self._offered = session.response
        nothing = "<p>Nothing is written yet. Each file will stand here with its error, and with its command.</p>"
        self.main[:] = [self._card(each) for each in reversed(session.written.values())] or [text(nothing)]

    def _card(self, written: Written) -> pmui.Paper:
        """What was written: lines that tell of it, and its command with a button that copies it."""
        stale = " (stale)" if self.session.is_old(written) else ""
        title = f"{written.what}: {self.session.folders.name(written.path)}{stale}"
        lines = "".join(f"<p>{escape(line)}</p>" for line in written.told)
        card = pmui.Paper(
            text(f"<h2>{escape(title)}</h2>{lines}"), variant="outlined", sizing_mode="stretch_width", margin=8
        )
        if written.command:
            words = f"Copy the command: {written.what}"
            copy = pmui.Button(label="Copy", description=words, size="small", variant="outlined", margin=8)
            copied = "navigator.clipboard.writeText(command); button.data.label = 'Copied';"
            copied += " setTimeout(() => { button.data.label = 'Copy'; }, 1500);"
            copy.js_on_click(args={"command": written.command, "button": copy}, code=copied)
            card.append(pn.Row(text(f"<code>{escape(written.command)}</code>"), copy, sizing_mode="stretch_width"))
        return card

    def _paths(self, *suffixes: str) -> list[Path]:
        """Return where files go, under one name.

        A proposed name gives way to files of before. Raises WorkspaceError, once, where one that the visitor wrote has
        such.
        """
        name = written = self.name.value_input or self.name.value
        for number in count(2):
            paths = [self.session.folders.inside(name + suffix) for suffix in suffixes]
            for path in paths:
                require_writable(path)
            there = [path for path in paths if path.exists() and path not in self.written]
            if not there or there == self.asked:
                break
            if written != self.proposed:
                self.asked = there
                names = ", ".join(path.name for path in there)
                raise WorkspaceError(f"{names}: there already; press again to replace, or choose another name")
            name = f"{re.sub(r'_[0-9]+$', '', written)}_{number}"
        if name != written:
            self.proposed = name
            self.name.param.update(value=name, value_input=name)
        self.written.update(paths)
        return paths

    def _with_profile(self, *suffixes: str) -> list[Path]:
        """Return the profile's file and where others go.

        The profile is saved where it was made in this visit; one that was opened is where it was.
        """
        opened = self.session.profile_file
        if opened is not None and opened.is_file():
            return [opened, *self._paths(*suffixes)]
        paths = self._paths(".npz", *suffixes)
        self.session.profile.save(paths[0])
        return paths

    def _tell(self, what: str, path: Path, told: tuple[str, ...], command: str) -> None:
        command = command.replace(f"{self.session.folders.roots[0]}/", "")  # as one types it there
        self.session.written.pop(what, None)
        self.session.written[what] = Written(what, path, told[:20], command, self.session.made)
        self.session.say(f"{what}: written, {path.name}")
        self.session.on_change()

    def _workspace(self) -> None:
        (path,) = self._paths(SUFFIX)
        save_workspace(self.session.workspace, path)
        self._tell("workspace", path, ("all of this page's work: open it under Shots",), "")

    def _save_profile(self) -> None:
        """The profile, and the samples that it was fitted to, so that the command line makes the same."""
        profile = self.session.profile
        task = None
        if self.session.history is not None and self.session.workspace.fitted is not None:
            task = self.session.workspace.fitted.task
        if task is None:
            (path,) = self._paths(".npz")
            profile.save(path)
            response = self.session.response
            command = "" if response is None or response[1].profile is not profile else response[0].command(path)
            self._tell("profile", path, (f"profile of {profile.camera}", *profile.notes), command)
            return
        stages = task.stages.task if task.stages is not None else None
        path, table, *others = self._paths(".npz", ".parquet", *(["_inliers.parquet"] if stages is not None else []))
        samples = self.session.workspace.samples
        profile.save(path)
        write_samples(table, samples.select(task.rows))
        if stages is not None:
            write_samples(others[0], samples.select(stages.rows))
        command = calibration_command(table, others[0] if others else None, task.options, path)
        if task.kind == "matrix":  # no command fits the stages alone
            command = ""
        error = held_out_error(profile)
        known = "no shot could be left out" if error is None else f"mean error on shots left out {error:.4f}"
        told = f"profile of {profile.camera}, {int(task.rows.sum()):,} samples; {known}"
        self._tell("profile", path, (told,), command)

    def _run(self, what: str, export: Export) -> None:
        def done(lines: tuple[str, ...]) -> None:
            self._tell(what, export.output, lines, str(export))

        self.session.start(f"lutforge {export.command}", done, run, export)

    def _wanted(self) -> str:
        if not self.session.look.target:
            raise WorkspaceError("no look yet: choose the style and white balance under Look")
        self.session.look_chosen = True
        return self.session.look.target

    def _bake(self) -> None:
        look, kind = self.session.look, self.kind.value
        target = "" if kind == "linearize" else self._wanted()
        profile, source = self.session.profile, look.source
        if not source and len(profile.styles) == len(profile.white_balances) == 1:
            source = f"{next(iter(profile.styles))}/{next(iter(profile.white_balances))}"
        if kind != "render" and not source:
            raise WorkspaceError("what were the pictures taken as? choose that under Look, “Taken as”")
        wanted = wanted_lut(kind, source, target, look.ev, self.space.value)
        path, output = self._with_profile(f"_{kind}{self.suffix.value}")
        self._run(f"LUT, {kind}", LutExport(path, output, wanted))

    def _kit(self) -> None:
        target, program = self._wanted(), self.program.value
        profile, output = self._with_profile(f"_{program}_kit")
        shots = tuple(self.session.opened.files.values()) if self.check.value else ()
        self._run(f"kit for {program}", KitExport(profile, output, target, program, shots))

    def _config(self) -> None:
        profile, output = self._with_profile(".ocioz")
        self._run("config", ConfigExport(profile, output))

    def _parameters(self) -> None:
        style = next(iter(self.session.profile.styles))
        profile, output = self._with_profile("_parameters")
        self._run("parameters", ParametersExport(profile, output, style))

    def _report(self) -> None:
        if self.session.history is None:
            profile, output = self._with_profile(".html")
            self._run("report", ReportExport(profile, output))
            return
        profile, output, table = self._with_profile(".html", ".parquet")
        samples = self.session.workspace.samples.select(self.session.workspace.fitted_rows)
        write_samples(table, samples)
        self._run("report", ReportExport(profile, output, samples, table))
