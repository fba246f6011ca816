"""Bake a transform into a LUT of the form that a file can hold: lower it, then fit its segments.

A lattice of a profile is copied without loss. Any other transform is evaluated at many more points than the nodes, and
fitted by least squares under the interpolation of the file's reader, with node levels where the function bends.
"""

from __future__ import annotations  # so that help() shows the names of types

from dataclasses import replace
from pathlib import Path
from typing import SupportsIndex

import numpy as np

from lutforge.arrays import ColourFunction
from lutforge.colour.srgb import delta_e_2000
from lutforge.errors import LutError
from lutforge.interpolation import Interpolation
from lutforge.luts.fit_segments import fit_segments
from lutforge.luts.forms import MAX_SIZE
from lutforge.luts.lower import lower, lower_steps, takes_scenes
from lutforge.luts.ops import Op
from lutforge.luts.refinish import keeps_neutrals, refinish_lut
from lutforge.luts.sequence import Lut
from lutforge.luts.target import Target, target_of
from lutforge.model.transform import Transform
from lutforge.progress import Progress, silent
from lutforge.sobol import sobol


def bake(
    transform: ColourFunction,
    path: Path | None = None,
    *,
    size: int | None = None,
    interpolation: Interpolation | None = None,
    title: str = "",
) -> Lut:
    """Bake any transform of colours on [0, 1]³ as `bake_to` does. path: a file to write; its suffix names the form."""
    if path is None:
        return bake_to(transform, Target(size=size, interpolation=interpolation), title=title)
    lut = bake_to(transform, target_of(path, None, size, interpolation, takes_scenes(transform)), title=title)
    lut.write(path)
    return lut


def bake_to(
    transform: ColourFunction,
    target: Target,
    *,
    title: str = "",
    comments: tuple[str, ...] = (),
    highest: float = 1.0,
    progress: Progress = silent,
) -> Lut:
    """Bake a transform to one form.

    highest: of the inputs, above 1 for scene-linear values. Raises LutError on a size that no format has, and where the
    transform returns a number that is not finite.
    """
    require_transform(transform, highest)
    if target.size is not None and not (isinstance(target.size, SupportsIndex) and 2 <= target.size <= MAX_SIZE):
        raise LutError(f"{target.size} nodes per axis: choose 2 to {MAX_SIZE} (17, 33 and 65 are usual)")
    return Lut(_ops(transform, target, highest, progress), title, comments)


def bake_within(
    transform: ColourFunction,
    target: Target,
    tolerance: float,
    *,
    title: str = "",
    comments: tuple[str, ...] = (),
    highest: float = 1.0,
    progress: Progress = silent,
) -> Lut:
    """Bake a transform, whose outputs are encoded sRGB, to one form with the smallest size that meets a tolerance.

    tolerance: the largest ΔE00 of 99 % of the colours. Raises LutError where no size meets it.
    """
    require_transform(transform, highest)
    if not tolerance > 0:
        raise LutError(f"tolerance {tolerance:g}: a ΔE00 above 0 is needed")
    if target.size is not None:
        raise LutError("give a size or a tolerance, not both")

    # The error is measured at other colours than those of the fit.
    top = transform.highest() if isinstance(transform, Transform) and takes_scenes(transform) else highest
    x = sobol(8192, seed=7) * top
    exact = transform(x)
    errors: dict[int, float] = {}
    sizes = list(target.sizes)
    while sizes:
        size = sizes[0]
        ops = _ops(transform, replace(target, size=size), highest, progress)
        error = float(np.quantile(delta_e_2000(Lut(ops)(x), exact), 0.99))
        if error <= tolerance:
            return Lut(ops, title, comments)
        errors[size] = error
        # No error falls faster than with the third power of the size (piecewise linear: the second).
        sizes = [larger for larger in sizes[1:] if error * (size / larger) ** 3 <= tolerance]

    best = min(errors, key=lambda size: errors[size])
    largest = target.sizes[-1]
    raise LutError(
        f"no size up to {largest} brings 99 % of colours within {tolerance:g} ΔE00: the smallest error found is "
        f"{errors[best]:.2g}, at {best}; give a larger tolerance, or --size {largest} for the best there is"
    )


def bake_steps(
    transform: Transform, size: int | None = None, *, title: str = "", comments: tuple[str, ...] = ()
) -> Lut:
    """Bake a transform with one cube for each of its steps, as process lists (CLF, CTF) can hold it.

    size: nodes per axis of each cube; None: 33, and a profile's lattice keeps its own size, which loses nothing.
    """
    if keeps_neutrals(transform):
        return replace(refinish_lut(transform, lambda step: bake(step, size=size)), title=title, comments=comments)
    target = Target(size=size)
    parts = lower_steps(transform, target)
    return Lut(fit_segments(parts, target.size or target.default, target.method, silent), title, comments)


def require_transform(transform: object, highest: float = 1.0) -> None:
    """Raise LutError where the transform cannot be called, or `highest` is more than files hold."""
    if not callable(transform):
        kind = type(transform).__name__
        raise LutError(f'a {kind} is no transform of colours; name one of a profile: profile.render("STYLE/WB")')
    if not 0 < highest < 65504:
        raise LutError(f"LUT: inputs up to {highest:g}; half floats end at 65504")


def _ops(transform: ColourFunction, target: Target, highest: float, progress: Progress) -> tuple[Op, ...]:
    """The operations of a transform, lowered and fitted."""
    parts = lower(transform, target, highest)
    return fit_segments(parts, target.size or target.default, target.method, progress)
