"""The axes of a cube for a known function: per channel an input curve, and node levels along it.

A cube interpolates linearly between its nodes, so each axis is first stretched until the function rises evenly along
it: the curve is the running sum of its root-mean-square slope, which leaves, of all curves, the least curvature on
average (d/dx log u' = ⟨F_xx, F_x⟩ / ⟨F_x, F_x⟩). Node levels then even out what curvature is left: intervals of width h
carry a mean error ∝ |κ| h² per unit length of the curve, and at a fixed number of them the total is least where 1/h ∝
|κ|^(1/3), the largest where 1/h ∝ |κ|^(1/2) (de Boor 1973). The first is wanted where the cube holds all, the second
where an output curve behind it magnifies the errors of the darks; few of the lines across an axis then carry the
largest errors, and a power mean of their curvatures counts these for more.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy

from lutforge.arrays import Array
from lutforge.interpolation import Levels, apply_curve
from lutforge.luts.shaper import SHAPER_SIZE
from lutforge.model.lattice import snap_levels
from lutforge.sobol import sobol

Function = Callable[[Array], Array]

LINES = 64
"""Lines along each axis on which slope and curvature are measured, beside the grey axis, and steps of each."""
STEPS = 256


@dataclass(frozen=True, eq=False)
class Axes:
    """The axes of a cube.

    levels: of the input, on the shaper's grid. curve: (m, 3), increasing from 0 to 1, or none: the cube is linear in
    its values between two nodes.
    """

    curve: Array | None
    levels: Levels

    def stretched(self, x: Array) -> Array:
        """Map inputs (…, 3) through the curve, which continues with slope 1 beyond 1."""
        return x if self.curve is None else apply_curve(self.curve, x) + np.maximum(x - 1.0, 0.0)


@dataclass(frozen=True, eq=False)
class MeasuredLines:
    """A function along lines: per axis its values (LINES + 1, STEPS + 1, 3) at inputs t; the first is the grey axis.

    share: (LINES,), the share of all inputs that each line but the grey axis stands for; half lie in the dark tones.
    """

    t: Array
    values: tuple[Array, Array, Array]
    share: Array


def measure_lines(function: Function, gain: Array, stops: float = 0.0) -> MeasuredLines:
    """Lines of a function (n, 3) in [0, 1] → (n, 3).

    gain: (3,) in front of it, where it clamps at 1: inputs are taken to be even before it. stops: of light that the
    axes span beyond 1; the more, the finer the darks are looked at.
    """
    t = np.linspace(0.0, 1.0, STEPS + 1) ** (1.5 + 0.25 * stops)  # finer in the darks, where responses are steep
    places = sobol(LINES, 2)
    places[: LINES // 2] **= 2
    density = 0.5 + 0.125 / np.sqrt(np.maximum(places.prod(axis=1), 1e-4))
    values = []
    for axis in range(3):
        others = [c for c in range(3) if c != axis]
        x = np.empty((LINES + 1, len(t), 3))
        x[..., axis] = t
        x[1:, :, others] = np.minimum(places * np.maximum(gain[others], 1.0), 1.0)[:, None, :]
        x[0] = t[:, None]
        values.append(function(x.reshape(-1, 3)).reshape(x.shape))
    r, g, b = values
    return MeasuredLines(t, (r, g, b), 1 / (density * np.sum(1 / density)))


def fit_axes(
    lines: MeasuredLines,
    size: int,
    weight: Function | None = None,
    curve: Array | None = None,
) -> Axes:
    """Curve and `size` node levels per axis for a function along lines.

    weight: outputs (n, 3) → (n,), how much a squared error counts there. curve: the input curve, where it is known.
    """
    t = lines.t
    share = lines.share if weight is None else np.full(LINES, 1 / LINES)  # a weight looks for the largest errors
    if curve is None:
        squares = [np.sum((np.diff(y, axis=1) / np.diff(t)[:, None]) ** 2, axis=2) for y in lines.values]
        slopes = [np.sqrt(_mean(square, share)) for square in squares]
        curve = np.stack([_curve(slope, t) for slope in slopes], axis=1)
    even = np.linspace(0.0, 1.0, len(curve))
    places = [np.interp(t, even, curve[:, axis]) for axis in range(3)]
    levels = []
    for axis in range(3):  # between two levels there is equal mass
        total = np.concatenate([[0.0], np.cumsum(_mass(lines.values[axis], t, places[axis], share, weight))])
        level = np.interp(np.linspace(0.0, total[-1], size), total, t)
        levels.append(snap_levels(level, SHAPER_SIZE))
    r, g, b = levels
    return Axes(curve if len(curve) > 2 else None, (r, g, b))  # a straight line stretches nothing


def _mean(values: Array, share: Array, grey: float = 0.25) -> Array:
    """The mean over the lines (LINES + 1, m), of which the grey axis counts the share `grey`."""
    return np.asarray((1 - grey) * (share @ values[1:]) + grey * values[0])


def _curve(slope: Array, t: Array) -> Array:
    """The running sum of a slope, from 0 to 1, at SHAPER_SIZE even steps."""
    density = scipy.ndimage.gaussian_filter1d(slope, 4.0, mode="nearest")
    total = float(np.sum(density * np.diff(t)))
    # Half of a straight line beside the slope, so that the curve rises where the function is flat.
    density = density + 0.5 * total if total > 1e-12 else np.ones_like(density)
    u = np.concatenate([[0.0], np.cumsum(density * np.diff(t))])
    curve = scipy.interpolate.PchipInterpolator(t, u / u[-1])(np.linspace(0.0, 1.0, SHAPER_SIZE))
    curve[0], curve[-1] = 0.0, 1.0
    return np.asarray(curve)


def _mass(y: Array, t: Array, u: Array, share: Array, weight: Function | None) -> Array:
    """Share of the nodes in each step, from the curvature that is left along u."""
    step, wide = np.diff(t), np.diff(u)
    bend = np.diff(np.diff(y, axis=1) / wide[:, None], axis=1) * (2 / (wide[1:] + wide[:-1]))[:, None]
    square = np.sum(bend**2, axis=2)
    if weight is None:
        inputs = (step[1:] + step[:-1]) / (wide[1:] + wide[:-1])  # how many, per unit of u; half way, as the fit has it
        density = (_mean(np.sqrt(square), share) * np.sqrt(inputs)) ** (1 / 3)
    else:
        square *= weight(y[:, 1:-1].reshape(-1, 3)).reshape(square.shape)
        # The cubic mean of curvatures lies between the root mean square and the largest.
        density = _mean(square**1.5, share, 0.5) ** (1 / 6)
    density = scipy.ndimage.gaussian_filter1d(np.pad(density, 1, mode="edge"), 1.0, mode="nearest")
    mass = 0.5 * (density[1:] + density[:-1]) * wide
    total = mass.sum()
    mass = 0.8 * mass / total + 0.2 * step if total > 1e-12 else step  # a fifth of the nodes stays evenly spread
    return np.asarray(mass / mass.sum())
