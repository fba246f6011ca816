"""The smallest lattice that reaches an error on shots that were held out."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from lutforge.arrays import Array, Mask
from lutforge.calibration.options import MEASURING_TOLERANCE, CalibrationOptions
from lutforge.calibration.style_data import LEAST_SAMPLES, StyleData
from lutforge.calibration.style_fit import fit_render
from lutforge.errors import CalibrationError
from lutforge.progress import Progress, silent
from lutforge.solvers.cross_validation import leave_groups_out, predict_held_out


def smallest_size(
    data: Mapping[str, StyleData],
    tolerance: float,
    options: CalibrationOptions | None = None,
    progress: Progress = silent,
    sizes: Sequence[int] = (9, 13, 17, 21, 25, 33, 41, 49, 57, 65),
) -> int:
    """Find the first of `sizes` whose mean error of rendering is within the tolerance in every style.

    The error is the norm of the RGB difference of encoded values 0 … 1, mean over the samples of shots that the fit has
    not seen, as `lutforge calibrate` prints it. Raises CalibrationError where no size reaches it, or no shot can be
    held out.
    """
    if not tolerance > 0:
        raise CalibrationError(f"tolerance {tolerance:g}: an error above 0 is needed; 0.0068 is one code of 255")
    for name, style in data.items():
        masks = leave_groups_out(style.shot)
        if len(masks) < 2 or any((~mask).sum() < LEAST_SAMPLES for mask in masks):
            raise CalibrationError(f'style "{name}": no shot can be held out to measure a tolerance on: add shots')
    options = options or CalibrationOptions()
    smoothness = {name: _smoothness(style, options) for name, style in data.items()}
    best, at = float("inf"), sizes[0]
    for index, size in enumerate(sizes):
        progress(f"{size} nodes per axis", index / len(sizes))
        error = max(_held_out(style, replace(options, size=size), smoothness[name]) for name, style in data.items())
        if error <= tolerance:
            progress("done", 1.0)
            return size
        if error < best:
            best, at = error, size
    raise CalibrationError(
        f"no size up to {sizes[-1]} renders held-out shots with a mean error of {tolerance:g}; the smallest is "
        f"{best:.2g}, at {at}: give a larger tolerance, or add shots"
    )


def _smoothness(style: StyleData, options: CalibrationOptions) -> float:
    """λ_S for all sizes, chosen on one that shows what the largest would choose."""
    middle = replace(options, size=17)
    return fit_render(style, middle, tolerance=MEASURING_TOLERANCE).smoothness


def _held_out(style: StyleData, options: CalibrationOptions, smoothness: float) -> float:
    """Mean error of rendering on each group of shots by a fit to the others."""

    def rendered(train: Mask, test: Mask) -> Array:
        part = style.select(train)
        fit = fit_render(part, options, smoothness=smoothness, tolerance=MEASURING_TOLERANCE).lattice
        return np.clip(fit(style.balanced[test]), 0.0, 1.0)

    predicted = predict_held_out(leave_groups_out(style.shot), rendered)
    return float(np.linalg.norm(predicted - style.encoded, axis=1).mean())
