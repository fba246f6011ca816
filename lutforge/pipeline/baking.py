"""Use case: profiles and settings → a transform → LUT files, each read back and measured."""

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
from lutforge.kits.icc import NODES, VARIANTS, fit_icc_profile, write_icc
from lutforge.kits.kit import look_of, setting_of
from lutforge.kits.measure import error_of_profile
from lutforge.luts.bake import bake_forms, bake_steps, takes_scenes
from lutforge.luts.check import FileError, verify
from lutforge.luts.description import description
from lutforge.luts.formats import AMPAS_CLF_3, CLF_NAMESPACE, PROCESS_LISTS
from lutforge.luts.programs import Target, files_for, program_named, target_of
from lutforge.luts.sequence import ADOBE_RGB, ENCODED, FORMS, Form, Lut, format_of, input_and_output_of
from lutforge.model.camera_profile import MODELS, CameraProfile, as_profile, match, through_camera
from lutforge.model.provenance import Pictures, ResponseOnly
from lutforge.model.raw_transfer import RawTransfer, load_transfer
from lutforge.model.transform import Purpose, Transform
from lutforge.pipeline.outputs import Paths, check_output, one_of, several
from lutforge.progress import Progress, silent, telling_of_compilation
from lutforge.settings import StyleName

KINDS = ("render", "linearize", "refinish", "match")


@dataclass(frozen=True)
class TransformRequest:
    """The options of `transform`, beside the profile. Raises SettingsError where one does not go with the kind.

    kind: one of KINDS; space: "raw", or the name of a colour space; in any case, and kept as they are named.
    """

    kind: str
    source: str | None = None
    target: str | None = None
    ev: float = 0.0
    space: str = "raw"
    model: str | None = None
    look: CameraProfile | Path | None = None
    transfer: RawTransfer | Path | None = None

    def __post_init__(self) -> None:
        kind, space = one_of("transform", self.kind, KINDS), self.space.strip().lower()
        space = space if space == "raw" else rgb_space(self.space).name
        if (self.look is not None) != (kind == "match"):
            raise SettingsError("match needs two profiles, A.npz match B.npz; the other transforms need one")
        if self.transfer is not None and kind != "match":
            raise SettingsError("--transfer goes with match")
        if space != "raw" and kind in ("refinish", "match"):
            raise SettingsError(f"--space goes with linearize and render; a {kind} has JPEGs on both sides")
        if self.ev and (kind == "linearize" or (kind == "render" and space == "raw")):
            instead = "scale the scene" if kind == "linearize" else "name a scene with --space, or scale the RAW values"
            raise SettingsError(f"--ev does not go with a {kind}{' of camera RAW' * (kind == 'render')}: {instead}")
        object.__setattr__(self, "kind", kind)
        object.__setattr__(self, "space", space)


def transform(
    profile: CameraProfile | str | Path,
    kind: str,
    source: str | None = None,
    target: str | None = None,
    *,
    ev: float = 0.0,
    space: str = "raw",
    model: str | None = None,
    look: CameraProfile | str | Path | None = None,
    transfer: RawTransfer | str | Path | None = None,
) -> Transform:
    """Return the transform of a profile that words ask for: a function of colours (…, 3), exact to the model.

    JPEG values are encoded, RAW and scenes linear, with 1 = full scale.

    Args:
        profile: a profile, or the path of its file.
        kind: "render" (RAW → JPEG), "linearize" (JPEG → scene), "refinish" (JPEG → JPEG) or "match" (camera → camera).
        source: STYLE/WB of the JPEG that comes in.
        target: STYLE/WB of the JPEG that comes out.
        ev: exposure change in stops.
        space: what render takes and linearize gives: "raw", or a colour space such as "acescg" or "vlog".
        model: "lattice", or "model" for the camera model itself, where the profile holds both.
        look: for match, the profile whose look is wanted.
        transfer: for match, the transfer from RAW to RAW, or its file.

    Returns:
        The transform; its `purpose` has a title, and notes on settings that stand for others.

    Raises:
        SettingsError: a setting is missing or unknown, or an option does not go with the kind.
        ProfileError: a profile or transfer cannot be read, or holds no such model.
    """
    beside = Path(look) if isinstance(look, str) else look
    step = Path(transfer) if isinstance(transfer, str) else transfer
    wanted = TransformRequest(kind, source, target, ev, space, model, beside, step)
    return choose_transform(as_profile(profile), wanted)


def choose_transform(camera: CameraProfile, wanted: TransformRequest) -> Transform:
    """Return the transform that the words ask for. Raises SettingsError where a setting is missing or unknown."""
    kind, space = wanted.kind, wanted.space
    model = None if wanted.model is None else one_of("model", wanted.model, MODELS)
    end = camera if wanted.look is None else as_profile(wanted.look)
    for selector, option, profile in ((wanted.source, "--from", camera), (wanted.target, "--to", end)):
        if selector is None and kind != ("render" if option == "--from" else "linearize"):
            raise SettingsError(
                f"{kind} needs {option} STYLE/WB; {profile.camera} has the styles {', '.join(profile.styles)} "
                f"and the white balances {', '.join(profile.white_balances)}"
            )
    source, target = wanted.source or "", wanted.target or ""
    if kind == "linearize":
        response_only = isinstance(camera.provenance, ResponseOnly)
        return camera.linearize(source, "linear-srgb" if space == "raw" and response_only else space, model)
    if kind == "render":
        fed = camera.fed_to if space == "raw" else space
        return camera.render(target, model) if fed == "raw" else through_camera(camera, target, fed, wanted.ev, model)
    step = load_transfer(wanted.transfer) if isinstance(wanted.transfer, Path) else wanted.transfer
    return match(camera, source, end, target, wanted.ev, model, step)


# --- LUT files --------------------------------------------------------------------------------------------------------


CAMERA_PROFILES = (".icc", ".icm", ".dcp")

BALANCED = "input: camera RAW behind its white balance, which the RAW developer sets: one profile for all of a style"


@dataclass(frozen=True)
class BakedFile:
    """A file that was written. summary: what it holds; error: of what it makes of colours, against the model."""

    path: Path
    summary: str
    error: FileError

    def __str__(self) -> str:
        return f"{self.path}: {self.summary}\n  read back, against the model: {self.error}"


@dataclass(frozen=True, eq=False, repr=False)
class BakedLut(Lut):
    """A LUT with what baking it showed: the files that were written, the most exact first, and notes."""

    files: tuple[BakedFile, ...] = ()
    notes: tuple[str, ...] = ()

    def __str__(self) -> str:
        return "\n".join([super().__str__(), *map(str, self.files), *(f"note: {note}" for note in self.notes)])


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
        outputs: files to write; their suffixes pick the formats. Without, the LUT is in memory alone.
        program: the one that will read the files, which names them where there are no outputs, such as "resolve".
        size: nodes per axis; without, 33 or what suits the file. A lattice of a profile keeps its own.
        form: of a LUT in memory: "full" has curves and matrices around its cube (.clf, .ctf), "shaper" one curve per
            channel in front of it (.resolve.cube, .csp, .spi1d), "plain" is an evenly spaced cube alone (.cube).
        tolerance: instead of a size, the ΔE00 that 99 % of colours keep within; the smallest size that does is taken.
        interpolation: how the reader interpolates, "trilinear" or "tetrahedral".
        title: of the files, if not the transform's own.
        highest: inputs of a function reach from 0 to this, for scene-linear light.
        clf_version: "3" writes .clf files in the namespace of the Academy's version 3.0, for readers that do not know
            SMPTE's.
        progress: called with what is being done, and the share that is done.

    Returns:
        The LUT of the most exact file: `lut(pixels)` evaluates it, `lut.write(path)` writes it where a format can hold
        it, `lut.files` has the errors of the files, and `lut.notes` what to know of them.

    Raises:
        LutError: the form, size, tolerance or format cannot be had, or the transform is none.
        SettingsError: an option is unknown, or the program feeds no LUT with camera RAW.
        LutForgeError: nothing can be written there. All of these are raised before the work.
    """
    method = None if interpolation is None else one_of("interpolation", interpolation, INTERPOLATIONS)
    if program is not None:
        method = method or program_named(program).interpolation
    if form not in FORMS:
        raise LutError(f'unknown form "{form}"; choose {", ".join(FORMS)}')
    purpose = transform.purpose if isinstance(transform, Transform) else Purpose()
    kind, title, displayed = purpose.kind, title or purpose.title, purpose.kind != "linearize"
    _require_fed(program, purpose)
    named, notes = _files([check_output(path) for path in several(outputs)], program, title)
    metadata = _clf_metadata(clf_version, named)
    adobe_rgb = StyleName.parse(purpose.source.partition("/")[0]).colour_space == "adobe rgb"
    ends = input_and_output_of(kind, purpose.light, ADOBE_RGB if adobe_rgb else ENCODED) if kind else None
    scenes = takes_scenes(transform) or highest != 1
    if kind:  # of camera RAW, a matrix in front is that of a reference camera
        scenes = kind == "render" and purpose.space != "raw" and rgb_space(purpose.space).is_linear
    targets = [target_of(path, reader, size, method, scenes) for path, reader in named.items()]
    targets = targets or [Target(form, size, method)]
    place = "" if program is None else program_named(program).use
    comments = description(ends, place, [f"camera and settings: {title}"] * bool(kind) + list(purpose.comments))
    # A cube for each step, so that lattices of a profile stay exact, where nothing else is asked for.
    whole = kind in ("refinish", "match") and not any((program, size, tolerance, method))
    stepwise = [whole and path.suffix.lower() in PROCESS_LISTS for path in named] or [False]
    with telling_of_compilation(progress) as telling:
        luts = bake_forms(
            transform, [target for target, steps in zip(targets, stepwise, strict=True) if not steps],
            tolerance=tolerance, display_referred=displayed, title=title, comments=comments, highest=highest,
            progress=telling,
        )  # fmt: skip
        if any(stepwise):
            steps = bake_steps(transform, title=title, comments=comments)
            for at in np.flatnonzero(stepwise):
                luts.insert(int(at), steps)
    made = []
    luts = [replace(lut, metadata={**lut.metadata, **metadata}) for lut in luts]
    for path, lut in zip(named, luts, strict=False):
        error = verify(lut.write(path), transform, lut, display_referred=displayed, scenes=scenes and bool(kind))
        made.append((BakedFile(path, f"{lut.summary}, {lut.interpolation}", error), lut))
    made.sort(key=lambda pair: pair[0].error.mean)
    notes = [*purpose.notes, *notes]
    for file, _ in made:  # what it cannot hold: whole numbers, linear light; plain cubes, light far above white
        if kind == "linearize" and format_of(file.path).bits is not None:
            lost = "whole numbers band the darks of linear light and lose what is beyond 1; use .clf"
            notes.append(f"{file.path}: {lost}")
        if kind == "render" and purpose.space != "raw" and file.error.max_de00 is not None and file.error.max_de00 > 1:
            light = rgb_space(purpose.space).linearize(np.array(file.error.worst))
            if light.max() > 1 or light.min() < 0:  # where a difference that is seen is the largest
                bright, dark = f"{light.max():.0f} times as bright as white", f"{light.min():.2f}, below black"
                where = f"at light {bright if light.max() > 1 else dark}"
                notes.append(f"{file.path}: the largest difference is {where}; a .clf is closer")
    if made and ends is not None and kind in ("render", "linearize"):
        notes.append("; ".join(ends.comments))
    if made and program is not None:
        use = program_named(program).advice(made[0][0].path)
        notes.append(f"load {made[0][0].path} in {program.lower()}{f': {use}' if use else ''}")
    best = made[0][1] if made else luts[0]
    return BakedLut(best.ops, best.title, best.comments, best.metadata, tuple(file for file, _ in made), tuple(notes))


def bake_files(
    profile: CameraProfile | str | Path,
    wanted: TransformRequest,
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

    Returned are the files, the most exact first, and what the user should know of them. colours: of an ICC profile, the
    look without its tone curve, scene-linear. Raises ProfileError, and what `bake` does.
    """
    inputs = [path for path in (profile, wanted.look, wanted.transfer) if isinstance(path, str | Path)]
    paths = [check_output(path, inputs=inputs) for path in outputs]
    if not paths and program is None:
        raise LutError(
            "no output: name a file with -o, for example -o look.cube or -o look.clf; or a program with --for"
        )
    camera = as_profile(profile)
    if wanted.target is not None and any(path.suffix.lower() in CAMERA_PROFILES for path in paths):
        wanted = replace(wanted, target=setting_of(camera, wanted.target))
    transform = choose_transform(camera, wanted)
    purpose = transform.purpose
    profiles = [path for path in dict.fromkeys(paths) if path.suffix.lower() in CAMERA_PROFILES]
    for path in profiles:
        if isinstance(camera.provenance, Pictures):
            raise LutError(f"{path}: a camera profile renders RAW; this profile is of {camera.provenance}")
        if (purpose.kind, purpose.space) != ("render", "raw"):
            raise LutError(f"{path}: a camera profile renders RAW: bake … render --to STYLE/WB, without --space")
        if program is not None and path.suffix.lower().replace(".icm", ".icc") not in program_named(program).reads:
            raise LutError(f"{path}: {program} does not read {path.suffix.lower()} files")
    if colours and not (paths and all(path.suffix.lower() in CAMERA_PROFILES[:2] for path in paths)):
        raise SettingsError("--colours goes with an ICC profile: -o look.icc")
    luts = [path for path in paths if path not in profiles]
    if profiles and not luts:
        return tuple(_bake_camera_profile(camera, wanted, path, colours) for path in profiles), (BALANCED,)
    if isinstance(profile, str | Path):
        _require_fed(program, transform.purpose, str(profile))
    baked = bake(
        transform, luts, program=program, size=size, tolerance=tolerance, interpolation=interpolation,
        clf_version=clf_version, progress=progress,
    )  # fmt: skip
    files = [*baked.files, *(_bake_camera_profile(camera, wanted, path, colours) for path in profiles)]
    return tuple(sorted(files, key=lambda file: file.error.mean)), baked.notes


def _require_fed(program: str | None, purpose: Purpose, profile: str = "camera.npz") -> None:
    """Raise SettingsError where a program feeds no LUT with camera RAW. profile: the file that a kit is made of."""
    if program is not None and purpose.kind == "render" and program_named(program).develops:
        helps = f"make a kit for it, lutforge kit {profile} --to {purpose.target} --for {program.lower()} -o kit"
        raise SettingsError(f"{program} feeds a LUT with what it developed, never with camera RAW: {helps}")


def _bake_camera_profile(camera: CameraProfile, wanted: TransformRequest, path: Path, colours: bool) -> BakedFile:
    """Write a camera profile of a look, read it back, and compare it with the model behind white balance."""
    look = look_of(camera, wanted.target or "")
    if path.suffix.lower() == ".dcp":
        write_dcp(fit_dng_profile(look), path)
        summary = f"DNG camera profile, look table {' × '.join(map(str, DIVISIONS))}"
    else:
        write_icc(fit_icc_profile(look, VARIANTS[colours]), path)
        summary = f"ICC profile, {NODES}³ nodes, to Lab"
    return BakedFile(path, summary, error_of_profile(path, look, colours))


def _clf_metadata(version: str | None, paths: Iterable[Path]) -> dict[str, str]:
    """What a LUT holds so that it is written in a version of CLF. Raises SettingsError on an unknown one."""
    if version is None:
        return {}
    if str(version) not in ("3", "3.0"):
        raise SettingsError(f'unknown CLF version "{version}": 3, or none for SMPTE ST 2136-1')
    if not any(path.suffix.lower() == ".clf" for path in paths):
        raise SettingsError("--clf-version goes with a .clf: -o look.clf")
    return {CLF_NAMESPACE: AMPAS_CLF_3}


def _files(paths: Sequence[Path], program: str | None, title: str) -> tuple[dict[Path, str | None], list[str]]:
    """Files to write, each once, and the program of each; without names, those that suit the program; and notes."""
    named = {} if paths or program is None else files_for(program, title)
    for path in named:
        check_output(path)
    notes = []
    for path in paths:
        if path.resolve() in {known.resolve() for known in named}:
            notes.append(f"{path}: named twice, written once")
            continue
        named[path] = program
    return named, notes
