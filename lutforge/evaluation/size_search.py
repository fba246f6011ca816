"""The smallest lattice that reaches an error on shots that were held out."""

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from lutforge.calibration.lattice_options import MEASURING_TOLERANCE
from lutforge.calibration.options import CalibrationOptions
from lutforge.calibration.physical.matrix_and_response import fit_matrix_and_response
from lutforge.calibration.style_data import LEAST_SAMPLES, StyleData
from lutforge.calibration.style_fit import fit_direction
from lutforge.errors import CalibrationError
from lutforge.solvers.cross_validation import leave_groups_out

SIZES = (9, 13, 17, 21, 25, 33, 41, 49, 57, 65)
SEARCH_SIZE = 17
"""Size at which λ_S is chosen for all of them."""


def smallest_size(
    data: Mapping[str, StyleData],
    tolerance: float,
    options: CalibrationOptions | None = None,
    progress: Callable[[str, float], None] = lambda what, share: None,
) -> int:
    """The first of SIZES whose mean error of rendering is within the tolerance in every style.

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
    best, at = float("inf"), SIZES[0]
    for index, size in enumerate(SIZES):
        progress(f"{size} nodes per axis", index / len(SIZES))
        error = max(_held_out(style, replace(options, size=size), smoothness[name]) for name, style in data.items())
        if error <= tolerance:
            progress("done", 1.0)
            return size
        if error < best:
            best, at = error, size
    raise CalibrationError(
        f"no size up to {SIZES[-1]} renders held-out shots with a mean error of {tolerance:g}; the smallest is "
        f"{best:.2g}, at {at}: give a larger tolerance, or add shots"
    )


def _smoothness(style: StyleData, options: CalibrationOptions) -> float:
    base = fit_matrix_and_response(style.balanced, style.encoded)
    return fit_direction(
        style, replace(options, size=SEARCH_SIZE), base, inverse=False, tolerance=MEASURING_TOLERANCE
    ).smoothness


def _held_out(style: StyleData, options: CalibrationOptions, smoothness: float) -> float:
    """Mean error of rendering on each group of shots by a fit to the others."""
    error = np.empty(len(style.shot))
    for mask in leave_groups_out(style.shot):
        train = style.select(~mask)
        base = fit_matrix_and_response(train.balanced, train.encoded)
        fit = fit_direction(
            train, options, base, inverse=False, smoothness=smoothness, tolerance=MEASURING_TOLERANCE
        ).lattice
        rendered = np.clip(fit(style.balanced[mask]), 0.0, 1.0)
        error[mask] = np.linalg.norm(rendered - style.encoded[mask], axis=1)
    return float(error.mean())
