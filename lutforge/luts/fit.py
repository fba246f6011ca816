"""Fit a LUT of a given size to a transform: axes along which it is smooth, then the cube by least squares."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lutforge.errors import LutError
from lutforge.interpolation import Interpolation
from lutforge.luts.axes import Axes, fit_axes, measure_lines
from lutforge.luts.least_squares import Samples, fit_cube, sample
from lutforge.luts.lut import Lut
from lutforge.luts.parts import Parts, slope_weight
from lutforge.model.lattice import uniform_levels
from lutforge.model.transform import Transform

Array = NDArray[np.float64]
Progress = Callable[[str, float], None]
"""Called with what is being done and the share that is done, 0 … 1."""


@dataclass(frozen=True, eq=False)
class Evaluated:
    """A transform, and what was evaluated of it for a LUT with a response: one without need not do so again.

    plain: the axes of that one; lut: the one with a response.
    """

    transform: Transform
    parts: Parts
    plain: Axes
    samples: Samples
    lut: Lut

    def __call__(self, x: ArrayLike) -> Array:
        """The transform, (…, 3) → (…, 3)."""
        return self.transform(x)


def fit_lut(
    transform: Transform,
    parts: Parts,
    size: int,
    method: Interpolation,
    shaper: bool = True,
    shared: bool = False,
    progress: Progress = lambda what, share: None,
) -> Lut:
    """A LUT of a transform's parts; its source is the transform, evaluated where it has a response."""
    progress(f"{size}³ nodes: where they lie", 0.0)
    axes, plain = Axes(np.repeat([[0.0], [1.0]], 3, axis=1), uniform_levels(size)), None
    if shaper:
        weight = None if parts.response is None else slope_weight(parts.response)
        lines = measure_lines(parts.inner, parts.gain, parts.stops)
        axes = fit_axes(lines, size, weight, parts.curve, shared)
        if parts.response is not None:
            plain = fit_axes(lines.through(parts.response), size)
    designs = (axes.levels,) if plain is None else (axes.levels, plain.levels)
    samples = sample(parts.inner, designs, parts.gain, lambda share: progress(f"{size}³ nodes: evaluated", 0.8 * share))
    progress(f"{size}³ nodes: fitted", 0.8)
    lut = _fitted(parts, axes, samples, 0, method, parts.response)
    source = transform if plain is None else Evaluated(transform, parts, plain, samples, lut)
    return replace(lut, source=source)


def fit_without_response(known: Evaluated, method: Interpolation) -> Lut:
    """The same transform at the same size as a shaper and a cube."""
    if known.parts.response is None:
        raise LutError("the LUT has no response")
    samples = known.samples.through(known.parts.response)
    return replace(_fitted(known.parts, known.plain, samples, 1, method, None), source=known)


def _fitted(
    parts: Parts, axes: Axes, samples: Samples, design: int, method: Interpolation, response: Array | None
) -> Lut:
    curve = axes.curve if len(axes.curve) > 2 else None  # a straight line stretches nothing
    empty = Lut(
        parts.gain,
        axes.levels,
        samples.nodes[design],
        parts.matrix,
        interpolation=method,
        curve=curve,
        response=response,
    )
    weight = None if response is None else slope_weight(response)
    cube = fit_cube(samples, design, empty.knots, method, empty.stretched, weight, response is None)
    return replace(empty, cube=cube)
