"""Measure a calibration on shots that were left out."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from scipy.optimize import nnls

from lutforge.arrays import Array
from lutforge.calibration.gamut_map import posterior_deviation
from lutforge.calibration.matrix_and_response import encoding_slope
from lutforge.calibration.style import StyleData
from lutforge.errors import CalibrationError
from lutforge.evaluation.figures import error_figures
from lutforge.evaluation.methods import BASELINES, LATTICE, MODEL
from lutforge.evaluation.polynomials import Predictor
from lutforge.evaluation.predictions import Predictions, predict
from lutforge.interpolation import interpolate
from lutforge.model.camera_profile import CameraProfile
from lutforge.model.gamut_map import OFFSET, even_slope
from lutforge.model.lattice import grid
from lutforge.model.profile import ByDirection, Direction, PictureStyle
from lutforge.progress import Progress, part
from lutforge.thesis.options import Options
from lutforge.threads import one_blas_thread


@one_blas_thread
def measured(
    profile: CameraProfile, data: Mapping[str, StyleData], options: Options, progress: Progress
) -> CameraProfile:
    """Return a profile with its errors on shots of its data, by style, left out, and notes on what makes them weak."""
    styles, notes = dict(profile.styles), list(profile.notes)
    for index, (name, style) in enumerate(data.items()):
        within = part(progress, index / len(data), (index + 1) / len(data), name)
        styles[name], weak = _measured(name, profile.styles[name], style, options, within, bool(profile.diagnoses))
        notes.extend(f"{name}: {note}" for note in weak)
    progress("done", 1.0)
    return replace(profile, styles=styles, notes=tuple(notes))


def _measured(
    name: str, model: PictureStyle, data: StyleData, options: Options, progress: Progress, spoilt: bool
) -> tuple[PictureStyle, list[str]]:
    """One style with its errors, and what makes its calibration weak. spoilt: a cause was diagnosed."""
    weak = []
    shots = tuple(str(shot) for shot in np.unique(data.shot))
    refitted = partial(progress, "held-out error")
    refitted(0.0)
    if len(data.shot) < 500:
        weak.append(f"only {len(data.shot)} samples: colours between them are guessed from the matrix and response")
    if len(shots) < 2:
        weak.append("one shot only: no shot is left to measure the error on; add another of other colours")
        return model, weak
    if len(np.unique(data.scene)) < 2:
        weak.append(
            "the shots are of one scene, copies or a burst: the error on others is not known; add another scene"
        )
        return model, weak
    try:
        predictions = predict(model, name, data, shots, options, progress=refitted)
    except CalibrationError:
        weak.append("too few samples to leave a shot out: the error is not known")
        return model, weak
    method = LATTICE if LATTICE in predictions.methods else MODEL
    errors = _errors(predictions, method)
    if not errors:
        reasons = f" ({'; '.join(predictions.notes)})" if predictions.notes else ""
        weak.append(f"without one of its shots the rest does not suffice, so the error is not known{reasons}")
    weak.extend(_worse_than_baselines(predictions, errors, spoilt))
    model = replace(model, errors=errors)
    held_out = held_out_errors(predictions, method)
    for direction, values in held_out.items():
        at_sample, per_deviation = values.coefficients()
        errors |= {f"{direction}_at_sample": float(at_sample), f"{direction}_per_deviation": float(per_deviation)}
    return replace(model, expected=expected_errors(model, held_out, data)), weak


def _errors(predictions: Predictions, method: str) -> dict[str, float]:
    """The figures that a profile keeps, by name; none where a sample was not predicted."""
    errors = {}
    for direction, values_by_method in predictions.predicted.items():
        if predictions.data.monochrome and direction == "linearize":
            continue  # the colour that its JPEGs do not hold would count
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


def _worse_than_baselines(predictions: Predictions, errors: dict[str, float], spoilt: bool) -> list[str]:
    """A note for each direction in which a plain method predicts the left-out shots better than the model does.

    spoilt: something was diagnosed of the samples, which more of them would not help.
    """
    notes = []
    reason = (
        "see what is wrong with the samples" if spoilt else "these shots tell too little; add shots of other colours"
    )
    for direction, values in predictions.predicted.items():
        wanted = predictions.data.both[direction][1]
        error = errors.get(f"{direction}_mean", np.inf)
        plain = {
            method: float(np.linalg.norm(np.clip(values[method], 0.0, 1.0) - wanted, axis=1).mean())
            for method in BASELINES
        }
        best = min(plain, key=lambda method: plain[method])
        if np.isfinite(error) and error > 1.02 * plain[best]:
            notes.append(
                f"to {direction} shots that were left out, {best} alone is nearer ({plain[best]:.4f}, this model "
                f"{error:.4f}): {reason}"
            )
    return notes


# --- The expected error at any colour: the deviation of the fitted process, in units of held-out errors --------------
# Held-out samples give e = a + b · σ by nonnegative least squares, for each direction. σ is the posterior standard
# deviation of the gamut map (`calibration.gamut_map`), which is small near samples and grows away from them,
# times the slope of the encoding. Errors are norms of encoded RGB; linearized light is compared after matrix and
# response have rendered it.


@dataclass(frozen=True, eq=False)
class HeldOut:
    """The held-out samples of one direction, each (n,).

    deviation: σ given the samples of the fit that predicts one; error: of the prediction.
    """

    deviation: Array
    error: Array

    def coefficients(self) -> Array:
        """Return the coefficients a and b of the expected error, (2,), by nonnegative least squares."""
        coefficients, _ = nnls(np.column_stack([np.ones_like(self.deviation), self.deviation]), self.error)
        return np.asarray(coefficients)


def held_out_errors(predictions: Predictions, method: str) -> dict[Direction, HeldOut]:
    """Measure held-out samples by direction. method: the one that the profile has.

    It is empty where the samples are too few, or where one fit predicts them all: what it was fitted to is not there.
    """
    data, rows = predictions.data, predictions.held_out.copy()
    for values in predictions.predicted:
        rows &= np.isfinite(values[method]).all(axis=1) if method in values else False
    if rows.sum() < 24 or data.monochrome or len(np.unique(predictions.fold)) < 2:
        return {}
    base, deviation = data.base, ByDirection(np.zeros(len(rows)), np.zeros(len(rows)))
    for fold in np.unique(predictions.fold[rows]):
        inside, train = rows & (predictions.fold == fold), predictions.fold != fold
        of_codes = deviations(data, data.balanced[train], data.encoded[train])
        for direction, of_fold in of_codes.items():
            deviation[direction][inside] = of_fold(data.both[direction][0][inside], data.encoded[inside])
    encoders = ByDirection[Predictor](lambda rendered: np.clip(rendered, 0.0, 1.0), base.render)
    errors: dict[Direction, HeldOut] = {}
    for direction, values in predictions.predicted.items():
        encode = encoders[direction]
        residual = encode(values[method][rows]) - encode(data.both[direction][1][rows])
        errors[direction] = HeldOut(deviation[direction][rows], np.linalg.norm(residual, axis=1))
    return errors


def deviations(data: StyleData, balanced: Array, encoded: Array) -> ByDirection[Callable[[Array, Array], Array]]:
    """σ by direction, given some of a style's samples, Tw E → I, both (n, 3).

    A function of the colours (…, 3) that the direction takes, and of their JPEG codes.
    """
    base = data.base
    roughness = data.model.gamut_map.roughness
    of_light = posterior_deviation(balanced @ base.matrix.T, roughness)
    of_codes = posterior_deviation(base.response.linearize(encoded), roughness)

    def slope(codes: Array) -> Array:
        flat = codes.reshape(-1, 3)
        slopes = encoding_slope(base.response, flat) / even_slope(base.response.linearize(flat), OFFSET)
        return np.asarray(slopes.mean(axis=1).reshape(codes.shape[:-1]))

    return ByDirection(
        lambda light, codes: of_light(light @ base.matrix.T) * slope(codes),
        lambda _, codes: of_codes(base.response.linearize(codes)) * slope(codes),
    )


def expected_errors(
    style: PictureStyle, held_out: Mapping[Direction, HeldOut], data: StyleData
) -> dict[Direction, Array]:
    """The expected error at the nodes of a style's lattices, by direction, (N_r, N_g, N_b).

    It is computed at every second node, which is as closely as it varies.
    """
    deviation, result = deviations(data, data.balanced, data.encoded), {}
    for direction, errors in held_out.items():
        lattice = style.lattices.get(direction)
        if lattice is None:
            continue
        red, green, blue = (np.unique(np.append(level[::2], level[-1])) for level in lattice.levels)
        coarse = lattice.from_axes(grid((red, green, blue)))
        codes = np.clip(lattice(coarse), 0.0, 1.0) if direction == "render" else coarse
        at_sample, by_deviation = errors.coefficients()
        expected = at_sample + by_deviation * deviation[direction](coarse, codes)
        values = expected[..., None].repeat(3, axis=-1)
        result[direction] = interpolate(grid(lattice.levels), (red, green, blue), values, "trilinear")[..., 0]
    return result
