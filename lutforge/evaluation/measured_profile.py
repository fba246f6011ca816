"""The held-out errors of a calibration: each shot is predicted by a fit to the others."""

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from lutforge.calibration.style import StyleData
from lutforge.errors import CalibrationError
from lutforge.evaluation.figures import error_figures
from lutforge.evaluation.methods import BASELINES, CAMERA_MODEL, LATTICE
from lutforge.evaluation.predictions import Predictions, predict
from lutforge.model.camera_profile import CameraProfile
from lutforge.model.profile import PictureStyle
from lutforge.progress import Progress, of_tasks
from lutforge.thesis.options import Options
from lutforge.threads import each, one_blas_thread


@one_blas_thread
def measured(
    profile: CameraProfile, data: Mapping[str, StyleData], options: Options, progress: Progress
) -> CameraProfile:
    """The profile with its errors on held-out shots, by style, and with notes on styles whose calibration is weak."""
    progress("held-out error", 0.0)

    def of_style(task: tuple[str, Callable[[float], None]]) -> tuple[PictureStyle, list[str]]:
        name, report = task
        return _measured(name, profile.styles[name], data[name], options, report, bool(profile.diagnoses))

    styles = dict(profile.styles)
    notes = list(profile.notes)
    tasks = list(zip(data, of_tasks(progress, "held-out error", len(data)), strict=True))
    for name, (style, weaknesses) in zip(data, each(of_style, tasks), strict=True):
        styles[name] = style
        notes.extend(f"{name}: {note}" for note in weaknesses)
    progress("done", 1.0)
    return replace(profile, styles=styles, notes=tuple(notes))


def _measured(
    name: str,
    style: PictureStyle,
    data: StyleData,
    options: Options,
    report: Callable[[float], None],
    is_diagnosed: bool,
) -> tuple[PictureStyle, list[str]]:
    """A style with its errors, and notes on why its calibration is weak.

    report: called with the share that is done; is_diagnosed: the samples have a fault.
    """
    notes = []
    shots = tuple(str(shot) for shot in np.unique(data.shot))
    if len(data.shot) < 500:
        notes.append(f"only {len(data.shot)} samples: colours between them are guessed from the matrix and response")
    if len(shots) < 2:
        notes.append("one shot only: no shot is left to measure the error on; add another of other colours")
        return style, notes
    scenes = len(np.unique(data.scene))
    if scenes < 2:
        notes.append(
            "the shots are of one scene, copies or a burst: the error on others is not known; add another scene"
        )
        return style, notes
    if scenes == 2 and len(shots) > 2:
        notes.append(
            f"the {len(shots)} shots are of two scenes, and each was predicted from the other alone: the error of "
            "both together is likely smaller, and not known; add a third scene"
        )
    try:
        predictions = predict(style, name, data, shots, options, progress=report)
    except CalibrationError:
        notes.append("too few samples to leave a shot out: the error is not known")
        return style, notes

    method = LATTICE if LATTICE in predictions.methods else CAMERA_MODEL
    errors = _errors(predictions, method)
    if not errors:
        reasons = f" ({'; '.join(predictions.notes)})" if predictions.notes else ""
        notes.append(f"without one of its shots the rest does not suffice, so the error is not known{reasons}")
    notes.extend(_worse_than_baselines(predictions, errors, is_diagnosed))
    return replace(style, errors=errors), notes


def _errors(predictions: Predictions, method: str) -> dict[str, float]:
    """The figures that a profile keeps, by name; empty where a sample was not predicted."""
    errors = {}
    for direction, values_by_method in predictions.predicted.items():
        if predictions.data.monochrome and direction == "linearize":
            continue  # black-and-white JPEGs do not hold the colours of the RAW
        predicted = values_by_method.get(method)
        if predicted is None or not np.all(np.isfinite(predicted)):
            return {}
        measured = predictions.data.both[direction][1]
        values = error_figures(np.clip(predicted, 0.0, 1.0), measured, display=direction == "render")
        errors[f"{direction}_mean"] = values.mean
        errors[f"{direction}_max"] = values.maximum
        if values.de00_mean is not None:
            errors[f"{direction}_de00_mean"] = values.de00_mean
    return errors


def _worse_than_baselines(predictions: Predictions, errors: dict[str, float], is_diagnosed: bool) -> list[str]:
    """A note for each direction in which a plain method predicts held-out shots better than the model does.

    is_diagnosed: the samples have a fault, so that more of them would not help.
    """
    notes = []
    fault = "see what is wrong with the samples"
    reason = fault if is_diagnosed else "these shots show too few colours; add shots of other colours"
    for direction, values in predictions.predicted.items():
        measured = predictions.data.both[direction][1]
        error = errors.get(f"{direction}_mean", np.inf)
        baselines = {
            method: float(np.linalg.norm(np.clip(values[method], 0.0, 1.0) - measured, axis=1).mean())
            for method in BASELINES
        }
        best = min(baselines, key=lambda method: baselines[method])
        if np.isfinite(error) and error > 1.02 * baselines[best]:
            notes.append(
                f"to {direction} shots that were left out, {best} alone is nearer ({baselines[best]:.4f}, this model "
                f"{error:.4f}): {reason}"
            )
    return notes
