"""The output curve behind a cube, with which a small cube can hold a rendering that clips.

Encoded values have a kink where a camera clips. It lies on oblique planes, which a lattice along the axes cannot
follow. Encoded values also have their largest curvature in dark colours. So the cube holds values v that continue
smoothly across the clipping, and the curve I(v) behind it has the curvature and clamps. Its slope is dI/dv ∝ 1 + f',
half way between encoded values (dI/dv = 1) and linear light (dI/dv = f').
"""

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import PchipInterpolator

from lutforge.arrays import Array
from lutforge.model.response import Response


@dataclass(frozen=True, eq=False)
class OutputCurve:
    """An output curve for each channel.

    table: (4096, 3), I at even steps of v in [0, 1], rising from 0 to 1; linear, values: (n, 3), f⁻¹ and v at n even
    steps of I; end_slopes: (2, 3), dv/d(linear) below the first and above the last of these.
    """

    table: Array
    linear: Array
    values: Array
    end_slopes: Array

    def to_values(self, encoded: Array) -> Array:
        """Take I (…, 3) in [0, 1] to the values v in front of the curve, by its table as files hold it."""
        even, inside = np.linspace(0.0, 1.0, len(self.table)), np.clip(encoded, 0.0, 1.0)
        return np.stack([np.interp(inside[..., c], self.table[:, c], even) for c in range(3)], axis=-1)

    def slope(self, encoded: Array) -> Array:
        """dI/dv at I (…, 3), over two codes."""
        low, high = np.clip(encoded - 1 / 255, 0.0, 1.0), np.clip(encoded + 1 / 255, 0.0, 1.0)
        return np.asarray((high - low) / (self.to_values(high) - self.to_values(low)))

    def continued(self, linear: Array) -> Array:
        """Take linear light (…, 3) to v, which continues as a straight line where the camera clips."""
        inside = np.clip(linear, self.linear[0], self.linear[-1])
        axes = zip(np.moveaxis(inside, -1, 0), self.linear.T, self.values.T, strict=True)
        values = np.stack([np.interp(light, known, value) for light, known, value in axes], axis=-1)
        below, above = np.minimum(linear - self.linear[0], 0.0), np.maximum(linear - self.linear[-1], 0.0)
        return np.asarray(values + below * self.end_slopes[0] + above * self.end_slopes[1])


def output_curve(response: Response) -> OutputCurve:
    """The curve of a camera with response f.

    f' is bounded by 8, with respect to the whole range of linear light. A fitted f can be arbitrarily steep at the very
    foot, where saturated colours stay away from black: errors of the cube must not be multiplied by that.
    """
    entries = 4096
    codes = np.linspace(0.0, 1.0, entries)
    inverse = response.inverse
    linear = PchipInterpolator(np.linspace(0.0, 1.0, len(inverse)), inverse, axis=0)(codes)
    span = linear[-1] - linear[0]
    slope = np.maximum(np.gradient(linear / span, 1.0 / (entries - 1), axis=0), 1.0 / 8.0)  # of f⁻¹
    rate = slope / (1.0 + slope)
    values = np.concatenate([np.zeros((1, 3)), np.cumsum(0.5 * (rate[1:] + rate[:-1]), axis=0) / (entries - 1)])
    total = values[-1].copy()
    values /= total
    table = np.stack([np.interp(codes, values[:, c], codes) for c in range(3)], axis=1)
    end_slopes = (rate / slope)[[0, -1]] / (total * span)
    return OutputCurve(table, linear, values, end_slopes)
