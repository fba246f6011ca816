"""Exports: the use cases of the command line, each with the words that would do the same there."""

import shlex
from dataclasses import dataclass
from pathlib import Path

from lutforge.pipeline.baking import bake_files
from lutforge.pipeline.configs import write_checked_config
from lutforge.pipeline.reports import report
from lutforge.pipeline.transforms import TransformRequest
from lutforge.progress import Progress
from lutforge.samples.sample_set import SampleSet


@dataclass(frozen=True, eq=False)
class Export:
    """What to write. profile: the path that it was saved to; samples: those in the fit, and their path, for reports."""

    command: str
    profile: Path
    output: Path
    wanted: TransformRequest | None = None
    samples: SampleSet | None = None
    table: Path | None = None

    def __str__(self) -> str:
        """The command as one would type it."""
        words = ["lutforge", self.command, str(self.profile)]
        if self.table is not None:
            words.append(str(self.table))
        if self.wanted is not None:
            words.append(self.wanted.kind)
            for option, value in (("--from", self.wanted.source), ("--to", self.wanted.target)):
                words += [option, value] if value else []
            words += ["--ev", f"{self.wanted.ev:g}"] if self.wanted.ev else []
        return shlex.join([*words, "-o", str(self.output)])


def wanted_lut(kind: str, source: str, target: str, ev: float) -> TransformRequest:
    """The transform of a LUT, with the options that its kind takes."""
    return TransformRequest(
        kind,
        source if kind != "render" else None,
        target if kind != "linearize" else None,
        ev if kind == "refinish" else 0.0,
    )


def run(export: Export, progress: Progress) -> tuple[str, ...]:
    """Write the export; the lines that tell of it. Raises LutForgeError."""
    if export.wanted is not None:
        baked = bake_files(export.profile, export.wanted, [export.output], progress=progress)
        return (*(f"{file}; read back, against the model: {file.error}" for file in baked.files), *baked.notes)
    if export.command == "config":
        written = write_checked_config([export.profile], export.output, progress=progress)
        return (f"{written.path}: {len(written.spaces)} input colour spaces, {len(written.looks)} looks",)
    page = report(export.profile, export.samples, export.output, progress=progress)
    return (f"{export.output}: {len(page.pictures)} figures",)
