"""Use case: a transform → LUT files, each read back and measured; and camera profiles of a profile's look."""

from __future__ import annotations  # so that help() shows the names of types

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from lutforge.arrays import ColourFunction
from lutforge.colour.rgb_spaces import rgb_space
from lutforge.errors import LutError, SettingsError
from lutforge.interpolation import INTERPOLATIONS, Interpolation
from lutforge.kits.dcp import DIVISIONS, fit_dng_profile, write_dcp
from lutforge.kits.icc import NODES, Variant, fit_icc_profile, write_icc
from lutforge.kits.kit import look_of, setting_of
from lutforge.kits.measure import error_of_profile
from lutforge.luts.bake import bake_steps, bake_to, bake_within
from lutforge.luts.description import description
from lutforge.luts.formats import format_of, write
from lutforge.luts.forms import FORMS, Form
from lutforge.luts.input_and_output import ADOBE_RGB, ENCODED, InputAndOutput, input_and_output_of
from lutforge.luts.lower import takes_scenes
from lutforge.luts.lut_metadata import LutMetadata
from lutforge.luts.lut_programs import Program, program_named
from lutforge.luts.sequence import Lut
from lutforge.luts.target import Target, files_for, target_of
from lutforge.luts.verification import FileError, verify
from lutforge.luts.writers.process_list import AMPAS_CLF_3, PROCESS_LISTS
from lutforge.model.camera_profile import CameraProfile, as_profile
from lutforge.model.provenance import Pictures
from lutforge.model.transform import Purpose, PurposeKind, Transform
from lutforge.pipeline.file_kinds import CAMERA_PROFILE_SUFFIXES, ICC_SUFFIXES
from lutforge.pipeline.outputs import Paths, check_output, one_of, several
from lutforge.pipeline.transforms import TransformRequest, choose_transform
from lutforge.progress import Progress, silent, with_compilation
from lutforge.settings import StyleName

BALANCED = "input: camera RAW behind its white balance, which the RAW developer sets: one profile for all of a style"
"""The note on a camera profile: its input."""
EXAMPLE_PROFILE = "camera.npz"
"""The file of a profile in advice, where its own is not known."""


@dataclass(frozen=True)
class BakedFile:
    """A file that was written. summary: its operations; error: of its colours, against the model."""

    path: Path
    summary: str
    error: FileError

    def __str__(self) -> str:
        return f"{self.path}: {self.summary}\n  read back, against the model: {self.error}"


@dataclass(frozen=True, eq=False, repr=False)
class BakedLut(Lut):
    """A LUT, with the files that were written, the most exact first, and notes."""

    files: tuple[BakedFile, ...] = ()
    notes: tuple[str, ...] = ()

    def __str__(self) -> str:
        return "\n".join([super().__str__(), *map(str, self.files), *(f"note: {note}" for note in self.notes)])


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


def bake_files(
    profile: CameraProfile | str | Path,
    request: TransformRequest,
    outputs: Sequence[str | Path] = (),
    options: BakeOptions | None = None,
    *,
    colours: bool = False,
    progress: Progress = silent,
) -> tuple[tuple[BakedFile, ...], tuple[str, ...]]:
    """Bake a transform of a profile to LUT files as `bake` does, and to ICC and DNG camera profiles.

    Returned are the files, the most exact first, and notes for the user. colours: an ICC profile gets the look without
    its tone curve, scene-linear. Raises ProfileError, and the errors of `bake`.
    """
    options = options or BakeOptions()
    reader = options.reader
    inputs = [path for path in (profile, request.look, request.transfer) if isinstance(path, str | Path)]
    paths = [check_output(path, inputs=inputs) for path in outputs]
    if not paths and reader is None:
        raise LutError(
            "no output: name a file with -o, for example -o look.cube or -o look.clf; or a program with --for"
        )
    profiles = [path for path in dict.fromkeys(paths) if path.suffix.lower() in CAMERA_PROFILE_SUFFIXES]
    luts = [path for path in paths if path not in profiles]
    if colours and not (paths and all(path.suffix.lower() in ICC_SUFFIXES for path in paths)):
        raise SettingsError("--colours goes with an ICC profile: -o look.icc")

    camera = as_profile(profile)
    if request.target is not None and profiles:
        request = replace(request, target=setting_of(camera, request.target))
    transform = choose_transform(camera, request)

    for path in profiles:
        _require_camera_profile(path, camera, transform.purpose, reader)
    if profiles and not luts:
        return tuple(_bake_camera_profile(camera, request, path, colours) for path in profiles), (BALANCED,)

    named = str(profile) if isinstance(profile, str | Path) else EXAMPLE_PROFILE
    baked = _bake(_plan(transform, luts, options, named), progress)
    files = [*baked.files, *(_bake_camera_profile(camera, request, path, colours) for path in profiles)]
    return tuple(sorted(files, key=lambda file: file.error.mean)), baked.notes


def _require_camera_profile(path: Path, camera: CameraProfile, purpose: Purpose, reader: Program | None) -> None:
    """Raise LutError where a camera profile cannot be made of a transform, or its program does not read it."""
    suffix = path.suffix.lower()
    if isinstance(camera.provenance, Pictures):
        raise LutError(f"{path}: a camera profile renders RAW; this profile is of {camera.provenance}")
    if not purpose.takes_raw:
        raise LutError(f"{path}: a camera profile renders RAW: bake … render --to STYLE/WB, without --space")
    if reader is not None and suffix.replace(".icm", ".icc") not in reader.reads:
        raise LutError(f"{path}: {reader.name} does not read {suffix} files")


def _bake_camera_profile(camera: CameraProfile, request: TransformRequest, path: Path, colours: bool) -> BakedFile:
    """Write a camera profile of a look, read it back, and compare it with the model after white balance."""
    look = look_of(camera, request.target or "")
    if path.suffix.lower() == ".dcp":
        write_dcp(fit_dng_profile(look), path)
        summary = f"DNG camera profile, look table {' × '.join(map(str, DIVISIONS))}"
    else:
        variant = Variant.COLOURS if colours else Variant.JPEG
        write_icc(fit_icc_profile(look, variant), path)
        summary = f"ICC profile, {NODES}³ nodes, to Lab"
    return BakedFile(path, summary, error_of_profile(path, look, colours))


def bake(
    transform: ColourFunction,
    outputs: Paths = (),
    *,
    program: str | None = None,
    size: int | None = None,
    form: Form = "full",
    tolerance: float | None = None,
    interpolation: str | None = None,
    title: str = "",
    highest: float = 1.0,
    clf_version: str | None = None,
    progress: Progress = silent,
) -> BakedLut:
    """Bake a transform of colours to a LUT, and to LUT files, each read back and measured against the transform.

    Args:
        transform: one of a profile, such as `profile.refinish(…)`, or any function of colours (…, 3) → (…, 3).
        outputs: files to write; their suffixes pick the formats. Without outputs the LUT is in memory only.
        program: the one that will read the files, such as "resolve"; it names them where there are no outputs.
        size: nodes per axis; None: 33, or as the file's format prefers. A lattice of a profile keeps its own size.
        form: of a LUT in memory: "full" has curves and matrices around its cube (.clf, .ctf), "shaper" one curve per
            channel before it (.resolve.cube, .csp, .spi1d), "plain" is an evenly spaced cube alone (.cube).
        tolerance: in place of a size, the largest ΔE00 of 99 % of the colours; the smallest size that meets it is used.
        interpolation: of the reader, "trilinear" or "tetrahedral".
        title: of the files, in place of the transform's own.
        highest: of the inputs of a function, which begin at 0; above 1 for scene-linear values.
        clf_version: "3" writes .clf files in the namespace of the Academy's version 3.0, for readers that do not know
            SMPTE's.
        progress: called with the name of the present step, and the share that is done.

    Returns:
        The LUT of the most exact file: `lut(pixels)` evaluates it, `lut.write(path)` writes it where a format can hold
        it, `lut.files` has the errors of the files, and `lut.notes` notes on them.

    Raises:
        LutError: the form, size, tolerance or format is not possible, or the transform is none.
        SettingsError: an option is unknown, or the program does not apply LUTs to camera RAW.
        LutForgeError: nothing can be written there. All of these are raised before the work.
    """
    options = BakeOptions(
        program=program,
        size=size,
        form=form,
        tolerance=tolerance,
        interpolation=interpolation,
        title=title,
        highest=highest,
        clf_version=clf_version,
    )
    return _bake(_plan(transform, several(outputs), options), progress)


@dataclass(frozen=True)
class _Task:
    """One LUT of a plan: its form, and the file that it is written to, or None for a LUT in memory.

    in_steps: a cube for each step of the transform, so that lattices of a profile stay exact.
    """

    target: Target
    path: Path | None = None
    in_steps: bool = False


@dataclass(frozen=True, eq=False)
class _Plan:
    """The LUTs to bake, and the metadata of their files.

    title, comments, metadata: of the files; input_and_output: where they are known; scenes: inputs are scene-linear;
    notes: for the user.
    """

    transform: ColourFunction
    purpose: Purpose
    options: BakeOptions
    tasks: tuple[_Task, ...]
    title: str
    comments: tuple[str, ...]
    metadata: LutMetadata
    input_and_output: InputAndOutput | None
    scenes: bool
    notes: tuple[str, ...]


def _plan(
    transform: ColourFunction, outputs: Sequence[str | Path], options: BakeOptions, profile: str = EXAMPLE_PROFILE
) -> _Plan:
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
        _Task(
            target_of(path, reader_of_file, options.size, options.method, scenes),
            path,
            in_steps=is_exact and path.suffix.lower() in PROCESS_LISTS,
        )
        for path, reader_of_file in readers.items()
    ]
    in_memory = _Task(Target(options.form, options.size, options.method))
    input_and_output = _input_and_output(purpose)
    return _Plan(
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


def _bake(plan: _Plan, progress: Progress) -> BakedLut:
    """Fit, write and verify the LUTs of a plan; return the most exact one, or the one in memory."""
    luts = [_fit_lut(plan, task, progress) for task in plan.tasks]
    files = _write_all(plan, luts)
    best = files[0][1] if files else luts[0]
    written = tuple(file for file, _ in files)
    notes = (*plan.purpose.notes, *plan.notes, *_notes_on(plan, written))
    return BakedLut(best.ops, best.title, best.comments, best.metadata, written, notes)


def _fit_lut(plan: _Plan, task: _Task, progress: Progress) -> Lut:
    """Fit the LUT of one task."""
    options = plan.options
    with with_compilation(progress) as reporting:
        if task.in_steps and isinstance(plan.transform, Transform):
            lut = bake_steps(plan.transform, title=plan.title, comments=plan.comments)
        elif options.tolerance is not None:
            lut = bake_within(
                plan.transform, task.target, options.tolerance, title=plan.title, comments=plan.comments,
                highest=options.highest, progress=reporting,
            )  # fmt: skip
        else:
            lut = bake_to(
                plan.transform, task.target, title=plan.title, comments=plan.comments, highest=options.highest,
                progress=reporting,
            )  # fmt: skip
    return replace(lut, metadata=plan.metadata)


def _write_all(plan: _Plan, luts: Sequence[Lut]) -> list[tuple[BakedFile, Lut]]:
    """Write each file of a plan and read it back. Returns the files with their LUTs, the most exact first."""
    files = []
    for task, lut in zip(plan.tasks, luts, strict=True):
        if task.path is not None:
            error = verify(
                write(lut, task.path), plan.transform, lut, display_referred=plan.purpose.gives_encoded,
                scenes=plan.scenes and plan.purpose.is_of_profile,
            )  # fmt: skip
            files.append((BakedFile(task.path, f"{lut.summary}, {lut.interpolation}", error), lut))
    return sorted(files, key=lambda pair: pair[0].error.mean)


def _notes_on(plan: _Plan, files: Sequence[BakedFile]) -> list[str]:
    """Notes for the user on the files: what they cannot hold, what their input is, and how to load them."""
    notes = []
    for file in files:
        if not plan.purpose.gives_encoded and format_of(file.path).bits is not None:
            loss = "whole numbers band the darks of linear light and lose what is beyond 1; use .clf"
            notes.append(f"{file.path}: {loss}")
        notes += _notes_on_difference(plan.purpose, file)
    if files and plan.input_and_output is not None and plan.purpose.kind.has_scene:
        notes.append("; ".join(plan.input_and_output.comments))
    reader = plan.options.reader
    if files and reader is not None:
        first = files[0].path
        use = reader.advice(first)
        notes.append(f"load {first} in {reader.name}{f': {use}' if use else ''}")
    return notes


def _notes_on_difference(purpose: Purpose, file: BakedFile) -> list[str]:
    """A note on the largest error of a file, if it is visible (above ΔE00 1) and its scene is beyond black or white."""
    error = file.error
    if not purpose.takes_footage or error.max_de00 is None or error.max_de00 <= 1:
        return []
    scene = rgb_space(purpose.space).linearize(np.array(error.worst))
    if scene.max() > 1:
        place = f"{scene.max():.0f} times as bright as white"
    elif scene.min() < 0:
        place = f"{scene.min():.2f}, below black"
    else:
        return []
    return [f"{file.path}: the largest difference is at light {place}; a .clf is closer"]
