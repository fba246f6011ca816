"""The thesis's error tables of a profile on samples, held out by shot, beside plain baselines (chapters 4 to 6)."""

import time
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from lutforge.arrays import Array, Mask
from lutforge.calibration.lattice.monochrome import is_monochrome, monochrome_note
from lutforge.calibration.options import options_from_json
from lutforge.calibration.physical.white_balance import complete_multipliers, with_gains
from lutforge.calibration.shots.departures import Departure, find_departures
from lutforge.calibration.shots.falloff import at_the_centre
from lutforge.calibration.style import style_data, styles_with_enough, unclipped
from lutforge.errors import CalibrationError
from lutforge.evaluation.evaluation import Evaluation, EvaluationRow, error_rows, raw_errors
from lutforge.evaluation.held_out import Predictions, predict
from lutforge.evaluation.linearization import edited_errors, linearization_errors
from lutforge.evaluation.refinish_errors import refinish_errors
from lutforge.model.camera_profile import CameraProfile, is_response_alone
from lutforge.model.reference_raw import with_own_raw
from lutforge.progress import Progress, part, silent
from lutforge.samples.sample_set import SampleSet


def evaluate(
    profile: CameraProfile,
    samples: SampleSet,
    progress: Progress = silent,
    *,
    tables: bool = False,
    sizes: Sequence[int] = (13, 17, 24),
) -> Evaluation:
    """Measure errors of both directions, per shot and over all shots, for the profile's models and the baselines.

    A shot that the profile was calibrated from is predicted by a refit without it, any other by the profile as it is.
    tables: every method of the thesis's tables, with its times, whatever the profile holds; sizes: nodes per axis of
    the lattices in these. Raises CalibrationError where the samples hold none of the profile's styles.
    """
    if is_response_alone(profile):
        raise CalibrationError(
            f"the profile of {profile.camera} holds a response alone, found without RAW: samples of RAW cannot tell "
            "its error; lutforge response prints it"
        )
    samples = at_the_centre(with_own_raw(profile, samples), profile.falloffs)
    multipliers, notes = complete_multipliers(samples)
    multipliers = with_gains(samples, multipliers, profile.white_balances)
    known, strange = _known_styles(profile, samples)
    samples, multipliers = samples.select(known), multipliers[known]
    data, clipped = style_data(samples, multipliers)
    notes = (*notes, *strange, *styles_with_enough(samples, multipliers)[1])
    if clipped:
        notes = (*notes, f"{clipped} of {len(samples)} samples are clipped and are not counted")
    notes = (*notes, *_missing_shots(profile, samples, tables=tables))
    options, predictions = options_from_json(profile.options), {}
    for index, (name, style) in enumerate(data.items()):
        telling = part(progress, index / len(data), (index + 1) / len(data), name)
        found = predict(
            profile.styles[name],
            name,
            style,
            profile.shots,
            options,
            sizes=sizes if tables else (),
            progress=partial(telling, "leaving shots out"),
        )
        predictions[name] = found
        notes = (*notes, *found.notes, *([monochrome_note(name)] if style.monochrome else []))
    departures = departures_from(profile, samples, multipliers)
    notes = (*notes, *(f"{each.shot} departs from the fixed rendering: {each.words}" for each in departures))
    evaluation = _evaluation(profile, predictions, notes, departures, tables=tables)
    progress("done", 1.0)
    return evaluation


def departures_from(profile: CameraProfile, samples: SampleSet, multipliers: Array) -> tuple[Departure, ...]:
    """The shots that depart clearly from the profile's rendering, beside the others of their style."""
    usable = unclipped(samples, multipliers)
    found: list[Departure] = []
    for name, style in profile.styles.items():
        rows = usable & (samples.style == name)
        if style.linearize is not None and rows.any() and not is_monochrome(samples.raw[rows], samples.srgb[rows]):
            balanced = samples.raw[rows] * multipliers[rows]
            found.extend(find_departures(style.linearize(samples.srgb[rows]), balanced, samples.shot[rows]))
    return tuple(found)


def scene_departures(profile: CameraProfile, samples: SampleSet) -> tuple[Departure, ...]:
    """What the camera did to shots beyond its fixed rendering, of styles that the profile has."""
    samples = at_the_centre(with_own_raw(profile, samples), profile.falloffs)
    multipliers = with_gains(samples, complete_multipliers(samples)[0], profile.white_balances)
    return departures_from(profile, samples, multipliers)


def _known_styles(profile: CameraProfile, samples: SampleSet) -> tuple[Mask, tuple[str, ...]]:
    """(n,): the samples of styles that the profile has, and notes on the others. Raises CalibrationError."""
    notes = []
    others = [str(name) for name in np.unique(samples.camera) if name != profile.camera]
    if others:
        notes.append(f"the profile is of {profile.camera}, the samples are of {', '.join(others)}")
    known = np.isin(samples.style, list(profile.styles))
    if not known.any():
        raise CalibrationError(
            f"the samples' styles ({', '.join(np.unique(samples.style))}) are not in the profile "
            f"({', '.join(profile.styles)})"
        )
    if not known.all():
        strange = ", ".join(np.unique(samples.style[~known]))
        notes.append(f"the samples of {strange} are not counted: not in the profile")
    return known, tuple(notes)


def _missing_shots(profile: CameraProfile, samples: SampleSet, *, tables: bool) -> Iterator[str]:
    """Notes on shots of the calibration that are not among the samples."""
    missing = sum(shot not in samples.shot for shot in profile.shots)
    if 0 < missing < len(profile.shots):
        yield (
            f"{missing} of the {len(profile.shots)} shots of the calibration are not among these: the refits without "
            "each of the others see fewer colours than the profile did; give all for its error"
        )
    if tables and not np.isin(samples.shot, profile.shots).any():
        yield "no shot of the calibration is among these: add them for the baselines and the lattice sizes"


def _evaluation(
    profile: CameraProfile,
    predictions: dict[str, Predictions],
    notes: tuple[str, ...],
    departures: tuple[Departure, ...],
    *,
    tables: bool,
) -> Evaluation:
    """The tables that predictions of styles make."""
    rows = (row for name, found in predictions.items() for row in error_rows(name, found))
    return Evaluation(
        camera=profile.camera,
        rows=tuple(_timed(rows, predictions) if tables else rows),
        notes=notes,
        raw=tuple(row for name, found in predictions.items() for row in raw_errors(name, found)),
        linearization=tuple(
            row for name, found in predictions.items() for row in linearization_errors(name, found, profile.matrix)
        ),
        edited=tuple(row for name, found in predictions.items() for row in edited_errors(name, found)),
        refinish=refinish_errors(predictions),
        departures=departures,
        tables=tables,
        predictions=predictions,
    )


def _timed(rows: Iterable[EvaluationRow], predictions: dict[str, Predictions]) -> Iterable[EvaluationRow]:
    """The rows over all shots with the times of their methods."""
    pixels = np.random.default_rng(0).random((1 << 17, 3))
    for row in rows:
        fits = [fitted[row.method] for fitted in predictions[row.style].fits if row.method in fitted]
        if row.shot != "all" or not fits:
            yield row
            continue
        known = [seconds for fit in fits if (seconds := fit.seconds[row.direction]) is not None]
        evaluate_pixels = fits[-1][row.direction]
        took = []
        for some in (pixels[:1], pixels, pixels, pixels):  # the first compiles
            start = time.perf_counter()
            evaluate_pixels(some)
            took.append(time.perf_counter() - start)
        fit_seconds = float(np.median(known)) if known else None
        yield replace(row, fit_seconds=fit_seconds, seconds_per_megapixel=min(took[1:]) * 1e6 / len(pixels))
