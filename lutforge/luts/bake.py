"""Bake a transform into a shaper and a cube (method: lattice regression to a known function).

A lattice of a profile is baked as it stands, without loss. Any other transform is evaluated densely and fitted by least
squares under the reader's own interpolation, with node levels where the function bends; it is never merely sampled at
the nodes.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from lutforge.errors import LutError
from lutforge.interpolation import Interpolation, Levels
from lutforge.luts.lut import Lut, lut_from_lattice
from lutforge.luts.shaper import SHAPER_SIZE
from lutforge.model.colour_difference import delta_e_2000
from lutforge.model.lattice import grid, uniform_levels
from lutforge.model.transform import LatticeTransform, Transform
from lutforge.regression.lattice_regression import LatticeFit, Prior, Regularisation, fit_lattice, predict
from lutforge.regression.node_levels import equidistributed_levels, snap_levels

Array = NDArray[np.float64]

DEFAULT_SIZE = 33
SIZES = (9, 13, 17, 21, 25, 33, 41, 49, 57, 65)
"""Sizes that a tolerance is tried at."""
ROUNDS = 5
POINTS_PER_NODE = 6
SEARCH_POINTS = 60_000
SMOOTHNESS = 1e-5
"""Only keeps nodes between samples in place: the data term of a dense evaluation weighs several units per node."""
CORNER_HOLD = 1e3
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
    progress: Callable[[str, float], None] = lambda what, share: None,
) -> Lut:
    """A LUT of any transform of colours, (…, 3) → (…, 3) on [0, 1]³.

    size: nodes per axis (33; a lattice of a profile keeps its own). tolerance: instead, the smallest size at which 99 %
    of colours are within this ΔE00; display_referred: the output is encoded sRGB, so that ΔE00 has a meaning.
    Raises LutError where the size or tolerance cannot be had, or the transform gives numbers that are not finite.
    """
    if size is not None and tolerance is not None:
        raise LutError("give a size or a tolerance, not both")
    if size is not None and not 2 <= size <= 129:
        raise LutError(f"{size} nodes per axis: choose 2 to 129 (17, 33 and 65 are usual)")
    if isinstance(transform, LatticeTransform) and tolerance is None:
        lattice = transform.lattice
        own = set(lattice.size) == {size or lattice.size[0]}
        if own and (interpolation or lattice.interpolation) == lattice.interpolation:
            lut = lut_from_lattice(lattice, transform.gain, transform.matrix, title)
            return replace(lut, comments=comments)
    problem = _Problem(transform, interpolation or "trilinear")
    if tolerance is None:
        lut = problem.fit(size or DEFAULT_SIZE)
    else:
        lut = _smallest(problem, tolerance, display_referred, progress)
    return replace(lut, title=title, comments=comments)


def _smallest(
    problem: "_Problem", tolerance: float, display_referred: bool, progress: Callable[[str, float], None]
) -> Lut:
    if not display_referred:
        raise LutError("a ΔE00 tolerance has no meaning for scene-linear output; give a size (33 or 65) instead")
    if not tolerance > 0:
        raise LutError(f"tolerance {tolerance:g}: a ΔE00 above 0 is needed")
    reached = float("inf")
    for index, size in enumerate(SIZES):
        progress(f"{size} nodes per axis", index / len(SIZES))
        lut = problem.fit(size)
        error = bake_error(lut, problem.transform).de00_p99
        reached = min(reached, error if error is not None else reached)
        if reached <= tolerance:
            return lut
    raise LutError(
        f"no size up to {SIZES[-1]} brings 99 % of colours within {tolerance:g} ΔE00; the best is {reached:.2g}"
    )


def bake_error(lut: Lut, transform: Transform, display_referred: bool = True) -> BakeError:
    """Measure a LUT against its transform on a scrambled Sobol set of its input cube."""
    x = qmc.Sobol(3, rng=7).random(CHECK_POINTS)
    got, wanted = lut(x), transform(x)
    norm = np.linalg.norm(got - wanted, axis=1)
    p99 = None
    if display_referred:
        p99 = float(np.quantile(delta_e_2000(got[:8192], wanted[:8192]), 0.99))
    return BakeError(float(norm.mean()), float(norm.max()), p99)


class _Problem:
    """The core of a transform, to be fitted by a lattice; its gain and matrix stay outside."""

    def __init__(self, transform: Transform, method: Interpolation) -> None:
        self.transform = transform
        self.method = method
        self.gain: Array = getattr(transform, "gain", np.ones(3))
        self.matrix: Array = getattr(transform, "matrix", np.eye(3))
        self._core: Callable[[Array], Array] = getattr(transform, "core", transform)

    def core(self, x: Array) -> Array:
        """The function that the lattice holds, at x (…, 3)."""
        y = np.asarray(self._core(x), dtype=np.float64)
        if y.shape != x.shape:
            raise LutError(f"the transform made shape {y.shape} of colours of shape {x.shape}; it must keep it")
        if not np.all(np.isfinite(y)):
            worst = x.reshape(-1, 3)[np.flatnonzero(~np.all(np.isfinite(y.reshape(-1, 3)), axis=1))[0]]
            raise LutError(f"the transform gives a number that is not finite at {np.round(worst, 4).tolist()}")
        return y

    def fit(self, size: int) -> Lut:
        """Node levels by rounds on a sparse set of points, then the values on a dense one."""
        x = _points(min(SEARCH_POINTS, 2 * POINTS_PER_NODE * size**3), uniform_levels(size))
        y = self.core(x)
        levels = uniform_levels(size)
        best: tuple[float, Levels] = (float("inf"), levels)
        for _ in range(ROUNDS):
            nodes = self._fit(x, y, levels, 1e-3)
            error = np.sum((predict(nodes, x, self.method) - y) ** 2, axis=1)
            mean = float(np.mean(error))
            if mean < best[0]:
                best = (mean, levels)
            if mean > 0.97 * best[0] and levels is not best[1]:
                break
            levels = equidistributed_levels(x, error, levels)
        r, g, b = (snap_levels(axis, SHAPER_SIZE) for axis in best[1])
        dense = _points(POINTS_PER_NODE * size**3, (r, g, b))
        values = self._fit(dense, self.core(dense), (r, g, b), 1e-6).values
        return Lut(self.gain, (r, g, b), values, self.matrix, SHAPER_SIZE, self.method)

    def _fit(self, x: Array, y: Array, levels: Levels, tolerance: float) -> LatticeFit:
        sampled = self.core(grid(levels))
        hold = np.zeros_like(sampled)
        hold[0, 0, 0] = hold[-1, -1, -1] = CORNER_HOLD
        return fit_lattice(
            x,
            y,
            levels,
            Regularisation(SMOOTHNESS, twist=SMOOTHNESS, anchor=0.0, thin_plate=0.0),
            method=self.method,
            prior=Prior(sampled, hold),
            tolerance=tolerance,
        )


def _points(count: int, levels: Levels) -> Array:
    """Colours (n, 3) on [0, 1]: half spread over the cube, half over the cells of the lattice; and the grey axis."""
    half = 1 << max(6, int(np.ceil(np.log2(max(1, count // 2)))))
    even = qmc.Sobol(3, scramble=False).random(half)
    spread = qmc.Sobol(3, rng=1).random(half)
    cells = np.stack([np.interp(spread[:, c], np.linspace(0, 1, len(levels[c])), levels[c]) for c in range(3)], axis=1)
    grey = np.repeat(np.linspace(0.0, 1.0, 1025)[:, None], 3, axis=1)
    return np.concatenate([even, cells, grey])
