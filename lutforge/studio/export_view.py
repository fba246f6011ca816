"""Export: samples, profile, LUTs, config, report and the workspace, as files of the command line."""

from html import escape
from pathlib import Path

import panel as pn

from lutforge.atomic_write import require_writable
from lutforge.samples.sample_set import SampleSet
from lutforge.samples.table import write_samples
from lutforge.studio.elements import Slider, entry, select, text
from lutforge.studio.export import Export, run, wanted_lut
from lutforge.studio.preview_view import PreviewView
from lutforge.studio.session import Session
from lutforge.studio.workspace import WorkspaceError
from lutforge.studio.workspace_file import SUFFIX, save_workspace

LUT_SUFFIXES = (".clf", ".cube", ".resolve.cube", ".csp", ".3dl", ".png")


class ExportView:
    """The page's last view."""

    def __init__(self, session: Session, preview: PreviewView) -> None:
        self.session, self.preview = session, preview
        self.name = entry("Name of the files", value="camera")
        self.kind = select("Transform of the LUT", ["refinish", "render", "linearize"])
        self.source, self.target = entry("From STYLE/WB"), entry("To STYLE/WB")
        self.ev = Slider("Exposure", 0, start=-3, end=3, step=0.05, unit=" EV")
        self.suffix = select("LUT file", list(LUT_SUFFIXES))
        self.lines: list[str] = []
        self.written: set[Path] = set()
        self.asked: list[Path] = []
        self.log = text(width=960, height=600, styles={"overflow": "auto", "background": "#ffffff", "padding": "6px"})
        actions = {
            "Save workspace": self._workspace,
            "Save samples in the fit": self._samples,
            "Save profile": self._save_profile,
            "Bake LUT": self._bake,
            "Write config": self._config,
            "Write report": self._report,
        }
        buttons = [session.button(name, action, width=200) for name, action in actions.items()]
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

    def refresh(self) -> None:
        """Take From and To over from the preview."""
        if not self.session.has_profile:
            return
        self.source.value = self.preview.source.value
        self.target.value = self.preview.target()
        self.ev.value = self.preview.ev.value

    def _tell(self, line: str) -> None:
        self.lines = [*self.lines, line][-60:]
        self.log.object = "<h2>Written</h2>" + "".join(f"<p><code>{escape(entry)}</code></p>" for entry in self.lines)

    def _paths(self, *suffixes: str) -> list[Path]:
        """Return where files go, under one name. Raises WorkspaceError, once, where there are other files already."""
        name = self.name.value_input or self.name.value
        paths = [self.session.folders.inside(name + suffix) for suffix in suffixes]
        for path in paths:
            require_writable(path)
        there = [path for path in paths if path.exists() and path not in self.written]
        if there and there != self.asked:
            self.asked = there
            names = ", ".join(path.name for path in there)
            raise WorkspaceError(f"{names}: there already; press again to replace, or choose another name")
        self.written.update(paths)
        return paths

    def _workspace(self) -> None:
        (path,) = self._paths(SUFFIX)
        save_workspace(self.session.workspace, path)
        self._said(f"{path}: the whole workspace")

    def _samples(self) -> None:
        (path,) = self._paths(".parquet")
        samples = self._in_fit()
        write_samples(path, samples)
        self._said(f"{path}: {len(samples):,} samples, as the model in use was fitted to")

    def _in_fit(self) -> SampleSet:
        workspace = self.session.workspace
        return workspace.samples.select(workspace.fitted_rows)

    def _save_profile(self) -> None:
        (path,) = self._paths(".npz")
        self.session.profile.save(path)
        self._said(f"{path}: profile of {self.session.profile.camera}")

    def _bake(self) -> None:
        source, target = (box.value_input or box.value for box in (self.source, self.target))
        wanted = wanted_lut(self.kind.value, source, target, self.ev.value)
        profile, output = self._paths(".npz", f"_{self.kind.value}{self.suffix.value}")
        self._run(Export("bake", profile, output, wanted))

    def _config(self) -> None:
        profile, output = self._paths(".npz", ".ocioz")
        self._run(Export("config", profile, output))

    def _report(self) -> None:
        if self.session.history is None:
            profile, output = self._paths(".npz", ".html")
            self._run(Export("report", profile, output))
            return
        profile, output, table = self._paths(".npz", ".html", ".parquet")
        samples = self._in_fit()
        write_samples(table, samples)
        self._run(Export("report", profile, output, samples=samples, table=table))

    def _run(self, export: Export) -> None:
        def done(lines: tuple[str, ...]) -> None:
            for line in (f"$ {export}", *lines[:20]):
                self._tell(line)
            self.session.say(f"{export.command}: written")

        self.session.profile.save(export.profile)
        self.session.start(f"lutforge {export.command}", done, run, export)

    def _said(self, line: str) -> None:
        self._tell(line)
        self.session.say(line)
