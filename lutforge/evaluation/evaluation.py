"""The thesis's error tables of a profile on samples, held out by shot, and of plain baselines (chapters 4 to 6).

The result is records, and one JSON document with stable keys.

    format        "lutforge-evaluation"; version: 1 (a key that exists keeps its meaning; new ones may be added)
    camera        the profile's; tables: whether it has the thesis's tables
    rows          chapter 5: one entry per direction, style, shot ("all", and all_shots true: together) and method, with
                  held_out, count, mean, maximum, q1, median, q3 (of the Euclidean norm of the RGB difference, 1 = full
                  scale), rmse (over channels), de00_mean, de00_max (null where the values are not display colours),
                  fit_seconds and seconds_per_megapixel (null where they were not measured)
    raw           Fig. 4.5: JPEG → RAW before white balance: style, method, held_out, count, rmse, rmse_rgb
    linearization  equation (4.11): style, method, held_out, pairs, delta (r, g, b)
    edited        ΔE00 after exposure and white balance are changed: style, method, held_out, count, and de00, the means
                  by edit ("+2 EV", "warmer" …)
    refinish      Fig. 6.2: source, target (STYLE/WB), method, held_out, shots, and figures as in rows
    departures    shots that deviate from the fixed rendering: shot, values and errors (exposure, contrast, saturation,
                  red and blue of the white balance), clear (which of them are significant)
    notes         sentences

Directions are "render" (RAW → JPEG) and "linearize" (JPEG → white-balanced RAW). Methods are "camera model" and
"lattice" (the profile's own), "f and T, no h", "matrix and response", "polynomial per channel", "polynomial of all
channels"; in the thesis's tables also "thesis's camera model" (chapter 4), "uniform lattice N", "nonuniform lattice N"
and "lattice by (5.3) N" (the thesis's baseline); and under refinish "unchanged".
"""

import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np

from lutforge.arrays import Array, Mask
from lutforge.calibration.deviations import Deviation
from lutforge.calibration.lattice.monochrome import is_monochrome, monochrome_note
from lutforge.calibration.setting_gains import gains_of, multiplied_by_gains
from lutforge.calibration.shot_comparison import ShotCheck, compare_shots
from lutforge.calibration.style import style_data, styles_with_enough, unclipped
from lutforge.calibration.vignetting import at_the_centre
from lutforge.calibration.white_balance import complete_multipliers
from lutforge.errors import CalibrationError
from lutforge.evaluation.edit_errors import edited_errors
from lutforge.evaluation.figures import ErrorFigures, error_figures
from lutforge.evaluation.linearization_errors import linearization_errors
from lutforge.evaluation.methods import CAMERA_MODEL, LATTICE
from lutforge.evaluation.predictions import Predictions, predict
from lutforge.evaluation.raw_errors import MethodError, raw_errors
from lutforge.evaluation.refinish_errors import RefinishError, refinish_errors
from lutforge.model.camera_profile import CameraProfile
from lutforge.model.profile import Direction
from lutforge.model.provenance import ResponseOnly
from lutforge.model.reference_raw import with_own_raw
from lutforge.progress import Progress, part, silent
from lutforge.samples.sample_set import SampleSet
from lutforge.thesis.options import stated_options


@dataclass(frozen=True)
class EvaluationRow:
    """One row of the error table.

    direction: "render" or "linearize"; shot: a name, or "all" where all_shots is true; method: of the prediction;
    held_out: its fit had not seen the shot. fit_seconds: the median over its fits; seconds_per_megapixel: of its
    evaluation; None where they were not measured.
    """

    direction: Direction
    style: str
    shot: str
    all_shots: bool
    method: str
    held_out: bool
    figures: ErrorFigures
    fit_seconds: float | None = None
    seconds_per_megapixel: float | None = None


@dataclass(frozen=True)
class Evaluation:
    """The result of an evaluation.

    rows: the error table; raw, linearization, edited, refinish: the other tables; notes: on what was left out, and why;
    predictions: by style, from which the rows are computed; deviations: of shots. The values of raw are the root mean
    squares over all channels ("RMSE") and of each channel.
    """

    camera: str
    rows: tuple[EvaluationRow, ...]
    notes: tuple[str, ...]
    raw: tuple[MethodError, ...] = ()
    linearization: tuple[MethodError, ...] = ()
    refinish: tuple[RefinishError, ...] = ()
    edited: tuple[MethodError, ...] = ()
    tables: bool = False
    predictions: Mapping[str, Predictions] = field(default_factory=dict, repr=False)  # long arrays
    deviations: tuple[Deviation, ...] = ()

    def as_json(self) -> dict[str, object]:
        """The JSON document that the docstring of this module describes."""
        return {
            "format": "lutforge-evaluation",
            "version": 1,
            "camera": self.camera,
            "tables": self.tables,
            "rows": [_plain(row) for row in self.rows],
            "raw": [
                _plain(row) | {"rmse": row.values["RMSE"], "rmse_rgb": [row.values[channel] for channel in "RGB"]}
                for row in self.raw
            ],
            "linearization": [
                {
                    "style": row.style, "method": row.method, "held_out": row.held_out, "pairs": row.count,
                    "delta": [row.values[channel] for channel in "RGB"],
                }
                for row in self.linearization
            ],
            "departures": [asdict(deviation) for deviation in self.deviations],
            "edited": [_plain(row) | {"de00": row.values} for row in self.edited],
            "refinish": [_plain(row) for row in self.refinish],
            "notes": list(self.notes),
        }  # fmt: skip


def _plain(row: Any) -> dict[str, object]:
    """The values of a table's row by name, including its figures."""
    values: dict[str, Any] = asdict(row)
    values.pop("values", None)
    figures: dict[str, object] = values.pop("figures", {})
    return values | figures


def error_rows(style: str, predictions: Predictions) -> Iterator[EvaluationRow]:
    """The rows of each direction and method: of all shots together, and for the profile's own models of each shot."""
    data = predictions.data
    for direction, predicted in predictions.predicted.items():
        display = direction == "render"
        measured = data.both[direction][1]
        for method in predictions.methods:
            values = np.clip(predicted[method], 0.0, 1.0)
            finite = np.all(np.isfinite(values), axis=1)
            parts = [("all", True, finite)]
            if method in (LATTICE, CAMERA_MODEL):
                parts += [(str(shot), False, finite & (data.shot == shot)) for shot in np.unique(data.shot[finite])]
            for shot, all_shots, rows in parts:
                figures = error_figures(values[rows], measured[rows], display=display)
                held_out = bool(np.all(predictions.held_out[rows]))
                yield EvaluationRow(direction, style, shot, all_shots, method, held_out, figures)


def evaluate(
    profile: CameraProfile,
    samples: SampleSet,
    progress: Progress = silent,
    *,
    tables: bool = False,
    sizes: Sequence[int] = (13, 17, 24),
) -> Evaluation:
    """Measure errors of both directions, per shot and over all shots, for the profile's models and the baselines.

    A shot that the profile was calibrated from is predicted by a refit without it, any other by the profile itself.
    tables: measure every method of the thesis's tables, with its times; sizes: nodes per axis of the lattices in these.
    Raises CalibrationError where the samples hold none of the profile's styles.
    """
    if isinstance(profile.provenance, ResponseOnly):
        raise CalibrationError(
            f"the profile of {profile.camera} holds a response alone, found without RAW: samples of RAW cannot show "
            "its error; lutforge response prints it"
        )
    samples = at_the_centre(with_own_raw(profile, samples), profile.vignettings)
    multipliers, balance_notes = complete_multipliers(samples)
    multipliers = multiplied_by_gains(samples, multipliers, gains_of(profile.white_balances))
    in_profile, style_notes = known_styles(profile, samples)
    samples = samples.select(in_profile)
    multipliers = multipliers[in_profile]
    data, clipped = style_data(samples, multipliers)
    notes = [*balance_notes, *style_notes, *styles_with_enough(samples, multipliers)[1]]
    notes += _notes_on_shots(profile, samples, clipped, tables)

    options = stated_options(profile.options)
    predictions = dict[str, Predictions]()
    for index, (name, style) in enumerate(data.items()):
        of_style = partial(part(progress, index / len(data), (index + 1) / len(data), name), "leaving shots out")
        predictions[name] = predict(
            profile.styles[name], name, style, profile.shots, options, sizes=sizes if tables else (), progress=of_style
        )
        notes += [*predictions[name].notes, *([monochrome_note(name)] if style.monochrome else [])]

    shots = compare_with_profile(profile, samples, multipliers)
    notes += [
        f"{deviation.shot} deviates from the fixed rendering: {deviation.words}" for deviation in shots.deviations
    ]
    notes += [str(groups.diagnosis) for groups in shots.groups]
    by_style = predictions.items()
    rows = [row for name, of_style in by_style for row in error_rows(name, of_style)]
    evaluation = Evaluation(
        camera=profile.camera,
        rows=tuple(_timed(rows, predictions) if tables else rows),
        notes=tuple(notes),
        raw=tuple(row for name, predicted in by_style for row in raw_errors(name, predicted)),
        linearization=tuple(
            row for name, predicted in by_style for row in linearization_errors(name, predicted, profile.matrix)
        ),
        edited=tuple(row for name, predicted in by_style for row in edited_errors(name, predicted)),
        refinish=refinish_errors(predictions),
        deviations=shots.deviations,
        tables=tables,
        predictions=predictions,
    )
    progress("done", 1.0)
    return evaluation


def _notes_on_shots(profile: CameraProfile, samples: SampleSet, clipped: int, tables: bool) -> Iterator[str]:
    """Notes on clipped samples, and on shots of the calibration that are missing. tables: the thesis's are measured."""
    if clipped:
        yield f"{clipped} of {len(samples)} samples are clipped and are not counted"
    missing = sum(shot not in samples.shot for shot in profile.shots)
    if 0 < missing < len(profile.shots):
        yield (
            f"{missing} of the {len(profile.shots)} shots of the calibration are not among these: the refits without "
            "each of the others see fewer colours than the profile did; give all for its error"
        )
    if tables and not np.isin(samples.shot, profile.shots).any():
        yield "no shot of the calibration is among these: add them for the baselines and the lattice sizes"


def compare_with_profile(profile: CameraProfile, samples: SampleSet, multipliers: Array) -> ShotCheck:
    """Compare the JPEG values of each style's shots with the profile's rendering of their RAW."""
    usable = unclipped(samples, multipliers)
    checks = list[ShotCheck]()
    for name, style in profile.styles.items():
        rows = usable & (samples.style == name)
        if style.render is None or style.linearize is None or not rows.any():
            continue
        balanced = samples.raw[rows] * multipliers[rows]
        encoded = samples.srgb[rows]
        if not is_monochrome(balanced, encoded):
            known = bool(np.isfinite(samples.wb[rows]).all())
            rendered, shot = style.render(balanced), samples.shot[rows]
            checks.append(compare_shots(rendered, encoded, shot, style.linearize, balances_known=known))
    return ShotCheck.of(checks)


def scene_deviations(profile: CameraProfile, samples: SampleSet) -> tuple[Deviation, ...]:
    """The deviations of shots from the fixed rendering, of styles that the profile has."""
    samples = at_the_centre(with_own_raw(profile, samples), profile.vignettings)
    multipliers, _ = complete_multipliers(samples)
    multipliers = multiplied_by_gains(samples, multipliers, gains_of(profile.white_balances))
    shots = compare_with_profile(profile, samples, multipliers)
    return shots.deviations + tuple(groups.deviation for groups in shots.groups)


def known_styles(profile: CameraProfile, samples: SampleSet) -> tuple[Mask, tuple[str, ...]]:
    """Mask (n,) of the samples of styles that the profile has, and notes on the others. Raises CalibrationError."""
    notes = []
    other_cameras = [str(name) for name in np.unique(samples.camera) if name != profile.camera]
    if other_cameras:
        notes.append(f"the profile is of {profile.camera}, the samples are of {', '.join(other_cameras)}")
    in_profile = np.isin(samples.style, list(profile.styles))
    if not in_profile.any():
        raise CalibrationError(
            f"the samples' styles ({', '.join(np.unique(samples.style))}) are not in the profile "
            f"({', '.join(profile.styles)})"
        )
    if not in_profile.all():
        missing = ", ".join(np.unique(samples.style[~in_profile]))
        notes.append(f"the samples of {missing} are not counted: not in the profile")
    return in_profile, tuple(notes)


def _timed(rows: Iterable[EvaluationRow], predictions: dict[str, Predictions]) -> Iterable[EvaluationRow]:
    """The rows over all shots with the times of their methods."""
    pixels = np.random.default_rng(0).random((1 << 17, 3))
    for row in rows:
        fits = [fitted[row.method] for fitted in predictions[row.style].fits if row.method in fitted]
        if not row.all_shots or not fits:
            yield row
            continue
        of_fits = [seconds for fit in fits if (seconds := fit.seconds[row.direction]) is not None]
        evaluate_pixels = fits[-1][row.direction]
        durations = []
        for block in (pixels[:1], pixels, pixels, pixels):  # the first call compiles
            start = time.perf_counter()
            evaluate_pixels(block)
            durations.append(time.perf_counter() - start)
        fit_seconds = float(np.median(of_fits)) if of_fits else None
        yield replace(row, fit_seconds=fit_seconds, seconds_per_megapixel=min(durations[1:]) * 1e6 / len(pixels))
