"""Bake a transform into a LUT of the form that a file can hold.

A lattice of a profile is baked as it stands, without loss. Any other transform is evaluated densely and fitted by least
squares under the reader's own interpolation, with node levels where the function bends; it is never merely sampled at
the nodes.
"""

from __future__ import annotations  # so that help() shows the names of types

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import SupportsIndex

import numpy as np

from lutforge.colour.colour_difference import delta_e_2000
from lutforge.errors import LutError
from lutforge.interpolation import Interpolation
from lutforge.luts.fit import EvaluatedTransform, evaluate, fit_ops
from lutforge.luts.ops import Cube, Curve, Matrix, Op, Range
from lutforge.luts.parts import Parts, curve_alone, parts_of
from lutforge.luts.programs import Target, target_of
from lutforge.luts.sequence import MAX_SIZE, Form, Lut
from lutforge.luts.shaper import SHAPER_SIZE, lattice_ops, levels_behind_gain, node_levels, shaper
from lutforge.model.lattice import grid, uniform_levels
from lutforge.model.transform import ColourFunction, DecodeRgb, MatrixStage, Transform
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
