"""Use case: a profile and settings → LUT files, each read back and measured."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lutforge import __version__
from lutforge.errors import LutError, SettingsError
from lutforge.interpolation import INTERPOLATIONS
from lutforge.luts.bake import bake_forms
from lutforge.luts.ends import ends_of
from lutforge.luts.formats.clf import KINDS as PROCESS_LISTS
from lutforge.luts.programs import files_for, program_named, target_of
from lutforge.luts.sequence import Lut, format_of
from lutforge.luts.steps import bake_steps
from lutforge.luts.verify import FileError, verify
from lutforge.model.camera_profile import CameraProfile
from lutforge.pipeline.evaluation import as_profile
from lutforge.pipeline.options import one_of
from lutforge.pipeline.outputs import check_output
from lutforge.pipeline.transforms import Wanted, choose_transform
from lutforge.progress import Progress, silent, telling_of_compilation


@dataclass(frozen=True)
class BakedFile:
    """A file that was written. error: what it makes of colours, read back, against the model."""

    path: Path
    lut: Lut
    error: FileError

    def __str__(self) -> str:
        return f"{self.path}: {self.lut.summary}, {self.lut.interpolation}"


@dataclass(frozen=True)
class Baked:
    """Files of one transform, the most exact first, and what the user should know of them."""

    files: tuple[BakedFile, ...]
    notes: tuple[str, ...]


def bake_files(
    profile: CameraProfile | str | Path,
    wanted: Wanted,
    outputs: Sequence[str | Path] = (),
    *,
    program: str | None = None,
    size: int | None = None,
    tolerance: float | None = None,
    interpolation: str | None = None,
    stages: bool = False,
    progress: Progress = silent,
) -> Baked:
    """Bake a transform of a profile to LUT files, and measure each as its readers see it.

    outputs: their suffixes pick the formats; program: the one that will read them, which names them where there are
    none. size: nodes per axis; tolerance: instead, the ΔE00 that 99 % of colours keep within. interpolation: how the
    reader interpolates. stages: each step a cube of its own (.clf, .ctf), which is how a refinish or match is
    written where nothing else is asked for.
    Raises SettingsError, LutError, ProfileError, and LutForgeError where nothing can be written: all before the work.
    """
    method = None if interpolation is None else one_of("interpolation", interpolation, INTERPOLATIONS)
    if program is not None:
        method = method or program_named(program).interpolation
    if stages and tolerance is not None:
        raise SettingsError("--stages goes with --size: steps that are exact alone need no tolerance")
    inputs = [path for path in (profile, wanted.look, *wanted.transfers) if isinstance(path, str | Path)]
    paths = [check_output(path, inputs=inputs) for path in outputs]
    chosen = choose_transform(as_profile(profile), wanted)
    if program is not None and chosen.kind == "render" and program_named(program).develops:
        raise SettingsError(
            f"{program} feeds a LUT with what it developed, never with camera RAW: make a kit for it, "
            f"lutforge kit camera.npz --to {wanted.target} --for {program.lower()} -o kit"
        )
    named, notes = _files(paths, program, chosen.title, stages)
    kind, ends = chosen.kind, ends_of(chosen.kind, chosen.space)
    scenes = kind == "render" and chosen.space != "raw"
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
    files = []
    for path, lut in zip(named, luts, strict=True):
        error = verify(lut.write(path), chosen.transform, lut, display_referred=kind != "linearize")
        files.append(BakedFile(path, lut, error))
        if kind == "linearize" and format_of(path).bits is not None:
            notes.append(f"{path}: whole numbers band the darks of linear light and lose what is beyond 1; use .clf")
    files.sort(key=lambda file: file.error.mean)
    if kind in ("render", "linearize"):
        notes.append("; ".join(ends.comments))
    if program is not None:
        use = program_named(program).use
        notes.append(f"load {files[0].path} in {program.lower()}{f': {use}' if use else ''}")
    return Baked(tuple(files), (*chosen.notes, *notes))


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
