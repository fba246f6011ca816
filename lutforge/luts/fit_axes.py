"""The axes of a cube that is fitted to a known function: an input curve per channel, and node levels along it.

A cube interpolates linearly between its nodes, so an axis is made in two steps.

1. The curve stretches the axis until the function rises evenly along it. It is the running sum of the function's slope,
   the root mean square over many lines along the axis. Of all curves this one leaves the least curvature on average,
   since d/dx log u' = ⟨F_xx, F_x⟩ / ⟨F_x, F_x⟩ for a curve u and a function F.
2. The node levels even out the curvature κ that is left. In an interval of width h the mean error is proportional to
   |κ| h². For a given number of intervals the total error is least where 1/h is proportional to |κ|^(1/3), and the
   largest error is least where it is proportional to |κ|^(1/2) (de Boor 1973, https://doi.org/10.1007/BFb0069390).

`fit_axes` takes the first of these two powers: it is for a cube without a curve after it. `fit_axes_before_curve` takes
the second: an output curve magnifies the errors of dark colours, so that few lines have the largest errors, and a power
mean over the lines gives these lines more weight.
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
    lines = _function_on_lines(function, gain, stops)

    # The share of all inputs that each line but the grey axis represents; half lie in the dark tones.
    density = 0.5 + 0.125 / np.sqrt(np.maximum(lines.across.prod(axis=1), 1e-4))
    share = 1 / (density * np.sum(1 / density))

    def node_density(bends: _Bends) -> Array:
        # Inputs per unit of the curve. The square root lies half way between counting inputs and counting cells, as the
        # weights of the fit do.
        input_density = bends.input_widths / bends.widths
        curvature = _share_weighted_mean(np.sqrt(bends.squared_curvature), share)
        return np.asarray((curvature * np.sqrt(input_density)) ** (1 / 3))

    return _spaced_axes(lines, share, curve, size, node_density)


def fit_axes_before_curve(
    function: Function, gain: Array, size: int, weight: Function, curve: Array | None = None
) -> FittedAxes:
    """Curve and node levels as in `fit_axes`, but such that the largest error after an output curve is least.

    weight: outputs (n, 3) → (n,), the weight of a squared error there.
    """
    lines = _function_on_lines(function, gain, 0.0)
    share = np.full(LINES, 1 / LINES)

    def node_density(bends: _Bends) -> Array:
        weights = weight(bends.outputs.reshape(-1, 3)).reshape(bends.squared_curvature.shape)
        # The cubic mean of curvatures lies between the root mean square and the largest.
        cubes = (bends.squared_curvature * weights) ** 1.5
        return np.asarray(_share_weighted_mean(cubes, share, grey_share=0.5) ** (1 / 6))

    return _spaced_axes(lines, share, curve, size, node_density)


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

    levels: (LINE_STEPS + 1,), the inputs along each line. values: per axis (LINES + 1, LINE_STEPS + 1, 3), the first of
    the lines being the grey axis. across: (LINES, 2), the coordinates of the other lines on the other two axes.
    """

    levels: Array
    across: Array
    values: tuple[Array, ...]


@dataclass(frozen=True, eq=False)
class _Bends:
    """How a function bends between the steps of the lines along an axis, in units of the axis's curve.

    outputs: (LINES + 1, LINE_STEPS − 1, 3), where two steps meet; squared_curvature: (LINES + 1, LINE_STEPS − 1) there;
    widths: (LINE_STEPS − 1,), of these two steps along the curve; input_widths: of the two along the inputs.
    """

    outputs: Array
    squared_curvature: Array
    widths: Array
    input_widths: Array


def _function_on_lines(function: Function, gain: Array, stops: float) -> _Lines:
    """The values of a function along the lines, more of which lie where a gain clips."""
    # Steps are finer in the darks, where responses are steep.
    levels = np.linspace(0.0, 1.0, LINE_STEPS + 1) ** (1.5 + 0.25 * stops)
    across = sobol(LINES, 2)
    across[: LINES // 2] **= 2

    values = []
    for axis in range(3):
        other_axes = [c for c in range(3) if c != axis]
        x = np.empty((LINES + 1, len(levels), 3))
        x[..., axis] = levels
        x[1:, :, other_axes] = np.minimum(across * np.maximum(gain[other_axes], 1.0), 1.0)[:, None, :]
        x[0] = levels[:, None]
        values.append(function(x.reshape(-1, 3)).reshape(x.shape))

    return _Lines(levels, across, tuple(values))


def _spaced_axes(
    lines: _Lines, share: Array, curve: Array | None, size: int, node_density: Callable[[_Bends], Array]
) -> FittedAxes:
    """The axes with nodes spaced by a density along a curve that is given, or else measured.

    share: (LINES,), the weight of each line but the grey axis.
    """
    if curve is None:
        curve = np.stack([_cumulated_slope(_mean_slope(lines, axis, share), lines.levels) for axis in range(3)], axis=1)
    curve_inputs = np.linspace(0.0, 1.0, len(curve))

    node_levels = []
    for axis, values in enumerate(lines.values):
        stretched = np.interp(lines.levels, curve_inputs, curve[:, axis])
        nodes = np.cumsum(_nodes_per_step(values, lines.levels, stretched, node_density))
        nodes_before = np.concatenate([[0.0], nodes])
        # Each cell holds the same share of the nodes.
        node_levels.append(np.interp(np.linspace(0.0, nodes_before[-1], size), nodes_before, lines.levels))

    r, g, b = node_levels
    is_straight = len(curve) == 2  # two entries: the identity
    return _on_shortest_grid((r, g, b), None if is_straight else curve)


def _share_weighted_mean(values: Array, share: Array, grey_share: float = 0.25) -> Array:
    """The mean over the lines of values (LINES + 1, m), by the share of each line.

    grey_share: of the grey axis; share: (LINES,), of the other lines among themselves.
    """
    return np.asarray((1 - grey_share) * (share @ values[1:]) + grey_share * values[0])


def _mean_slope(lines: _Lines, axis: int, share: Array) -> Array:
    """The root-mean-square slope of a function in each step (LINE_STEPS,) along an axis."""
    slope = np.diff(lines.values[axis], axis=1) / np.diff(lines.levels)[:, None]
    return np.sqrt(_share_weighted_mean(np.sum(slope**2, axis=2), share))


def _cumulated_slope(slope: Array, levels: Array) -> Array:
    """The running sum of a slope, from 0 to 1, at MAX_SHAPER_SIZE even steps."""
    steps = np.diff(levels)
    smooth = scipy.ndimage.gaussian_filter1d(slope, 4.0, mode="nearest")
    rise = float(np.sum(smooth * steps))
    # Add half of a straight line, so that the curve rises where the function is flat.
    rising = smooth + 0.5 * rise if rise > 1e-12 else np.ones_like(smooth)
    sums = np.concatenate([[0.0], np.cumsum(rising * steps)])
    curve = scipy.interpolate.PchipInterpolator(levels, sums / sums[-1])(np.linspace(0.0, 1.0, MAX_SHAPER_SIZE))
    curve[0], curve[-1] = 0.0, 1.0
    return np.asarray(curve)


def _nodes_per_step(outputs: Array, levels: Array, stretched: Array, node_density: Callable[[_Bends], Array]) -> Array:
    """The share of the nodes in each step (LINE_STEPS,), from the function's curvature along the curve.

    outputs: (LINES + 1, LINE_STEPS + 1, 3), of the function; stretched: the curve at the levels, (LINE_STEPS + 1,).
    """
    input_steps = np.diff(levels)
    steps = np.diff(stretched)
    widths = steps[1:] + steps[:-1]
    slope = np.diff(outputs, axis=1) / steps[:, None]
    curvature = np.diff(slope, axis=1) * (2 / widths)[:, None]

    bends = _Bends(outputs[:, 1:-1], np.sum(curvature**2, axis=2), widths, input_steps[1:] + input_steps[:-1])
    density = np.pad(node_density(bends), 1, mode="edge")
    smooth = scipy.ndimage.gaussian_filter1d(density, 1.0, mode="nearest")

    nodes = 0.5 * (smooth[1:] + smooth[:-1]) * steps
    total = nodes.sum()
    # A fifth of the nodes stays evenly spread; all of them, where the function is straight.
    nodes = 0.8 * nodes / total + 0.2 * input_steps if total > 1e-12 else input_steps
    return np.asarray(nodes / nodes.sum())


def _on_shortest_grid(node_levels: Levels, curve: Array | None) -> FittedAxes:
    """Node levels on the grid of the shortest shaper that holds them and the curve: a long one makes long files."""
    short = snapped(node_levels, SHORT_SHAPER_SIZE)
    narrowest = min(float(np.diff(axis).min()) for axis in short) * (SHORT_SHAPER_SIZE - 1)
    if narrowest >= CELL_STEPS and shaper_error(short, SHORT_SHAPER_SIZE, curve) <= SHAPER_ERROR:
        return FittedAxes(curve, short, SHORT_SHAPER_SIZE)
    return FittedAxes(curve, snapped(node_levels, MAX_SHAPER_SIZE), MAX_SHAPER_SIZE)
