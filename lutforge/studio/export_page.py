"""Export: profile, LUTs, kits, config, report: use cases of the command line, each with the words that do the same."""

import shlex
from collections.abc import Callable, Iterable, Mapping
from dataclasses import fields, replace
from functools import partial
from pathlib import Path

import panel as pn
import panel_material_ui as pmui

from lutforge.atomic_write import require_writable
from lutforge.calibration.options import CalibrationOptions, LatticeOptions
from lutforge.colour.rgb_spaces import SPACES
from lutforge.pipeline.kits import kits_of
from lutforge.pipeline.looks import ChosenLook, changes_nothing
from lutforge.pipeline.transforms import TransformRequest
from lutforge.samples.sample_set import SampleSet
from lutforge.studio import ui
from lutforge.studio.exports import (
    Export,
    run_export,
    write_config_archive,
    write_kit_folder,
    write_lut_file,
    write_parameters,
    write_report,
)
from lutforge.studio.model_page import held_out_error
from lutforge.studio.models import BASE_MODEL, FitTask
from lutforge.studio.session import Session, Written
from lutforge.studio.setting_control import in_short
from lutforge.studio.workspace import WorkspaceError
from lutforge.studio.workspace_file import SUFFIX, save_workspace

OFFERED_SUFFIXES = (".clf", ".cube", ".resolve.cube", ".csp", ".spi1d", ".3dl", ".vlt", ".png")


class ExportPage:
    """The page of the last step: what can be written, and what was."""

    def __init__(self, session: Session) -> None:
        self.session = session
        self.name = ui.entry("Name of the files", value="camera")
        self.program = ui.select("Program of the kit", {"compute a model first": ""})
        self.kind = ui.select("Transform of the LUT", ["refinish", "render", "linearize"])
        self.space = ui.select("Scene of render and linearize", ["raw", *SPACES])
        self.suffix = ui.select("LUT file", list(OFFERED_SUFFIXES))
        self.remembered = (self.name, self.program, self.kind, self.space, self.suffix)
        self._cards: dict[tuple[Written, bool], pmui.Paper] = {}
        self._offered: object = None
        self.refused_paths: list[Path] = []
        self.warned_look: ChosenLook | None = None
        self.look = ui.text()
        self.main = pn.Column(**ui.SCROLLED)
        self.actions: dict[str, Callable[[], None]] = {
            "Save profile": self._save_profile, "Write kit": self._write_kit, "Bake LUT": self._bake_lut,
            "Write config": self._write_config, "Write report": self._write_report,
            "Save parameters as text": self._write_parameters, "Save workspace": self._save_workspace,
        }  # fmt: skip
        profile, kit, bake, *more_buttons = (
            session.page.button(label, action, variant="contained" if place < 3 else "outlined", **ui.FULL_WIDTH)
            for place, (label, action) in enumerate(self.actions.items())
        )
        folder = ui.html("<p>Files go to <b>{}</b>; the commands are of that folder.</p>", session.folders.roots[0])
        self.controls = [
            ui.text(folder),
            self.name,
            profile,
            pn.Column(self.look, self.program, kit, **ui.TOGETHER),
            pn.Column(self.kind, self.space, self.suffix, bake, **ui.TOGETHER),
            *more_buttons,
        ]

    def refresh(self) -> None:
        """Draw what was written, stale where model or look have changed since, and offer programs for a kit."""
        session = self.session
        if session.profile is not None:
            ui.offer(self.program, kits_of(session.profile, session.look.target))
            target = in_short(session.look.target)
            self.look.object = ui.paragraphs(f"Kits and LUTs are of {target}; choose another under Look.")
        if self._offered is not session.response and session.response is not None:  # what a bracket is taken for
            self.kind.value = "linearize"
            self.space.value = "aces2065-1" if session.response[0].chart else "raw"
        self._offered = session.response
        cards = [(written, session.is_old(written)) for written in reversed(session.written.values())]
        if not cards or cards != list(self._cards):  # drawing them anew would lose a click or a selection of text
            self._cards = {card: self._cards.get(card) or self._card(*card) for card in cards}
            nothing = "Nothing is written yet. Each file will stand here with its error, and with its command."
            self.main[:] = list(self._cards.values()) or [ui.text(ui.paragraphs(nothing))]

    def _card(self, made: Written, stale: bool) -> pmui.Paper:
        """A card of what was written: what there is to know of it, and its command."""
        title = f"{made.kind}: {self.session.folders.name(made.path)}{' (stale)' if stale else ''}"
        summary = ui.text(ui.html("<h2>{}</h2>{}", title, ui.paragraphs(*made.lines)))
        command = ui.html("<code>{}</code>", made.command) if made.command else ui.Html("")
        return pmui.Paper(summary, ui.text(command), variant="outlined", sizing_mode="stretch_width", margin=8)

    def _paths(self, *suffixes: str) -> list[Path]:
        """Return where files, and folders (a suffix without a dot), go, under one name.

        Raises WorkspaceError, once, where there are such that this visit has not written.
        """
        paths = [self.session.folders.inside(ui.written(self.name) + suffix) for suffix in suffixes]
        for path, suffix in zip(paths, suffixes, strict=True):
            require_writable(path if "." in suffix else path / "README.md")
        existing = [path for path in paths if path.exists() and path not in self.session.own_files]
        if existing and existing != self.refused_paths:
            self.refused_paths = existing
            names = ", ".join(path.name for path in existing)
            raise WorkspaceError(f"{names}: there already; press again to replace, or choose another name")
        self.session.own_files.update(paths)
        return paths

    def _with_profile(self, *suffixes: str) -> list[Path]:
        """Return the profile's file, which is saved unless it was opened and is there, and where others go."""
        profile = self.session.require_profile()
        opened = self.session.opened
        if profile is opened.profile and opened.profile_source is not None and opened.profile_source.is_file():
            return [opened.profile_source, *self._paths(*suffixes)]
        paths = self._paths(".npz", *suffixes)
        profile.save(paths[0])
        return paths

    def _announce(
        self, kind: str, path: Path, lines: tuple[str, ...], words: str, look_fields: tuple[str, ...] = ()
    ) -> None:
        """Show what was written on a card.

        lines: on its contents; words: of the command that writes the same; look_fields: of the look that it depends on.
        """
        session = self.session
        words = words.replace(f"{session.folders.roots[0]}/", "")  # as one types it there
        session.written.pop(kind, None)
        session.written[kind] = Written(kind, path, lines[:20], words, session.profile, session.look, look_fields)
        session.page.say(f"{kind}: written, {path.name}")
        session.page.on_change()

    def _start(self, export: Export, table: SampleSet | None = None) -> None:
        """Write an export in another process. table: samples that its command reads from a file, saved beside it."""
        more_suffixes = [] if table is None else ["_samples.npz"]
        profile, output, *table_paths = self._with_profile(export.suffix, *more_suffixes)
        if table is not None:
            table.save(table_paths[0])
        words = command((export.command, profile, *export.words, *table_paths), export.options, output)
        done = partial(self._announce, export.title, output, words=words, look_fields=export.look_fields)
        self.session.work.start(f"lutforge {export.command}", done, run_export, export, profile, output)

    def _save_workspace(self) -> None:
        """Save all of this page's work."""
        workspace = self.session.require_workspace()
        (path,) = self._paths(SUFFIX)
        save_workspace(workspace, path)
        self._announce("workspace", path, ("all of this page's work: open it under Shots",), "")

    def _save_profile(self) -> None:
        """The profile, and the samples that it was fitted to, so that the command line makes the same."""
        profile = self.session.require_profile()
        workspace = self.session.workspace
        response = self.session.response
        task = None if workspace is None or workspace.fitted is None else workspace.fitted.task
        if workspace is None or task is None:
            (path,) = self._paths(".npz")
            profile.save(path)
            words = ""
            if response is not None and response[1].profile is profile:
                names = ("times", "chart", "light", "corners", "all_colours")
                request = response[0]
                options = {name: getattr(request, name) for name in names}
                words = command(("response", *request.files), options, path)
            self._announce("profile", path, (f"profile of {profile.camera}", *profile.notes), words)
            return
        path, table = self._paths(".npz", "_samples.npz")
        profile.save(path)
        workspace.samples.select(task.rows).save(table)
        error = held_out_error(profile)
        error_in_words = "no shot could be left out" if error is None else f"mean error on shots left out {error:.4f}"
        words = calibration_command(task, table, path)
        lines = [f"profile of {profile.camera}, {int(task.rows.sum()):,} samples; {error_in_words}"]
        if not words:
            lines.append("no command has its stages or options: Save workspace keeps them")
        self._announce("profile", path, tuple(lines), words)

    def _bake_lut(self) -> None:
        """Bake the transform that is chosen to a LUT."""
        profile = self.session.require_profile()
        look = self.session.look
        kind = self.kind.value
        source = look.source
        space = "raw" if kind == "refinish" else self.space.value
        if not source and len(profile.styles) == len(profile.white_balances) == 1:
            source = f"{next(iter(profile.styles))}/{next(iter(profile.white_balances))}"
        if kind != "render" and not source:
            raise WorkspaceError("what were the pictures taken as? choose that under Look, “Taken as”")
        if kind == "refinish" and changes_nothing(profile, replace(look, source=source)):
            raise WorkspaceError(
                f"from {in_short(source)} to {in_short(look.target)} nothing changes: choose under Look "
                "what is wanted, or another transform of the LUT"
            )
        stated_source = source if kind != "render" else None
        target = look.target if kind != "linearize" else None
        exposed = kind == "refinish" or (kind == "render" and space != "raw")
        request = TransformRequest(kind, stated_source, target, look.ev if exposed else 0.0, space)
        options = {
            "from": stated_source,
            "to": target,
            "ev": f"{request.ev:g}" if request.ev else None,
            "space": space if space != "raw" else None,
        }
        self._start(
            Export(
                title=f"LUT, {kind}",
                command="bake",
                suffix=f"_{kind}{self.suffix.value}",
                write=partial(write_lut_file, request),
                words=(kind,),
                options=options,
                look_fields=("source",) * bool(stated_source) + ("target",) * bool(target) + ("ev",) * exposed,
            )
        )

    def _write_kit(self) -> None:
        """Write the kit of the look for the chosen program; where the look was never on screen, say so first."""
        target = self.session.look.target
        program = self.program.value
        if self.session.is_unseen and self.warned_look != self.session.look:
            self.warned_look = self.session.look
            raise WorkspaceError(
                f"{in_short(target)} was never on screen: choose under Look, “Taken as”, how the photograph "
                "was taken, or press again to write the kit unseen"
            )
        if not program:
            raise WorkspaceError("a kit needs a camera with RAW: compute a model, or open a profile")
        self._start(
            Export(
                title=f"kit for {program}",
                command="kit",
                suffix=f"_{program}_kit",
                write=partial(write_kit_folder, target, program),
                options={"to": target, "for": program},
                look_fields=("target",),
            )
        )

    def _write_config(self) -> None:
        """Write an OpenColorIO config of the camera."""
        self._start(Export("config", "config", ".ocioz", write_config_archive))

    def _write_parameters(self) -> None:
        """Write the camera model of the first style as the thesis authors' text files."""
        style = next(iter(self.session.require_profile().styles))
        write = partial(write_parameters, style)
        self._start(Export("parameters", "export-nus", "_parameters", write, options={"style": style}))

    def _write_report(self) -> None:
        """Write the report, with the samples in the fit where there are any."""
        workspace = self.session.workspace
        samples = None
        if workspace is not None and workspace.has_raw:
            samples = workspace.samples.select(workspace.fitted_rows)
        self._start(Export("report", "report", ".html", partial(write_report, samples)), table=samples)


def command(words: Iterable[object], options: Mapping[str, object], output: Path) -> str:
    """A command as one types it. An option without a value is left out; True is an option that takes none."""
    named = {f"--{name.replace('_', '-')}": value for name, value in options.items() if value}
    named_words = [(name,) if value is True else (name, value) for name, value in named.items()]
    return shlex.join(map(str, ("lutforge", *words, *(word for pair in named_words for word in pair), "-o", output)))


def calibration_command(task: FitTask, table: Path, profile: Path) -> str:
    """Return the command that makes a profile of the samples in a table, "" where none does.

    No command fits the stages alone, takes stages that were fitted before, or options of the camera model.
    """
    options = task.options
    usual = type(options)()
    of_lattices = {field.name for field in fields(LatticeOptions)}
    of_model = [field.name for field in fields(options) if field.name not in of_lattices]
    if task.kind == BASE_MODEL or task.stages is not None:
        return ""
    if any(getattr(options, name) != getattr(usual, name) for name in of_model):
        return ""
    preset = options.preset if options.preset != CalibrationOptions.preset else ""  # which is the command's default
    names = ("size", "interpolation")
    moved = {name: getattr(options, name) for name in names if getattr(options, name) != getattr(usual, name)}
    return command(("calibrate", table), {"preset": preset, **moved, "uniform": not options.nonuniform}, profile)
