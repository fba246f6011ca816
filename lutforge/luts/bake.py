"""Bake a transform into a LUT of the form that a file can hold.

A lattice of a profile is baked as it stands, without loss. Any other transform is evaluated densely, never merely at
nodes, and fitted by least squares under the reader's own interpolation, with node levels where the function bends.
"""

from __future__ import annotations  # so that help() shows the names of types

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import SupportsIndex

import numpy as np
import scipy

from lutforge.arrays import Array, ColourFunction, Mask
from lutforge.colour.rgb_spaces import RgbSpace
from lutforge.colour.srgb import delta_e_2000
from lutforge.errors import CalibrationError, LutError
from lutforge.interpolation import Interpolation, Levels, apply_curve, interpolate
from lutforge.luts.forms import MAX_SIZE, Form
from lutforge.luts.highlights import raised
from lutforge.luts.ops import Cube, Curve, Matrix, Op, Range
from lutforge.luts.programs import Target, target_of
from lutforge.luts.sequence import Lut
from lutforge.luts.shaper import SHAPER_SIZE, is_even, lattice_ops, levels_behind_gain, node_levels, shaper
from lutforge.model.gamut_map import GamutMap
from lutforge.model.highlights import NeutralHighlights
from lutforge.model.inverse_gamut_map import SolvedInverse
from lutforge.model.lattice import Lattice, grid, snap_levels, uniform_levels
from lutforge.model.response import Response
from lutforge.model.transform import (
    Clip,
    Decode,
    Encode,
    Gain,
    MatrixStage,
    Stage,
    Transform,
    through_stages,
)
from lutforge.progress import Progress, silent
from lutforge.sobol import sobol
from lutforge.solvers.lattice_regression import Prior, fit_lattice
from lutforge.solvers.robust_weights import lawson

Function = Callable[[Array], Array]


def bake(
    transform: ColourFunction,
    path: Path | None = None,
    *,
    size: int | None = None,
    interpolation: Interpolation | None = None,
    display_referred: bool = True,
    title: str = "",
) -> Lut:
    """Bake any transform of colours on [0, 1]³ as `bake_forms` does. path: a file to be written; it says the form."""
    if path is None:
        target = Target(size=size, interpolation=interpolation)
    else:
        target = target_of(path, None, size, interpolation, takes_scenes(transform))
    (lut,) = bake_forms(transform, [target], display_referred=display_referred, title=title)
    if path is not None:
        lut.write(path)
    return lut


def bake_forms(
    transform: ColourFunction,
    targets: Sequence[Target],
    *,
    tolerance: float | None = None,
    display_referred: bool = True,
    title: str = "",
    comments: tuple[str, ...] = (),
    highest: float = 1.0,
    progress: Progress = silent,
) -> list[Lut]:
    """Bake one transform to several forms.

    tolerance: instead of a size, the ΔE00 that 99 % of colours keep within; the smallest size that does is taken.
    display_referred: the output is encoded sRGB, so that ΔE00 has a meaning. highest: inputs reach from 0 to this, for
    scene-linear light. Raises LutError where a size or tolerance cannot be had, or a number is not finite.
    """
    given: object = transform
    if not callable(given):
        kind = type(given).__name__
        raise LutError(f'a {kind} is no transform of colours; name one of a profile: profile.render("STYLE/WB")')
    if tolerance is not None and not display_referred:
        raise LutError("a ΔE00 tolerance has no meaning for scene-linear output; give a size (33 or 65) instead")
    if tolerance is not None and not tolerance > 0:
        raise LutError(f"tolerance {tolerance:g}: a ΔE00 above 0 is needed")
    if not 0 < highest < 65504:
        raise LutError(f"LUT: inputs up to {highest:g}; half floats end at 65504")
    scenes = takes_scenes(transform)
    reach = transform.highest() if isinstance(transform, Transform) and scenes else highest

    def fitted(target: Target, size: int) -> tuple[Op, ...]:
        most = highest if scenes and target.form == "full" else reach
        return fit(transform, target.form, size, target.interpolation or "tetrahedral", most, progress)

    luts = []
    for target in targets:
        if target.size is not None and tolerance is not None:
            raise LutError("give a size or a tolerance, not both")
        if target.size is not None and not (isinstance(target.size, SupportsIndex) and 2 <= target.size <= MAX_SIZE):
            raise LutError(f"{target.size} nodes per axis: choose 2 to {MAX_SIZE} (17, 33 and 65 are usual)")
        if tolerance is not None:
            ops = _smallest(transform, reach, target, fitted, tolerance)
        elif (footage := _decoded(transform)) is not None and target.form == "full":
            (lut,) = bake_forms(footage[1], [target], display_referred=display_referred, progress=progress)
            ops = (footage[0], *lut.ops)
        else:
            ops = _as_it_stands(transform, target) or fitted(target, target.size or target.default)
        luts.append(Lut(ops, title, comments))
    return luts


def joined(ops: Sequence[Op]) -> tuple[Op, ...]:
    """Return operations with neighbouring matrices made one, and without those that change nothing."""
    result: list[Op] = []
    for op in ops:
        before = result[-1] if result else None
        if isinstance(op, Matrix) and isinstance(before, Matrix):
            result[-1] = Matrix(op.matrix @ before.matrix, op.matrix @ before.offset + op.offset)
        else:
            result.append(op)
    return tuple(op for op in result if not (isinstance(op, Matrix) and op.is_identity))


def takes_scenes(transform: ColourFunction) -> bool:
    """True for a transform of scene-linear light, which a matrix takes to the camera's RAW."""
    return isinstance(transform, Transform) and bool(transform.stages) and isinstance(transform.stages[0], MatrixStage)


def _decoded(transform: ColourFunction) -> tuple[Curve, Transform] | None:
    """The curve of a space that footage is encoded in, and the transform of its linear light; None of other inputs."""
    first = transform.stages[0] if isinstance(transform, Transform) and transform.stages else None
    if not isinstance(transform, Transform) or not (isinstance(first, Decode) and isinstance(first.curve, RgbSpace)):
        return None
    codes = np.repeat(np.linspace(0.0, 1.0, SHAPER_SIZE)[:, None], 3, axis=1)
    return Curve(first(codes)), Transform(transform.stages[1:])


def _as_it_stands(transform: ColourFunction, target: Target) -> tuple[Op, ...] | None:
    """A lattice of a profile, where it has the size and the interpolation that are asked for and fits the form."""
    if isinstance(transform, Transform) and transform.is_identity:
        even = grid(uniform_levels(target.size or target.default))
        return (Range(),) if target.form == "full" else (Cube(even, target.interpolation or "tetrahedral"),)
    curve_ops = curve_alone(transform)
    if curve_ops is not None:
        if target.form == "full":
            return joined(curve_ops)
        match [op for op in joined(curve_ops) if not isinstance(op, Range)]:
            case [Curve() as curve] if target.curve or target.form == "shaper":
                return (curve,)
            case [Curve() as curve, Matrix() as matrix] if target.form == "shaper":
                return curve, Cube(matrix(grid(uniform_levels(2))), target.interpolation or "tetrahedral")
        return None
    parts = parts_of(transform)
    if parts.lattice is None:
        return None
    lattice = parts.lattice
    if set(lattice.size) != {target.size or lattice.size[0]}:
        return None
    if (target.interpolation or lattice.interpolation) != lattice.interpolation:
        return None
    ops = lattice_ops(lattice)
    if target.form == "full":
        ahead = Matrix(parts.gain[:, None] * parts.before)
        return joined((ahead, Range(), *ops, Matrix(parts.matrix)))
    folded = None if takes_scenes(transform) else _folded(ops, parts)
    return folded if folded is not None and Lut(folded).has_form(target.form) else None


def _folded(ops: tuple[Op, ...], behind: Parts) -> tuple[Op, ...] | None:
    """A lattice with its gain in the shaper and its matrix in the cube; None where an output curve is behind it."""
    if not Lut(ops).has_form("shaper"):
        return None
    curve, cube = Lut(ops).shaper_and_cube()
    gain, matrix = behind.gain, behind.matrix
    if np.all(gain == 1):
        return (*ops[:-1], Cube(cube.values @ matrix.T, cube.interpolation))
    # The cube is evaluated at the moved levels: outputs change by less than kinks do over one step of the shaper.
    levels = levels_behind_gain(node_levels(curve, cube), gain)
    values = Lut(ops)(np.clip(grid(levels) * gain, 0.0, 1.0)) @ matrix.T
    return shaper(levels), Cube(values, cube.interpolation)


def _smallest(
    transform: ColourFunction,
    highest: float,
    target: Target,
    fitted: Callable[[Target, int], tuple[Op, ...]],
    tolerance: float,
) -> tuple[Op, ...]:
    """The operations of the smallest size with which 99 % of other colours than those of the fit keep a tolerance."""
    x = sobol(8192, seed=7) * highest
    exact, largest = transform(x), target.sizes[-1]
    best, at, left = float("inf"), 0, list(target.sizes)
    while left:
        size = left[0]
        ops = fitted(target, size)
        error = float(np.quantile(delta_e_2000(Lut(ops)(x), exact), 0.99))
        if error < best:
            best, at = error, size
        if error <= tolerance:
            return ops
        # No error falls faster than with the third power of the size (piecewise linear: the second).
        left = [larger for larger in left[1:] if error * (size / larger) ** 3 <= tolerance]
    raise LutError(
        f"no size up to {largest} brings 99 % of colours within {tolerance:g} ΔE00: the smallest error found is "
        f"{best:.2g}, at {at}; give a larger tolerance, or --size {largest} for the best there is"
    )


# --- A transform as a gain, an input curve, a response and a matrix, and the rest, which the cube holds --------------
# A camera model keeps its two responses as curves: the cube then holds the smooth colour mapping between them, on
# linear axes, and what the camera clips is clipped by the response, not rounded off by the cube.


@dataclass(frozen=True, eq=False)
class Parts:
    """A transform as matrix · output_curve(cube_values(gain · before · x)); the cube holds `cube_values`.

    curve: the input curves (m, 3) along which `cube_values` is smooth; lattice: it, where it is a lattice as it stands;
    stops: how many stops of light beyond 1 the inputs span.
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
    response = last.curve if isinstance(last, Encode) and isinstance(last.curve, Response) else None
    if response is not None:
        ahead, behind = _output_curve(response)
        cube_values = lambda x: ahead(through_stages(body[:-1], x))  # noqa: E731 - as above
    elif isinstance(last, Lattice) and last.output_curve is not None:
        in_front, behind = last.cube_values, last.output_curve
        cube_values = lambda x: in_front(through_stages(body[:-1], x))  # noqa: E731 - as above
    curve = None
    # Behind a clip in the middle only an output curve magnifies what the axes of its input are made for.
    if behind is not None or not any(isinstance(stage, Clip) for stage in body):
        first = body[0] if body else None
        if isinstance(first, Decode) and isinstance(first.curve, Response):
            # f⁻¹ from 0 to 1, with a little of a straight line, so that it rises everywhere.
            inverse = first.curve.inverse
            straight = np.linspace(0.0, 1.0, len(inverse))[:, None]
            curve = 0.999 * (inverse - inverse[0]) / (inverse[-1] - inverse[0]) + 0.001 * straight
        elif response is not None:
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
            case Decode(Response() as response):
                # Three entries between two of its own: a reader that lays a spline through them makes the same of it.
                even = np.linspace(0.0, 1.0, 4 * len(response.inverse) - 3)[:, None].repeat(3, axis=1)
                ops.append(Curve(response.linearize(even)))
            case Encode(Response() as response):
                low, span = response.inverse[0], response.inverse[-1] - response.inverse[0]
                ops += [Matrix(np.diag(1 / span), -low / span), Curve(_output_curve(response)[1])]
            case GamutMap() if stage.is_identity:
                pass
            case _:
                return None
    return tuple(ops) if sum(isinstance(op, Curve) for op in ops) == 1 else None


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


# --- Fit a cube of a given size: axes along which it is smooth, then the nodes by least squares ----------------------


def fit(
    transform: ColourFunction, form: Form, size: int, method: Interpolation, highest: float = 1.0,
    progress: Progress = silent,
) -> tuple[Op, ...]:  # fmt: skip
    """The operations that come nearest to a transform, under the reader's own interpolation.

    highest: inputs reach from 0 to this. O(size³) evaluations.
    """
    progress(f"{size}³ nodes: where they lie", 0.0)
    if highest == 1 and form != "plain":
        parts = parts_of(transform)
    else:  # nothing is taken out of it
        whole = transform if highest == 1 else lambda x: transform(x * highest)
        parts = Parts(_checked(whole), stops=float(np.log2(max(highest, 1.0))))
    gain, curve, behind = parts.gain, parts.curve, parts.output_curve
    function, weight = parts.cube_values, None
    if behind is not None and form == "full":
        weight = slope_weight(behind)
    elif behind is not None:  # the cube holds the output curve, too
        function, curve = lambda x: apply_curve(behind, parts.cube_values(x)), None
    if form == "plain":
        axes = Axes(None, uniform_levels(size))
    else:
        axes = fit_axes(function, gain, size, weight, curve, parts.stops)
        if form == "shaper":
            r, g, b = (axis * factor for axis, factor in zip(levels_behind_gain(axes.levels, gain), gain, strict=True))
            axes = Axes(axes.curve, (r, g, b))
    r, g, b = (axes.stretched(np.stack(axes.levels, axis=1))[:, c].copy() for c in range(3))
    values = fit_cube(
        lambda x: function(np.minimum(x, 1.0)),  # a level in front of a gain is rounded up, beyond what clips
        axes.levels, (r, g, b), method, gain, axes.stretched, weight, limit=weight is None,
        progress=lambda share: progress(f"{size}³ nodes: evaluated", 0.8 * share),
    )  # fmt: skip
    progress(f"{size}³ nodes: fitted", 0.8)
    if form == "full":
        ahead = Matrix((gain / highest)[:, None] * parts.before)
        curves = () if behind is None else (Curve(behind),)
        return joined((ahead, Range(), *_shaper(axes), Cube(values, method), *curves, Matrix(parts.matrix)))
    folded = Cube(values @ parts.matrix.T, method)
    if form == "plain":
        return (folded,)
    if np.all(gain == 1):
        return (*_shaper(axes, highest), folded)
    r, g, b = (axis / factor for axis, factor in zip(axes.levels, gain, strict=True))
    at = np.linspace(0.0, 1.0, SHAPER_SIZE)[:, None] * gain
    in_front = None if axes.curve is None else axes.stretched(at)
    return shaper((r, g, b), SHAPER_SIZE, in_front, highest), folded


def _shaper(axes: Axes, high: float = 1.0) -> tuple[Op, ...]:
    if axes.curve is None and is_even(axes.levels) and high == 1:
        return ()
    return (shaper(axes.levels, SHAPER_SIZE, axes.curve, high),)


# --- The steps of a transform in one sequence: what a process list (CLF, CTF) can hold whole -------------------------
# A refinish between two lattices of a profile is lattice → matrix → lattice: written so, the file is the model, while
# one cube of both can only come near. A refinish of a camera model becomes two cubes with the camera's clipping
# between.


def bake_steps(
    transform: ColourFunction, size: int | None = None, *, title: str = "", comments: tuple[str, ...] = ()
) -> Lut:
    """Bake a transform with a cube for each of its steps, from one clip to the next.

    size: nodes per axis of each (33; lattices of a profile keep their own, and lose nothing).
    """

    def baked(step: ColourFunction) -> Lut:
        return bake(step, size=size)

    if isinstance(transform, Transform) and any(isinstance(stage, NeutralHighlights) for stage in transform.stages):
        return Lut(joined(grading_lut(transform, baked).ops), title, comments)
    steps: list[ColourFunction] = [transform]
    if isinstance(transform, Transform):  # cut in front of each clip but the first
        stages = transform.stages
        cuts = [at for at, stage in enumerate(stages) if isinstance(stage, Clip)][1:]
        steps = [Transform(stages[i:j]) for i, j in zip([0, *cuts], [*cuts, len(stages)], strict=True)]
    return Lut(joined([op for step in steps for op in baked(step).ops]), title, comments)


def grading_lut(transform: Transform, baked: Callable[[Transform], Lut]) -> Lut:
    """A refinish for photographs, from the baked steps of its two styles: white stays neutral.

    baked: returns the LUT of a step that is the same under all white balances: of JPEG → linear, or of white-balanced
    RAW → JPEG. Only what is between them is computed anew, so that a picture with a white balance of its own costs
    milliseconds. Raises LutError on a transform that keeps no neutrals.
    """
    if transform.is_identity:
        return Lut((Range(),))
    linearize, between, highlights, render = grading_steps(transform)
    front = baked(linearize)
    cube = front.cube
    if cube is None:
        raise LutError(f"LUT: a cube is wanted, not {front.summary}")
    ahead, behind = front.ops[: front.ops.index(cube)], front.ops[front.ops.index(cube) :]
    values = through_stages(between, Lut(behind)(grid(uniform_levels(cube.size))))
    neutral = raised(highlights, np.ones(3), float((values / highlights.white).max()))
    return Lut((*ahead, Cube(values, cube.interpolation), *neutral, *baked(render).ops))


def grading_steps(transform: Transform) -> tuple[Transform, tuple[Stage, ...], NeutralHighlights, Transform]:
    """The parts of a refinish for photographs: JPEG → linear, from there to balanced light, highlights, the render."""
    stages = transform.stages
    at = next((at for at, stage in enumerate(stages) if isinstance(stage, NeutralHighlights)), None)
    highlights = None if at is None else stages[at]
    if at is None or not isinstance(highlights, NeutralHighlights):
        raise LutError("LUT: photographs are graded by a refinish that keeps clipped neutrals")
    cut = 1 + next(at for at, stage in enumerate(stages) if isinstance(stage, Lattice | GamutMap | SolvedInverse))
    return Transform(stages[:cut]), stages[cut:at], highlights, Transform(stages[at + 1 :])


# --- A cube is fitted to a known function: input curves and node levels along its axes, then its nodes ----------------
# A cube interpolates linearly between its nodes, so each axis is first stretched until the function rises evenly along
# it: the curve is the running sum of its root-mean-square slope, which leaves, of all curves, the least curvature on
# average (d/dx log u' = ⟨F_xx, F_x⟩ / ⟨F_x, F_x⟩). Node levels then even out what curvature is left: intervals of width
# h carry a mean error ∝ |κ| h² per unit length of the curve, and at a fixed number of them the total is least where
# 1/h ∝ |κ|^(1/3), the largest where 1/h ∝ |κ|^(1/2) (de Boor 1973). The first is wanted where the cube holds all, the
# second where an output curve behind it magnifies the errors of the darks; few of the lines across an axis then carry
# the largest errors, and a power mean of their curvatures counts these for more.
#
# Sampling a function at the nodes makes every cell err to the same side of a curve; the least-squares cube under the
# reader's own interpolation has less than half of that error. Points are plentiful, so the normal equations are well
# conditioned: conjugate gradients with a diagonal preconditioner take a dozen steps, without a smoothness term.


LINES = 64
"""Lines along each axis on which slope and curvature are measured, beside the grey axis, and steps of each."""
STEPS = 256


@dataclass(frozen=True, eq=False)
class Axes:
    """Node levels of a cube, on the shaper's grid, and a curve (m, 3), in whose values the cube is linear; or none."""

    curve: Array | None
    levels: Levels

    def stretched(self, x: Array) -> Array:
        """Map inputs (…, 3) through the curve, which continues with slope 1 beyond 1."""
        return x if self.curve is None else apply_curve(self.curve, x) + np.maximum(x - 1.0, 0.0)


def fit_axes(
    function: Function,
    gain: Array,
    size: int,
    weight: Function | None = None,
    curve: Array | None = None,
    stops: float = 0.0,
) -> Axes:
    """Curve and `size` node levels per axis for a function (n, 3) in [0, 1] → (n, 3), which is measured along lines.

    gain: (3,) in front of it, where it clamps at 1: inputs are taken to be even before it. weight: outputs (n, 3) →
    (n,), how much a squared error counts there. curve: the input curve, where it is known. stops: of light that the
    axes span beyond 1; the more, the finer the darks are looked at.
    """
    t = np.linspace(0.0, 1.0, STEPS + 1) ** (1.5 + 0.25 * stops)  # finer in the darks, where responses are steep
    others = sobol(LINES, 2)
    others[: LINES // 2] **= 2
    lines = []  # per axis the values (LINES + 1, STEPS + 1, 3) along it; the first line is the grey axis
    for axis in range(3):
        across = [c for c in range(3) if c != axis]
        x = np.empty((LINES + 1, len(t), 3))
        x[..., axis] = t
        x[1:, :, across] = np.minimum(others * np.maximum(gain[across], 1.0), 1.0)[:, None, :]
        x[0] = t[:, None]
        lines.append(function(x.reshape(-1, 3)).reshape(x.shape))
    # The share of all inputs that each line but the grey axis stands for; half lie in the dark tones.
    density = 0.5 + 0.125 / np.sqrt(np.maximum(others.prod(axis=1), 1e-4))
    share = 1 / (density * np.sum(1 / density))
    if weight is not None:  # it looks for the largest errors
        share = np.full(LINES, 1 / LINES)
    if curve is None:
        squares = [np.sum((np.diff(y, axis=1) / np.diff(t)[:, None]) ** 2, axis=2) for y in lines]
        curve = np.stack([_curve(np.sqrt(_mean(square, share)), t) for square in squares], axis=1)
    even = np.linspace(0.0, 1.0, len(curve))
    levels = []
    for axis, values in enumerate(lines):  # between two levels there is equal mass
        mass = _mass(values, t, np.interp(t, even, curve[:, axis]), share, weight)
        total = np.concatenate([[0.0], np.cumsum(mass)])
        levels.append(snap_levels(np.interp(np.linspace(0.0, total[-1], size), total, t), SHAPER_SIZE))
    return Axes(curve if len(curve) > 2 else None, (levels[0], levels[1], levels[2]))  # a straight line changes nothing


def _mean(values: Array, share: Array, grey: float = 0.25) -> Array:
    """The mean over the lines (LINES + 1, m), of which the grey axis counts the share `grey`."""
    return np.asarray((1 - grey) * (share @ values[1:]) + grey * values[0])


def _curve(slope: Array, t: Array) -> Array:
    """The running sum of a slope, from 0 to 1, at SHAPER_SIZE even steps."""
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


GREY_POINTS = 1025
"""Points of the grey axis, beside those of the whole cube."""


def fit_cube(
    function: Function,
    levels: Levels,
    knots: Levels,
    method: Interpolation,
    gain: Array | float = 1.0,
    curve: Function | None = None,
    weight: Function | None = None,
    limit: bool = True,
    progress: Callable[[float], None] = lambda share: None,
) -> Array:
    """Node values (N, N, N, 3) at `levels` that come nearest to a function (n, 3) in [0, 1] → (n, 3), interpolated.

    knots: the levels on the axes of the cube, to which `curve` takes inputs. gain: in front of the function, as
    `fit_axes` has it. Black and white are the function's own; the grey axis counts 30 times. weight: (n, 3) of
    outputs → (n,), how much a squared error counts there, as an output curve behind the cube magnifies it; then a
    second, reweighted fit (Lawson 1961) brings down the largest errors. limit: no node leaves the function's own range,
    whatever would fit best, so that a file keeps within the legal range. progress: called with the share of the points
    at which the function is evaluated.
    """
    spread, on_face, counted = _points(levels, np.broadcast_to(gain, 3))
    count, at_nodes = len(spread), grid(levels)
    grey = np.repeat(np.linspace(0.0, 1.0, GREY_POINTS)[:, None], 3, axis=1)
    x = np.concatenate([spread, grey, at_nodes.reshape(-1, 3)])
    y = np.empty_like(x)
    for start in range(0, len(x), 1 << 16):
        progress(start / len(x))
        y[start : start + (1 << 16)] = function(x[start : start + (1 << 16)])
    nodes = y[count + GREY_POINTS :].reshape(at_nodes.shape)
    # A weight is the geometric mean of every input and every cell counting alike.
    cell_size = np.ones(count)
    for c, axis in enumerate(levels):
        widths = np.diff(axis) * (len(axis) - 1)
        cell = np.searchsorted(axis[1:-1], spread[:, c], side="right")
        cell_size *= np.where(on_face[:, c], 1.0, widths[cell])
    node_size = np.sqrt(np.einsum("i,j,k->ijk", *(np.gradient(axis) * (len(axis) - 1) for axis in levels))).ravel()
    share = counted / (np.sqrt(cell_size) * (1 / cell_size))
    # A node counts half of a point: more, and the fit comes near to sampling.
    omega = np.concatenate([share / share.mean(), np.ones(GREY_POINTS), 0.5 * node_size / node_size.mean()])
    order = np.r_[0:count, count + GREY_POINTS : len(x), count : count + GREY_POINTS]
    x, y, omega = x[order], y[order], omega[order]
    counts = None if weight is None else weight(y)
    if counts is not None:
        omega *= counts
    omega[-GREY_POINTS:] *= 30.0
    omega[[count, -GREY_POINTS - 1]] = 1e4 * omega.mean()  # black and white: the nodes beside them know where they stay
    x = x if curve is None else curve(x)
    values = solve_nodes(x, y, knots, method, omega / omega.mean(), nodes, nodes)
    if counts is not None:
        error = np.sqrt(counts * np.sum((interpolate(x, knots, values, method) - y) ** 2, axis=1))
        omega *= lawson(error, 0.75)
        values = solve_nodes(x, y, knots, method, omega / omega.mean(), nodes, values)
    if limit:
        values = np.clip(values, y.min(axis=0), y.max(axis=0))
    values[0, 0, 0], values[-1, -1, -1] = nodes[0, 0, 0], nodes[-1, -1, -1]
    return values


def _points(levels: Levels, gain: Array) -> tuple[Array, Mask, Array]:
    """Points (n, 3), even over the cells, some of them on the faces of the cube.

    With them which coordinates were beyond an end of their axis and clamped to it, (n, 3), and a weight that corrects
    for how many inputs really lie there, (n,): where a gain clips its inputs, many of them fall on the upper face.
    """
    overhang = 0.03  # share of the points beyond either end of an axis, clamped to its face
    cells = (len(levels[0]) - 1) ** 3
    # Four points a cell; above half a million one for each is enough beside its node.
    u = sobol(max(1 << 16, min(4 * cells, max(1 << 19, cells))))
    even = np.linspace(0.0, 1.0, len(levels[0]))
    counted = np.ones(len(u))
    on_face = np.empty(u.shape, dtype=np.bool_)
    x = np.empty_like(u)
    for c in range(3):
        beyond = max(1.0 - 1.0 / float(gain[c]), 0.0)
        above = max(overhang, 0.25 * beyond**0.5)
        place = u[:, c] * (1 + overhang + above) - overhang
        upper = max(beyond, overhang) / above / (1.0 - beyond)
        counted *= np.where(place > 1, np.sqrt(upper), 1.0)
        on_face[:, c] = (place > 1) | (place < 0)
        x[:, c] = np.interp(np.clip(place, 0.0, 1.0), even, levels[c])
    return x, on_face, counted


def solve_nodes(
    x: Array, y: Array, levels: Levels, method: Interpolation, omega: Array, sampled: Array, start: Array
) -> Array:
    """(W'ΩW + ε) b = W'Ωy + ε b₀ by conjugate gradients from `start`, the three outputs together; ω: 1 in the mean."""
    # A node without points around it takes the function's own value: it counts a thousandth of the points of a node.
    hold = np.full_like(sampled, 3e-4 * len(x) / sampled[..., 0].size)
    try:
        # A hundredth of the difference between the sampled cube and the best one remains. At the limit of iterations
        # more remains, but each iteration has brought the cube nearer to the function.
        solution = fit_lattice(
            x, y, levels, method=method, weight=omega, prior=Prior(sampled, hold), start=start, tolerance=1e-2, most=60
        )
    except CalibrationError as error:
        raise LutError("the transform cannot be fitted by a cube: its values span too wide a range") from error
    return solution.value
