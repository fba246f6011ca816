"""Use case: a profile and settings → LUT files, each read back and measured."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from lutforge import __version__
from lutforge.colour.rgb_spaces import rgb_space
from lutforge.errors import LutError, SettingsError
from lutforge.interpolation import INTERPOLATIONS
from lutforge.kits.dcp import DIVISIONS, fit_dng_profile, read_dcp, write_dcp
from lutforge.kits.icc import NODES, VARIANTS, fit_icc_profile, read_icc, scene_linear, write_icc
from lutforge.kits.kit import look_of, setting_of
from lutforge.luts.bake import bake_forms
from lutforge.luts.formats.clf import ACES_ID
from lutforge.luts.formats.clf import KINDS as PROCESS_LISTS
from lutforge.luts.input_and_output import ADOBE_RGB, ENCODED, input_and_output_of
from lutforge.luts.programs import files_for, program_named, target_of
from lutforge.luts.sequence import Lut, format_of
from lutforge.luts.steps import bake_steps
from lutforge.luts.verify import FileError, compare, verify
from lutforge.model.camera_profile import CameraProfile, as_profile
from lutforge.pipeline.outputs import check_output, one_of
from lutforge.pipeline.transforms import DescribedTransform, TransformRequest, choose_transform
from lutforge.progress import Progress, silent, telling_of_compilation
from lutforge.shots.maker_settings import ADOBE_RGB as ADOBE_RGB_STYLE

CAMERA_PROFILES = (".icc", ".icm", ".dcp")

BALANCED = "input: camera RAW behind its white balance, which the RAW developer sets: one profile for all of a style"


@dataclass(frozen=True)
class BakedFile:
    """A file that was written. summary: what it holds; error: of what it makes of colours, against the model."""

    path: Path
    summary: str
    error: FileError

    def __str__(self) -> str:
        return f"{self.path}: {self.summary}"


@dataclass(frozen=True)
class BakedFiles:
    """Files of one transform, the most exact first, and what the user should know of them."""

    files: tuple[BakedFile, ...]
    notes: tuple[str, ...]


def bake_files(
    profile: CameraProfile | str | Path,
    wanted: TransformRequest,
    outputs: Sequence[str | Path] = (),
    *,
    program: str | None = None,
    size: int | None = None,
    tolerance: float | None = None,
    interpolation: str | None = None,
    stages: bool = False,
    colours: bool = False,
    progress: Progress = silent,
) -> BakedFiles:
    """Bake a transform of a profile to LUT files, and measure each as its readers see it.

    outputs: their suffixes pick the formats; program: the one that will read them, which names them where there are
    none. size: nodes per axis; tolerance: instead, the ΔE00 that 99 % of colours keep within. interpolation: how the
    reader interpolates. stages: each step a cube of its own (.clf, .ctf), which is how a refinish or match is
    written where nothing else is asked for. colours: of an ICC profile, the look without its tone curve, scene-linear.
    Raises SettingsError, LutError, ProfileError, and LutForgeError where nothing can be written: all before the work.
    """
    method = None if interpolation is None else one_of("interpolation", interpolation, INTERPOLATIONS)
    if program is not None:
        method = method or program_named(program).interpolation
    if stages and tolerance is not None:
        raise SettingsError("--stages goes with --size: steps that are exact alone need no tolerance")
    inputs = [path for path in (profile, wanted.look, *wanted.transfers) if isinstance(path, str | Path)]
    paths = [check_output(path, inputs=inputs) for path in outputs]
    camera = as_profile(profile)
    if wanted.target is not None and any(path.suffix.lower() in CAMERA_PROFILES for path in paths):
        wanted = replace(wanted, target=setting_of(camera, wanted.target))
    chosen = choose_transform(camera, wanted)
    camera_profiles = _camera_profiles(paths, camera, chosen, program)
    if colours and not (paths and all(path.suffix.lower() in CAMERA_PROFILES[:2] for path in paths)):
        raise SettingsError("--colours goes with an ICC profile: -o look.icc")
    if camera_profiles and set(paths) <= set(camera_profiles):
        baked = (_bake_camera_profile(camera, wanted, path, colours) for path in camera_profiles)
        return BakedFiles(tuple(baked), (BALANCED,))
    _require_feeds(program, camera, chosen, wanted.target)
    named, notes = _files([path for path in paths if path not in camera_profiles], program, chosen.title, stages)
    kind = chosen.kind
    source_style = (wanted.source or "").partition("/")[0]
    encoded = ADOBE_RGB if source_style.endswith(ADOBE_RGB_STYLE) else ENCODED
    ends = input_and_output_of(kind, camera.raw_space if chosen.space == "raw" else chosen.space, encoded)
    scenes = kind == "render" and chosen.space != "raw" and rgb_space(chosen.space).is_linear
    targets = [target_of(path, reader, size, method, scenes) for path, reader in named.items()]
    comments = (f"LutForge {__version__}", *ends.comments, *chosen.comments)
    with telling_of_compilation(progress) as telling:
        whole = stages or (kind in ("refinish", "match") and not any((program, size, tolerance, method)))
        stepwise = [whole and path.suffix.lower() in PROCESS_LISTS for path in named]
        luts = bake_forms(
            chosen.transform, [target for target, steps in zip(targets, stepwise, strict=True) if not steps],
            tolerance=tolerance, display_referred=kind != "linearize", title=chosen.title, comments=comments,
            progress=telling,
        )  # fmt: skip
        if any(stepwise):
            steps = bake_steps(chosen.transform, size, interpolation=method, title=chosen.title, comments=comments)
            for at in np.flatnonzero(stepwise):
                luts.insert(int(at), steps)
    files = [_bake_camera_profile(camera, wanted, path, colours) for path in camera_profiles]
    for path, lut in zip(named, _with_aces_id(luts, chosen), strict=True):
        error = verify(lut.write(path), chosen.transform, lut, display_referred=kind != "linearize")
        files.append(BakedFile(path, f"{lut.summary}, {lut.interpolation}", error))
    notes += [text for file in files for text in _notes_on(file, chosen)]
    files.sort(key=lambda file: file.error.mean)
    told = ("; ".join(ends.comments),) if kind in ("render", "linearize") else ()
    return BakedFiles(tuple(files), (*chosen.notes, *notes, *told, *_how_to_load(files[0].path, program)))


def _notes_on(file: BakedFile, chosen: DescribedTransform) -> Iterator[str]:
    """Yield what a file of a transform cannot hold: whole numbers, linear light; plain cubes, light far above white.

    The latter is told where a difference that is seen (ΔE00 above 1) is the largest at light above white.
    """
    path, error = file.path, file.error
    if chosen.kind == "linearize" and format_of(path).bits is not None:
        yield f"{path}: whole numbers band the darks of linear light and lose what is beyond 1; use .clf"
    if chosen.kind == "render" and chosen.space != "raw" and error.max_de00 is not None and error.max_de00 > 1:
        light = float(rgb_space(chosen.space).decode(np.array(error.worst)).max())
        if light > 1:
            yield f"{path}: the largest difference is at light {light:.0f} times as bright as white; a .clf is closer"


def _with_aces_id(luts: Sequence[Lut], chosen: DescribedTransform) -> list[Lut]:
    """The LUTs, those of an input transform with an id such as "…:CSC.LutForge.Drone_7_standard_auto_to_ACES.a2.v1".

    Its form is that of the transforms of ACES 2: type, namespace, name, version of ACES, own version. Source:
    https://docs.acescentral.com/system-components/transform-ids/ (ACES Transform Identifiers).
    """
    if chosen.kind != "linearize" or chosen.space != "aces2065-1":
        return list(luts)
    name = re.sub(r"[^A-Za-z0-9]+", "_", chosen.title.removesuffix(" to aces2065-1")).strip("_")
    identity = f"urn:ampas:aces:transformId:v2.0:CSC.LutForge.{name}_to_ACES.a2.v1"
    return [replace(lut, metadata={ACES_ID: identity}) for lut in luts]


def _how_to_load(path: Path, program: str | None) -> tuple[str, ...]:
    """A note on the file that is best for a program, where one is named."""
    if program is None:
        return ()
    use = program_named(program).use
    return (f"load {path} in {program.lower()}{f': {use}' if use else ''}",)


def _camera_profiles(
    paths: Sequence[Path], camera: CameraProfile, chosen: DescribedTransform, program: str | None
) -> list[Path]:
    """Return the outputs that are ICC or DNG camera profiles, each once.

    Raises LutError where none can hold what is asked for, or the program does not read it.
    """
    found = [path for path in dict.fromkeys(paths) if path.suffix.lower() in CAMERA_PROFILES]
    for path in found[:1]:
        if camera.developer:
            raise LutError(f"{path}: a camera profile renders RAW; this profile is of {camera.developer}")
        if (chosen.kind, chosen.space) != ("render", "raw"):
            raise LutError(f"{path}: a camera profile renders RAW: bake … render --to STYLE/WB, without --space")
    for path in found:
        if program is not None and path.suffix.lower().replace(".icm", ".icc") not in program_named(program).reads:
            raise LutError(f"{path}: {program} does not read {path.suffix.lower()} files")
    return found


def _require_feeds(program: str | None, camera: CameraProfile, chosen: DescribedTransform, target: str | None) -> None:
    """Raise SettingsError, with the command that helps, where a program never feeds to a LUT what a render takes."""
    if program is not None and chosen.kind == "render" and program_named(program).develops:
        helps = f"make a kit for it, lutforge kit camera.npz --to {target} --for {program.lower()} -o kit"
        raise SettingsError(f"{program} feeds a LUT with what it developed, never with camera RAW: {helps}")


def _bake_camera_profile(camera: CameraProfile, wanted: TransformRequest, path: Path, colours: bool) -> BakedFile:
    """Write a camera profile of a look, read it back, and compare it with the model behind white balance."""
    look = look_of(camera, wanted.target or "")
    x = np.random.default_rng(0).random((1 << 14, 3))
    exact = look.render(x)
    if path.suffix.lower() == ".dcp":
        write_dcp(fit_dng_profile(look), path)
        written, summary = read_dcp(path)(x), f"DNG camera profile, look table {' × '.join(map(str, DIVISIONS))}"
    else:
        write_icc(fit_icc_profile(look, VARIANTS[colours]), path)
        written, summary = read_icc(path)(x), f"ICC profile, {NODES}³ nodes, to Lab"
        exact = rgb_space("srgb").encode(scene_linear(look)(x)) if colours else exact
    error = compare(x, written.astype(np.float32), np.clip(exact, 0.0, 1.0))
    return BakedFile(path, summary, error)


def _files(
    paths: Sequence[Path], program: str | None, title: str, stages: bool
) -> tuple[dict[Path, str | None], list[str]]:
    """Files to write, each once, and the program of each; without names, those that suit the program; and notes."""
    if not paths and program is None:
        raise LutError(
            "no output: name a file with -o, for example -o look.cube or -o look.clf; or a program with --for"
        )
    if not paths and program is not None:
        named = files_for(program, title)
        for path in named:
            check_output(path)
        return named, []
    outputs: dict[Path, str | None] = {}
    notes = []
    for path in paths:
        if path.resolve() in {known.resolve() for known in outputs}:
            notes.append(f"{path}: named twice, written once")
            continue
        if stages and path.suffix.lower() not in PROCESS_LISTS:
            raise LutError(f"{path}: --stages writes {' and '.join(PROCESS_LISTS)}; other files hold one cube")
        outputs[path] = program
    return outputs, notes
