"""Split a transform into a gain, an input curve, a response and a matrix, and the rest, which the cube holds.

A physical model keeps its two responses as curves: the cube then holds the smooth colour mapping between them, on
linear axes, and what the camera clips is clipped by the response, not rounded off by the cube.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from lutforge.arrays import Array
from lutforge.errors import LutError
from lutforge.interpolation import apply_curve
from lutforge.luts.ops import Curve, Matrix, Op, Range
from lutforge.luts.shaper import SHAPER_SIZE
from lutforge.model.gamut_map import GamutMap
from lutforge.model.lattice import Lattice
from lutforge.model.response import Response
from lutforge.model.transform import (
    Clip,
    ColourFunction,
    Decode,
    Encode,
    Gain,
    MatrixStage,
    Stage,
    Transform,
    through_stages,
)

Function = Callable[[Array], Array]


@dataclass(frozen=True, eq=False)
class Parts:
    """A transform as matrix · output_curve(cube_values(gain · before · x)).

    The cube holds `cube_values`. curve: the input curves (m, 3) along which `cube_values` is smooth; output_curve:
    (k, 3) or None; lattice: `cube_values`, where it is a lattice as it stands; stops: how many stops of light beyond 1
    the inputs span.
    """

    cube_values: Function
    gain: Array = field(default_factory=lambda: np.ones(3))
    matrix: Array = field(default_factory=lambda: np.eye(3))
    before: Array = field(default_factory=lambda: np.eye(3))
    curve: Array | None = None
    output_curve: Array | None = None
    lattice: Lattice | None = None
    stops: float = 0.0


def parts_of(transform: ColourFunction) -> Parts:
    """Split a transform into its parts by its stages; a function that is no Transform goes into the cube whole."""
    if not isinstance(transform, Transform):
        return Parts(_checked(transform))
    stages = list(transform.stages)
    before, gain, matrix, behind = np.eye(3), np.ones(3), np.eye(3), None
    if stages and isinstance(stages[0], MatrixStage):
        before = stages.pop(0)(before.T).T
    if stages and isinstance(stages[0], Gain):
        gain = stages.pop(0)(gain)
    if stages and isinstance(stages[0], Clip):
        stages.pop(0)  # a curve and a cube do so themselves
    while stages and isinstance(stages[-1], MatrixStage | Gain):
        matrix = matrix @ stages.pop()(np.eye(3)).T
    last = stages[-1] if stages else None
    body: tuple[Stage, ...] = tuple(stages)
    cube_values: Function = lambda x: through_stages(body, x)  # noqa: E731 - replaced where an output curve is taken out
    if isinstance(last, Encode):
        ahead, behind = _output_curve(last.response)
        cube_values = lambda x: ahead(through_stages(body[:-1], x))  # noqa: E731 - as above
    elif isinstance(last, Lattice) and last.output_curve is not None:
        in_front, behind = last.cube_values, last.output_curve
        cube_values = lambda x: in_front(through_stages(body[:-1], x))  # noqa: E731 - as above
    curve = None
    # Behind a clip in the middle only an output curve magnifies what the axes of its input are made for.
    if behind is not None or not any(isinstance(stage, Clip) for stage in body):
        first = body[0] if body else None
        curve = _input_curve(first.response) if isinstance(first, Decode) else None
        if curve is None and isinstance(last, Encode):
            curve = np.repeat([[0.0], [1.0]], 3, axis=1)  # a gamut map is smooth in linear light
    lattice = last if isinstance(last, Lattice) and len(body) == 1 else None
    return Parts(_checked(cube_values), gain, matrix, before, curve, behind, lattice)


def curve_alone(transform: ColourFunction) -> tuple[Op, ...] | None:
    """The operations of a transform that holds one response at most, beside gains and matrices; None of any other."""
    ops: list[Op] = []
    for stage in transform.stages if isinstance(transform, Transform) else ():
        match stage:
            case Gain():
                ops.append(Matrix(np.diag(stage.factors)))
            case MatrixStage():
                ops.append(Matrix(stage.matrix))
            case Clip():
                ops.append(Range())
            case Decode():
                # Three entries between two of its own: a reader that lays a spline through them makes the same of it.
                even = np.linspace(0.0, 1.0, 4 * len(stage.response.inverse) - 3)[:, None].repeat(3, axis=1)
                ops.append(Curve(stage.response.linearize(even)))
            case Encode():
                low, span = stage.response.inverse[0], stage.response.inverse[-1] - stage.response.inverse[0]
                ops += [Matrix(np.diag(1 / span), -low / span), Curve(_output_curve(stage.response)[1])]
            case GamutMap() if stage.is_identity:
                pass
            case _:
                return None
    return tuple(ops) if sum(isinstance(op, Curve) for op in ops) == 1 else None


def as_one(transform: ColourFunction, highest: float) -> Parts:
    """A transform with nothing taken out of it, its inputs from 0 to `highest`."""
    cube_values = transform if highest == 1 else lambda x: transform(x * highest)
    return Parts(_checked(cube_values), stops=float(np.log2(max(highest, 1.0))))


def _input_curve(response: Response) -> Array:
    """f⁻¹ from 0 to 1, (m, 3), with a little of a straight line, so that it rises everywhere."""
    low, span = response.inverse[0], response.inverse[-1] - response.inverse[0]
    straight = np.linspace(0.0, 1.0, len(response.inverse))[:, None]
    return np.asarray(0.999 * (response.inverse - low) / span + 0.001 * straight)


def _output_curve(response: Response) -> tuple[Function, Array]:
    """Linear values scaled to [0, 1] where f begins and ends, and f from there, (SHAPER_SIZE, 3)."""
    low, span = response.inverse[0], response.inverse[-1] - response.inverse[0]
    even = np.linspace(0.0, 1.0, SHAPER_SIZE)[:, None]
    return lambda y: (y - low) / span, response.encode(low + even * span)


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


def _checked(function: Function) -> Function:
    """Evaluate a function in blocks that stay in cache. Raises LutError on another shape or numbers not finite."""

    def checked(x: Array) -> Array:
        flat = x.reshape(-1, 3)
        y = np.empty_like(flat)
        for start in range(0, len(flat), 1 << 15):
            part = flat[start : start + (1 << 15)]
            result = np.asarray(function(part), dtype=np.float64)
            if result.shape != part.shape:
                raise LutError(f"the transform made shape {result.shape} of {part.shape}; it must keep the shape")
            if not np.all(np.isfinite(result)):
                worst = part[np.flatnonzero(~np.all(np.isfinite(result), axis=1))[0]]
                raise LutError(f"the transform gives a number that is not finite at {np.round(worst, 4).tolist()}")
            y[start : start + (1 << 15)] = result
        return y.reshape(x.shape)

    return checked
