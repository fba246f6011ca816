"""The journey of the data, one function per step; each step lives in the folder of the same name.

shots → samples → calibration → camera profile → baked LUT → OpenColorIO config → graded images
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

from lutforge.calibration.calibrate import calibrate as fit_profile
from lutforge.calibration.calibrate import data_by_style
from lutforge.calibration.options import CalibrationOptions
from lutforge.errors import LutForgeError, SampleError, ShotError
from lutforge.evaluation.evaluate import evaluate as evaluate_profile
from lutforge.evaluation.evaluation import Evaluation
from lutforge.evaluation.held_out_error import with_held_out_errors
from lutforge.evaluation.learning_curve import LearningCurve, learning_curve
from lutforge.evaluation.size_search import smallest_size as find_smallest_size
from lutforge.model.camera_profile import CameraProfile
from lutforge.samples.extract import ShotSamples, extract
from lutforge.samples.sample_set import SampleSet, concatenate, with_setting_names
from lutforge.samples.table import read_samples
from lutforge.shots.discover import discover
from lutforge.shots.read import read_shot
from lutforge.shots.shot import Shot

if TYPE_CHECKING:
    from lutforge.report.page import Report

TABLE_SUFFIXES = (".csv", ".parquet")

Progress = Callable[[str, float], None]
"""Called with what is being done and the share that is done, 0 … 1."""


def _silent(what: str, share: float) -> None:
    pass


@dataclass(frozen=True, eq=False)
class Sampled:
    """samples: of all usable shots; shots: the account of each; left_out: one line for each that is not usable;
    files: the RAW file of each shot by its name."""

    samples: SampleSet
    shots: tuple[ShotSamples, ...]
    left_out: tuple[str, ...]
    files: Mapping[str, Path] = field(default_factory=dict)


def sample_shots(paths: Sequence[str | Path], progress: Progress = _silent) -> Sampled:
    """RAW files, or folders of them → colour samples. A shot that cannot be used is left out, with its reason.

    Raises ShotError where no shot is left.
    """
    files = discover(paths)
    names = _unique_names(files)
    accounts: list[ShotSamples] = []
    left_out: list[str] = []
    for index, file in enumerate(files):
        progress(file.name, index / len(files))
        try:
            accounts.append(extract(_named(read_shot(file), names[index])))
        except LutForgeError as error:
            if len(files) == 1:
                raise
            left_out.append(str(error))
    progress("done", 1.0)
    kept = [account.samples for account in accounts if account.kept]
    if not kept:
        raise ShotError("no usable shot: " + "; ".join([*left_out, *(account.summary for account in accounts)]))
    by_name = dict(zip(names, files, strict=True))
    return Sampled(concatenate(kept), tuple(accounts), tuple(left_out), by_name)


def _named(shot: Shot, name: str) -> Shot:
    return shot if shot.name == name else replace(shot, name=name)


def _unique_names(files: Sequence[Path]) -> list[str]:
    """The stems, with the folder in front where two files share one."""
    stems = [file.stem for file in files]
    return [stem if stems.count(stem) == 1 else str(file) for file, stem in zip(files, stems, strict=True)]


def gather_samples(paths: Sequence[str | Path], progress: Progress = _silent) -> Sampled:
    """Sample tables, RAW files and folders of them, in any mixture → samples."""
    if not paths:
        raise SampleError("nothing given: name sample tables (.csv, .parquet) or RAW files")
    tables = [Path(path) for path in paths if Path(path).suffix.lower() in TABLE_SUFFIXES]
    others = [path for path in paths if Path(path).suffix.lower() not in TABLE_SUFFIXES]
    parts = [read_samples(table) for table in tables]
    sampled = Sampled(concatenate(parts), (), ()) if parts else None
    if not others:
        assert sampled is not None
        return sampled
    shots = sample_shots(others, progress)
    return replace(shots, samples=concatenate([*parts, shots.samples]))


def sample(paths: Sequence[str | Path]) -> SampleSet:
    """RAW files, or folders of them → colour samples."""
    return sample_shots(paths).samples


def calibrate(
    samples: SampleSet, options: CalibrationOptions | None = None, progress: Progress = _silent
) -> CameraProfile:
    """Samples → a camera profile, with its error on shots that were left out."""
    options = options or CalibrationOptions()
    fitted = fit_profile(with_setting_names(samples), options, lambda what, share: progress(what, 0.5 * share))
    return with_held_out_errors(fitted, options, lambda what, share: progress(what, 0.5 + 0.5 * share))


def smallest_size(
    samples: SampleSet, tolerance: float, options: CalibrationOptions | None = None, progress: Progress = _silent
) -> int:
    """Nodes per axis of the smallest lattice that renders held-out shots within a mean error (RGB norm, 1 = full)."""
    return find_smallest_size(data_by_style(with_setting_names(samples)), tolerance, options, progress)


def learning_curves(samples: SampleSet, progress: Progress = _silent) -> dict[str, LearningCurve]:
    """How many shots are enough, by style: the error on held-out shots against the number of shots fitted to."""
    data = data_by_style(with_setting_names(samples))
    curves = {}
    for index, (name, style) in enumerate(data.items()):
        start = index / len(data)

        def within(what: str, share: float, name: str = name, start: float = start) -> None:
            progress(f"{name}: {what}", start + share / len(data))

        curves[name] = learning_curve(style, progress=within)
    return curves


def evaluate(
    profile: CameraProfile, samples: SampleSet, progress: Progress = _silent, *, tables: bool = False
) -> Evaluation:
    """The error tables of a profile on samples, held out by shot; tables: all methods of the thesis's tables."""
    return evaluate_profile(profile, with_setting_names(samples), progress, tables=tables)


def report(profile: CameraProfile, sampled: Sampled | None = None, progress: Progress = _silent) -> "Report":
    """A profile, and with the samples that it was calibrated from its errors and what to shoot next, for reading."""
    from lutforge.report.report import build_report  # matplotlib takes a second to import, and no other step draws

    if sampled is None:
        return build_report(profile, progress=progress)
    return build_report(profile, with_setting_names(sampled.samples), sampled.shots, sampled.files, progress)
