"""The fit of a lowered transform's segments: a curve per channel and a cube under the reader's own interpolation."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from lutforge.interpolation import Interpolation
from lutforge.luts.fit_axes import fit_axes, fit_axes_before_curve, slope_weight
from lutforge.luts.fit_cube import Axes, Share, fit_cube, fit_cube_before_curve
from lutforge.luts.lower import EvenSegment, LoweredPart, Segment, SegmentBeforeCurve, SegmentOnLevels, WholeSegment
from lutforge.luts.ops import Cube, Op, joined
from lutforge.luts.shaper import MAX_SHAPER_SIZE, levels_before_gain, shaper
from lutforge.model.lattice import SHORT_SHAPER_SIZE, nodes_at, resized_levels, snapped, uniform_levels, with_level_at
from lutforge.progress import Progress


def fit_segments(parts: Sequence[LoweredPart], size: int, method: Interpolation, progress: Progress) -> tuple[Op, ...]:
    """The operations of a lowered transform, its segments by cubes of `size` nodes per axis. O(size³) evaluations."""
    return joined([op for part in parts for op in _fitted(part, size, method, progress)])


def _fitted(part: LoweredPart, size: int, method: Interpolation, progress: Progress) -> tuple[Op, ...]:
    """A segment as operations; an operation as it is."""
    if not isinstance(part, Segment | SegmentOnLevels | EvenSegment):
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
            values = fit_cube(part.function, axes.of_cube(), method, part.gain, share)
            ops = (*axes.shaper(), Cube(values, method))
        case SegmentOnLevels():
            ops = _fitted_on_levels(part, size, method, share)
        case EvenSegment():
            even = uniform_levels(size)
            values = fit_cube(part.function, Axes(even, even, lambda x: x), method, np.ones(3), share)
            ops = (Cube(values, method),)
    progress(f"{size}³ nodes: fitted", 0.8)
    return ops


def _share(size: int, progress: Progress) -> Share:
    """A callback that reports the share of a function's evaluations as progress of a fit."""
    return lambda share: progress(f"{size}³ nodes: evaluated", 0.8 * share)


def _fitted_on_levels(part: SegmentOnLevels, size: int, method: Interpolation, share: Share) -> tuple[Op, ...]:
    """A segment fitted at `size` node levels as dense as its own."""
    levels = snapped(resized_levels(part.levels, size), SHORT_SHAPER_SIZE)
    on_grid = [np.rint(place * (SHORT_SHAPER_SIZE - 1)) / (SHORT_SHAPER_SIZE - 1) for place in (part.black, part.white)]
    for place in on_grid:
        levels = with_level_at(levels, place)
    weight = slope_weight(part.output_curve)
    values = fit_cube_before_curve(part.function, Axes(levels, levels, lambda x: x), method, np.ones(3), weight, share)
    for place, exact in zip(on_grid, (part.black, part.white), strict=True):
        values[nodes_at(levels, place)] = part.function(exact[None])
    return shaper(levels, SHORT_SHAPER_SIZE), Cube(values, method)


def _fitted_whole(part: WholeSegment, size: int, method: Interpolation, share: Share) -> tuple[Op, ...]:
    """A segment that is all of a LUT, with its gain and its domain in the shaper, and its matrix in the cube."""
    gain = part.gain
    axes = fit_axes(part.function, gain, size, part.curve, part.stops)
    if np.all(gain == 1):
        values = fit_cube(part.function, axes.of_cube(), method, gain, share)
        return (*axes.shaper(part.highest), Cube(values @ part.matrix.T, method))

    # The levels of the shaper lie before the gain, where each is on the grid.
    levels = levels_before_gain(axes.levels, gain)
    r, g, b = (axis * factor for axis, factor in zip(levels, gain, strict=True))
    axes = replace(axes, levels=(r, g, b))
    values = fit_cube(part.function, axes.of_cube(), method, gain, share)

    at = np.linspace(0.0, 1.0, MAX_SHAPER_SIZE)[:, None] * gain
    curve = None if axes.curve is None else axes.stretched(at)
    return shaper(levels, MAX_SHAPER_SIZE, curve, part.highest), Cube(values @ part.matrix.T, method)


def _fitted_before_curve(part: SegmentBeforeCurve, size: int, method: Interpolation, share: Share) -> tuple[Op, ...]:
    """A segment fitted with its errors weighted by the slope of the curve after it."""
    weight = slope_weight(part.output_curve)
    axes = fit_axes_before_curve(part.function, part.gain, size, weight, part.curve)
    values = fit_cube_before_curve(part.function, axes.of_cube(), method, part.gain, weight, share)
    return (*axes.shaper(), Cube(values, method))
