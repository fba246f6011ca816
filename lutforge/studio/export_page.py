"""Export: profile, LUTs, kits, config, report: use cases of the command line, each with the words that do the same."""

import re
import shlex
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import count
from pathlib import Path
from typing import Any

import panel as pn
import panel_material_ui as pmui

from lutforge.atomic_write import require_writable
from lutforge.calibration.options import CalibrationOptions
from lutforge.colour.rgb_spaces import SPACES
from lutforge.errors import LutForgeError, one_line
from lutforge.model.camera_profile import as_profile
from lutforge.model.published_model import export_published
from lutforge.pipeline.baking import bake_files
from lutforge.pipeline.configs import write_config
from lutforge.pipeline.kits import SCRIPT, check_kit, kits_of, write_kit
from lutforge.pipeline.reports import report
from lutforge.pipeline.transforms import TransformRequest
from lutforge.progress import Progress
from lutforge.samples.sample_set import SampleSet
from lutforge.samples.table import write_samples
from lutforge.studio import ui
from lutforge.studio.model_page import held_out_error
from lutforge.studio.session import Session, Written
from lutforge.studio.workspace import SUFFIX, WorkspaceError, save_workspace

LUT_SUFFIXES = (".clf", ".cube", ".resolve.cube", ".dctl", ".csp", ".spi1d", ".3dl", ".png")


@dataclass(frozen=True)
class Export:
    """A file or folder to write. words: of the command, as one would type them; write: tells lines, with the error."""

    words: tuple[str, ...]
    write: Callable[..., Iterator[str]]
    arguments: tuple[Any, ...]

    def __str__(self) -> str:
        return shlex.join(["lutforge", *self.words])


def run(export: Export, progress: Progress) -> tuple[str, ...]:
    """Write the export; the lines that tell of it, and of its error. Raises LutForgeError."""
    return tuple(export.write(*export.arguments, progress))


def lut_export(profile: Path, output: Path, wanted: TransformRequest) -> Export:
    """A LUT of a transform."""
    words = ["bake", str(profile), wanted.kind]
    for option, value in (("--from", wanted.source), ("--to", wanted.target)):
        words += [option, value] if value else []
    words += ["--ev", f"{wanted.ev:g}"] if wanted.ev else []
    words += ["--space", wanted.space] if wanted.space != "raw" else []
    return Export((*words, "-o", str(output)), _bake, (profile, output, wanted))


def _bake(profile: Path, output: Path, wanted: TransformRequest, progress: Progress) -> Iterator[str]:
    files, notes = bake_files(profile, wanted, [output], progress=progress)
    yield from (f"{file.summary}; read back, against the model: {file.error}" for file in files)
    yield from notes


def kit_export(profile: Path, output: Path, target: str, program: str, shots: tuple[Path, ...] = ()) -> Export:
    """A kit for a program. target: its STYLE/WB; shots: RAW files that it is checked with."""
    checks = [word for shot in shots for word in ("--check", str(shot))]
    words = ("kit", str(profile), "--to", target, "--for", program, *checks, "-o", str(output))
    return Export(words, _kit, (profile, output, target, program, shots))


def _kit(
    profile: Path, output: Path, target: str, program: str, shots: tuple[Path, ...], progress: Progress
) -> Iterator[str]:
    progress("kit", 0.0)
    folder = write_kit(as_profile(profile), target, output, program)
    yield f"{', '.join(sorted(path.name for path in folder.iterdir()))}; read README.md first"
    if shots and not (folder / SCRIPT).is_file():
        yield f"not checked: {program} is not run from the command line; compare a shot there by eye"
    elif shots:
        try:
            checks, notes = check_kit(folder, shots, progress)
        except LutForgeError as error:  # such as a program that is not installed here: the kit is written all the same
            yield f"not checked: {one_line(str(error), 300)}"
            return
        for each in checks:
            yield f"{each.shot}: the program against the camera's JPEG, ΔE00 mean {each.mean:.2f}, 95 % {each.p95:.2f}"
        yield from notes


def config_export(profile: Path, output: Path) -> Export:
    """An OpenColorIO config, checked."""
    return Export(("config", str(profile), "-o", str(output)), _config, (profile, output))


def _config(profile: Path, output: Path, progress: Progress) -> Iterator[str]:
    made = write_config([profile], output, progress=progress)
    checked = "; ".join(map(str, made.findings)) or "sound"
    yield f"{len(made.spaces)} input colour spaces, {len(made.looks)} looks; checked: {checked}"


def parameters_export(profile: Path, output: Path, style: str) -> Export:
    """The parameters of one style as text."""
    words = ("export-nus", str(profile), "--style", style, "-o", str(output))
    return Export(words, _parameters, (profile, output, style))


def _parameters(profile: Path, output: Path, style: str, progress: Progress) -> Iterator[str]:
    progress("parameters", 0.0)
    yield from (f"{path}" for path in export_published(as_profile(profile), style, output))


def report_export(profile: Path, output: Path, samples: SampleSet | None = None, table: Path | None = None) -> Export:
    """A report; with the samples in the fit, which are in a table, where there are any."""
    words = ("report", str(profile), *(() if table is None else (str(table),)), "-o", str(output))
    return Export(words, _report, (profile, output, samples))


def _report(profile: Path, output: Path, samples: SampleSet | None, progress: Progress) -> Iterator[str]:
    yield f"{len(report(profile, samples, output, progress=progress).pictures)} figures"


def wanted_lut(kind: str, source: str, target: str, ev: float, space: str = "raw") -> TransformRequest:
    """The transform of a LUT, with the options that its kind takes."""
    spaced = kind == "linearize" or (kind == "render" and space != "raw")
    return TransformRequest(
        kind,
        source if kind != "render" else None,
        target if kind != "linearize" else None,
        ev if kind == "refinish" or (kind == "render" and spaced) else 0.0,
        space if spaced else "raw",
    )


def calibration_command(table: Path, inliers: Path | None, options: CalibrationOptions, profile: Path) -> str:
    """Return what makes a profile of the samples in a table: a command, or lines of Python where no command does.

    inliers: the table that response, matrix and white balances were fitted to, where that was another.
    """
    usual = CalibrationOptions()
    if inliers is not None or options.physical != usual.physical:
        given = "" if inliers is None else f", stages=calibrate_stages({str(inliers)!r}, options)"
        return "\n".join(
            (
                "from lutforge.calibration.options import CalibrationOptions, PhysicalOptions",
                "from lutforge.pipeline.calibration import calibrate, calibrate_stages",
                f"options = {options!r}",
                f"calibrate({str(table)!r}, options{given}).save({str(profile)!r})",
            )
        )
    words = ["lutforge", "calibrate", str(table)]
    for name in ("model", "preset", "size", "interpolation"):
        words += [f"--{name}", str(getattr(options, name))] if getattr(options, name) != getattr(usual, name) else []
    return shlex.join([*words, *([] if options.nonuniform else ["--uniform"]), "-o", str(profile)])


class ExportPage:
    """The last step."""

    def __init__(self, session: Session) -> None:
        self.session = session
        self.proposed = "camera"
        self.name = ui.entry("Name of the files", value=self.proposed)
        self.program = ui.select("Program of the kit", {"compute a model first": ""})
        self.check = ui.checkbox("Check the kit on the shots")
        self.kind = ui.select("Transform of the LUT", ["refinish", "render", "linearize"])
        self.space = ui.select("Scene of render and linearize", ["raw", *SPACES])
        self.suffix = ui.select("LUT file", list(LUT_SUFFIXES))
        self.written: set[Path] = set()
        self._offered: object = None
        self._cards: dict[tuple[Written, bool], pmui.Paper] = {}  # each stays while its file does: so does its button
        self.asked: list[Path] = []
        self.look = ui.text()
        self.main = pn.Column(**ui.SCROLLED)

        def button(label: str, action: Any, **more: Any) -> pmui.Button:
            return session.button(label, action, **{**ui.WIDE, **more})

        bake, kit = (
            button("Bake LUT", self._bake, variant="contained"),
            button("Write kit", self._kit, variant="contained"),
        )
        self.controls = [
            ui.text(
                ui.html("<p>Files go to <b>{}</b>; the commands are of that folder.</p>", session.folders.roots[0])
            ),
            self.name,
            button("Save profile", self._save_profile, variant="contained"),
            pn.Column(self.look, self.program, self.check, kit, **ui.TOGETHER),
            pn.Column(self.kind, self.space, self.suffix, bake, **ui.TOGETHER),
            button("Write config", self._config),
            button("Write report", self._report),
            button("Save parameters as text", self._parameters),
            button("Save workspace", self._workspace),
        ]

    def refresh(self) -> None:
        """What was written, and whether it is of the model and look as they are; the programs that a kit can be for."""
        session = self.session
        if session.has_profile:
            ui.offer(self.program, kits_of(session.profile, session.look.target))
            self.look.object = ui.paragraphs(f"Kits and LUTs are of {session.look.target}; choose another under Look.")
        if self._offered is not session.response and session.response is not None:  # what a bracket is taken for
            self.kind.value = "linearize"
            self.space.value = "aces2065-1" if session.response[0].chart else "raw"
        self._offered = session.response
        nothing = ui.paragraphs(
            "Nothing is written yet. Each file will stand here with its error, and with its command."
        )
        cards = {(each, session.is_old(each)): None for each in reversed(session.written.values())}
        if not cards or list(cards) != list(self._cards):
            self._cards = {key: self._cards.get(key) or self._card(*key) for key in cards}
            self.main[:] = list(self._cards.values()) or [ui.text(nothing)]

    def _card(self, made: Written, stale: bool) -> pmui.Paper:
        """What was written: lines that tell of it, and its command with a button that copies it."""
        title = f"{made.what}: {self.session.folders.name(made.path)}{' (stale)' if stale else ''}"
        shown = ui.text(ui.html("<h2>{}</h2>{}", title, ui.paragraphs(*made.lines)))
        card = pmui.Paper(shown, variant="outlined", sizing_mode="stretch_width", margin=8)
        if made.command:
            words = f"Copy the command: {made.what}"
            copy = pmui.Button(label="Copy", description=words, size="small", variant="outlined", margin=8)
            copied = "navigator.clipboard.writeText(command); button.data.label = 'Copied';"
            copied += " setTimeout(() => { button.data.label = 'Copy'; }, 1500);"
            copy.js_on_click(args={"command": made.command, "button": copy}, code=copied)
            card.append(pn.Row(ui.text(ui.html("<code>{}</code>", made.command)), copy, sizing_mode="stretch_width"))
        return card

    def _paths(self, *suffixes: str) -> list[Path]:
        """Return where files, and folders (a suffix without a dot), go, under one name.

        A proposed name gives way to files of before. Raises WorkspaceError, once, where one that the visitor wrote has
        such.
        """
        name = wished = ui.written(self.name)
        for number in count(2):
            paths = [self.session.folders.inside(name + suffix) for suffix in suffixes]
            for path, suffix in zip(paths, suffixes, strict=True):
                require_writable(path if "." in suffix else path / "README.md")
            there = [path for path in paths if path.exists() and path not in self.written]
            if not there or there == self.asked:
                break
            if wished != self.proposed:
                self.asked = there
                names = ", ".join(path.name for path in there)
                raise WorkspaceError(f"{names}: there already; press again to replace, or choose another name")
            name = f"{re.sub(r'_[0-9]+$', '', wished)}_{number}"
        if name != wished:
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
        profile = self.session.profile  # before any name is taken
        paths = self._paths(".npz", *suffixes)
        profile.save(paths[0])
        return paths

    def _tell(self, what: str, path: Path, lines: tuple[str, ...], command: str) -> None:
        command = command.replace(f"{self.session.folders.roots[0]}/", "")  # as one types it there
        self.session.written.pop(what, None)
        self.session.written[what] = Written(what, path, lines[:20], command, self.session.made)
        self.session.say(f"{what}: written, {path.name}")
        self.session.on_change()

    def _workspace(self) -> None:
        workspace = self.session.workspace
        (path,) = self._paths(SUFFIX)
        save_workspace(workspace, path)
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
        path, table, *others = self._paths(".npz", "_samples.npz", *(["_inliers.npz"] if stages is not None else []))
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
        line = f"profile of {profile.camera}, {int(task.rows.sum()):,} samples; {known}"
        self._tell("profile", path, (line,), command)

    def _run(self, what: str, path: Path, export: Export) -> None:
        def done(lines: tuple[str, ...]) -> None:
            self._tell(what, path, lines, str(export))

        self.session.start(f"lutforge {export.words[0]}", done, run, export)

    def _bake(self) -> None:
        profile, look, kind = self.session.profile, self.session.look, self.kind.value
        source = look.source
        if not source and len(profile.styles) == len(profile.white_balances) == 1:
            source = f"{next(iter(profile.styles))}/{next(iter(profile.white_balances))}"
        if kind != "render" and not source:
            raise WorkspaceError("what were the pictures taken as? choose that under Look, “Taken as”")
        wanted = wanted_lut(kind, source, look.target, look.ev, self.space.value)
        path, output = self._with_profile(f"_{kind}{self.suffix.value}")
        self._run(f"LUT, {kind}", output, lut_export(path, output, wanted))

    def _kit(self) -> None:
        target, program = self.session.look.target, self.program.value
        if not program:
            raise WorkspaceError("a kit needs a camera with RAW: compute a model, or open a profile")
        profile, output = self._with_profile(f"_{program}_kit")
        shots = tuple(self.session.opened.files.values()) if self.check.value else ()
        self._run(f"kit for {program}", output, kit_export(profile, output, target, program, shots))

    def _config(self) -> None:
        profile, output = self._with_profile(".ocioz")
        self._run("config", output, config_export(profile, output))

    def _parameters(self) -> None:
        style = next(iter(self.session.profile.styles))
        profile, output = self._with_profile("_parameters")
        self._run("parameters", output, parameters_export(profile, output, style))

    def _report(self) -> None:
        if self.session.history is None or not self.session.workspace.has_raw:
            profile, output = self._with_profile(".html")
            self._run("report", output, report_export(profile, output))
            return
        profile, output, table = self._with_profile(".html", "_samples.npz")
        samples = self.session.workspace.samples.select(self.session.workspace.fitted_rows)
        write_samples(table, samples)
        self._run("report", output, report_export(profile, output, samples, table))
