"""Exports: the use cases of the command line, each with the words that do the same there."""

import shlex
from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

from lutforge.calibration.options import CalibrationOptions
from lutforge.errors import LutForgeError, one_line
from lutforge.model.camera_profile import as_profile
from lutforge.model.published_model import export_published
from lutforge.pipeline.baking import bake_files
from lutforge.pipeline.configs import write_checked_config
from lutforge.pipeline.kits import SCRIPT, check_kit, write_kit
from lutforge.pipeline.reports import report
from lutforge.pipeline.transforms import TransformRequest
from lutforge.progress import Progress
from lutforge.samples.sample_set import SampleSet


@dataclass(frozen=True, eq=False)
class Export(ABC):
    """A file or folder to write of a profile, by a command of `lutforge`. profile: the path that it was saved to."""

    profile: Path
    output: Path
    command: ClassVar[str]

    @abstractmethod
    def write(self, progress: Progress) -> Iterator[str]:
        """Write it; the lines that tell of it, and of its error. Raises LutForgeError."""

    def options(self) -> list[str]:
        """The command's words between the profile and the output."""
        return []

    def __str__(self) -> str:
        """The command as one would type it."""
        return shlex.join(["lutforge", self.command, str(self.profile), *self.options(), "-o", str(self.output)])


@dataclass(frozen=True, eq=False)
class LutExport(Export):
    """A LUT of a transform."""

    wanted: TransformRequest
    command = "bake"

    def options(self) -> list[str]:
        """The transform's kind and what is not as usual."""
        wanted = self.wanted
        words = [wanted.kind]
        for option, value in (("--from", wanted.source), ("--to", wanted.target)):
            words += [option, value] if value else []
        words += ["--ev", f"{wanted.ev:g}"] if wanted.ev else []
        return words + (["--space", wanted.space] if wanted.space != "raw" else [])

    def write(self, progress: Progress) -> Iterator[str]:
        """Tell a line a file, with its error when read back."""
        baked = bake_files(self.profile, self.wanted, [self.output], progress=progress)
        yield from (f"{file.summary}; read back, against the model: {file.error}" for file in baked.files)
        yield from baked.notes


@dataclass(frozen=True, eq=False)
class KitExport(Export):
    """A kit. target: its STYLE/WB; shots: RAW files that it is checked with."""

    target: str
    program: str
    shots: tuple[Path, ...] = ()
    command = "kit"

    def options(self) -> list[str]:
        """Settings and program; each shot is an option's one word."""
        return ["--to", self.target, "--for", self.program, *(w for shot in self.shots for w in ("--check", str(shot)))]

    def write(self, progress: Progress) -> Iterator[str]:
        """Tell the kit's files, and how far each checked shot is from the camera's."""
        progress("kit", 0.0)
        folder = write_kit(as_profile(self.profile), self.target, self.output, self.program)
        yield f"{', '.join(sorted(path.name for path in folder.iterdir()))}; read README.md first"
        if self.shots:
            yield from self._checked(folder, progress)

    def _checked(self, folder: Path, progress: Progress) -> Iterator[str]:
        """A line a shot: how far the program is from the camera's JPEG, or why that is not known."""
        if not (folder / SCRIPT).is_file():
            yield f"not checked: {self.program} is not run from the command line; compare a shot there by eye"
            return
        try:
            checks, notes = check_kit(folder, self.shots, progress)
        except LutForgeError as error:  # such as a program that is not installed here: the kit is written all the same
            yield f"not checked: {one_line(str(error), 300)}"
            return
        yield from (
            f"{each.shot}: the program against the camera's JPEG, ΔE00 mean {each.mean:.2f}, 95 % {each.p95:.2f}"
            for each in checks
        )
        yield from notes


@dataclass(frozen=True, eq=False)
class ConfigExport(Export):
    """An OpenColorIO config, checked."""

    command = "config"

    def write(self, progress: Progress) -> Iterator[str]:
        """Tell how much the config holds, and what its check found."""
        written = write_checked_config([self.profile], self.output, progress=progress)
        yield f"{len(written.spaces)} input colour spaces, {len(written.looks)} looks; checked: " + (
            "; ".join(map(str, written.findings)) or "sound"
        )


@dataclass(frozen=True, eq=False)
class ParametersExport(Export):
    """The parameters of one style as text."""

    style: str
    command = "export-nus"

    def options(self) -> list[str]:
        """The style."""
        return ["--style", self.style]

    def write(self, progress: Progress) -> Iterator[str]:
        """Tell the files."""
        progress("parameters", 0.0)
        yield from (f"{path}" for path in export_published(as_profile(self.profile), self.style, self.output))


@dataclass(frozen=True, eq=False)
class ReportExport(Export):
    """A report; with the samples in the fit, which are in a table, where there are any."""

    samples: SampleSet | None = None
    table: Path | None = None
    command = "report"

    def options(self) -> list[str]:
        """The table, where there are samples."""
        return [str(self.table)] if self.table is not None else []

    def write(self, progress: Progress) -> Iterator[str]:
        """Tell how many figures there are."""
        page = report(self.profile, self.samples, self.output, progress=progress)
        yield f"{len(page.pictures)} figures"


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
    """The command that makes a profile of the samples in a table, and of the inliers where stages were fitted."""
    usual, physical = CalibrationOptions(), options.physical
    words = ["lutforge", "calibrate", str(table)]
    words += ["--inliers", str(inliers)] if inliers is not None else []
    for option, value, default in (
        ("--model", options.model, usual.model),
        ("--preset", options.preset, usual.preset),
        ("--size", options.size, usual.size),
        ("--interpolation", options.interpolation, usual.interpolation),
        ("--beta", physical.beta, usual.physical.beta),
        ("--curves", physical.curves, usual.physical.curves),
        ("--weighting", physical.weighting, usual.physical.weighting),
        ("--centres", physical.centres, usual.physical.centres),
        ("--rho", physical.rho, None),
    ):
        words += [option, str(value)] if value != default else []
    for one, other in physical.without_pairs:
        words += ["--without-pair", f"{one}|{other}"]
    return shlex.join([*words, *([] if options.nonuniform else ["--uniform"]), "-o", str(profile)])


def run(export: Export, progress: Progress) -> tuple[str, ...]:
    """Write the export; the lines that tell of it, and of its error. Raises LutForgeError."""
    return tuple(export.write(progress))
