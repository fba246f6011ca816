"""Bake a transform into a LUT of the form that a file can hold.

A lattice of a profile is baked as it stands, without loss. Any other transform is evaluated densely and fitted by least
squares under the reader's own interpolation, with node levels where the function bends; it is never merely sampled at
the nodes.
"""

from __future__ import annotations  # so that help() shows the names of types

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import SupportsIndex

import numpy as np

from lutforge.arrays import Array
from lutforge.colour.srgb import delta_e_2000
from lutforge.errors import LutError
from lutforge.interpolation import Interpolation
from lutforge.luts.axes import Axes, fit_axes, measure_lines
from lutforge.luts.least_squares import Samples, fit_cube, sample
from lutforge.luts.ops import Cube, Curve, Matrix, Op, Range
from lutforge.luts.parts import Parts, as_one, curve_alone, parts_of, slope_weight
from lutforge.luts.programs import Target, target_of
from lutforge.luts.sequence import MAX_SIZE, Form, Lut
from lutforge.luts.shaper import FEW, SHAPER_SIZE, is_even, lattice_ops, levels_behind_gain, node_levels, shaper
from lutforge.model.gamut_map import GamutMap
from lutforge.model.highlights import NeutralHighlights
from lutforge.model.lattice import Lattice, grid, snap_levels, uniform_levels
from lutforge.model.transform import Clip, ColourFunction, DecodeRgb, MatrixStage, Stage, Transform, through_stages
from lutforge.progress import Progress, silent
from lutforge.sobol import sobol


def bake(
    transform: ColourFunction,
    path: Path | None = None,
    *,
    size: int | None = None,
    form: Form = "full",
    tolerance: float | None = None,
    interpolation: Interpolation | None = None,
    display_referred: bool = True,
    title: str = "",
) -> Lut:
    """Bake any transform of colours, (…, 3) → (…, 3) on [0, 1]³, to one LUT, as `bake_forms` does to several.

    path: a file to be written, too, which then says the form.
    """
    target = Target(form, size, interpolation)
    if path is not None:
        target = target_of(path, None, size, interpolation, takes_scenes(transform))
    lut = bake_forms(transform, [target], tolerance=tolerance, display_referred=display_referred, title=title)[0]
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
    """Bake one transform to several forms, and evaluate it once for all forms of a size.

    tolerance: instead of a size, the ΔE00 that 99 % of colours keep within; the smallest size that does is taken.
    display_referred: the output is encoded sRGB, so that ΔE00 has a meaning. highest: inputs reach from 0 to this, for
    scene-linear light. Raises LutError where the size or tolerance cannot be had, or the transform gives numbers that
    are not finite.
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
    known: dict[tuple[str, int], EvaluatedTransform] = {}

    def together(form: Form) -> str:
        return form if scenes or form == "plain" else "curves"

    def fitted(target: Target, size: int) -> tuple[Op, ...]:
        form, key = target.form, (together(target.form), size)
        if key not in known:
            forms = list(dict.fromkeys(other.form for other in targets if together(other.form) == key[0]))
            reach = highest if scenes and form == "full" else _highest(transform, highest)
            known[key] = evaluate(transform, size, forms, reach, progress)
        progress(f"{size}³ nodes: fitted", 0.8)
        return fit_ops(known[key], form, target.interpolation or "tetrahedral")

    luts = []
    for target in targets:
        if target.size is not None and tolerance is not None:
            raise LutError("give a size or a tolerance, not both")
        if target.size is not None and not (isinstance(target.size, SupportsIndex) and 2 <= target.size <= MAX_SIZE):
            raise LutError(f"{target.size} nodes per axis: choose 2 to {MAX_SIZE} (17, 33 and 65 are usual)")
        if tolerance is not None:
            measured = partial(_p99, transform, _highest(transform, highest))
            ops = _smallest(partial(fitted, target), measured, tolerance, target.sizes)
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
    if not isinstance(transform, Transform) or not isinstance(first, DecodeRgb):
        return None
    codes = np.repeat(np.linspace(0.0, 1.0, SHAPER_SIZE)[:, None], 3, axis=1)
    return Curve(first(codes)), Transform(transform.stages[1:])


def _highest(transform: ColourFunction, highest: float) -> float:
    return transform.highest() if isinstance(transform, Transform) and takes_scenes(transform) else highest


def _p99(transform: ColourFunction, highest: float, ops: tuple[Op, ...]) -> float:
    """The ΔE00 within which 99 % of colours are that took no part in the fit, evenly spread from 0 to `highest`."""
    x = sobol(8192, seed=7) * highest
    return float(np.quantile(delta_e_2000(Lut(ops)(x), transform(x)), 0.99))


def _as_it_stands(transform: ColourFunction, target: Target) -> tuple[Op, ...] | None:
    """A lattice of a profile, where it has the size and the interpolation that are asked for and fits the form."""
    if isinstance(transform, Transform) and transform.is_identity:
        even = grid(uniform_levels(target.size or target.default))
        return (Range(),) if target.form == "full" else (Cube(even, target.interpolation or "tetrahedral"),)
    curve = curve_alone(transform)
    if curve is not None:
        return joined(curve) if target.form == "full" else _with_curve(joined(curve), target)
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


def _with_curve(ops: tuple[Op, ...], target: Target) -> tuple[Op, ...] | None:
    """A curve alone, where the file may hold one, or with a cube of what matrices there are; None for other forms."""
    match [op for op in ops if not isinstance(op, Range)]:
        case [Curve() as curve]:
            if target.curve or target.form == "shaper":
                return (curve,)
        case [Curve() as curve, Matrix() as matrix] if target.form == "shaper":
            return curve, Cube(matrix(grid(uniform_levels(2))), target.interpolation or "tetrahedral")
    return None


def _folded(ops: tuple[Op, ...], behind: Parts) -> tuple[Op, ...] | None:
    """A lattice with its gain in the shaper and its matrix in the cube; None where an output curve is behind it.

    Node levels L / gain are moved to the shaper's grid, and the cube is evaluated there, so that an output changes by
    less than its kinks do over one step of the shaper.
    """
    if not Lut(ops).has_form("shaper"):
        return None
    curve, cube = Lut(ops).shaper_and_cube()
    gain, matrix = behind.gain, behind.matrix
    if np.all(gain == 1):
        return (*ops[:-1], Cube(cube.values @ matrix.T, cube.interpolation))
    levels = levels_behind_gain(node_levels(curve, cube), gain)
    values = Lut(ops)(np.clip(grid(levels) * gain, 0.0, 1.0)) @ matrix.T
    return shaper(levels), Cube(values, cube.interpolation)


def _smallest(
    fitted: Callable[[int], tuple[Op, ...]],
    error_of: Callable[[tuple[Op, ...]], float],
    tolerance: float,
    sizes: Sequence[int],
) -> tuple[Op, ...]:
    best, at, left = float("inf"), 0, list(sizes)
    while left:
        size = left[0]
        ops = fitted(size)
        error = error_of(ops)
        if error < best:
            best, at = error, size
        if error <= tolerance:
            return ops
        # No error falls faster than with the third power of the size (piecewise linear: the second).
        left = [larger for larger in left[1:] if error * (size / larger) ** 3 <= tolerance]
    raise LutError(
        f"no size up to {sizes[-1]} brings 99 % of colours within {tolerance:g} ΔE00: the smallest error found is "
        f"{best:.2g}, at {at}; give a larger tolerance, or --size {sizes[-1]} for the best there is"
    )


# --- Fit a cube of a given size: axes along which it is smooth, then the nodes by least squares ----------------------
# What is costly is evaluating the transform; `evaluate` does it once for all forms of a size.


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


# --- The steps of a transform in one sequence: what a process list (CLF, CTF) can hold whole -------------------------
# A refinish between two lattices of a profile is lattice → matrix → lattice: written so, the file is the model, while
# one cube of both can only come near. A refinish of a physical model becomes two cubes with the camera's clipping
# between.


HIGHLIGHT_SIZE, DARK_CELLS = 33, 5
"""Nodes per axis of the cube that keeps white neutral, and how many cells of them lie below the light that is raised.
"""


def bake_steps(
    transform: ColourFunction,
    size: int | None = None,
    *,
    interpolation: Interpolation | None = None,
    title: str = "",
    comments: tuple[str, ...] = (),
) -> Lut:
    """Bake a transform with a cube for each of its steps, from one clip to the next.

    size: nodes per axis of each (33; lattices of a profile keep their own, and lose nothing).
    """

    def baked(step: ColourFunction) -> Lut:
        return bake(step, size=size, interpolation=interpolation)

    if isinstance(transform, Transform) and any(isinstance(stage, NeutralHighlights) for stage in transform.stages):
        return Lut(joined(grading_lut(transform, baked).ops), title, comments)
    steps: list[ColourFunction] = [transform]
    if isinstance(
        transform, Transform
    ):  # cut in front of each clip but the first, and of matrices and gains ahead of it
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


def raised(highlights: NeutralHighlights, gain: Array, reach: float, size: int = HIGHLIGHT_SIZE) -> tuple[Op, ...]:
    """Highlights as a cube of the light in front of a gain (3,), relative to white, up to `reach`.

    The nodes lie where light is raised, at the same levels in all channels. Interpolated in tetrahedra, what is not
    raised passes exactly, and so does the least channel. White is a node.
    """
    steps = len(highlights.floor) - 1
    dark = max(int(np.argmax(highlights.floor.max(axis=1) > 0)) - 1, DARK_CELLS) / steps
    below, above = np.linspace(0.0, dark, DARK_CELLS + 1)[:-1], np.linspace(dark, 1.0, size - 1 - DARK_CELLS)
    axis = snap_levels(np.append(np.append(below, above), max(reach, 1.0) + 0.01) / (max(reach, 1.0) + 0.01), FEW)
    levels, scale = (axis, axis, axis), highlights.white / gain / axis[-2]
    cube = Cube(highlights(grid(levels) * scale * gain), "tetrahedral")
    return Matrix(np.diag(1.0 / scale)), Range(), shaper(levels, FEW), cube


def grading_steps(transform: Transform) -> tuple[Transform, tuple[Stage, ...], NeutralHighlights, Transform]:
    """The parts of a refinish for photographs: JPEG → linear, from there to balanced light, highlights, and the render.

    Raises LutError on a transform that keeps no neutrals.
    """
    stages = transform.stages
    at = next((at for at, stage in enumerate(stages) if isinstance(stage, NeutralHighlights)), None)
    highlights = None if at is None else stages[at]
    if at is None or not isinstance(highlights, NeutralHighlights):
        raise LutError("LUT: photographs are graded by a refinish that keeps clipped neutrals")
    cut = 1 + next(at for at, stage in enumerate(stages) if isinstance(stage, Lattice | GamutMap))
    return Transform(stages[:cut]), stages[cut:at], highlights, Transform(stages[at + 1 :])
