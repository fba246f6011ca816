"""Bake a transform into a shaper and a cube, and a response behind it where the file can hold one.

A lattice of a profile is baked as it stands, without loss, in the form that the file can hold. Any other transform is
evaluated densely and fitted by least squares under the reader's own interpolation, with node levels where the function
bends; it is never merely sampled at the nodes.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from lutforge.colour.colour_difference import delta_e_2000
from lutforge.errors import LutError
from lutforge.interpolation import Interpolation
from lutforge.luts.fit import Evaluated, Progress, fit_lut, fit_without_response
from lutforge.luts.lut import Lut, lut_from_lattice
from lutforge.luts.parts import Parts, as_one, parts_of
from lutforge.model.scene_render import SceneRender
from lutforge.model.transform import LatticeTransform, Transform

Array = NDArray[np.float64]

DEFAULT_SIZE = 33
SIZES = (9, 13, 17, 21, 25, 33, 41, 49, 57, 65)
"""Sizes that a tolerance is tried at."""
BEST_ORDER = 3
"""No error falls faster than with this power of the size (piecewise linear: 2); sizes that cannot do are left out."""
CHECK_POINTS = 1 << 15


@dataclass(frozen=True)
class BakeError:
    """A LUT against its transform, on points that took no part in the fit: RGB norm; ΔE00 for display colours."""

    mean: float
    maximum: float
    de00_p99: float | None


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
    known = transform if isinstance(transform, Evaluated) else None
    transform = transform if known is None else known.transform
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
    if known is not None and shaper and not (response or shared) and size == known.lut.size:
        return replace(fit_without_response(known, method), title=title, comments=comments)
    if isinstance(transform, SceneRender):
        highest = transform.highest
    parts = parts_of(transform, response) if shaper and not shared and highest == 1 else as_one(transform, highest)
    if tolerance is None:
        lut = fit_lut(transform, parts, size or DEFAULT_SIZE, method, shaper, shared, progress)
    else:
        lut = _smallest(transform, parts, tolerance, method, shaper, shared, display_referred, progress)
    return replace(lut, title=title, comments=comments, highest=highest)


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


def _smallest(
    transform: Transform,
    parts: Parts,
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
        lut = fit_lut(transform, parts, size, method, shaper, shared, progress)
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
