"""Use case: RAW files and sample tables → samples; and what these are of, RAW or pictures in its place."""

from __future__ import annotations  # so that help() shows the names of types

from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from lutforge.colour.rgb_spaces import rgb_space
from lutforge.errors import CalibrationError, LutForgeError, SampleError, SettingsError, ShotError, in_common
from lutforge.model.provenance import Chart, Developed, OwnRaw, Pictures
from lutforge.pipeline.outputs import TABLE_SUFFIXES, Paths, several
from lutforge.progress import Progress, silent
from lutforge.samples.sample_set import SampleSet, concatenate
from lutforge.samples.table import read_samples
from lutforge.threads import cores

if TYPE_CHECKING:  # tables are read without what decodes RAW files
    from lutforge.images.read import Development
    from lutforge.model.camera_profile import CameraProfile
    from lutforge.samples.chart import ChartKind
    from lutforge.samples.extract import ShotSamples
    from lutforge.shots.geometry import Placement
    from lutforge.shots.read import Shot

RawSubstitute = Callable[[Path], "Development"]
"""A function of a RAW file that gives the picture to use instead of it, as a program developed it."""


@dataclass(frozen=True, eq=False)
class SampledShots:
    """The samples of all usable shots and of tables.

    shots: the account of each shot; left_out: a line for each that is not usable; files: the RAW file of each by name.
    """

    samples: SampleSet
    shots: tuple[ShotSamples, ...] = ()
    left_out: tuple[str, ...] = ()
    files: Mapping[str, Path] = field(default_factory=dict)


def file_notes(shots: Iterable[ShotSamples]) -> tuple[str, ...]:
    """Return what is to be known of the files of shots, one line for all that share it."""
    return tuple(in_common(((shot.shot, text) for shot in shots for text in shot.file_notes), "shots"))


def sample(paths: Paths, progress: Progress = silent) -> SampleSet:
    """Sample the colours that RAW files share with their camera's JPEGs.

    Args:
        paths: RAW files, folders of them, or sample tables (.csv, .npz), in any mixture. The JPEG is the one beside the
            RAW file, else the preview embedded in it.
        progress: called with what is being done, and the share that is done.

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

    substitute: gives the picture that is sampled in the place of a RAW file's own pixels, where a program developed it.
    chart: the name of one whose patches are sampled, too, wherever it is found; CalibrationError where it is none.
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
    # The other shots are looked for first where the JPEG of the first one lies: which that is does not depend on time.
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

    # Decoding and registration run outside Python's lock; programs that develop use all cores by themselves.
    threads = cores() if substitute is None else 1
    return sample_each(dict(zip(_names(files), files, strict=True)), read, progress, threads, kind)


def sample_each(
    files: Mapping[str, Path],
    read: Callable[[str, Path], Shot],
    progress: Progress,
    threads: int,
    kind: ChartKind | None = None,
) -> SampledShots:
    """Sample the shots that `read` makes of names and files; one that cannot be used is left out, with its reason."""
    from lutforge.samples.extract import ShotSamples, extract

    accounts, left_out = list[ShotSamples](), list[str]()

    def sampled(name: str, file: Path) -> ShotSamples | LutForgeError:
        try:
            return extract(read(name, file), kind)
        except LutForgeError as error:
            return error

    progress(next(iter(files.values())).name, 0.0)
    with ThreadPoolExecutor(threads) as pool:
        try:
            results = pool.map(sampled, files, files.values())
            for index, (file, shot) in enumerate(zip(files.values(), results, strict=True), 1):
                if isinstance(shot, ShotSamples):
                    accounts.append(shot)
                elif len(files) == 1:
                    raise shot
                else:
                    left_out.append(str(shot))
                progress(file.name, index / len(files))
        finally:
            pool.shutdown(cancel_futures=True)
    kept = [account.samples for account in accounts if account.kept]
    if not kept:
        raise ShotError("no usable shot: " + "; ".join([*left_out, *(account.summary for account in accounts)]))
    return SampledShots(concatenate(kept), tuple(accounts), tuple(left_out), files)


def sample_by_reference(pictures: Paths, reference: str | Path, progress: Progress = silent) -> SampledShots:
    """Sample JPEGs of a camera without RAW against the RAW files of another camera of the same scenes.

    pictures: JPEGs, or folders of them; reference: a folder of RAW files. Those of one stem belong together; without,
    those of one place in the order of names. The two may stand in different places. RAW values are scaled by what the
    files state of both exposures. Raises ShotError where no shot is usable, or it is not clear what belongs together.
    """
    from lutforge.shots.discover import discover, jpegs_of
    from lutforge.shots.other_view import read_other_view

    files = [file for path in several(pictures) for file in jpegs_of(path)]
    raws = discover([reference])
    by_stem = {raw.stem.lower(): raw for raw in raws}
    if all(file.stem.lower() in by_stem for file in files):
        pairs = [(file, by_stem[file.stem.lower()]) for file in files]
    elif len(files) == len(raws):
        pairs = list(zip(sorted(files), sorted(raws), strict=True))
    else:
        raise ShotError(
            f"{len(files)} JPEGs and {len(raws)} RAW files: give both of a scene one name, or as many of each in order"
        )
    ratios: dict[str, float] = {}

    def read(name: str, file: Path) -> Shot:
        shot, ratios[name] = read_other_view(file, raw_of[file])
        return replace(shot, name=name)

    raw_of, names = dict(pairs), _names([file for file, _ in pairs])
    sampled = sample_each(dict(zip(names, raw_of, strict=True)), read, progress, cores())
    scales = {account.shot: ratios[account.shot] for account in sampled.shots}
    if not all(map(np.isfinite, scales.values())):
        scales = dict.fromkeys(scales, 1.0)
    scale = np.array([scales[shot] for shot in sampled.samples.shot]) / max(scales.values())
    return replace(sampled, samples=replace(sampled.samples, raw=sampled.samples.raw * scale[:, None]), files={})


def _names(files: Sequence[Path]) -> list[str]:
    """The names of shots: the stems of their files, or the whole paths of two that share one."""
    stems = [file.stem for file in files]
    return [stem if stems.count(stem) == 1 else str(file) for file, stem in zip(files, stems, strict=True)]


def gather_samples(paths: Paths, progress: Progress = silent, substitute: RawSubstitute | None = None) -> SampledShots:
    """Read sample tables, and sample RAW files and folders of them, in any mixture; what is given twice counts once."""
    given = list({path.resolve(): path for path in several(paths)}.values())
    if not given:
        raise SampleError("nothing given: name sample tables (.csv, .npz) or RAW files")
    parts = [read_samples(path) for path in given if path.suffix.lower() in TABLE_SUFFIXES]
    others = [path for path in given if path.suffix.lower() not in TABLE_SUFFIXES]
    if not others:
        return SampledShots(concatenate(_each_shot_once(parts)))
    sampled = sample_shots(others, progress, substitute)
    return replace(sampled, samples=concatenate(_each_shot_once([*parts, sampled.samples])))


def _each_shot_once(parts: Sequence[SampleSet]) -> list[SampleSet]:
    """The sample sets without the shots that a later one holds, too, as a table does of the folder beside it.

    It is one shot where camera, name and more than half of the JPEG colours, to a thousandth, are the same.
    """
    distinct, later = list[SampleSet](), dict[tuple[str, str], set[tuple[float, ...]]]()
    for part in reversed(parts):
        shots, doubled = list(part.by_shot()), list[str]()
        for name, samples in shots:
            colours = [tuple(colour) for colour in np.rint(1e3 * samples.srgb).tolist()]
            key = str(samples.camera[0]), name
            if sum(colour in later.get(key, ()) for colour in colours) > len(colours) / 2:
                doubled.append(name)
            else:
                later[key] = later.get(key, set()).union(colours)
        if len(doubled) < len(shots):
            distinct.append(part.select(~np.isin(part.shot, doubled)) if doubled else part)
    return distinct[::-1]


def as_samples(samples: SampleSet | Paths) -> SampleSet:
    """Return samples as they are, or those of tables and shots. Raises SampleError on anything else."""
    paths = samples if isinstance(samples, Sequence) else [samples]
    if not isinstance(samples, SampleSet) and not all(isinstance(path, str | Path) for path in paths):
        raise SampleError("not samples: give a SampleSet (SampleSet.from_arrays makes one of arrays), or paths")
    return samples if isinstance(samples, SampleSet) else sample(samples)


# --- What samples are of: RAW, or pictures in its place --------------------------------------------------------------


def provenance_of(samples: SampleSet) -> OwnRaw | Developed | Chart:
    """What the linear values of samples are: RAW, of whichever camera, developed pictures, or a chart's known colours.

    Raises CalibrationError where they are of several kinds.
    """
    columns = (samples.raw_space, samples.developer, samples.chart, samples.chart_light)
    rows = sorted(set(zip(*(column.tolist() for column in columns), strict=True)))
    kinds = list(dict.fromkeys(_provenance(*row) for row in rows)) or [OwnRaw()]
    if len(kinds) > 1:
        names = ", ".join(f"{kind} ({kind.space})" if isinstance(kind, Pictures) else "RAW" for kind in kinds[:4])
        raise CalibrationError(f"the samples are of several kinds: {names}; calibrate each by itself")
    return kinds[0]


def _provenance(space: str, developer: str, chart: str, light: str) -> OwnRaw | Developed | Chart:
    if not space:
        return OwnRaw()
    return Chart(chart, light, space) if chart else Developed(developer, space)


def require_same_provenance(profile: CameraProfile, samples: SampleSet) -> None:
    """Raise CalibrationError, with what helps, where samples are not of what a profile was calibrated on."""
    given = provenance_of(samples)
    if profile.provenance.space != given.space:
        option = "--developed DIR --developed-space SPACE " if isinstance(profile.provenance, Pictures) else ""
        raise CalibrationError(
            f"the profile is of {profile.provenance}, the samples are of {given}: sample what the profile is of, "
            f"lutforge sample SHOT… {option}-o samples.csv"
        )


# --- Pictures instead of RAW: what a program exported, or any rendering of the frames --------------------------------


PAIRED_SUFFIXES = (".tif", ".tiff", ".exr", ".png", ".jpg", ".jpeg")
"""Kinds of pictures that are paired, the best first."""


def raw_substitute(developed: str | Path | None, developed_space: str | None) -> RawSubstitute | None:
    """Return the function that gives the picture to use instead of a RAW file; None where the RAW itself is used.

    developed: a folder of pictures, one a shot with its stem, encoded in developed_space; neither goes alone.
    """
    if developed is None:
        if developed_space is not None:
            raise SettingsError("--developed-space names the space of the pictures in --developed: give both")
        return None
    if developed_space is None:
        raise SettingsError("--developed needs --developed-space, the space that its pictures are encoded in")
    from lutforge.images.read import read_developed

    space = rgb_space(developed_space).name
    pictures = _pictures(Path(developed))

    def read(raw: Path) -> Development:
        picture = pictures.get(raw.stem.lower())
        if picture is None:
            raise ShotError(f"{raw}: {developed} holds no picture of that name ({', '.join(PAIRED_SUFFIXES[:3])})")
        return read_developed(picture, space)

    return read


def sample_pairs(
    from_folder: str | Path, to_folder: str | Path, from_space: str, progress: Progress = silent
) -> SampledShots:
    """Sample two renderings of the same frames: pictures of the same stem in two folders.

    from_space: the space that the pictures of the first folder are encoded in; those of the second are sRGB.
    """
    from lutforge.images.read import read_developed
    from lutforge.shots.read import read_pair

    space = rgb_space(from_space).name
    first, second = _pictures(Path(from_folder)), _pictures(Path(to_folder))
    stems = sorted(first.keys() & second.keys())
    if not stems:
        raise ShotError(f"{from_folder}, {to_folder}: no picture of one has the name of a picture of the other")

    def read(stem: str, file: Path) -> Shot:
        return read_pair(second[stem], read_developed(file, space))

    return sample_each({stem: first[stem] for stem in stems}, read, progress, cores())


def _pictures(folder: Path) -> dict[str, Path]:
    if not folder.is_dir():
        raise ShotError(f"{folder}: no such folder")
    # Of several of one stem the best kind comes last, and stays.
    pictures = [path for kind in reversed(PAIRED_SUFFIXES) for path in folder.iterdir() if path.suffix.lower() == kind]
    return {path.stem.lower(): path for path in pictures}
