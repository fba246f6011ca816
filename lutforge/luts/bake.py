"""Bake a transform into a shaper and a cube, and a response behind it where the file can hold one.

A lattice of a profile is baked as it stands, without loss, in the form that the file can hold. Any other transform is
evaluated densely and fitted by least squares under the reader's own interpolation, with node levels where the function
bends; it is never merely sampled at the nodes. A physical model keeps its two responses as curves: the cube then holds
the smooth colour mapping between them, on linear axes, and what the camera clips is clipped by the response, not
rounded off by the cube.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from lutforge.errors import LutError
from lutforge.interpolation import Interpolation, through
from lutforge.luts.axes import fit_axes
from lutforge.luts.least_squares import Function, fit_cube, sample
from lutforge.luts.lut import Lut, lut_from_lattice
from lutforge.luts.shaper import SHAPER_SIZE
from lutforge.model.colour_difference import delta_e_2000
from lutforge.model.lattice import uniform_levels
from lutforge.model.response import Response
from lutforge.model.scene_render import SceneRender
from lutforge.model.transform import LatticeTransform, LinearizeChain, Refinish, RenderChain, Transform

Array = NDArray[np.float64]
Progress = Callable[[str, float], None]
"""Called with what is being done and the share that is done, 0 … 1."""

DEFAULT_SIZE = 33
SIZES = (9, 13, 17, 21, 25, 33, 41, 49, 57, 65)
"""Sizes that a tolerance is tried at."""
BEST_ORDER = 3
"""No error falls faster than with this power of the size (piecewise linear: 2); sizes that cannot do are left out."""
CHECK_POINTS = 1 << 15
CURVE_SIZE = SHAPER_SIZE
BLOCK = 1 << 15
LEAST_SLOPE = 1e-3
"""Share of a straight line in an input curve, so that it rises where a response is flat."""


@dataclass(frozen=True)
class BakeError:
    """A LUT against its transform, on points that took no part in the fit: RGB norm; ΔE00 for display colours."""

    mean: float
    maximum: float
    de00_p99: float | None


@dataclass(frozen=True, eq=False)
class _Parts:
    """A transform as matrix · response(inner(gain · x)); curve: axes on which `inner` is smooth.

    The cube holds `inner`.
    """

    inner: Function
    gain: Array
    matrix: Array
    curve: Array | None = None
    response: Array | None = None
    stops: float = 0.0


def bake(
    transform: Transform,
    size: int | None = None,
    *,
    tolerance: float | None = None,
    interpolation: Interpolation | None = None,
    display_referred: bool = True,
    title: str = "",
    comments: tuple[str, ...] = (),
    progress: Progress = lambda what, share: None,
    shaper: bool = True,
    response: bool = True,
    shared: bool = False,
    highest: float = 1.0,
) -> Lut:
    """A LUT of any transform of colours, (…, 3) → (…, 3) on [0, 1]³.

    size: nodes per axis (33; a lattice of a profile keeps its own). tolerance: instead, the smallest size at which 99 %
    of colours are within this ΔE00; display_referred: the output is encoded sRGB, so that ΔE00 has a meaning.
    shaper: node levels and input curve are free, else the cube is uniform; shared: one shaper for all three axes;
    response: there may be a curve behind the cube, which only process lists hold. highest: inputs reach from 0 to this,
    for scene-linear light. A `SceneRender` brings its own, and a matrix in front where a response may be behind.
    `Lut.write` fits again where the format of a file cannot hold these.
    Raises LutError where the size or tolerance cannot be had, or the transform gives numbers that are not finite.
    """
    if size is not None and tolerance is not None:
        raise LutError("give a size or a tolerance, not both")
    if size is not None and not 2 <= size <= 129:
        raise LutError(f"{size} nodes per axis: choose 2 to 129 (17, 33 and 65 are usual)")
    whole = shaper and response and not shared
    if isinstance(transform, SceneRender) and whole:
        lut = bake(
            transform.render, size, tolerance=tolerance, interpolation=interpolation, display_referred=display_referred,
            progress=progress,
        )  # fmt: skip
        return replace(lut, before=transform.to_raw, source=transform, title=title, comments=comments)
    exact = (
        _as_it_stands(transform, size, interpolation, response) if shaper and not shared and tolerance is None else None
    )
    if exact is not None:
        return replace(exact, title=title, comments=comments, source=transform)
    method = interpolation or "tetrahedral"
    if isinstance(transform, SceneRender):
        highest = transform.highest
    parts = _parts(transform, response) if shaper and not shared and highest == 1 else _as_one(transform, highest)
    if tolerance is None:
        lut = _fit(parts, size or DEFAULT_SIZE, method, shaper, shared, progress)
    else:
        lut = _smallest(transform, parts, tolerance, method, shaper, shared, display_referred, progress)
    return replace(lut, title=title, comments=comments, highest=highest, source=transform)


def bake_error(lut: Lut, transform: Transform, display_referred: bool = True) -> BakeError:
    """Measure a LUT against its transform on a scrambled Sobol set of its input cube."""
    x = qmc.Sobol(3, rng=7).random(CHECK_POINTS) * lut.highest
    got, wanted = lut(x), transform(x)
    norm = np.linalg.norm(got - wanted, axis=1)
    p99 = None
    if display_referred:
        p99 = float(np.quantile(delta_e_2000(got[:8192], wanted[:8192]), 0.99))
    return BakeError(float(norm.mean()), float(norm.max()), p99)


def _as_it_stands(
    transform: Transform, size: int | None, interpolation: Interpolation | None, response: bool
) -> Lut | None:
    """A lattice of a profile, where it has the size and the interpolation that are asked for."""
    if not isinstance(transform, LatticeTransform):
        return None
    lattice = transform.lattice
    if lattice.response is not None and not response:
        if lattice.plain is None:
            return None
        lattice = lattice.plain
    if set(lattice.size) != {size or lattice.size[0]}:
        return None
    if (interpolation or lattice.interpolation) != lattice.interpolation:
        return None
    return lut_from_lattice(lattice, transform.gain, transform.matrix)


def _fit(parts: _Parts, size: int, method: Interpolation, shaper: bool, shared: bool, progress: Progress) -> Lut:
    progress(f"{size}³ nodes: where they lie", 0.0)
    weight = None if parts.response is None else _slope_weight(parts.response)
    curve, levels = None, uniform_levels(size)
    if shaper:
        axes = fit_axes(parts.inner, size, parts.gain, weight, parts.curve, shared, parts.stops)
        levels = axes.levels
        curve = axes.curve if len(axes.curve) > 2 else None  # a straight line stretches nothing
    empty = Lut(
        gain=parts.gain,
        levels=levels,
        cube=np.zeros((size, size, size, 3)),
        matrix=parts.matrix,
        interpolation=method,
        curve=curve,
        response=parts.response,
    )
    samples = sample(parts.inner, levels, parts.gain, lambda share: progress(f"{size}³ nodes: evaluated", 0.8 * share))
    progress(f"{size}³ nodes: fitted", 0.8)
    return replace(empty, cube=fit_cube(samples, empty.knots, method, empty.stretched, weight, parts.response is None))


def _smallest(
    transform: Transform,
    parts: _Parts,
    tolerance: float,
    method: Interpolation,
    shaper: bool,
    shared: bool,
    display_referred: bool,
    progress: Progress,
) -> Lut:
    if not display_referred:
        raise LutError("a ΔE00 tolerance has no meaning for scene-linear output; give a size (33 or 65) instead")
    if not tolerance > 0:
        raise LutError(f"tolerance {tolerance:g}: a ΔE00 above 0 is needed")
    best, at, sizes = float("inf"), 0, list(SIZES)
    while sizes:
        size = sizes[0]
        lut = _fit(parts, size, method, shaper, shared, progress)
        error = bake_error(replace(lut, highest=2.0**parts.stops), transform).de00_p99 or 0.0
        if error < best:
            best, at = error, size
        if error <= tolerance:
            return lut
        sizes = [larger for larger in sizes[1:] if error * (size / larger) ** BEST_ORDER <= tolerance]
    raise LutError(
        f"no size up to {SIZES[-1]} brings 99 % of colours within {tolerance:g} ΔE00: the smallest error found is "
        f"{best:.2g}, at {at}; give a larger tolerance, or --size {SIZES[-1]} for the best there is"
    )


def _parts(transform: Transform, response: bool) -> _Parts:
    """What of a transform can be a gain, a curve, a response and a matrix; the cube has to hold the rest."""
    one = np.eye(3)
    if isinstance(transform, LinearizeChain):
        return _Parts(_checked(transform.core), transform.gain, transform.matrix, _input_curve(transform.response))
    if isinstance(transform, RenderChain) and response:
        ahead, back = _output_curve(transform.response)
        to_linear, forward = transform.to_linear, transform.gamut_map
        straight = np.repeat([[0.0], [1.0]], 3, axis=1)
        return _Parts(_checked(lambda x: ahead(forward(x @ to_linear.T))), transform.gain, one, straight, back)
    if isinstance(transform, LatticeTransform) and response and transform.lattice.response is not None:
        lattice = transform.lattice
        return _Parts(_checked(lattice.inner), transform.gain, transform.matrix, None, lattice.response)
    if isinstance(transform, Refinish) and transform.transfer is None:
        first = _parts(transform.linearize, response)
        last = _parts(transform.render, response)
        if np.all(first.gain == 1) and first.response is None:
            between = transform.between @ first.matrix

            def both(x: Array) -> Array:
                return last.inner(np.clip(first.inner(x) @ between.T * last.gain, 0.0, 1.0))

            curve = first.curve if last.response is not None else None
            return _Parts(both, np.ones(3), last.matrix, curve, last.response)
    gain: Array = getattr(transform, "gain", np.ones(3))
    matrix: Array = getattr(transform, "matrix", one)
    return _Parts(_checked(getattr(transform, "core", transform)), gain, matrix)


def _as_one(transform: Transform, highest: float) -> _Parts:
    """A transform with nothing taken out of it, its inputs from 0 to `highest`."""
    inner = transform if highest == 1 else lambda x: transform(x * highest)
    return _Parts(_checked(inner), np.ones(3), np.eye(3), stops=float(np.log2(max(highest, 1.0))))


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


def _slope_weight(response: Array) -> Function:
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
