"""What of a transform can be a gain, a curve, a response and a matrix; the cube has to hold the rest.

A physical model keeps its two responses as curves: the cube then holds the smooth colour mapping between them, on
linear axes, and what the camera clips is clipped by the response, not rounded off by the cube.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lutforge.errors import LutError
from lutforge.interpolation import through
from lutforge.luts.shaper import SHAPER_SIZE
from lutforge.model.response import Response
from lutforge.model.transform import LatticeTransform, LinearizeChain, Refinish, RenderChain, Transform

Array = NDArray[np.float64]
Function = Callable[[Array], Array]

CURVE_SIZE = SHAPER_SIZE
BLOCK = 1 << 15
LEAST_SLOPE = 1e-3
"""Share of a straight line in an input curve, so that it rises where a response is flat."""


@dataclass(frozen=True, eq=False)
class Parts:
    """A transform as matrix · response(inner(gain · x)); curve: axes on which `inner` is smooth.

    The cube holds `inner`.
    """

    inner: Function
    gain: Array
    matrix: Array
    curve: Array | None = None
    response: Array | None = None
    stops: float = 0.0


def parts_of(transform: Transform) -> Parts:
    """What of a transform can be a gain, a curve, a response and a matrix; the cube has to hold the rest."""
    one = np.eye(3)
    if isinstance(transform, LinearizeChain):
        return Parts(_checked(transform.core), transform.gain, transform.matrix, _input_curve(transform.response))
    if isinstance(transform, RenderChain):
        ahead, back = _output_curve(transform.response)
        to_linear, forward = transform.to_linear, transform.gamut_map
        straight = np.repeat([[0.0], [1.0]], 3, axis=1)
        return Parts(_checked(lambda x: ahead(forward(x @ to_linear.T))), transform.gain, one, straight, back)
    if isinstance(transform, LatticeTransform) and transform.lattice.response is not None:
        lattice = transform.lattice
        return Parts(_checked(lattice.inner), transform.gain, transform.matrix, None, lattice.response)
    if isinstance(transform, Refinish) and transform.transfer is None:
        first = parts_of(transform.linearize)
        last = parts_of(transform.render)
        if np.all(first.gain == 1) and first.response is None:

            def both(x: Array) -> Array:
                return last.inner(np.clip(transform.balanced(x, first.inner(x) @ first.matrix.T), 0.0, 1.0))

            curve = first.curve if last.response is not None else None
            return Parts(both, np.ones(3), last.matrix, curve, last.response)
    gain: Array = getattr(transform, "gain", np.ones(3))
    matrix: Array = getattr(transform, "matrix", one)
    return Parts(_checked(getattr(transform, "core", transform)), gain, matrix)


def as_one(transform: Transform, highest: float) -> Parts:
    """A transform with nothing taken out of it, its inputs from 0 to `highest`."""
    inner = transform if highest == 1 else lambda x: transform(x * highest)
    return Parts(_checked(inner), np.ones(3), np.eye(3), stops=float(np.log2(max(highest, 1.0))))


def _input_curve(response: Response) -> Array:
    """f⁻¹ from 0 to 1, (m, 3), with a little of a straight line, so that it rises everywhere."""
    low, span = response.inverse[0], response.inverse[-1] - response.inverse[0]
    straight = np.linspace(0.0, 1.0, len(response.inverse))[:, None]
    return np.asarray((1 - LEAST_SLOPE) * (response.inverse - low) / span + LEAST_SLOPE * straight)


def _output_curve(response: Response) -> tuple[Function, Array]:
    """Linear values scaled to [0, 1] where f begins and ends, and f from there, (CURVE_SIZE, 3)."""
    low, span = response.inverse[0], response.inverse[-1] - response.inverse[0]
    even = np.linspace(0.0, 1.0, CURVE_SIZE)[:, None]
    return lambda y: (y - low) / span, response.encode(low + even * span)


def slope_weight(response: Array) -> Function:
    """How much an error of the cube shows behind the response: the sum of its squared slopes; near clipping, too."""
    reach, share, margin = 0.003, 0.05, 0.25
    y = np.repeat(np.linspace(-margin, 1 + margin, 4096)[:, None], 3, axis=1)
    inside = np.clip(y, 0.0, 1.0)
    slope = (through(response, inside + reach) - through(response, inside - reach)) / (2 * reach)
    table = slope**2 * np.exp(-0.5 * ((y - inside) / share) ** 2)

    def weight(y: Array) -> Array:
        return np.asarray(share + through(table, (y + margin) / (1 + 2 * margin)).sum(axis=-1))

    return weight


def _checked(function: Function) -> Function:
    """The function in blocks that stay in cache; refused where it changes the shape or gives what is not finite."""

    def checked(x: Array) -> Array:
        flat = x.reshape(-1, 3)
        y = np.empty_like(flat)
        for start in range(0, len(flat), BLOCK):
            part = flat[start : start + BLOCK]
            result = np.asarray(function(part), dtype=np.float64)
            if result.shape != part.shape:
                raise LutError(f"the transform made shape {result.shape} of {part.shape}; it must keep the shape")
            if not np.all(np.isfinite(result)):
                worst = part[np.flatnonzero(~np.all(np.isfinite(result), axis=1))[0]]
                raise LutError(f"the transform gives a number that is not finite at {np.round(worst, 4).tolist()}")
            y[start : start + BLOCK] = result
        return y.reshape(x.shape)

    return checked
