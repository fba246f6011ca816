"""Exports: the use cases of the command line, each with the words that do the same there."""

import shlex
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

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
class Export:
    """What to write. command: of `lutforge`; profile: the path that it was saved to; output: a file or folder.

    wanted: the transform of a LUT; target: the STYLE/WB of a kit, and its program; style: of the parameters as text.
    samples: those in the fit, with their table, for reports; shots: RAW files that a kit is checked with.
    """

    command: str
    profile: Path
    output: Path
    wanted: TransformRequest | None = None
    target: str = ""
    program: str = ""
    style: str = ""
    samples: SampleSet | None = None
    table: Path | None = None
    shots: tuple[Path, ...] = ()

    def __str__(self) -> str:
        """The command as one would type it."""
        words = ["lutforge", self.command, str(self.profile)]
        words += [str(self.table)] if self.table is not None else []
        if self.wanted is not None:
            words.append(self.wanted.kind)
            for option, value in (("--from", self.wanted.source), ("--to", self.wanted.target)):
                words += [option, value] if value else []
            words += ["--ev", f"{self.wanted.ev:g}"] if self.wanted.ev else []
            words += ["--space", self.wanted.space] if self.wanted.space != "raw" else []
        for option, value in (("--to", self.target), ("--for", self.program), ("--style", self.style)):
            words += [option, value] if value else []
        words += ["-o", str(self.output)]
        return shlex.join([*words, *(["--check", *map(str, self.shots)] if self.shots else [])])


def _checked(folder: Path, export: Export, progress: Progress) -> Iterator[str]:
    """A line a shot: how far the program is from the camera's JPEG, or why that is not known."""
    if not (folder / SCRIPT).is_file():
        yield f"not checked: {export.program} is not run from the command line; compare a shot there by eye"
        return
    try:
        checks, notes = check_kit(folder, export.shots, progress)
    except LutForgeError as error:  # such as a program that is not installed here: the kit is written all the same
        yield f"not checked: {one_line(str(error), 300)}"
        return
    yield from (
        f"{each.shot}: the program against the camera's JPEG, ΔE00 mean {each.mean:.2f}, 95 % {each.p95:.2f}"
        for each in checks
    )
    yield from notes


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
    return tuple(_run(export, progress))


def _run(export: Export, progress: Progress) -> Iterator[str]:
    if export.wanted is not None:
        baked = bake_files(export.profile, export.wanted, [export.output], progress=progress)
        yield from (f"{file.summary}; read back, against the model: {file.error}" for file in baked.files)
        yield from baked.notes
    elif export.command == "kit":
        progress("kit", 0.0)
        folder = write_kit(as_profile(export.profile), export.target, export.output, export.program or None)
        yield f"{', '.join(sorted(path.name for path in folder.iterdir()))}; read README.md first"
        if export.shots:
            yield from _checked(folder, export, progress)
    elif export.command == "config":
        written = write_checked_config([export.profile], export.output, progress=progress)
        yield f"{len(written.spaces)} input colour spaces, {len(written.looks)} looks; checked: " + (
            "; ".join(map(str, written.findings)) or "sound"
        )
    elif export.command == "export-nus":
        progress("parameters", 0.0)
        yield from (f"{path}" for path in export_published(as_profile(export.profile), export.style, export.output))
    else:
        page = report(export.profile, export.samples, export.output, progress=progress)
        yield f"{len(page.pictures)} figures"
