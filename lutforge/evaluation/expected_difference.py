"""The colour difference that a camera model is expected to have, from the model alone.

The gamut map is the mean of a Gaussian process, whose roughness and variance its samples made likeliest. Its standard
deviation, which grows with the distance to the samples, times what a step of a channel changes to the eye, is the root
mean square of the expected ΔE00. So it is known of every colour, and without a shot that was held out.
"""

from collections.abc import Callable

import numpy as np

from lutforge.arrays import Array
from lutforge.calibration.gamut_map import posterior_deviation
from lutforge.colour.srgb import delta_e_2000
from lutforge.model.gamut_map import from_even, to_even
from lutforge.model.profile import CameraModel

STEP = 0.005
"""A step on the even scale of corrections, about one code."""


def expected_difference(model: CameraModel) -> Callable[[Array], Array] | None:
    """The expected ΔE00 (n,) of rendering linear colours after the matrix (n, 3); None where no process was fitted."""
    gamut_map = model.gamut_map
    if gamut_map.kernel != "kriging" or gamut_map.is_identity:
        return None
    offset = gamut_map.correction_offset
    deviation = posterior_deviation(gamut_map)

    def encoded(even: Array) -> Array:
        return np.asarray(np.clip(model.response.encode(from_even(even, offset)), 0.0, 1.0))

    def expected(linear: Array) -> Array:
        even = to_even(gamut_map(linear), offset)
        steps = [delta_e_2000(encoded(even + STEP * axis), encoded(even)) for axis in np.eye(3)]
        return np.asarray(deviation(linear) * np.linalg.norm(steps, axis=0) / STEP)

    return expected
