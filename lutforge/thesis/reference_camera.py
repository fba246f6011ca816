"""Cameras without RAW by the thesis (4.2.4): f from exposure pairs, then (4.10) over colours of equal weight."""

import numpy as np
from numpy.typing import NDArray

from lutforge.arrays import Array, Mask
from lutforge.calibration.joint_diagonalization import jointly_diagonal
from lutforge.calibration.reference_camera import (
    INVERSE_OUTLIERS,
    StyleFit,
    check_inverse,
    gains_and_scale,
    level_of,
    linear_values,
    transformed,
    unclipped_pairs,
    unsaturated_of_several_hues,
)
from lutforge.colour.saturation import saturation
from lutforge.samples.sample_set import SampleSet
from lutforge.thesis.camera_model import response_of_exposures
from lutforge.thesis.options import ThesisOptions


def own_raw(samples: SampleSet, options: ThesisOptions) -> tuple[SampleSet, Array]:
    """Transform a reference camera's RAW to that of the camera that was sampled with it: the samples, and Tc (3, 3).

    This is done as in `lutforge.calibration.reference_camera.own_raw`, but shots have no gains.
    """
    unclipped = unclipped_pairs(samples)
    setting = unclipped.settings
    values = linear_values(unclipped, setting, lambda style, of_style: _fit_style(style, of_style, options))

    names = [str(name) for name in np.unique(setting)]
    inverses = {name: _fit_inverse(values.linear, unclipped, setting == name, name) for name in names}
    transfer, matrix, balances = jointly_diagonal(inverses)
    multipliers = np.array([balances[str(name)] / balances[str(name)][1] for name in setting])
    _, scale = gains_and_scale(unclipped, setting, values, transfer, matrix, multipliers)
    return transformed(unclipped, values, transfer, multipliers, values.gain, scale)


def _fit_style(samples: SampleSet, setting: NDArray[np.str_], options: ThesisOptions) -> StyleFit:
    """Fit f to the exposure pairs (4.2.1), and Tz to the colours below β by plain least squares."""
    response = response_of_exposures(samples, options)
    unsaturated = saturation(samples.srgb) < options.beta
    linear = response.linearize(samples.srgb)
    matrices = {}
    for name in np.unique(setting):
        rows = unsaturated & (setting == name)
        matrices[str(name)] = np.linalg.lstsq(samples.raw[rows], linear[rows])[0].T
    return StyleFit(response, matrices, np.ones(len(samples)), unsaturated.astype(np.float64))


def _fit_inverse(linear: Array, samples: SampleSet, rows: Mask, name: str) -> tuple[Array, Array]:
    """Tz⁻¹ (3, 3) of one white balance, f⁻¹(I) → E' (4.10), and the precision (3, 3) of each of its rows.

    Raises CalibrationError where the colours do not determine it, or contradict every matrix.
    """
    x = linear[rows]
    y = samples.raw[rows]
    unsaturated, _ = unsaturated_of_several_hues(x, saturation(samples.srgb[rows]), name)
    inverse = np.asarray(np.linalg.lstsq(x[unsaturated], y[unsaturated])[0].T, dtype=np.float64)
    error = np.linalg.norm(y - x @ inverse.T, axis=1) / level_of(y)
    scale = INVERSE_OUTLIERS.scale(error[unsaturated]) / INVERSE_OUTLIERS.multiple
    check_inverse(inverse, scale, name)
    weighted = x[unsaturated] / scale
    return inverse, weighted.T @ weighted
