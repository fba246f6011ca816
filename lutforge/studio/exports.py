"""What Export writes in another process: each file or folder by the use case of the command that writes the same."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from lutforge.model.camera_profile import as_profile
from lutforge.model.published_model import export_published
from lutforge.pipeline.baking import bake_files
from lutforge.pipeline.configs import write_config
from lutforge.pipeline.kits import kit_contents, write_kit
from lutforge.pipeline.reports import report
from lutforge.pipeline.transforms import TransformRequest
from lutforge.progress import Progress
from lutforge.samples.sample_set import SampleSet

Lines = tuple[str, ...]
"""What there is to know of something that was written, a line each."""


@dataclass(frozen=True, eq=False)
class Export:
    """Something to write of a profile.

    title: on its card; command: the command that writes the same; suffix: of the file, or of a folder's name (without a
    dot); write: writes the output from the file of a profile; words, options: of the command, behind the profile;
    look_fields: the names of the fields of the look that it depends on.
    """

    title: str
    command: str
    suffix: str
    write: Callable[[Path, Path, Progress], Lines]
    words: tuple[object, ...] = ()
    options: Mapping[str, object] = field(default_factory=dict)
    look_fields: tuple[str, ...] = ()


def run_export(export: Export, profile: Path, output: Path, progress: Progress) -> Lines:
    """Write an export, in another process. Raises LutForgeError."""
    progress(export.command, 0.0)
    return export.write(profile, output, progress)


def write_lut_file(request: TransformRequest, profile: Path, output: Path, progress: Progress) -> Lines:
    """Bake a transform to a LUT file."""
    files, notes = bake_files(profile, request, [output], progress=progress)
    return (*(f"{file.summary}; read back, against the model: {file.error}" for file in files), *notes)


def write_config_archive(profile: Path, output: Path, progress: Progress) -> Lines:
    """Write an OpenColorIO config."""
    written = write_config([profile], output, progress=progress)
    return (f"{len(written.spaces)} input colour spaces, {len(written.looks)} looks; checked",)


def write_parameters(style: str, profile: Path, output: Path, progress: Progress) -> Lines:
    """Write the camera models of a style as text files."""
    return tuple(map(str, export_published(as_profile(profile), style, output)))


def write_report(samples: SampleSet | None, profile: Path, output: Path, progress: Progress) -> Lines:
    """Write a report, with errors on samples where there are any."""
    return (f"{len(report(profile, samples, output, progress=progress).pictures)} figures",)


def write_kit_folder(look: str, program: str, profile: Path, output: Path, progress: Progress) -> Lines:
    """Write a kit of a look for a program."""
    folder = write_kit(profile, look, output, program)
    return kit_contents(folder)
