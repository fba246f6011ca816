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
from dataclasses import dataclass, replace

import numpy as np

from lutforge.arrays import Array
from lutforge.errors import LutError
from lutforge.interpolation import Levels, apply_curve
from lutforge.luts.ops import Cube, Curve, Op
from lutforge.model.lattice import Lattice, grid, snap_levels
from lutforge.sobol import sobol

SHAPER_SIZE = 65536
"""Entries of a shaper: the most that DaVinci Resolve and OpenColorIO read in a .cube file."""

FEW = 4096
"""Entries that hold the node levels of profiles, which are snapped to so many points."""


def shaper(levels: Levels, size: int = SHAPER_SIZE, axis_curve: Array | None = None, high: float = 1.0) -> Curve:
    """The curve that takes node levels, multiples of 1 / (size − 1), to even steps.

    levels: (N,) per channel, as shares of the domain from 0 to `high`; they may end before or beyond it.
    axis_curve: (m, 3), rising, at even steps of the domain: the cube is linear in its values between two nodes, and not
    in the inputs. Raises LutError where a level is not on the grid, or the curve does not rise from node to node.
    """
    if not 2 <= size <= SHAPER_SIZE:
        raise LutError(f"LUT: a shaper of {size} entries; readers take 2 to {SHAPER_SIZE}")
    for name, axis in zip("RGB", levels, strict=True):
        if not np.all(np.isfinite(axis)) or axis[0] != 0 or not np.all(np.diff(axis) > 0):
            raise LutError(f"LUT: the {name} node levels do not increase strictly from 0")
        if not on_grid(axis, size):
            raise LutError(
                f"LUT: node levels are not multiples of 1/{size - 1}, so a shaper of {size} entries cannot hold them; "
                "snap them before the fit"
            )
    at = np.linspace(0.0, 1.0, size)
    columns = []
    for c, axis in enumerate(levels):
        x, knots = at, axis
        if axis_curve is not None:
            even = np.linspace(0.0, 1.0, len(axis_curve))
            x, knots = np.interp(at, even, axis_curve[:, c]), np.interp(axis, even, axis_curve[:, c])
            # Beyond the domain the curve runs straight on, so that a last level out there is told from those before.
            knots = knots + np.maximum(axis - 1.0, 0.0)
            if not np.all(np.diff(knots) > 0):
                raise LutError("LUT: the axis curve does not rise from one node level to the next")
        columns.append(np.interp(x, knots, np.linspace(0.0, 1.0, len(axis))))
    return Curve(np.stack(columns, axis=1), 0.0, high)


def node_levels(curve: Curve | None, cube: Cube) -> Levels:
    """The inputs (N,) of a shaper at which the nodes of its cube lie, per channel; even ones where there is no shaper.

    Nodes that the shaper does not reach lie at its ends.
    """
    r, g, b = (np.linspace(0.0, 1.0, count) for count in cube.values.shape[:3])
    if curve is None:
        return r, g, b
    at = np.linspace(curve.low, curve.high, len(curve.outputs))
    levels = []
    for c, even in enumerate((r, g, b)):
        rising = np.maximum.accumulate(curve.outputs[:, c])
        first = np.concatenate([[True], np.diff(rising) > 0])  # a flat end is reached where it begins
        inputs = at if curve.inputs is None else curve.inputs[:, c]
        levels.append(np.interp(even, rising[first], inputs[first]))
    return levels[0], levels[1], levels[2]


def on_grid(axis: Array, size: int) -> bool:
    """True where every node level is one of the points of a sampled shaper of `size` entries."""
    points = axis * (size - 1)
    return bool(np.all(np.abs(points - np.rint(points)) < 1e-6))


def is_even(levels: Levels) -> bool:
    """True where node levels are evenly spaced on [0, 1], so that no shaper is needed."""
    return all(np.allclose(axis, np.linspace(0.0, 1.0, len(axis)), rtol=0, atol=1e-12) for axis in levels)


def levels_behind_gain(levels: Levels, gain: Array) -> Levels:
    """Node levels (N,) behind a gain (3,) as levels in front of it: L / gain, moved to the points of a shaper.

    Each gets a point of its own. The last may lie before or beyond 1; it is rounded up, so that all that the camera
    clips stays clipped.
    """
    moved = []
    for axis, factor in zip(levels, gain, strict=True):
        scaled = axis / factor * (SHAPER_SIZE - 1)
        points = np.rint(scaled).astype(np.int64)
        points[-1] = int(np.ceil(scaled[-1] - 1e-6))
        order = np.arange(len(axis))
        moved.append((np.maximum.accumulate(points - order) + order) / (SHAPER_SIZE - 1))
    return moved[0], moved[1], moved[2]


def padded_levels(axis: Array, size: int) -> Array:
    """Levels with midpoints of the widest cells added until there are `size` of them."""
    while len(axis) < size:
        widest = int(np.argmax(np.diff(axis)))
        axis = np.insert(axis, widest + 1, 0.5 * (axis[widest] + axis[widest + 1]))
    return axis


def lattice_ops(lattice: Lattice) -> tuple[Op, ...]:
    """A lattice as shaper, cube and output curve; exact where its levels are on a shaper's grid and equal in number.

    Else levels are moved to the grid, or added in the widest cells, and the cube is evaluated there.
    """
    size = max(lattice.size)
    r, g, b = (padded_levels(axis, size) for axis in lattice.levels)
    entries = next((few for few in (FEW, SHAPER_SIZE) if all(on_grid(axis, few) for axis in (r, g, b))), None)
    if entries is None and not is_even((r, g, b)):
        r, g, b = levels_behind_gain((r, g, b), np.ones(3))
    same = all(np.array_equal(new, old) for new, old in zip((r, g, b), lattice.levels, strict=True))
    values = lattice.values if same else lattice.cube_values(grid((r, g, b)))
    return ops_of_nodes((r, g, b), values, lattice, entries or SHAPER_SIZE)


def ops_of_nodes(levels: Levels, values: Array, like: Lattice, size: int = SHAPER_SIZE) -> tuple[Op, ...]:
    """Node values at levels on a shaper's grid as operations; interpolation and output curve are those of `like`."""
    curve: tuple[Op, ...] = () if is_even(levels) else (shaper(levels, size),)
    behind: tuple[Op, ...] = () if like.output_curve is None else (Curve(like.output_curve),)
    return *curve, Cube(values, like.interpolation), *behind


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

    def behind(self, curve: Array) -> "MeasuredLines":
        """Return the lines with a curve behind the function."""
        r, g, b = (apply_curve(curve, y) for y in self.values)
        return replace(self, values=(r, g, b))


def measure_lines(function: Function, gain: Array, stops: float = 0.0) -> MeasuredLines:
    """Lines of a function (n, 3) in [0, 1] → (n, 3).

    gain: (3,) in front of it, where it clamps at 1: inputs are taken to be even before it. stops: of light that the
    axes span beyond 1; the more, the finer the darks are looked at.
    """
    t = np.linspace(0.0, 1.0, STEPS + 1) ** (1.5 + 0.25 * stops)  # finer in the darks, where responses are steep
    places = sobol(LINES, 2)
    places[: LINES // 2] **= 2
    density = 0.5 + 0.125 / np.sqrt(np.maximum(places.prod(axis=1), 1e-4))
    r, g, b = (_lines(function, t, axis, places, gain) for axis in range(3))
    return MeasuredLines(t, (r, g, b), 1 / (density * np.sum(1 / density)))


def fit_axes(
    lines: MeasuredLines,
    size: int,
    weight: Function | None = None,
    curve: Array | None = None,
    shared: bool = False,
) -> Axes:
    """Curve and `size` node levels per axis for a function along lines.

    weight: outputs (n, 3) → (n,), how much a squared error counts there. curve: the input curve, where it is known.
    shared: all three axes get one curve and one set of levels.
    """
    t = lines.t
    share = lines.share if weight is None else np.full(LINES, 1 / LINES)  # a weight looks for the largest errors
    if curve is None:
        slopes = [_slope(y, t, share) for y in lines.values]
        if shared:
            slopes = [np.sqrt(np.mean(np.square(slopes), axis=0))] * 3
        curve = np.stack([_curve(slope, t) for slope in slopes], axis=1)
    even = np.linspace(0.0, 1.0, len(curve))
    places = [np.interp(t, even, curve[:, axis]) for axis in range(3)]
    masses = [_mass(lines.values[axis], t, places[axis], share, weight) for axis in range(3)]
    if shared:
        masses = [np.mean(masses, axis=0)] * 3
    r, g, b = (snap_levels(_equal(mass, t, size), SHAPER_SIZE) for mass in masses)
    return Axes(curve if len(curve) > 2 else None, (r, g, b))  # a straight line stretches nothing


def _lines(function: Function, t: Array, axis: int, places: Array, gain: Array) -> Array:
    """The function on lines along an axis, (LINES + 1, STEPS + 1, 3); the first is the grey axis."""
    others = [c for c in range(3) if c != axis]
    x = np.empty((LINES + 1, len(t), 3))
    x[..., axis] = t
    x[1:, :, others] = np.minimum(places * np.maximum(gain[others], 1.0), 1.0)[:, None, :]
    x[0] = t[:, None]
    return function(x.reshape(-1, 3)).reshape(x.shape)


def _mean(values: Array, share: Array, grey: float = 0.25) -> Array:
    """The mean over the lines (LINES + 1, m), of which the grey axis counts the share `grey`."""
    return np.asarray((1 - grey) * (share @ values[1:]) + grey * values[0])


def _slope(y: Array, t: Array, share: Array) -> Array:
    slope = np.diff(y, axis=1) / np.diff(t)[:, None]
    return np.asarray(np.sqrt(_mean(np.sum(slope**2, axis=2), share)))


def _curve(slope: Array, t: Array) -> Array:
    """The running sum of a slope, from 0 to 1, at SHAPER_SIZE even steps."""
    import scipy  # here: what grades by a file that is there loads this one, and makes no axes

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
    import scipy

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


def _equal(mass: Array, t: Array, size: int) -> Array:
    """Levels (size,) between which there is equal mass."""
    total = np.concatenate([[0.0], np.cumsum(mass)])
    return np.interp(np.linspace(0.0, total[-1], size), total, t)
