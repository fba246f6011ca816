"""The error of a calibration on shots that its fits have not seen: refits without each shot in turn."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lutforge.calibration.calibrate import Calibration
from lutforge.calibration.lattice.lattice_fit import MEASURING_TOLERANCE
from lutforge.calibration.options import CalibrationOptions
from lutforge.calibration.physical.physical_model import GamutMaps, linearize, render
from lutforge.calibration.style_data import LEAST_SAMPLES, StyleData
from lutforge.calibration.style_fit import StyleFit, fit_style, refit_physical
from lutforge.errors import CalibrationError
from lutforge.evaluation.errors_table import ErrorFigures, error_figures
from lutforge.model.camera_profile import CameraProfile
from lutforge.solvers.cross_validation import leave_groups_out

Array = NDArray[np.float64]

FEW_SAMPLES = 500


@dataclass(frozen=True, eq=False)
class HeldOut:
    """Predictions of samples by fits that did not see their shot. rendered: I (n, 3); linearized: Tw E (n, 3)."""

    rendered: Array
    linearized: Array


def _predict(
    data: StyleData, options: CalibrationOptions, smoothness: tuple[float, float] | None, most_folds: int
) -> HeldOut:
    """Refit without each shot (or each of `most_folds` groups of shots) and predict it. Needs two shots or more."""
    rendered, linearized = np.empty_like(data.encoded), np.empty_like(data.balanced)
    for mask in leave_groups_out(data.shot, most_folds):
        fit = fit_style(data.select(~mask), options, smoothness, tolerance=MEASURING_TOLERANCE)
        rendered[mask] = np.clip(fit.render.lattice(data.balanced[mask]), 0.0, 1.0)
        linearized[mask] = np.clip(fit.linearize.lattice(data.encoded[mask]), 0.0, 1.0)
    return HeldOut(rendered, linearized)


def _predict_physical(data: StyleData, maps: GamutMaps, options: CalibrationOptions, most_folds: int) -> HeldOut:
    """The same with the physical model. Raises CalibrationError where the rest of the shots does not determine it."""
    rendered, linearized = np.empty_like(data.encoded), np.empty_like(data.balanced)
    nuggets = (maps.nugget, maps.inverse_nugget)
    for mask in leave_groups_out(data.shot, most_folds):
        model = refit_physical(data.select(~mask), options, maps.model.white_balances, nuggets).model
        rendered[mask] = render(model, data.balanced[mask])
        linearized[mask] = np.clip(linearize(model, data.encoded[mask]), 0.0, 1.0)
    return HeldOut(rendered, linearized)


def with_held_out_errors(
    calibration: Calibration, options: CalibrationOptions, progress: Callable[[str, float], None]
) -> CameraProfile:
    """The calibrated profile with the errors of its styles on shots left out, and notes on what makes them weak."""
    profile = calibration.profile
    styles, notes = dict(profile.styles), list(profile.notes)
    for index, (name, style) in enumerate(calibration.styles.items()):
        progress(f"{name}: held-out error", index / len(calibration.styles))
        errors, weak = held_out_error(style.data, style.fit, options, style.maps)
        notes.extend(f"{name}: {note}" for note in weak)
        styles[name] = replace(styles[name], errors=errors)
    progress("done", 1.0)
    return replace(profile, styles=styles, notes=tuple(notes))


def held_out_error(
    data: StyleData, fit: StyleFit, options: CalibrationOptions, maps: GamutMaps | None
) -> tuple[dict[str, float], tuple[str, ...]]:
    """Held-out figures of the model asked for by name, and what makes this style's calibration weak."""
    weak = []
    shots = np.unique(data.shot)
    if len(data.shot) < FEW_SAMPLES:
        weak.append(f"only {len(data.shot)} samples: colours between them are guessed from the matrix and response")
    if len(shots) < 2:
        weak.append("one shot only: no shot is left to measure the error on; add another of other colours")
        return {}, tuple(weak)
    if any((~mask).sum() < LEAST_SAMPLES for mask in leave_groups_out(data.shot)):
        weak.append("too few samples to leave a shot out: the error is not known")
        return {}, tuple(weak)
    if maps is None:
        smoothness = (fit.render.smoothness, fit.linearize.smoothness)
        held = _predict(data, options, smoothness, most_folds=5)
    else:
        try:
            held = _predict_physical(data, maps, options, most_folds=5)
        except CalibrationError as error:
            weak.append(f"without one of its shots the rest does not suffice, so the error is not known ({error})")
            return {}, tuple(weak)
    return _figures(held, data), tuple(weak)


def _figures(held: HeldOut, data: StyleData) -> dict[str, float]:
    figures: dict[str, ErrorFigures] = {
        "render": error_figures(held.rendered, data.encoded, display=True),
    }
    if not data.monochrome:  # else the colour that its JPEGs do not hold would count
        figures["linearize"] = error_figures(held.linearized, data.balanced, display=False)
    errors = {}
    for direction, values in figures.items():
        errors[f"{direction}_mean"] = values.mean
        errors[f"{direction}_max"] = values.maximum
        if values.de00_mean is not None:
            errors[f"{direction}_de00_mean"] = values.de00_mean
    return errors
