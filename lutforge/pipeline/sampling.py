"""Use case: RAW files and sample tables → samples."""

from __future__ import annotations  # so that help() shows the names of types

from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from lutforge.errors import CalibrationError, LutForgeError, SampleError, ShotError, in_common
from lutforge.pipeline.file_kinds import TABLE_SUFFIXES
from lutforge.pipeline.one_camera import require_one_camera, with_one_name
from lutforge.pipeline.outputs import Paths, several
from lutforge.progress import Progress, silent
from lutforge.samples.sample_set import SampleSet, concatenate
from lutforge.samples.table import read_samples
from lutforge.threads import cores

if TYPE_CHECKING:  # imported in functions: tables are read without the decoders of RAW files
    from lutforge.images.developed import Development
    from lutforge.samples.chart import ChartKind
    from lutforge.samples.extract import ShotSamples
    from lutforge.shots.geometry import Placement
    from lutforge.shots.read import Shot

RawSubstitute = Callable[[Path], "Development"]
"""A function of a RAW file that returns the picture to use in its place, which a program developed."""


@dataclass(frozen=True, eq=False)
class SampledShots:
    """The samples of all usable shots and of tables.

    shots: the samples of each shot, with statistics; left_out: a line for each shot that is not usable; files: the RAW
    file of each shot, by name.
    """

    samples: SampleSet
    shots: tuple[ShotSamples, ...] = ()
    left_out: tuple[str, ...] = ()
    files: Mapping[str, Path] = field(default_factory=dict)


def file_notes(shots: Iterable[ShotSamples]) -> tuple[str, ...]:
    """The notes on the files of shots, one line for all files with the same note."""
    return tuple(in_common(((shot.shot, text) for shot in shots for text in shot.file_notes), "shots"))


def sample(paths: Paths, progress: Progress = silent) -> SampleSet:
    """Sample the colours that RAW files share with their camera's JPEGs.

    Args:
        paths: RAW files, folders of them, or sample tables (.csv, .npz), in any mixture. The JPEG is the one beside the
            RAW file, else the preview embedded in it.
        progress: called with the name of the present step, and the share that is done.

    Returns:
        The samples of all usable shots.

    Raises:
        ShotError: no shot is usable.
        SampleError: nothing is given, or a table is malformed.
    """
    return gather_samples(paths, progress).samples


def sample_shots(
    paths: Paths, progress: Progress = silent, substitute: RawSubstitute | None = None, chart: str = ""
) -> SampledShots:
    """Sample RAW files, or folders of them. A shot that cannot be used is left out, with its reason.

    substitute: returns the developed picture that is sampled in place of a RAW file's pixels. chart: the name of a
    chart whose patches are sampled, too, where it is found. Raises CalibrationError where it cannot be searched for.
    """
    from lutforge.samples.chart import chart_kind
    from lutforge.shots.discover import discover
    from lutforge.shots.read import read_shot

    kind = chart_kind(chart) if chart else None
    if kind is not None and not kind.detector:
        raise CalibrationError(
            f"a {kind.name} is not searched for in pictures: OpenCV has no detector for it; "
            "without --chart its plain areas are sampled"
        )
    files = discover(several(paths))
    require_one_camera(files)
    # The registration of each shot starts from the result of the first file, so that it does not depend on the order
    # in which threads finish.
    first: Future[Placement | None] = Future()

    def read(name: str, file: Path) -> Shot:
        developed = None if substitute is None else substitute(file)
        if file != files[0]:
            return replace(read_shot(file, developed, first.result), name=name)
        try:
            shot = read_shot(file, developed)
            first.set_result(shot.placement)
        finally:
            if not first.done():
                first.set_result(None)
        return replace(shot, name=name)

    # Decoding and registration release Python's lock; the programs of substitutes use all cores themselves.
    threads = cores() if substitute is None else 1
    return sample_each(dict(zip(_names(files), files, strict=True)), read, progress, threads, kind)


def sample_each(
    files: Mapping[str, Path],
    read: Callable[[str, Path], Shot],
    progress: Progress,
    threads: int,
    kind: ChartKind | None = None,
) -> SampledShots:
    """Sample shots by name and file, which `read` reads; one that cannot be used is left out, with its reason."""
    from lutforge.samples.extract import ShotSamples, extract

    shots = list[ShotSamples]()
    left_out = list[str]()

    def sampled(name: str, file: Path) -> ShotSamples | LutForgeError:
        try:
            return extract(read(name, file), kind)
        except LutForgeError as error:
            return error

    progress(next(iter(files.values())).name, 0.0)
    with ThreadPoolExecutor(threads) as pool:
        try:
            results = pool.map(sampled, files, files.values())
            for index, (file, result) in enumerate(zip(files.values(), results, strict=True), 1):
                if isinstance(result, ShotSamples):
                    shots.append(result)
                elif len(files) == 1:
                    raise result
                else:
                    left_out.append(str(result))
                progress(file.name, index / len(files))
        finally:
            pool.shutdown(cancel_futures=True)
    named = with_one_name([shot.samples for shot in shots])
    shots = [replace(shot, samples=samples) for shot, samples in zip(shots, named, strict=True)]
    sample_sets = [shot.samples for shot in shots if shot.kept]
    if not sample_sets:
        raise ShotError("no usable shot: " + "; ".join([*left_out, *(shot.summary for shot in shots)]))
    return SampledShots(concatenate(sample_sets), tuple(shots), tuple(left_out), files)


def sample_by_reference(pictures: Paths, reference: str | Path, progress: Progress = silent) -> SampledShots:
    """Sample JPEGs of a camera without RAW against the RAW files of another camera of the same scenes.

    pictures: JPEGs, or folders of them; reference: a folder of RAW files. Files with the same stem are a pair; where
    stems differ, files are paired in the order of their names. The two cameras may see a scene from different points.
    RAW values are scaled by the ratio of the stated exposures. Raises ShotError where no shot is usable, or files
    cannot be paired.
    """
    from lutforge.shots.discover import discover, jpegs_of
    from lutforge.shots.other_view import read_other_view

    files = [file for path in several(pictures) for file in jpegs_of(path)]
    raws = discover([reference])
    require_one_camera(files)
    require_one_camera(raws)
    by_stem = {raw.stem.lower(): raw for raw in raws}
    if all(file.stem.lower() in by_stem for file in files):
        pairs = [(file, by_stem[file.stem.lower()]) for file in files]
    elif len(files) == len(raws):
        pairs = list(zip(sorted(files), sorted(raws), strict=True))
    else:
        raise ShotError(
            f"{len(files)} JPEGs and {len(raws)} RAW files: give both of a scene one name, or as many of each in order"
        )

    raw_of = dict(pairs)
    names = _names([file for file, _ in pairs])
    ratios: dict[str, float] = {}

    def read(name: str, file: Path) -> Shot:
        shot, ratios[name] = read_other_view(file, raw_of[file])
        return replace(shot, name=name)

    sampled = sample_each(dict(zip(names, raw_of, strict=True)), read, progress, cores())
    scales = {shot.shot: ratios[shot.shot] for shot in sampled.shots}
    if not all(map(np.isfinite, scales.values())):
        scales = dict.fromkeys(scales, 1.0)
    scale = np.array([scales[shot] for shot in sampled.samples.shot]) / max(scales.values())
    return replace(sampled, samples=replace(sampled.samples, raw=sampled.samples.raw * scale[:, None]), files={})


def _names(files: Sequence[Path]) -> list[str]:
    """The names of shots: the stems of their files, or the whole paths where two files have the same stem."""
    stems = [file.stem for file in files]
    return [stem if stems.count(stem) == 1 else str(file) for file, stem in zip(files, stems, strict=True)]


def gather_samples(paths: Paths, progress: Progress = silent, substitute: RawSubstitute | None = None) -> SampledShots:
    """Read sample tables, and sample RAW files and folders of them; a file that is given twice counts once."""
    distinct = list({path.resolve(): path for path in several(paths)}.values())
    if not distinct:
        raise SampleError("nothing given: name sample tables (.csv, .npz) or RAW files")
    tables = {path: read_samples(path) for path in distinct if path.suffix.lower() in TABLE_SUFFIXES}
    shots = [path for path in distinct if path.suffix.lower() not in TABLE_SUFFIXES]
    if not shots:
        return SampledShots(_all_of([*tables.values()]))
    require_one_camera(
        shots, {str(camera): path for path, table in tables.items() for camera in np.unique(table.camera)}
    )
    sampled = sample_shots(shots, progress, substitute)
    return replace(sampled, samples=_all_of([*tables.values(), sampled.samples]))


def _all_of(sets: Sequence[SampleSet]) -> SampleSet:
    """The samples of tables and shots together, with one name for each camera, and without repeated shots."""
    return concatenate(_without_repeated_shots(with_one_name(sets)))


def _without_repeated_shots(sets: Sequence[SampleSet]) -> list[SampleSet]:
    """The sample sets without shots that a later set also holds, as with a table and the folder that it was made from.

    Two shots are the same where camera, name, and more than half of the JPEG colours to a thousandth, are equal.
    """
    distinct = list[SampleSet]()
    later = dict[tuple[str, str], set[tuple[float, ...]]]()
    for samples in reversed(sets):
        shots = list(samples.by_shot())
        repeated = list[str]()
        for name, shot in shots:
            colours = [tuple(colour) for colour in np.rint(1e3 * shot.srgb).tolist()]
            key = str(shot.camera[0]), name
            if sum(colour in later.get(key, ()) for colour in colours) > len(colours) / 2:
                repeated.append(name)
            else:
                later[key] = later.get(key, set()).union(colours)
        if len(repeated) < len(shots):
            distinct.append(samples.select(~np.isin(samples.shot, repeated)) if repeated else samples)
    return distinct[::-1]


def as_samples(samples: SampleSet | Paths) -> SampleSet:
    """Return a SampleSet itself, or the samples of tables and shots. Raises SampleError on anything else."""
    paths = samples if isinstance(samples, Sequence) else [samples]
    if not isinstance(samples, SampleSet) and not all(isinstance(path, str | Path) for path in paths):
        raise SampleError("not samples: give a SampleSet (SampleSet.from_arrays makes one of arrays), or paths")
    return samples if isinstance(samples, SampleSet) else sample(samples)
