"""The fit of a lowered transform's segments: a curve per channel and a cube under the reader's own interpolation."""

from collections.abc import Sequence

import numpy as np

from lutforge.interpolation import Interpolation
from lutforge.luts.fit_axes import FittedAxes, fit_axes, fit_axes_before_curve
from lutforge.luts.fit_cube import Axes, Function, Share, fit_cube, fit_cube_before_curve, slope_weight
from lutforge.luts.lower import EvenSegment, Part, Segment, SegmentBeforeCurve, WholeSegment
from lutforge.luts.ops import Cube, Op, joined
from lutforge.luts.shaper import SHAPER_SIZE, is_even, levels_behind_gain, shaper
from lutforge.model.lattice import uniform_levels
from lutforge.progress import Progress


def fit_segments(parts: Sequence[Part], size: int, method: Interpolation, progress: Progress) -> tuple[Op, ...]:
    """The operations of a lowered transform, its segments by cubes of `size` nodes per axis. O(size³) evaluations."""
    return joined([op for part in parts for op in _fitted(part, size, method, progress)])


def _fitted(part: Part, size: int, method: Interpolation, progress: Progress) -> tuple[Op, ...]:
    """A segment as operations; an operation as it is."""
    if not isinstance(part, Segment | EvenSegment):
        return (part,)

    progress(f"{size}³ nodes: where they lie", 0.0)
    share = _share(size, progress)
    match part:
        case WholeSegment():
            ops = _fitted_whole(part, size, method, share)
        case SegmentBeforeCurve():
            ops = _fitted_before_curve(part, size, method, share)
        case Segment():
            axes = fit_axes(part.function, part.gain, size, part.curve, part.stops)
            values = fit_cube(within(part.function), axes.of_cube(), method, part.gain, share)
            ops = (*_shaper(axes), Cube(values, method))
        case EvenSegment():
            even = uniform_levels(size)
            values = fit_cube(part.function, Axes(even, even, lambda x: x), method, np.ones(3), share)
            ops = (Cube(values, method),)
    progress(f"{size}³ nodes: fitted", 0.8)
    return ops


def _fitted_before_curve(part: SegmentBeforeCurve, size: int, method: Interpolation, share: Share) -> tuple[Op, ...]:
    """A segment whose errors count as the curve after it magnifies them."""
    weight = slope_weight(part.output_curve)
    axes = fit_axes_before_curve(part.function, part.gain, size, weight, part.curve)
    values = fit_cube_before_curve(within(part.function), axes.of_cube(), method, part.gain, weight, share)
    return (*_shaper(axes), Cube(values, method))


def _fitted_whole(part: WholeSegment, size: int, method: Interpolation, share: Share) -> tuple[Op, ...]:
    """A segment that is all of a LUT, with its gain and its domain in the shaper, and its matrix in the cube."""
    gain = part.gain
    axes = fit_axes(part.function, gain, size, part.curve, part.stops)
    # The levels are those of the shaper, before the gain, where each is on its grid.
    levels = levels_behind_gain(axes.levels, gain)
    r, g, b = (axis * factor for axis, factor in zip(levels, gain, strict=True))
    axes = FittedAxes(axes.curve, (r, g, b))

    values = fit_cube(within(part.function), axes.of_cube(), method, gain, share)
    cube = Cube(values @ part.matrix.T, method)
    if np.all(gain == 1):
        return (*_shaper(axes, part.highest), cube)

    r, g, b = (axis / factor for axis, factor in zip(axes.levels, gain, strict=True))
    at = np.linspace(0.0, 1.0, SHAPER_SIZE)[:, None] * gain
    curve = None if axes.curve is None else axes.stretched(at)
    return shaper((r, g, b), SHAPER_SIZE, curve, part.highest), cube


def _shaper(axes: FittedAxes, high: float = 1.0) -> tuple[Op, ...]:
    """The shaper of axes; none where they are even from 0 to 1."""
    if axes.curve is None and is_even(axes.levels) and high == 1:
        return ()
    return (shaper(axes.levels, SHAPER_SIZE, axes.curve, high),)


def within(function: Function) -> Function:
    """Return a function of inputs of 1 at most: a level before a gain is rounded up, beyond what clips."""
    return lambda x: function(np.minimum(x, 1.0))


def _share(size: int, progress: Progress) -> Share:
    """What reports the share of a function's evaluations as progress of a fit."""
    return lambda share: progress(f"{size}³ nodes: evaluated", 0.8 * share)
