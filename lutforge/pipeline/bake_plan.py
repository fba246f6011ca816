"""The plan of a bake: which LUTs are fitted, in what form, for which files and programs."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from lutforge.arrays import ColourFunction
from lutforge.colour.rgb_spaces import rgb_space
from lutforge.errors import LutError, SettingsError
from lutforge.interpolation import INTERPOLATIONS, Interpolation
from lutforge.luts.description import description
from lutforge.luts.forms import FORMS, Form
from lutforge.luts.input_and_output import ADOBE_RGB, ENCODED, InputAndOutput, input_and_output_of
from lutforge.luts.lower import takes_scenes
from lutforge.luts.lut_metadata import LutMetadata
from lutforge.luts.lut_programs import Program, program_named
from lutforge.luts.target import Target, files_for, target_of
from lutforge.luts.writers.process_list import AMPAS_CLF_3, PROCESS_LISTS
from lutforge.model.transform import Purpose, PurposeKind, Transform
from lutforge.pipeline.outputs import check_output, one_of
from lutforge.settings import StyleName

EXAMPLE_PROFILE = "camera.npz"
"""The file of a profile in advice, where its own is not known."""


@dataclass(frozen=True)
class BakeOptions:
    """How a transform is baked: the options of `bake`, which says what each of them means.

    Raises LutError or SettingsError where one of them is none.
    """

    program: str | None = None
    size: int | None = None
    form: Form = "full"
    tolerance: float | None = None
    interpolation: str | None = None
    title: str = ""
    highest: float = 1.0
    clf_version: str | None = None

    def __post_init__(self) -> None:
        _ = self.reader, self.method
        if self.form not in FORMS:
            raise LutError(f'unknown form "{self.form}"; choose {", ".join(FORMS)}')
        if self.clf_version is not None and str(self.clf_version) not in ("3", "3.0"):
            raise SettingsError(f'unknown CLF version "{self.clf_version}": 3, or none for SMPTE ST 2136-1')

    @cached_property
    def reader(self) -> Program | None:
        """The program that will read the files; None for any."""
        return None if self.program is None else program_named(self.program)

    @cached_property
    def method(self) -> Interpolation | None:
        """The interpolation that is given, else that of the reader; None where neither is known."""
        if self.interpolation is not None:
            return one_of("interpolation", self.interpolation, INTERPOLATIONS)
        return None if self.reader is None else self.reader.interpolation


@dataclass(frozen=True)
class Task:
    """One LUT of a plan: its form, and the file that it is written to, or None for a LUT in memory.

    in_steps: a cube for each step of the transform, so that lattices of a profile stay exact.
    """

    target: Target
    path: Path | None = None
    in_steps: bool = False


@dataclass(frozen=True, eq=False)
class Plan:
    """The LUTs to bake, and the metadata of their files.

    title, comments, metadata: of the files; input_and_output: where they are known; scenes: inputs are scene-linear;
    notes: for the user.
    """

    transform: ColourFunction
    purpose: Purpose
    options: BakeOptions
    tasks: tuple[Task, ...]
    title: str
    comments: tuple[str, ...]
    metadata: LutMetadata
    input_and_output: InputAndOutput | None
    scenes: bool
    notes: tuple[str, ...]


def plan_of(
    transform: ColourFunction, outputs: Sequence[str | Path], options: BakeOptions, profile: str = EXAMPLE_PROFILE
) -> Plan:
    """The plan of `bake`. profile: its file, for messages. Raises the errors that `bake` raises before the work."""
    reader = options.reader
    purpose = transform.purpose if isinstance(transform, Transform) else Purpose()
    if options.tolerance is not None and not purpose.gives_encoded:
        raise LutError("a ΔE00 tolerance has no meaning for scene-linear output; give a size (33 or 65) instead")
    if reader is not None and reader.develops and purpose.kind is PurposeKind.RENDER:
        advice = f"make a kit for it, lutforge kit {profile} --to {purpose.target} --for {reader.name} -o kit"
        raise SettingsError(f"{reader.name} feeds a LUT with what it developed, never with camera RAW: {advice}")

    title = options.title or purpose.title
    readers, notes = _readers_by_path([check_output(path) for path in outputs], reader, title)
    if purpose.is_of_profile:  # whose render from RAW begins with a matrix, too, that of a reference camera
        scenes = purpose.takes_footage and rgb_space(purpose.space).is_linear
    else:
        scenes = takes_scenes(transform) or options.highest != 1

    # One cube for each step, unless an option requires a single one.
    needs_one_cube = any((reader, options.size, options.tolerance, options.method))
    is_exact = purpose.kind.is_between_jpegs and not needs_one_cube
    tasks = [
        Task(
            target_of(path, reader_of_file, options.size, options.method, scenes),
            path,
            in_steps=is_exact and path.suffix.lower() in PROCESS_LISTS,
        )
        for path, reader_of_file in readers.items()
    ]
    in_memory = Task(Target(options.form, options.size, options.method))
    input_and_output = _input_and_output(purpose)
    return Plan(
        transform=transform,
        purpose=purpose,
        options=options,
        tasks=tuple(tasks) or (in_memory,),
        title=title,
        comments=_comments(purpose, input_and_output, reader, title),
        metadata=_clf_metadata(options.clf_version, readers),
        input_and_output=input_and_output,
        scenes=scenes,
        notes=tuple(notes),
    )


def _readers_by_path(
    paths: Sequence[Path], reader: Program | None, title: str
) -> tuple[dict[Path, Program | None], list[str]]:
    """The files to write, each with the program that reads it, and notes; a file that is named twice is written once.

    Without paths they are the files that the program needs.
    """
    readers = {} if paths or reader is None else files_for(reader, title)
    for path in readers:
        check_output(path)
    notes = []
    for path in paths:
        if path.resolve() in {file.resolve() for file in readers}:
            notes.append(f"{path}: named twice, written once")
            continue
        readers[path] = reader
    return readers, notes


def _input_and_output(purpose: Purpose) -> InputAndOutput | None:
    """The input and output of a transform of a profile; None for any other function."""
    if not purpose.is_of_profile:
        return None
    is_adobe_rgb = StyleName.parse(purpose.source.partition("/")[0]).colour_space == "adobe rgb"
    return input_and_output_of(purpose.kind, purpose.light, ADOBE_RGB if is_adobe_rgb else ENCODED)


def _comments(
    purpose: Purpose, input_and_output: InputAndOutput | None, reader: Program | None, title: str
) -> tuple[str, ...]:
    """The comments of the files."""
    place = "" if reader is None else reader.use
    settings = [f"camera and settings: {title}"] if purpose.is_of_profile else []
    return description(input_and_output, place, [*settings, *purpose.comments])


def _clf_metadata(version: str | None, paths: Iterable[Path]) -> LutMetadata:
    """The metadata of a LUT that select a version of CLF. Raises SettingsError where no file is a .clf."""
    if version is None:
        return LutMetadata()
    if not any(path.suffix.lower() == ".clf" for path in paths):
        raise SettingsError("--clf-version goes with a .clf: -o look.clf")
    return LutMetadata(clf_namespace=AMPAS_CLF_3)
