"""From samples to a camera profile: the stages of the calibration in order."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lutforge.calibration.errors_table import ErrorFigures, error_figures
from lutforge.calibration.lattice import LatticeResult, fit_samples, folds
from lutforge.calibration.matrix_and_response import MatrixAndResponse, fit_matrix_and_response
from lutforge.calibration.options import CalibrationOptions
from lutforge.calibration.white_balance import complete_multipliers, named_white_balances
from lutforge.errors import CalibrationError
from lutforge.model.camera_profile import CameraProfile, PictureStyle
from lutforge.samples.sample_set import SampleSet

Array = NDArray[np.float64]
Progress = Callable[[str, float], None]
"""Called with what is being done and the share that is done, 0 … 1."""

LEAST_SAMPLES = 10
FEW_SAMPLES = 500
CODE = 1.0 / 255.0


@dataclass(frozen=True, eq=False)
class StyleData:
    """The fitting samples of one style. balanced: Tw E (n, 3); encoded: I (n, 3); shot: (n,)."""

    balanced: Array
    encoded: Array
    shot: NDArray[np.str_]

    def select(self, rows: NDArray[np.bool_]) -> "StyleData":
        """The rows of a mask."""
        return StyleData(self.balanced[rows], self.encoded[rows], self.shot[rows])


@dataclass(frozen=True, eq=False)
class StyleFit:
    """base: the matrix and response that the lattices continue; render: Tw E → I; linearize: I → Tw E."""

    base: MatrixAndResponse
    render: LatticeResult
    linearize: LatticeResult


def _silent(what: str, share: float) -> None:
    pass


def calibrate(
    samples: SampleSet, options: CalibrationOptions | None = None, progress: Progress = _silent
) -> CameraProfile:
    """Fit a profile: white balances, matrix, and per style the lattices of both directions with held-out errors.

    Raises CalibrationError, in one line with what to do, where the samples do not determine it.
    """
    options = options or CalibrationOptions()
    _check_one_camera(samples)
    camera = str(samples.camera[0])
    multipliers, notes = complete_multipliers(samples)
    data, clipped = style_data(samples, multipliers)
    if clipped:
        notes = (*notes, f"{clipped} of {len(samples)} samples are clipped and take no part in the fit")
    styles, matrices = {}, {}
    for index, (name, style) in enumerate(data.items()):
        share = index / len(data)
        progress(f"{name}: fitting", share)
        fit = fit_style(style, options)
        progress(f"{name}: held-out error", share + 0.5 / len(data))
        errors, weak = _held_out(style, fit, options)
        notes = (*notes, *(f"{name}: {note}" for note in weak))
        styles[name] = PictureStyle(
            render=fit.render.lattice,
            linearize=fit.linearize.lattice,
            errors=errors,
            coverage={"render": fit.render.coverage, "linearize": fit.linearize.coverage},
        )
        matrices[name] = (len(style.shot), fit.base.matrix)
    progress("done", 1.0)
    return CameraProfile(
        camera=camera,
        matrix=max(matrices.values(), key=lambda entry: entry[0])[1],
        white_balances=named_white_balances(samples, multipliers),
        styles=styles,
        shots=tuple(name for name, _ in samples.by_shot()),
        options=options.as_json(),
        notes=notes,
    )


def _check_one_camera(samples: SampleSet) -> None:
    if not len(samples):
        raise CalibrationError("no samples to calibrate from")
    cameras = np.unique(samples.camera)
    if len(cameras) > 1:
        raise CalibrationError(
            f"samples of {len(cameras)} cameras ({', '.join(cameras[:4])}): calibrate one camera at a time"
        )
    foreign = samples.raw_camera != samples.camera
    if foreign.any():
        raise CalibrationError(
            f"{foreign.sum()} samples hold the RAW of {samples.raw_camera[foreign][0]}, not of {cameras[0]}: "
            "a lattice needs the camera's own RAW"
        )


def style_data(samples: SampleSet, multipliers: Array) -> tuple[dict[str, StyleData], int]:
    """The unclipped samples of each style, white-balanced, and how many are clipped.

    Clipped: a JPEG channel at 0 or 255, RAW at saturation or at black, or beyond saturation after white balance.
    """
    balanced = samples.raw * multipliers
    usable = (
        np.all((samples.srgb >= 0.5 * CODE) & (samples.srgb <= 1 - 0.5 * CODE), axis=1)
        & np.all((samples.raw > 0.0) & (samples.raw < 0.999), axis=1)
        & np.all(balanced < 1.0, axis=1)
    )
    result = {}
    for name in np.unique(samples.style):
        rows = usable & (samples.style == name)
        if rows.sum() < LEAST_SAMPLES:
            raise CalibrationError(
                f'style "{name}": {rows.sum()} unclipped samples; at least {LEAST_SAMPLES} are needed: '
                "add shots with more colours, exposed so that neither the JPEG nor the RAW clips"
            )
        result[str(name)] = StyleData(balanced[rows], samples.srgb[rows], samples.shot[rows])
    return result, int((~usable).sum())


def fit_style(data: StyleData, options: CalibrationOptions, smoothness: tuple[float, float] | None = None) -> StyleFit:
    """Both lattices of a style; smoothness: λ_S of (render, linearize) where known already."""
    base = fit_matrix_and_response(data.balanced, data.encoded)
    render_smoothness, linearize_smoothness = smoothness or (None, None)
    render = fit_samples(
        data.balanced, data.encoded, data.shot, base.render, options, clips=True, smoothness=render_smoothness
    )
    linearize = fit_samples(
        data.encoded,
        data.balanced,
        data.shot,
        base.linearize,
        options,
        clips=False,
        smoothness=linearize_smoothness,
    )
    return StyleFit(base, render, linearize)


@dataclass(frozen=True, eq=False)
class HeldOut:
    """Predictions of samples by fits that did not see their shot. rendered: I (n, 3); linearized: Tw E (n, 3)."""

    rendered: Array
    linearized: Array


def predict_held_out(
    data: StyleData, options: CalibrationOptions, smoothness: tuple[float, float] | None, most_folds: int
) -> HeldOut:
    """Refit without each shot (or each of `most_folds` groups of shots) and predict it. Needs two shots or more."""
    rendered, linearized = np.empty_like(data.encoded), np.empty_like(data.balanced)
    for mask in folds(data.shot, most_folds):
        fit = fit_style(data.select(~mask), options, smoothness)
        rendered[mask] = np.clip(fit.render.lattice(data.balanced[mask]), 0.0, 1.0)
        linearized[mask] = np.clip(fit.linearize.lattice(data.encoded[mask]), 0.0, 1.0)
    return HeldOut(rendered, linearized)


def _held_out(data: StyleData, fit: StyleFit, options: CalibrationOptions) -> tuple[dict[str, float], tuple[str, ...]]:
    """Held-out figures by name, and what makes this style's calibration weak."""
    weak = []
    shots = np.unique(data.shot)
    if len(data.shot) < FEW_SAMPLES:
        weak.append(f"only {len(data.shot)} samples: colours between them are guessed from the matrix and response")
    if len(shots) < 2:
        weak.append("one shot only: no shot is left to measure the error on; add another of other colours")
        return {}, tuple(weak)
    if any((~mask).sum() < LEAST_SAMPLES for mask in folds(data.shot)):
        weak.append("too few samples to leave a shot out: the error is not known")
        return {}, tuple(weak)
    smoothness = (fit.render.smoothness, fit.linearize.smoothness)
    held = predict_held_out(data, options, smoothness, most_folds=5)
    figures: dict[str, ErrorFigures] = {
        "render": error_figures(held.rendered, data.encoded, display=True),
        "linearize": error_figures(held.linearized, data.balanced, display=False),
    }
    errors = {}
    for direction, values in figures.items():
        errors[f"{direction}_mean"] = values.mean
        errors[f"{direction}_max"] = values.maximum
        if values.de00_mean is not None:
            errors[f"{direction}_de00_mean"] = values.de00_mean
    return errors, tuple(weak)
