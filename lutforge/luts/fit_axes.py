"""The axes of a cube that is fitted to a known function: an input curve per channel, and node levels along it.

A cube interpolates linearly between its nodes, so each axis is first stretched until the function rises evenly along
it: the curve is the running sum of its root-mean-square slope, which leaves, of all curves, the least curvature on
average (d/dx log u' = ⟨F_xx, F_x⟩ / ⟨F_x, F_x⟩). Node levels then even out what curvature is left: intervals of width h
have a mean error ∝ |κ| h² per unit length of the curve, and at a fixed number of them the total is least where
1/h ∝ |κ|^(1/3), the largest where 1/h ∝ |κ|^(1/2) (de Boor 1973, https://doi.org/10.1007/BFb0069390). The first is
right where the cube holds all, the second where an output curve after it magnifies the errors of the darks; few of the
lines across an axis then have the largest errors, and a power mean of their curvatures counts these for more.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy

from lutforge.arrays import Array
from lutforge.interpolation import Levels, apply_curve
from lutforge.luts.fit_cube import Axes, Function
from lutforge.luts.ops import Op
from lutforge.luts.shaper import FEW, SHAPER_SIZE, is_even, shaper, shaper_error
from lutforge.model.lattice import snapped
from lutforge.sobol import sobol

LINES = 64
"""Lines along each axis on which slope and curvature are measured, beside the grey axis."""

STEPS = 256
"""Steps of each line."""


CELL_STEPS = 8
"""Steps of a short shaper that the narrowest cell must have: a level is then moved by less than a sixteenth of it."""

SHAPER_ERROR = 1e-5
"""Largest error of a short shaper, of which cubes make about as much: a fifth of a step of 14 bits."""


@dataclass(frozen=True, eq=False)
class FittedAxes:
    """Node levels of a cube, and a curve (m, 3), in whose values the cube is linear; or none.

    entries: of the shaper that holds both, on whose grid the levels lie.
    """

    curve: Array | None
    levels: Levels
    entries: int

    def stretched(self, x: Array) -> Array:
        """Map inputs (…, 3) through the curve, which continues with slope 1 beyond 1."""
        return x if self.curve is None else apply_curve(self.curve, x) + np.maximum(x - 1.0, 0.0)

    def shaper(self, high: float = 1.0) -> tuple[Op, ...]:
        """Return the curve before the cube, for inputs from 0 to `high`; none where the axes are even from 0 to 1."""
        if self.curve is None and is_even(self.levels) and high == 1:
            return ()
        return (shaper(self.levels, self.entries, self.curve, high),)

    def of_cube(self) -> Axes:
        """Return the axes with the node levels behind the curve, where the cube has them."""
        r, g, b = (self.stretched(np.stack(self.levels, axis=1))[:, c].copy() for c in range(3))
        return Axes(self.levels, (r, g, b), self.stretched)


def fit_axes(function: Function, gain: Array, size: int, curve: Array | None = None, stops: float = 0.0) -> FittedAxes:
    """Curve and `size` node levels per axis for a function (n, 3) in [0, 1] → (n, 3): of least mean error.

    gain: (3,) before the function, where it clamps at 1: inputs are taken to be even before it. curve: the input curve,
    where it is known. stops: of light that the axes span beyond 1; the more, the finer the darks are looked at.
    """
    lines = _measured(function, gain, stops)

    # The share of all inputs that each line but the grey axis represents; half lie in the dark tones.
    density = 0.5 + 0.125 / np.sqrt(np.maximum(lines.across.prod(axis=1), 1e-4))
    share = 1 / (density * np.sum(1 / density))

    def node_density(bends: _Bends) -> Array:
        # How many inputs, per unit of the curve; half way, as the fit has it.
        inputs = bends.input_widths / bends.widths
        return np.asarray((_mean(np.sqrt(bends.square), share) * np.sqrt(inputs)) ** (1 / 3))

    return _axes(lines, share, curve, size, node_density)


def fit_axes_before_curve(
    function: Function, gain: Array, size: int, weight: Function, curve: Array | None = None
) -> FittedAxes:
    """Curve and node levels as of `fit_axes`, but of the least largest error behind an output curve.

    weight: outputs (n, 3) → (n,), how much a squared error counts there.
    """
    lines = _measured(function, gain, 0.0)
    share = np.full(LINES, 1 / LINES)

    def node_density(bends: _Bends) -> Array:
        square = bends.square * weight(bends.outputs.reshape(-1, 3)).reshape(bends.square.shape)
        # The cubic mean of curvatures lies between the root mean square and the largest.
        return np.asarray(_mean(square**1.5, share, 0.5) ** (1 / 6))

    return _axes(lines, share, curve, size, node_density)


def slope_weight(output_curve: Array) -> Function:
    """Return the weight of an error of the cube: the sum of the output curve's squared slopes, also near clipping."""
    reach, share, margin = 0.003, 0.05, 0.25
    y = np.repeat(np.linspace(-margin, 1 + margin, 4096)[:, None], 3, axis=1)
    inside = np.clip(y, 0.0, 1.0)
    slope = (apply_curve(output_curve, inside + reach) - apply_curve(output_curve, inside - reach)) / (2 * reach)
    table = slope**2 * np.exp(-0.5 * ((y - inside) / share) ** 2)

    def weight(y: Array) -> Array:
        return np.asarray(share + apply_curve(table, (y + margin) / (1 + 2 * margin)).sum(axis=-1))

    return weight


@dataclass(frozen=True, eq=False)
class _Lines:
    """A function along lines parallel to the axes.

    t: (STEPS + 1,), the levels on each line; across: (LINES, 2), where the lines but the first, the grey axis, cross
    the other two axes; values: per axis (LINES + 1, STEPS + 1, 3).
    """

    t: Array
    across: Array
    values: tuple[Array, ...]


@dataclass(frozen=True, eq=False)
class _Bends:
    """How a function bends between the steps of the lines along an axis, in units of the axis's curve.

    outputs: (LINES + 1, STEPS − 1, 3); square: the squared curvature (LINES + 1, STEPS − 1); widths: of two
    neighbouring steps on the curve (STEPS − 1,); input_widths: the same of the inputs.
    """

    outputs: Array
    square: Array
    widths: Array
    input_widths: Array


def _measured(function: Function, gain: Array, stops: float) -> _Lines:
    """A function along the lines; across a gain that clips, more of them lie where it clips."""
    t = np.linspace(0.0, 1.0, STEPS + 1) ** (1.5 + 0.25 * stops)  # finer in the darks, where responses are steep
    across = sobol(LINES, 2)
    across[: LINES // 2] **= 2

    values = []
    for axis in range(3):
        further = [c for c in range(3) if c != axis]
        x = np.empty((LINES + 1, len(t), 3))
        x[..., axis] = t
        x[1:, :, further] = np.minimum(across * np.maximum(gain[further], 1.0), 1.0)[:, None, :]
        x[0] = t[:, None]
        values.append(function(x.reshape(-1, 3)).reshape(x.shape))

    return _Lines(t, across, tuple(values))


def _axes(
    lines: _Lines, share: Array, curve: Array | None, size: int, node_density: Callable[[_Bends], Array]
) -> FittedAxes:
    """The axes whose nodes lie as a density has it, along a curve that is known or measured.

    share: (LINES,), how much each line but the grey axis counts.
    """
    t = lines.t
    if curve is None:
        squares = [np.sum((np.diff(y, axis=1) / np.diff(t)[:, None]) ** 2, axis=2) for y in lines.values]
        curve = np.stack([_curve(np.sqrt(_mean(square, share)), t) for square in squares], axis=1)
    even = np.linspace(0.0, 1.0, len(curve))

    places = []
    for axis, values in enumerate(lines.values):
        mass = _mass(values, t, np.interp(t, even, curve[:, axis]), node_density)
        total = np.concatenate([[0.0], np.cumsum(mass)])
        # Between two levels there is equal mass.
        places.append(np.interp(np.linspace(0.0, total[-1], size), total, t))

    is_straight = len(curve) == 2  # which changes nothing
    return _on_shortest_grid((places[0], places[1], places[2]), None if is_straight else curve)


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


def _mass(y: Array, t: Array, u: Array, node_density: Callable[[_Bends], Array]) -> Array:
    """Share of the nodes in each step (STEPS,), from the curvature that is left along the curve's values u at t."""
    step = np.diff(t)
    wide = np.diff(u)
    widths = wide[1:] + wide[:-1]
    bend = np.diff(np.diff(y, axis=1) / wide[:, None], axis=1) * (2 / widths)[:, None]

    density = node_density(_Bends(y[:, 1:-1], np.sum(bend**2, axis=2), widths, step[1:] + step[:-1]))
    density = scipy.ndimage.gaussian_filter1d(np.pad(density, 1, mode="edge"), 1.0, mode="nearest")

    mass = 0.5 * (density[1:] + density[:-1]) * wide
    total = mass.sum()
    mass = 0.8 * mass / total + 0.2 * step if total > 1e-12 else step  # a fifth of the nodes stays evenly spread
    return np.asarray(mass / mass.sum())


def _on_shortest_grid(places: Levels, curve: Array | None) -> FittedAxes:
    """Node levels on the grid of the shortest shaper that holds them and the curve: a long one makes long files."""
    short = snapped(places, FEW)
    narrowest = min(float(np.diff(axis).min()) for axis in short) * (FEW - 1)
    if narrowest >= CELL_STEPS and shaper_error(short, FEW, curve) <= SHAPER_ERROR:
        return FittedAxes(curve, short, FEW)
    return FittedAxes(curve, snapped(places, SHAPER_SIZE), SHAPER_SIZE)
