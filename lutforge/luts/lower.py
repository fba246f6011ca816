"""A transform lowered to the form of a file: a list of operations that are known, and of segments to fit.

A camera model keeps its two responses as curves: a cube then holds the smooth colour mapping between them, on linear
axes, and what the camera clips is clipped by the response, not rounded off by the cube. A lattice of a profile is
lowered to operations as it stands, where it has the size and the interpolation of the target.
"""

from dataclasses import dataclass, field, replace

import numpy as np

from lutforge.arrays import Array, ColourFunction
from lutforge.colour.rgb_spaces import RgbSpace
from lutforge.errors import LutError
from lutforge.interpolation import Levels
from lutforge.luts.decomposition import Decomposition, checked, curve_alone, decomposed
from lutforge.luts.fit_cube import Function
from lutforge.luts.ops import Cube, Curve, Matrix, Op, Range, joined
from lutforge.luts.sequence import Lut
from lutforge.luts.shaper import MAX_SHAPER_SIZE, lattice_ops, levels_before_gain, node_levels, shaper
from lutforge.luts.target import Target
from lutforge.model.lattice import Lattice, grid, uniform_levels
from lutforge.model.transform import Clip, Decode, MatrixStage, Transform


@dataclass(frozen=True, eq=False)
class Segment:
    """A function of [0, 1]³, (n, 3) → (n, 3), that a curve per channel and a cube are to be fitted to.

    gain: (3,) before it, where it clamps at 1; curve: the input curve (m, 3) along which the function is smooth, where
    it is known; stops: how many stops beyond 1 its inputs spanned before they were scaled to [0, 1].
    """

    function: Function
    gain: Array = field(default_factory=lambda: np.ones(3))
    curve: Array | None = None
    stops: float = 0.0


@dataclass(frozen=True, eq=False)
class SegmentBeforeCurve(Segment):
    """A segment with an output curve (m, 3) after it, which magnifies its errors, and clips."""

    output_curve: Array = field(kw_only=True)


@dataclass(frozen=True, eq=False)
class SegmentOnLevels:
    """A function of [0, 1]³, (n, 3) → (n, 3), to be fitted at node levels as dense as the given ones.

    black, white: (3,), their coordinates in [0, 1]³, where the fitted cube has exactly the function's values.
    output_curve: (m, 3), after the cube.
    """

    function: Function
    levels: Levels
    black: Array
    white: Array
    output_curve: Array


@dataclass(frozen=True, eq=False)
class WholeSegment(Segment):
    """A segment that is all of a LUT: the shaper holds its gain and a domain up to `highest`, the cube its matrix."""

    matrix: Array = field(kw_only=True)
    highest: float = field(default=1.0, kw_only=True)


@dataclass(frozen=True, eq=False)
class EvenSegment:
    """A function of [0, 1]³, (n, 3) → (n, 3), that an evenly spaced cube alone is to be fitted to."""

    function: Function


LoweredPart = Op | Segment | SegmentOnLevels | EvenSegment
"""A part of a lowered transform: an operation that is known, or a segment to fit."""


def lower(transform: ColourFunction, target: Target, highest: float = 1.0) -> tuple[LoweredPart, ...]:
    """Return the operations and segments of a transform for one form.

    highest: of the inputs, which begin at 0; a transform of scene-linear inputs states itself where they are clipped.
    Raises LutError where the form cannot hold such inputs.
    """
    match target.form:
        case "full":
            return _to_any_sequence(transform, target, highest)
        case "shaper":
            return _to_shaper_and_cube(transform, target, highest)
        case "plain":
            return _to_cube(transform, target, highest)


def lower_steps(transform: Transform, target: Target) -> tuple[LoweredPart, ...]:
    """Return the operations and segments of a transform with a cube for each of its steps, from one clip to the next.

    A refinish between two lattices of a profile is lattice → matrix → lattice: written so, the file is the model, while
    one cube of both can only come near.
    """
    stages = transform.stages
    cuts = [index for index, stage in enumerate(stages) if isinstance(stage, Clip)][1:]
    steps = [Transform(stages[i:j]) for i, j in zip([0, *cuts], [*cuts, len(stages)], strict=True)]
    return tuple(part for step in steps for part in lower(step, target))


def takes_scenes(transform: ColourFunction) -> bool:
    """True for a transform of scene-linear inputs, which a matrix takes to the camera's RAW."""
    return isinstance(transform, Transform) and bool(transform.stages) and isinstance(transform.stages[0], MatrixStage)


def _to_any_sequence(transform: ColourFunction, target: Target, highest: float) -> tuple[LoweredPart, ...]:
    """Lower a transform to a file that holds any sequence of operations."""
    if isinstance(transform, Transform) and transform.is_identity:
        return (Range(),)

    first = transform.stages[0] if isinstance(transform, Transform) else None
    if isinstance(transform, Transform) and isinstance(first, Decode) and isinstance(first.curve, RgbSpace):
        # Footage is decoded by a curve, after which its linear values may exceed 1.
        codes = np.linspace(0.0, 1.0, MAX_SHAPER_SIZE)[:, None].repeat(3, axis=1)
        return Curve(first(codes)), *_to_any_sequence(Transform(transform.stages[1:]), target, 1.0)

    curve_ops = curve_alone(transform)
    if curve_ops:
        return curve_ops

    parts = decomposed(transform)
    before = Matrix(parts.gain[:, None] * parts.matrix_before)
    after = Matrix(parts.matrix_after)
    lattice = _exact_lattice(parts, target)
    if lattice is not None:
        return (before, Range(), *lattice_ops(lattice), after)

    if highest != 1:
        return Matrix(np.eye(3) / highest), Range(), _scaled(transform, highest)
    if parts.output_curve is None:
        cube: tuple[LoweredPart, ...] = (Segment(parts.cube_values, parts.gain, parts.input_curve),)
    elif parts.lattice is not None and parts.lattice.input_matrix is not None:
        to_axes, segment = _without_outer_cells(parts.lattice, parts.lattice.input_matrix, parts.output_curve)
        cube = (to_axes, Range(), segment, Curve(parts.output_curve))
    else:
        magnified = SegmentBeforeCurve(
            parts.cube_values, parts.gain, parts.input_curve, output_curve=parts.output_curve
        )
        cube = (magnified, Curve(parts.output_curve))
    return (before, Range(), *cube, after)


def _to_shaper_and_cube(transform: ColourFunction, target: Target, highest: float) -> tuple[LoweredPart, ...]:
    """Lower a transform to a curve per channel and a cube after it, or to a curve alone."""
    if isinstance(transform, Transform) and transform.is_identity:
        return (_even_cube(target),)

    match [op for op in joined(curve_alone(transform)) if not isinstance(op, Range)]:
        case [Curve() as curve]:
            return (curve,)
        case [Curve() as curve, Matrix() as matrix]:
            return curve, Cube(matrix(grid(uniform_levels(2))), target.method)

    if isinstance(transform, Transform) and takes_scenes(transform):
        return (_one_segment(transform, transform.highest()),)
    parts = decomposed(transform)
    folded = _folded_lattice(parts, target)
    if folded:
        return folded
    if highest != 1:
        return (_one_segment(transform, highest),)
    # An input curve is known for the values before an output curve, not for those after it.
    input_curve = parts.input_curve if parts.output_curve is None else None
    return (WholeSegment(parts.body, parts.gain, input_curve, matrix=parts.matrix_after),)


def _to_cube(transform: ColourFunction, target: Target, highest: float) -> tuple[LoweredPart, ...]:
    """Lower a transform to an evenly spaced cube, or to a curve alone where the file may hold one."""
    if highest != 1:
        raise LutError(f"LUT: a plain cube takes inputs from 0 to 1, not to {highest:g}; bake the form shaper or full")
    if isinstance(transform, Transform) and transform.is_identity:
        return (_even_cube(target),)

    match [op for op in joined(curve_alone(transform)) if not isinstance(op, Range)]:
        case [Curve() as curve] if target.curve:
            return (curve,)

    folded = () if takes_scenes(transform) else _folded_lattice(decomposed(transform), target)
    return folded if folded and Lut(folded).has_form("plain") else (EvenSegment(checked(transform)),)


def _even_cube(target: Target) -> Cube:
    """The cube that changes nothing."""
    return Cube(grid(uniform_levels(target.size or target.default)), target.method)


def _one_segment(transform: ColourFunction, highest: float) -> WholeSegment:
    """A transform with inputs up to `highest` as one segment, from which nothing is taken out."""
    scaled = _scaled(transform, highest)
    return WholeSegment(scaled.function, stops=scaled.stops, matrix=np.eye(3), highest=highest)


def _scaled(transform: ColourFunction, highest: float) -> Segment:
    """A transform with inputs up to `highest` as a segment of [0, 1]³."""
    stops = float(np.log2(max(highest, 1.0)))
    return Segment(checked(lambda x: transform(x * highest)), stops=stops)


def _without_outer_cells(lattice: Lattice, input_matrix: Array, output_curve: Array) -> tuple[Matrix, SegmentOnLevels]:
    """The matrix of a lattice, and its cube as a segment without the first and the last cell of each axis.

    These cells hold linear values that hardly any scene has, beyond black and white: a small cube has no nodes for
    them. A first cell with black in it stays, and so does a last one with white.
    """
    on_axes = replace(lattice, input_matrix=None)
    black = input_matrix[:, 3]
    white = lattice.on_axes(np.ones(3))
    from_black = [axis[(axis > 0) | (axis[1] > low)] for axis, low in zip(lattice.levels, black, strict=True)]
    r, g, b = (axis[(axis < 1) | (axis[-2] < high)] for axis, high in zip(from_black, white, strict=True))
    first = np.array([r[0], g[0], b[0]])
    span = np.array([r[-1], g[-1], b[-1]]) - first

    def function(x: Array) -> Array:
        return on_axes.cube_values(first + span * x)

    to_axes = Matrix(input_matrix[:, :3] / span[:, None], (black - first) / span)
    r, g, b = ((axis - axis[0]) / (axis[-1] - axis[0]) for axis in (r, g, b))
    at_black, at_white = (np.clip((place - first) / span, 0.0, 1.0) for place in (black, white))
    return to_axes, SegmentOnLevels(function, (r, g, b), at_black, at_white, output_curve)


def _folded_lattice(parts: Decomposition, target: Target) -> tuple[Op, ...]:
    """The shaper and cube of a lattice, which hold its gain and its matrix; nothing where a fit is needed."""
    lattice = _exact_lattice(parts, target)
    if lattice is None or lattice.output_curve is not None:
        return ()
    ops = lattice_ops(lattice)
    curve, cube = Lut(ops).shaper_and_cube()
    gain = parts.gain
    if np.all(gain == 1):
        return (*ops[:-1], Cube(cube.values @ parts.matrix_after.T, cube.interpolation))

    # Levels move to the shaper's grid, so the cube is evaluated there anew; the change is below one step of the shaper.
    levels = levels_before_gain(node_levels(curve, cube), gain)
    values = Lut(ops)(np.clip(grid(levels) * gain, 0.0, 1.0)) @ parts.matrix_after.T
    return shaper(levels), Cube(values, cube.interpolation)


def _exact_lattice(parts: Decomposition, target: Target) -> Lattice | None:
    """The lattice of a transform, where it has the size and the interpolation of a target."""
    lattice = parts.lattice
    if lattice is None or set(lattice.size) != {target.size or lattice.size[0]}:
        return None
    return lattice if target.interpolation in (None, lattice.interpolation) else None
