"""Use case: a transform → LUT files, each read back and measured; and camera profiles of a profile's look."""

from __future__ import annotations  # so that help() shows the names of types

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from lutforge.arrays import ColourFunction
from lutforge.errors import LutError, SettingsError
from lutforge.kits.dcp import DIVISIONS, fit_dng_profile, write_dcp
from lutforge.kits.icc import NODES, Variant, fit_icc_profile, write_icc
from lutforge.kits.kit import look_of, setting_of
from lutforge.kits.measure import error_of_profile
from lutforge.luts.bake import bake_steps, bake_to, bake_within
from lutforge.luts.formats import write
from lutforge.luts.forms import Form
from lutforge.luts.lut_programs import Program
from lutforge.luts.sequence import Lut
from lutforge.luts.verification import verify
from lutforge.model.camera_profile import CameraProfile, as_profile
from lutforge.model.provenance import Pictures
from lutforge.model.transform import Purpose, Transform
from lutforge.pipeline.bake_plan import EXAMPLE_PROFILE, BakeOptions, Plan, Task, plan_of
from lutforge.pipeline.baked_files import BakedFile, BakedLut, notes_on
from lutforge.pipeline.file_kinds import CAMERA_PROFILE_SUFFIXES, ICC_SUFFIXES
from lutforge.pipeline.outputs import Paths, check_output, several
from lutforge.pipeline.transforms import TransformRequest, choose_transform
from lutforge.progress import Progress, silent, with_compilation

BALANCED = "input: camera RAW behind its white balance, which the RAW developer sets: one profile for all of a style"
"""The note on a camera profile: its input."""


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
    return _bake(plan_of(transform, several(outputs), options), progress)


def _bake(plan: Plan, progress: Progress) -> BakedLut:
    """Fit, write and verify the LUTs of a plan; return the most exact one, or the one in memory."""
    luts = [_fit_lut(plan, task, progress) for task in plan.tasks]
    files = _write_all(plan, luts)
    best = files[0][1] if files else luts[0]
    written = tuple(file for file, _ in files)
    notes = (*plan.purpose.notes, *plan.notes, *notes_on(plan, written))
    return BakedLut(best.ops, best.title, best.comments, best.metadata, written, notes)


def _fit_lut(plan: Plan, task: Task, progress: Progress) -> Lut:
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


def _write_all(plan: Plan, luts: Sequence[Lut]) -> list[tuple[BakedFile, Lut]]:
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
    baked = _bake(plan_of(transform, luts, options, named), progress)
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
