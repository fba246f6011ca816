"""Fit a cube of a given size to a transform: axes along which it is smooth, then the nodes by least squares.

What is costly is evaluating the transform; `evaluate` does it once for all forms of a size.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from lutforge.interpolation import Interpolation
from lutforge.luts.axes import Axes, fit_axes, measure_lines
from lutforge.luts.least_squares import Samples, fit_cube, sample
from lutforge.luts.ops import Cube, Curve, Matrix, Op, Range
from lutforge.luts.parts import Parts, as_one, parts_of, slope_weight
from lutforge.luts.sequence import Form
from lutforge.luts.shaper import SHAPER_SIZE, is_even, levels_behind_gain, shaper
from lutforge.model.lattice import uniform_levels
from lutforge.model.transform import ColourFunction
from lutforge.progress import Progress, silent


@dataclass(frozen=True, eq=False)
class EvaluatedTransform:
    """A transform at the points of a fit, for one size and one or more forms.

    designs: per form the axes of its cube, behind the gain of the parts; inputs span 0 to `highest`.
    """

    parts: Parts
    designs: Mapping[Form, Axes]
    samples: Samples
    highest: float


def evaluate(
    transform: ColourFunction, size: int, forms: Sequence[Form], highest: float = 1.0,
    progress: Progress = silent,
) -> EvaluatedTransform:  # fmt: skip
    """Evaluate a transform for fits of `size` nodes per axis. O(size³) evaluations.

    forms: "full" and "shaper" share what is evaluated; "plain" stands alone. highest: inputs reach from 0 to
    this. Raises LutError where the transform is no function of colours.
    """
    progress(f"{size}³ nodes: where they lie", 0.0)
    plain = "plain" in forms
    parts = parts_of(transform) if highest == 1 and not plain else as_one(transform, highest)
    designs: dict[Form, Axes] = {}
    if plain:
        designs["plain"] = Axes(None, uniform_levels(size))
    else:
        lines = measure_lines(parts.cube_values, parts.gain, parts.stops)
        rendered = lines if parts.output_curve is None else lines.behind(parts.output_curve)
        for form in forms:
            if form == "full":
                weight = None if parts.output_curve is None else slope_weight(parts.output_curve)
                designs[form] = fit_axes(lines, size, weight, parts.curve)
            else:
                curve = parts.curve if parts.output_curve is None else None
                axes = fit_axes(rendered, size, None, curve)
                folded = levels_behind_gain(axes.levels, parts.gain)
                r, g, b = (axis * gain for axis, gain in zip(folded, parts.gain, strict=True))
                designs[form] = Axes(axes.curve, (r, g, b))
    samples = sample(
        lambda x: parts.cube_values(np.minimum(x, 1.0)),  # a level in front of a gain is rounded up, beyond what clips
        tuple(axes.levels for axes in designs.values()),
        parts.gain,
        lambda share: progress(f"{size}³ nodes: evaluated", 0.8 * share),
    )
    return EvaluatedTransform(parts, designs, samples, highest)


def fit_ops(evaluated: EvaluatedTransform, form: Form, method: Interpolation) -> tuple[Op, ...]:
    """The operations of a form that come nearest to what was evaluated, under the reader's own interpolation."""
    parts, axes = evaluated.parts, evaluated.designs[form]
    curve = parts.output_curve if form == "full" else None
    samples = evaluated.samples
    if parts.output_curve is not None and curve is None:
        samples = samples.behind(parts.output_curve)
    weight = None if curve is None else slope_weight(curve)
    r, g, b = (axes.stretched(np.stack(axes.levels, axis=1))[:, c].copy() for c in range(3))
    design = list(evaluated.designs).index(form)
    values = fit_cube(samples, design, (r, g, b), method, axes.stretched, weight, curve is None)
    if form == "full":
        return full_ops(parts, axes, Cube(values, method), evaluated.highest)
    folded, gain = Cube(values @ parts.matrix.T, method), parts.gain
    if form == "plain":
        return (folded,)
    if np.all(gain == 1):
        return (*_shaper(axes, evaluated.highest), folded)
    r, g, b = (axis / factor for axis, factor in zip(axes.levels, gain, strict=True))
    at = np.linspace(0.0, 1.0, SHAPER_SIZE)[:, None] * gain
    in_front = None if axes.curve is None else axes.stretched(at)
    return shaper((r, g, b), SHAPER_SIZE, in_front, evaluated.highest), folded


def full_ops(parts: Parts, axes: Axes, cube: Cube, highest: float = 1.0) -> tuple[Op, ...]:
    """Matrices → clamp → shaper → cube → output curve → matrix, without what changes nothing."""
    ahead, behind = Matrix((parts.gain / highest)[:, None] * parts.before), Matrix(parts.matrix)
    return (
        *(() if ahead.is_identity else (ahead,)),
        Range(),
        *_shaper(axes),
        cube,
        *(() if parts.output_curve is None else (Curve(parts.output_curve),)),
        *(() if behind.is_identity else (behind,)),
    )


def _shaper(axes: Axes, high: float = 1.0) -> tuple[Op, ...]:
    if axes.curve is None and is_even(axes.levels) and high == 1:
        return ()
    return (shaper(axes.levels, SHAPER_SIZE, axes.curve, high),)
