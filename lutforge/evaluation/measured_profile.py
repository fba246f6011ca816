"""Measure a calibration on shots that were left out."""

from dataclasses import replace
from functools import partial

import numpy as np

from lutforge.calibration.calibrate import CalibratedStyle, Calibration
from lutforge.calibration.options import CalibrationOptions
from lutforge.errors import CalibrationError
from lutforge.evaluation.errors_table import error_figures
from lutforge.evaluation.expected_error import expected_errors, held_out_errors
from lutforge.evaluation.held_out import Predictions, predict
from lutforge.evaluation.methods import BASELINES, LATTICE, RBF
from lutforge.model.camera_profile import CameraProfile
from lutforge.model.profile_data import PictureStyle
from lutforge.progress import Progress, part


def measured(calibration: Calibration, options: CalibrationOptions, progress: Progress) -> CameraProfile:
    """Return the calibrated profile with its errors on shots left out, and notes on what makes them weak."""
    profile = calibration.profile
    styles, notes = dict(profile.styles), list(profile.notes)
    for index, (name, style) in enumerate(calibration.styles.items()):
        within = part(progress, index / len(calibration.styles), (index + 1) / len(calibration.styles), name)
        styles[name], weak = _measured(name, profile.styles[name], style, options, within)
        notes.extend(f"{name}: {note}" for note in weak)
    progress("done", 1.0)
    return replace(profile, styles=styles, notes=tuple(notes))


def _measured(
    name: str, model: PictureStyle, style: CalibratedStyle, options: CalibrationOptions, progress: Progress
) -> tuple[PictureStyle, list[str]]:
    """One style with its errors, and what makes its calibration weak."""
    data, weak = style.data, []
    shots = tuple(str(shot) for shot in np.unique(data.shot))
    refitted = partial(progress, "held-out error")
    refitted(0.0)
    if len(data.shot) < 500:
        weak.append(f"only {len(data.shot)} samples: colours between them are guessed from the matrix and response")
    if len(shots) < 2:
        weak.append("one shot only: no shot is left to measure the error on; add another of other colours")
        return model, weak
    try:
        found = predict(model, name, data, shots, options, own_only=True, progress=refitted)
    except CalibrationError:
        weak.append("too few samples to leave a shot out: the error is not known")
        return model, weak
    own = RBF if options.model == "rbf" else LATTICE
    errors = _errors(found, own)
    if not errors:
        reasons = f" ({'; '.join(found.notes)})" if found.notes else ""
        weak.append(f"without one of its shots the rest does not suffice, so the error is not known{reasons}")
    weak.extend(_worse_than_baselines(found, errors))
    model = replace(model, errors=errors)
    held_out = held_out_errors(found, own, data.base)
    for direction, values in held_out.items():
        at_sample, per_deviation = values.coefficients()
        errors |= {f"{direction}_at_sample": float(at_sample), f"{direction}_per_deviation": float(per_deviation)}
    return replace(model, expected=expected_errors(model, held_out, data.base, data.balanced, data.encoded)), weak


def _errors(found: Predictions, own: str) -> dict[str, float]:
    """The figures that a profile keeps, by name; none where a sample was not predicted."""
    errors = {}
    for direction, values_by_method in found.predicted.items():
        if found.data.monochrome and direction == "linearize":
            continue  # the colour that its JPEGs do not hold would count
        predicted = values_by_method.get(own)
        if predicted is None or not np.all(np.isfinite(predicted)):
            return {}
        measured = found.data.both[direction][1]
        values = error_figures(np.clip(predicted, 0.0, 1.0), measured, display=direction == "render")
        errors[f"{direction}_mean"] = values.mean
        errors[f"{direction}_max"] = values.maximum
        if values.de00_mean is not None:
            errors[f"{direction}_de00_mean"] = values.de00_mean
    return errors


def _worse_than_baselines(found: Predictions, errors: dict[str, float]) -> list[str]:
    """A note for each direction in which a plain method predicts the left-out shots better than the model does."""
    notes = []
    for direction, values in found.predicted.items():
        wanted = found.data.both[direction][1]
        own = errors.get(f"{direction}_mean", np.inf)
        plain = {
            method: float(np.linalg.norm(np.clip(values[method], 0.0, 1.0) - wanted, axis=1).mean())
            for method in BASELINES
        }
        best = min(plain, key=lambda method: plain[method])
        if np.isfinite(own) and own > 1.02 * plain[best]:
            notes.append(
                f"to {direction} shots that were left out, {best} alone is nearer ({plain[best]:.4f}, this model "
                f"{own:.4f}): these shots tell too little; add shots of other colours"
            )
    return notes
