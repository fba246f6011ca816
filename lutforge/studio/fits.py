"""Fits and evaluations of the studio's models, by the use cases that the command line calls."""

from dataclasses import replace

import numpy as np

from lutforge.arrays import Array, Mask
from lutforge.calibration.physical.white_balance import complete_multipliers, with_gains, with_known_balances
from lutforge.calibration.shots.falloff import at_the_centre
from lutforge.calibration.style_data import style_data
from lutforge.calibration.style_fit import uniform_lattice_errors
from lutforge.colour.srgb import srgb_encode
from lutforge.errors import CalibrationError, LutForgeError
from lutforge.model.camera_profile import CameraProfile, ModelName
from lutforge.model.directions import DIRECTIONS
from lutforge.pipeline.calibration import calibrate, calibrate_stages
from lutforge.progress import Progress
from lutforge.samples.sample_set import SampleSet, with_setting_names
from lutforge.settings import Multipliers, Selector
from lutforge.studio.workspace import FitTask, FittedModel


def fit_model(task: FitTask, samples: SampleSet, progress: Progress) -> FittedModel:
    """Fit a model to some samples, and evaluate it on all.

    Raises CalibrationError where they do not determine the model.
    """
    if task.rows.sum() < 10:
        raise CalibrationError(f"{int(task.rows.sum())} samples are left to fit; at least 10 are needed: filter less")
    chosen = samples.select(task.rows)
    if task.kind == "matrix":
        profile = calibrate_stages(chosen, task.options, progress)
    else:
        stages = None if task.stages is None else task.stages.profile
        profile = calibrate(chosen, task.options, progress, stages=stages)
    progress("evaluating on all samples", 0.9)
    fitted = evaluate_on(profile, task.kind, samples)
    if task.kind == "lattice" and not profile.raw_camera:
        progress("error of a uniform lattice", 0.95)
        chosen = with_setting_names(chosen)
        data, _ = style_data(chosen, complete_multipliers(chosen)[0])
        errors = {
            (name, direction): uniform_lattice_errors(style, task.options, direction)
            for name, style in data.items()
            for direction in DIRECTIONS
        }
        fitted = replace(fitted, uniform_error=errors)
    return fitted


def evaluate_on(profile: CameraProfile, kind: str, samples: SampleSet) -> FittedModel:
    """What a profile makes of samples; NaN where it does not know their style or white balance."""
    samples = at_the_centre(with_setting_names(samples), profile.falloffs)
    scene, transformed, predicted, linearized = (np.full_like(samples.raw, np.nan) for _ in range(4))
    multipliers = with_known_balances(samples, profile.white_balances).wb
    multipliers = with_gains(samples, multipliers / multipliers[:, 1:2], profile.white_balances)
    setting = np.char.add(np.char.add(samples.style, "/"), samples.white_balance)
    known = np.all(np.isfinite(multipliers), axis=1) & np.isin(samples.style, list(profile.styles))
    if profile.raw_camera:
        known &= np.isin(samples.white_balance, list(profile.white_balances))
    _, group = np.unique(
        np.column_stack([np.unique(setting, return_inverse=True)[1], multipliers]), axis=0, return_inverse=True
    )
    for index in np.unique(group[known]):
        rows = (group == index) & known
        style, balance = str(samples.style[rows][0]), str(samples.white_balance[rows][0])
        r, g, b = multipliers[rows][0].tolist()
        selector = Selector(style, balance if profile.raw_camera else Multipliers((r, g, b)))
        lattice = kind == "lattice" and profile.styles[style].render is not None
        model: ModelName = "lattice" if lattice else "rbf"
        scene[rows] = samples.raw[rows] @ profile.raw_to_linear_srgb(selector).T
        predicted[rows] = profile.render(selector, model)(samples.raw[rows])
        linearized[rows] = profile.linearize(selector, "linear-srgb", model)(samples.srgb[rows])
        transformed[rows] = predicted[rows]
        if not lattice:
            physical = profile.styles[style].physical
            one = next((one for one in physical if balance in one.white_balances), physical[0])
            own = samples.raw[rows] if profile.raw_transfer is None else samples.raw[rows] @ profile.raw_transfer.T
            balanced = np.clip(own * profile.multipliers(selector), 0.0, 1.0)
            transformed[rows] = one.gamut_map(balanced @ one.matrix.T)
    return FittedModel(profile, scene, transformed, predicted, linearized)


def residuals(predicted: Array, samples: SampleSet, rows: Mask) -> tuple[float, ...]:
    """Mean, median, 95 % and largest RGB distance from the JPEG of what was predicted (n, 3), on some rows.

    There are none where that says nothing of any of them.
    """
    distance = np.linalg.norm(predicted[rows] - samples.srgb[rows], axis=1)
    distance = distance[np.isfinite(distance)]
    return (distance.mean(), *np.percentile(distance, [50, 95, 100])) if len(distance) else ()


def held_out_error(profile: CameraProfile) -> float | None:
    """The mean error of a profile on shots left out, over its styles; None where it was not measured."""
    known = [style.errors["render_mean"] for style in profile.styles.values() if "render_mean" in style.errors]
    return float(np.mean(known)) if known else None


def before(samples: SampleSet) -> Array:
    """What there is before any fit (n, 3): white-balanced RAW through sRGB's own curve; NaN: unknown white balance."""
    try:
        multipliers, _ = complete_multipliers(with_setting_names(samples))
    except LutForgeError:
        multipliers = samples.wb
    return srgb_encode(np.clip(samples.raw * multipliers, 0.0, 1.0))
