"""The axes of a cube that is fitted to a known function: an input curve per channel, and node levels along it.

A cube interpolates linearly between its nodes, so each axis is first stretched until the function rises evenly along
it: the curve is the running sum of its root-mean-square slope, which leaves, of all curves, the least curvature on
average (d/dx log u' = ⟨F_xx, F_x⟩ / ⟨F_x, F_x⟩). Node levels then even out what curvature is left: intervals of width h
have a mean error ∝ |κ| h² per unit length of the curve, and at a fixed number of them the total is least where
1/h ∝ |κ|^(1/3), the largest error where 1/h ∝ |κ|^(1/2) (de Boor 1973, https://doi.org/10.1007/BFb0069390). The first
rule is for a cube without a curve after it, the second for one whose output curve magnifies the errors of dark colours:
few of the lines then have the largest errors, and a power mean of their curvatures gives these more weight.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy

from lutforge.arrays import Array
from lutforge.interpolation import Levels, apply_curve
from lutforge.luts.fit_cube import Axes, Function
from lutforge.luts.ops import Op
from lutforge.luts.shaper import MAX_SHAPER_SIZE, is_even, shaper, shaper_error
from lutforge.model.lattice import SHORT_SHAPER_SIZE, snapped
from lutforge.sobol import sobol

LINES = 64
"""Lines along each axis on which slope and curvature are measured, and the grey axis in addition."""

LINE_STEPS = 256
"""Steps of each line."""

CELL_STEPS = 8
"""Steps of a short shaper that the narrowest cell must span: a level then moves by at most a sixteenth of the cell."""

SHAPER_ERROR = 1e-5
"""Largest error of a short shaper, and about the error that it causes after the cube: a sixth of a step of 14 bits."""


@dataclass(frozen=True, eq=False)
class FittedAxes:
    """Node levels of a cube, and a curve (m, 3) in whose values the cube is linear between nodes, or none.

    entries: number of entries of the shaper that holds both; the levels lie on its grid.
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
        """Return the axes with the node levels after the curve, at which the cube is fitted."""
        r, g, b = (self.stretched(np.stack(self.levels, axis=1))[:, c].copy() for c in range(3))
        return Axes(self.levels, (r, g, b), self.stretched)


def fit_axes(function: Function, gain: Array, size: int, curve: Array | None = None, stops: float = 0.0) -> FittedAxes:
    """Curve and `size` node levels per axis, of least mean error, for a function (n, 3) in [0, 1] → (n, 3).

    gain: (3,), applied before the function, which clamps at 1: inputs are assumed to be evenly distributed before the
    gain. curve: the input curve (m, 3), where it is known. stops: how far beyond 1 the inputs reached before they were
    scaled to [0, 1]; the more, the finer the steps in dark colours.
    """
    lines = _measured(function, gain, stops)

    # The share of all inputs that each line but the grey axis represents; half lie in the dark tones.
    density = 0.5 + 0.125 / np.sqrt(np.maximum(lines.across.prod(axis=1), 1e-4))
    share = 1 / (density * np.sum(1 / density))

    def node_density(bends: _Bends) -> Array:
        # Inputs per unit of the curve. The square root lies half way between counting inputs and counting cells, as the
        # weights of the fit do.
        input_density = bends.input_widths / bends.widths
        return np.asarray((_mean(np.sqrt(bends.square), share) * np.sqrt(input_density)) ** (1 / 3))

    return _axes(lines, share, curve, size, node_density)


def fit_axes_before_curve(
    function: Function, gain: Array, size: int, weight: Function, curve: Array | None = None
) -> FittedAxes:
    """Curve and node levels as of `fit_axes`, but such that the largest error after an output curve is least.

    weight: outputs (n, 3) → (n,), the weight of a squared error there.
    """
    lines = _measured(function, gain, 0.0)
    share = np.full(LINES, 1 / LINES)

    def node_density(bends: _Bends) -> Array:
        square = bends.square * weight(bends.outputs.reshape(-1, 3)).reshape(bends.square.shape)
        # The cubic mean of curvatures lies between the root mean square and the largest.
        return np.asarray(_mean(square**1.5, share, 0.5) ** (1 / 6))

    return _axes(lines, share, curve, size, node_density)


def slope_weight(output_curve: Array) -> Function:
    """Return the weight of a cube's squared error: the sum of the squared slopes of the output curve (m, 3) there.

    Beyond [0, 1], where the curve clips, the weight falls off like a normal distribution.
    """
    half_step = 0.003  # of the difference quotient, in the cube's outputs
    fall_off = 0.05  # standard deviation beyond [0, 1], and the least weight
    margin = 0.25  # of the table beyond [0, 1]
    y = np.repeat(np.linspace(-margin, 1 + margin, 4096)[:, None], 3, axis=1)
    inside = np.clip(y, 0.0, 1.0)
    rise = apply_curve(output_curve, inside + half_step) - apply_curve(output_curve, inside - half_step)
    slope = rise / (2 * half_step)
    table = slope**2 * np.exp(-0.5 * ((y - inside) / fall_off) ** 2)

    def weight(y: Array) -> Array:
        return np.asarray(fall_off + apply_curve(table, (y + margin) / (1 + 2 * margin)).sum(axis=-1))

    return weight


@dataclass(frozen=True, eq=False)
class _Lines:
    """A function along lines parallel to the axes.

    t: (LINE_STEPS + 1,), the levels on each line. values: per axis (LINES + 1, LINE_STEPS + 1, 3), first the grey axis.
    across: (LINES, 2), the coordinates of all lines but the grey axis on the other two axes.
    """

    t: Array
    across: Array
    values: tuple[Array, ...]


@dataclass(frozen=True, eq=False)
class _Bends:
    """How a function bends between the steps of the lines along an axis, in units of the axis's curve.

    outputs: (LINES + 1, LINE_STEPS − 1, 3); square: the squared curvature (LINES + 1, LINE_STEPS − 1); widths: of two
    neighbouring steps on the curve (LINE_STEPS − 1,); input_widths: the same of the inputs.
    """

    outputs: Array
    square: Array
    widths: Array
    input_widths: Array


def _measured(function: Function, gain: Array, stops: float) -> _Lines:
    """The values of a function along the lines, more of which lie where a gain clips."""
    t = np.linspace(0.0, 1.0, LINE_STEPS + 1) ** (1.5 + 0.25 * stops)  # finer in the darks, where responses are steep
    across = sobol(LINES, 2)
    across[: LINES // 2] **= 2

    values = []
    for axis in range(3):
        other_axes = [c for c in range(3) if c != axis]
        x = np.empty((LINES + 1, len(t), 3))
        x[..., axis] = t
        x[1:, :, other_axes] = np.minimum(across * np.maximum(gain[other_axes], 1.0), 1.0)[:, None, :]
        x[0] = t[:, None]
        values.append(function(x.reshape(-1, 3)).reshape(x.shape))

    return _Lines(t, across, tuple(values))


def _axes(
    lines: _Lines, share: Array, curve: Array | None, size: int, node_density: Callable[[_Bends], Array]
) -> FittedAxes:
    """The axes with nodes spaced by a density along a curve that is given, or else measured.

    share: (LINES,), the weight of each line but the grey axis.
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
        # Each cell holds the same mass.
        places.append(np.interp(np.linspace(0.0, total[-1], size), total, t))

    is_straight = len(curve) == 2  # two entries: the identity
    return _on_shortest_grid((places[0], places[1], places[2]), None if is_straight else curve)


def _mean(values: Array, share: Array, grey: float = 0.25) -> Array:
    """The weighted mean over the lines (LINES + 1, m); grey: weight of the grey axis, share: of the other lines."""
    return np.asarray((1 - grey) * (share @ values[1:]) + grey * values[0])


def _curve(slope: Array, t: Array) -> Array:
    """The running sum of a slope, from 0 to 1, at MAX_SHAPER_SIZE even steps."""
    density = scipy.ndimage.gaussian_filter1d(slope, 4.0, mode="nearest")
    total = float(np.sum(density * np.diff(t)))
    # Add half of a straight line, so that the curve rises where the function is flat.
    density = density + 0.5 * total if total > 1e-12 else np.ones_like(density)
    u = np.concatenate([[0.0], np.cumsum(density * np.diff(t))])
    curve = scipy.interpolate.PchipInterpolator(t, u / u[-1])(np.linspace(0.0, 1.0, MAX_SHAPER_SIZE))
    curve[0], curve[-1] = 0.0, 1.0
    return np.asarray(curve)


def _mass(y: Array, t: Array, u: Array, node_density: Callable[[_Bends], Array]) -> Array:
    """Share of the nodes in each step (LINE_STEPS,), from the curvature along the curve's values u at the levels t."""
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
    short = snapped(places, SHORT_SHAPER_SIZE)
    narrowest = min(float(np.diff(axis).min()) for axis in short) * (SHORT_SHAPER_SIZE - 1)
    if narrowest >= CELL_STEPS and shaper_error(short, SHORT_SHAPER_SIZE, curve) <= SHAPER_ERROR:
        return FittedAxes(curve, short, SHORT_SHAPER_SIZE)
    return FittedAxes(curve, snapped(places, MAX_SHAPER_SIZE), MAX_SHAPER_SIZE)
