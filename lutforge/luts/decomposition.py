"""The decomposition of a transform: gain and matrices around a body, and responses, which become curves."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from lutforge.arrays import Array, ColourFunction
from lutforge.errors import LutError
from lutforge.interpolation import apply_curve
from lutforge.luts.fit_cube import Function
from lutforge.luts.ops import Curve, Matrix, Op, Range
from lutforge.luts.shaper import MAX_SHAPER_SIZE
from lutforge.model.gamut_map import GamutMap
from lutforge.model.lattice import Lattice
from lutforge.model.response import Response
from lutforge.model.transform import Clip, Decode, Encode, Gain, MatrixStage, Stage, Transform, through_stages


def curve_alone(transform: ColourFunction) -> tuple[Op, ...]:
    """Return the operations of a transform that is one response, gains and matrices; none of any other."""
    ops: list[Op] = []
    for stage in transform.stages if isinstance(transform, Transform) else ():
        match stage:
            case Gain():
                ops.append(Matrix(np.diag(stage.factors)))
            case MatrixStage():
                ops.append(Matrix(stage.matrix))
            case Clip():
                ops.append(Range())
            case Decode(Response() as response):
                # Three more entries between two of the response: a reader that interpolates by a spline then gets the
                # same values as one that interpolates linearly.
                even = np.linspace(0.0, 1.0, 4 * len(response.inverse) - 3)[:, None].repeat(3, axis=1)
                ops.append(Curve(response.linearize(even)))
            case Encode(Response() as response):
                low = response.inverse[0]
                span = response.inverse[-1] - low
                ops.append(Matrix(np.diag(1 / span), -low / span))
                ops.append(Curve(output_curve_of(response)[1]))
            case GamutMap() if stage.is_identity:
                pass
            case _:
                return ()
    return tuple(ops) if sum(isinstance(op, Curve) for op in ops) == 1 else ()


@dataclass(frozen=True, eq=False)
class Decomposition:
    """A transform as matrix_after · output_curve(cube_values(gain · matrix_before · x)).

    cube_values: the part that a cube is to hold, (n, 3) → (n, 3); matrix_before, matrix_after: (3, 3); gain: (3,).
    input_curve: (m, 3), along which `cube_values` is smooth, where it is known; output_curve: (m, 3), or none; lattice:
    the part between gain and matrix_after, where it is one lattice.
    """

    cube_values: Function
    gain: Array = field(default_factory=lambda: np.ones(3))
    matrix_after: Array = field(default_factory=lambda: np.eye(3))
    matrix_before: Array = field(default_factory=lambda: np.eye(3))
    input_curve: Array | None = None
    output_curve: Array | None = None
    lattice: Lattice | None = None

    def body(self, x: Array) -> Array:
        """The part between gain and matrix_after, of colours (n, 3) → (n, 3)."""
        values = self.cube_values(x)
        return values if self.output_curve is None else apply_curve(self.output_curve, values)


def decomposed(transform: ColourFunction) -> Decomposition:
    """Decompose a transform by its stages; of a function that is no Transform all is for the cube."""
    if not isinstance(transform, Transform):
        return Decomposition(checked(transform))

    stages = list(transform.stages)
    matrix_before = np.eye(3)
    gain = np.ones(3)
    matrix_after = np.eye(3)
    if stages and isinstance(stages[0], MatrixStage):
        matrix_before = stages.pop(0)(matrix_before.T).T
    if stages and isinstance(stages[0], Gain):
        gain = stages.pop(0)(gain)
    if stages and isinstance(stages[0], Clip):
        stages.pop(0)  # a curve or a cube clamps its inputs itself
    while stages and isinstance(stages[-1], MatrixStage | Gain):
        matrix_after = matrix_after @ stages.pop()(np.eye(3)).T

    body = tuple(stages)
    last = body[-1] if body else None
    lattice = last if isinstance(last, Lattice) and len(body) == 1 else None
    match last:
        case Encode(Response() as response):
            scaled, output_curve = output_curve_of(response)
            # A gamut map is smooth in linear values.
            input_curve = _input_curve(body, np.repeat([[0.0], [1.0]], 3, axis=1))
            cube_values = checked(lambda x: scaled(through_stages(body[:-1], x)))
            return Decomposition(cube_values, gain, matrix_after, matrix_before, input_curve, output_curve)
        case Lattice(output_curve=np.ndarray() as output_curve):
            input_curve = _input_curve(body, None)
            cube_values = checked(lambda x: last.cube_values(through_stages(body[:-1], x)))
            return Decomposition(cube_values, gain, matrix_after, matrix_before, input_curve, output_curve, lattice)

    # After a clip in the middle only an output curve magnifies what the axes of its input are made for.
    input_curve = None if any(isinstance(stage, Clip) for stage in body) else _input_curve(body, None)
    cube_values = checked(lambda x: through_stages(body, x))
    return Decomposition(cube_values, gain, matrix_after, matrix_before, input_curve, lattice=lattice)


def output_curve_of(response: Response) -> tuple[Function, Array]:
    """Linear values scaled to [0, 1] where f begins and ends, and f from there, (MAX_SHAPER_SIZE, 3)."""
    low = response.inverse[0]
    span = response.inverse[-1] - low
    even = np.linspace(0.0, 1.0, MAX_SHAPER_SIZE)[:, None]
    return lambda y: (y - low) / span, response.encode(low + even * span)


def _input_curve(body: Sequence[Stage], default: Array | None) -> Array | None:
    """f⁻¹ from 0 to 1 of a response that is the first stage, with a little of a straight line, so that it rises."""
    match body:
        case [Decode(Response(inverse=inverse)), *_]:
            straight = np.linspace(0.0, 1.0, len(inverse))[:, None]
            return np.asarray(0.999 * (inverse - inverse[0]) / (inverse[-1] - inverse[0]) + 0.001 * straight)
    return default


def checked(function: Function) -> Function:
    """Return the function (…, 3) → (…, 3) evaluated in blocks that stay in the processor's cache, at inputs up to 1.

    The last node level before a gain is rounded up, and may be above 1: such inputs are clipped. The function returned
    raises LutError on another shape and on numbers that are not finite.
    """

    def evaluated(x: Array) -> Array:
        flat = np.minimum(x, 1.0).reshape(-1, 3)
        y = np.empty_like(flat)
        for start in range(0, len(flat), 1 << 15):
            block = flat[start : start + (1 << 15)]
            result = np.asarray(function(block), dtype=np.float64)
            if result.shape != block.shape:
                raise LutError(f"the transform made shape {result.shape} of {block.shape}; it must keep the shape")
            if not np.all(np.isfinite(result)):
                worst = block[np.flatnonzero(~np.all(np.isfinite(result), axis=1))[0]]
                raise LutError(f"the transform gives a number that is not finite at {np.round(worst, 4).tolist()}")
            y[start : start + (1 << 15)] = result
        return y.reshape(x.shape)

    return evaluated
