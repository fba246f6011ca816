"""Use case: a transform → LUT files, each read back and measured; and camera profiles of a profile's look."""

from __future__ import annotations  # so that help() shows the names of types

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from lutforge.arrays import ColourFunction
from lutforge.colour.rgb_spaces import rgb_space
from lutforge.errors import LutError, SettingsError
from lutforge.interpolation import INTERPOLATIONS
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
from lutforge.model.transform import Purpose, Transform
from lutforge.pipeline.outputs import Paths, check_output, one_of, several
from lutforge.pipeline.transforms import TransformRequest, choose_transform
from lutforge.progress import Progress, silent, with_compilation
from lutforge.settings import StyleName

ICC_PROFILES = (".icc", ".icm")
CAMERA_PROFILES = (*ICC_PROFILES, ".dcp")

BALANCED = "input: camera RAW behind its white balance, which the RAW developer sets: one profile for all of a style"
"""The note on a camera profile: its input."""


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


def bake_files(
    profile: CameraProfile | str | Path,
    request: TransformRequest,
    outputs: Sequence[str | Path] = (),
    *,
    program: str | None = None,
    size: int | None = None,
    tolerance: float | None = None,
    interpolation: str | None = None,
    colours: bool = False,
    clf_version: str | None = None,
    progress: Progress = silent,
) -> tuple[tuple[BakedFile, ...], tuple[str, ...]]:
    """Bake a transform of a profile to LUT files as `bake` does, and to ICC and DNG camera profiles.

    Returned are the files, the most exact first, and notes for the user. colours: an ICC profile gets the look without
    its tone curve, scene-linear. Raises ProfileError, and the errors of `bake`.
    """
    inputs = [path for path in (profile, request.look, request.transfer) if isinstance(path, str | Path)]
    paths = [check_output(path, inputs=inputs) for path in outputs]
    if not paths and program is None:
        raise LutError(
            "no output: name a file with -o, for example -o look.cube or -o look.clf; or a program with --for"
        )
    profiles = [path for path in dict.fromkeys(paths) if path.suffix.lower() in CAMERA_PROFILES]
    luts = [path for path in paths if path not in profiles]
    if colours and not (paths and all(path.suffix.lower() in ICC_PROFILES for path in paths)):
        raise SettingsError("--colours goes with an ICC profile: -o look.icc")

    camera = as_profile(profile)
    if request.target is not None and profiles:
        request = replace(request, target=setting_of(camera, request.target))
    transform = choose_transform(camera, request)

    for path in profiles:
        _require_camera_profile(path, camera, transform.purpose, program)
    if profiles and not luts:
        return tuple(_bake_camera_profile(camera, request, path, colours) for path in profiles), (BALANCED,)

    if isinstance(profile, str | Path):
        _require_raw_input(program, transform.purpose, str(profile))
    baked = bake(
        transform, luts, program=program, size=size, tolerance=tolerance, interpolation=interpolation,
        clf_version=clf_version, progress=progress,
    )  # fmt: skip

    files = [*baked.files, *(_bake_camera_profile(camera, request, path, colours) for path in profiles)]
    return tuple(sorted(files, key=lambda file: file.error.mean)), baked.notes


def _require_camera_profile(path: Path, camera: CameraProfile, purpose: Purpose, program: str | None) -> None:
    """Raise LutError where a camera profile cannot be made of a transform, or its program does not read it."""
    suffix = path.suffix.lower()
    if isinstance(camera.provenance, Pictures):
        raise LutError(f"{path}: a camera profile renders RAW; this profile is of {camera.provenance}")
    if (purpose.kind, purpose.space) != ("render", "raw"):
        raise LutError(f"{path}: a camera profile renders RAW: bake … render --to STYLE/WB, without --space")
    if program is not None and suffix.replace(".icm", ".icc") not in program_named(program).reads:
        raise LutError(f"{path}: {program} does not read {suffix} files")


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
    plan = _plan(
        transform, outputs, program=program, size=size, form=form, tolerance=tolerance, interpolation=interpolation,
        title=title, highest=highest, clf_version=clf_version,
    )  # fmt: skip
    luts = [_fitted(plan, task, progress) for task in plan.tasks]
    files = _written(plan, luts)
    return _baked(plan, luts, files)


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

    input_and_output: where they are known; scenes: inputs are scene-linear; program: the name of the program that
    reads the files, or None.
    """

    transform: ColourFunction
    purpose: Purpose
    tasks: tuple[_Task, ...]
    title: str
    comments: tuple[str, ...]
    metadata: LutMetadata
    input_and_output: InputAndOutput | None
    scenes: bool
    program: str | None
    tolerance: float | None
    highest: float
    notes: tuple[str, ...]

    @property
    def display_referred(self) -> bool:
        """True where the output is encoded sRGB, so that ΔE00 has a meaning."""
        return self.purpose.kind != "linearize"


def _plan(
    transform: ColourFunction,
    outputs: Paths,
    *,
    program: str | None,
    size: int | None,
    form: Form,
    tolerance: float | None,
    interpolation: str | None,
    title: str,
    highest: float,
    clf_version: str | None,
) -> _Plan:
    """The plan of `bake`. Raises the errors that `bake` raises before the work."""
    method = None if interpolation is None else one_of("interpolation", interpolation, INTERPOLATIONS)
    reader = None if program is None else program_named(program)
    if reader is not None:
        method = method or reader.interpolation
    if form not in FORMS:
        raise LutError(f'unknown form "{form}"; choose {", ".join(FORMS)}')
    purpose = transform.purpose if isinstance(transform, Transform) else Purpose()
    if tolerance is not None and purpose.kind == "linearize":
        raise LutError("a ΔE00 tolerance has no meaning for scene-linear output; give a size (33 or 65) instead")
    _require_raw_input(program, purpose)

    title = title or purpose.title
    named, notes = _files([check_output(path) for path in several(outputs)], program, title)
    scenes = takes_scenes(transform) or highest != 1
    if purpose.kind:  # in a profile's render from RAW, a first matrix is that of a reference camera
        scenes = purpose.kind == "render" and purpose.space != "raw" and rgb_space(purpose.space).is_linear

    # One cube for each step, unless an option requires a single one.
    exact = purpose.kind in ("refinish", "match") and not any((program, size, tolerance, method))
    tasks = [
        _Task(target_of(path, name, size, method, scenes), path, exact and path.suffix.lower() in PROCESS_LISTS)
        for path, name in named.items()
    ]
    input_and_output = _input_and_output(purpose)
    return _Plan(
        transform=transform,
        purpose=purpose,
        tasks=tuple(tasks) or (_Task(Target(form, size, method)),),
        title=title,
        comments=_comments(purpose, input_and_output, reader, title),
        metadata=_clf_metadata(clf_version, named),
        input_and_output=input_and_output,
        scenes=scenes,
        program=program,
        tolerance=tolerance,
        highest=highest,
        notes=tuple(notes),
    )


def _require_raw_input(program: str | None, purpose: Purpose, profile: str = "camera.npz") -> None:
    """Raise SettingsError for a LUT of camera RAW where the program does not apply LUTs to RAW.

    profile: the file that the message names, for a kit.
    """
    if program is not None and purpose.kind == "render" and program_named(program).develops:
        advice = f"make a kit for it, lutforge kit {profile} --to {purpose.target} --for {program.lower()} -o kit"
        raise SettingsError(f"{program} feeds a LUT with what it developed, never with camera RAW: {advice}")


def _files(paths: Sequence[Path], program: str | None, title: str) -> tuple[dict[Path, str | None], list[str]]:
    """The files to write, each with the program that reads it, and notes; a file that is named twice is written once.

    Without paths they are the files that the program needs.
    """
    named = {} if paths or program is None else files_for(program, title)
    for path in named:
        check_output(path)
    notes = []
    for path in paths:
        if path.resolve() in {file.resolve() for file in named}:
            notes.append(f"{path}: named twice, written once")
            continue
        named[path] = program
    return named, notes


def _input_and_output(purpose: Purpose) -> InputAndOutput | None:
    """The input and output of a transform of a profile; None for any other function."""
    if not purpose.kind:
        return None
    is_adobe_rgb = StyleName.parse(purpose.source.partition("/")[0]).colour_space == "adobe rgb"
    return input_and_output_of(purpose.kind, purpose.light, ADOBE_RGB if is_adobe_rgb else ENCODED)


def _comments(
    purpose: Purpose, input_and_output: InputAndOutput | None, reader: Program | None, title: str
) -> tuple[str, ...]:
    """The comments of the files."""
    place = "" if reader is None else reader.use
    settings = [f"camera and settings: {title}"] if purpose.kind else []
    return description(input_and_output, place, [*settings, *purpose.comments])


def _clf_metadata(version: str | None, paths: Iterable[Path]) -> LutMetadata:
    """The metadata of a LUT that select a version of CLF. Raises SettingsError on an unknown version."""
    if version is None:
        return LutMetadata()
    if str(version) not in ("3", "3.0"):
        raise SettingsError(f'unknown CLF version "{version}": 3, or none for SMPTE ST 2136-1')
    if not any(path.suffix.lower() == ".clf" for path in paths):
        raise SettingsError("--clf-version goes with a .clf: -o look.clf")
    return LutMetadata(clf_namespace=AMPAS_CLF_3)


def _fitted(plan: _Plan, task: _Task, progress: Progress) -> Lut:
    """The LUT of one task."""
    with with_compilation(progress) as reporting:
        if task.in_steps and isinstance(plan.transform, Transform):
            lut = bake_steps(plan.transform, title=plan.title, comments=plan.comments)
        elif plan.tolerance is not None:
            lut = bake_within(
                plan.transform, task.target, plan.tolerance, title=plan.title, comments=plan.comments,
                highest=plan.highest, progress=reporting,
            )  # fmt: skip
        else:
            lut = bake_to(
                plan.transform, task.target, title=plan.title, comments=plan.comments, highest=plan.highest,
                progress=reporting,
            )  # fmt: skip
    return replace(lut, metadata=plan.metadata)


def _written(plan: _Plan, luts: Sequence[Lut]) -> list[tuple[BakedFile, Lut]]:
    """The files of a plan, each written and read back, with its LUT; the most exact first."""
    files = []
    for task, lut in zip(plan.tasks, luts, strict=True):
        if task.path is not None:
            error = verify(
                write(lut, task.path), plan.transform, lut, display_referred=plan.display_referred,
                scenes=plan.scenes and bool(plan.purpose.kind),
            )  # fmt: skip
            files.append((BakedFile(task.path, f"{lut.summary}, {lut.interpolation}", error), lut))
    return sorted(files, key=lambda pair: pair[0].error.mean)


def _baked(plan: _Plan, luts: Sequence[Lut], files: Sequence[tuple[BakedFile, Lut]]) -> BakedLut:
    """The LUT of the most exact file, or the one in memory, with the files and notes."""
    best = files[0][1] if files else luts[0]
    written = tuple(file for file, _ in files)
    notes = (*plan.purpose.notes, *plan.notes, *_notes_on(plan, written))
    return BakedLut(best.ops, best.title, best.comments, best.metadata, written, notes)


def _notes_on(plan: _Plan, files: Sequence[BakedFile]) -> list[str]:
    """Notes for the user on the files: what they cannot hold, what their input is, and how to load them."""
    notes = []
    for file in files:
        if plan.purpose.kind == "linearize" and format_of(file.path).bits is not None:
            loss = "whole numbers band the darks of linear light and lose what is beyond 1; use .clf"
            notes.append(f"{file.path}: {loss}")
        notes += _notes_on_difference(plan.purpose, file)
    if files and plan.input_and_output is not None and plan.purpose.kind in ("render", "linearize"):
        notes.append("; ".join(plan.input_and_output.comments))
    if files and plan.program is not None:
        first = files[0].path
        use = program_named(plan.program).advice(first)
        notes.append(f"load {first} in {plan.program.lower()}{f': {use}' if use else ''}")
    return notes


def _notes_on_difference(purpose: Purpose, file: BakedFile) -> list[str]:
    """A note on the largest error of a file, if it is visible (above ΔE00 1) and its scene is beyond black or white."""
    error = file.error
    if purpose.kind != "render" or purpose.space == "raw" or error.max_de00 is None or error.max_de00 <= 1:
        return []
    scene = rgb_space(purpose.space).linearize(np.array(error.worst))
    if scene.max() > 1:
        place = f"{scene.max():.0f} times as bright as white"
    elif scene.min() < 0:
        place = f"{scene.min():.2f}, below black"
    else:
        return []
    return [f"{file.path}: the largest difference is at light {place}; a .clf is closer"]
