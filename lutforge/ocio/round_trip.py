"""Make the linearization of a config the inverse of its render, where a profile's own two directions disagree.

A profile fits both directions to the same samples, each for the least error of its own output, so JPEG → scene → JPEG
comes back only as near as both fits allow. In a config every program goes there and back, so its linearization is made
anew as the inverse of the baked render: its axes run through the inverse of the render's response, on which a camera is
nearly linear; each colour that the render makes is taken back exactly (`ocio.preimage`), to the scene next to the
profile's own answer where several make it; the lattice is fitted to these, then for what is left after the render
(`ocio.inverse_fit`), with more colours where that is most. The change from the profile's own answer is kept smooth,
which continues it to colours that the render never makes. The lattice is the smallest that meets the goals.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from lutforge.interpolation import Levels, interpolate, through
from lutforge.luts.lut import Lut
from lutforge.model.lattice import grid, uniform_levels
from lutforge.ocio.inverse_fit import places, refine
from lutforge.ocio.lut_files import CURVE_SIZE, compact
from lutforge.ocio.preimage import Render, as_render, curve_inverse, preimages
from lutforge.regression.lattice_regression import Prior, Regularisation, fit_lattice
from lutforge.regression.node_levels import equidistributed_levels, resized_levels, snap_levels

Array = NDArray[np.float64]
Index = NDArray[np.int64]

MEAN_GOAL, MAX_GOAL = 0.002, 0.02
"""What a colour space of a config may lose to the reference and back, RGB norm of encoded values."""
MARGIN = 0.95
"""Share of the goals at which the fit is content, since other colours than its own will be tried."""
SIZES = (33, 49)
"""Nodes per axis that are tried."""
ROUNDS = 4
STEPS = 4
"""Most rounds at one size, and Gauss–Newton steps of each."""
POOL = 1 << 18
"""RAW colours of each of four spreads, whose JPEG colours are thinned out to PER_CELL in each cell of the lattice."""
PER_CELL, WORST_PER_CELL = 4, 3
WORST = 0.3
"""Share of the largest goal above which a colour of the pool takes part, up to WORST_PER_CELL a cell."""
SMOOTHNESS = Regularisation(smoothness=1e-4, twist=1e-4, anchor=0.0, thin_plate=0.0)
HOLD = 1e-4
"""Of the exact fit: how firmly a node is held to the profile's own answer beside one colour."""
MEASURED = 1 << 15


@dataclass(frozen=True)
class RoundTrip:
    """JPEG → RAW → JPEG on colours that the render makes: RGB norm of the encoded difference. departure: mean norm of
    the change of the linearization from the profile's own, linear, 1 = saturation; 0 where it is the profile's own."""

    mean: float
    maximum: float
    departure: float = 0.0

    @property
    def worth(self) -> float:
        """The larger share of its goal."""
        return max(self.mean / MEAN_GOAL, self.maximum / MAX_GOAL)

    @property
    def met(self) -> bool:
        """Within the goals."""
        return self.worth <= 1

    def __str__(self) -> str:
        text = f"round trip mean {self.mean:.2g}, max {self.maximum:.2g}"
        if self.departure:
            text += f", by a linearization fitted to the render (mean change {self.departure:.2g} of saturation)"
        return text


def measure(render: Lut, linearize: Lut, count: int = MEASURED, seed: int = 11) -> RoundTrip:
    """The round trip over RAW colours spread over the whole range and over its darks, as files hold what they make."""
    even = qmc.Sobol(3, rng=seed).random(count)
    jpeg = np.clip(render(np.concatenate([even, even**2, even**3])), 0.0, 1.0)
    error = np.linalg.norm(np.clip(render(linearize(jpeg)), 0.0, 1.0) - jpeg, axis=1)
    return RoundTrip(float(error.mean()), float(error.max()))


def consistent(render: Lut, linearize: Lut) -> tuple[Lut, RoundTrip]:
    """The linearization, the inverse of the render where the two do not meet the goals, and what is left.

    Both compact; render: white-balanced RAW → JPEG, linearize: back. The profile's own comes back where it does meet
    them, or where no fit is nearer. Time O(size³), a few seconds for 33³.
    """
    best, reached = linearize, measure(render, linearize)
    if reached.met:
        return best, reached
    colours = _Colours.of(as_render(render))
    levels = before = None
    for size in SIZES:
        levels = resized_levels(levels, size) if levels else _even_levels(colours, size)
        for candidate, largest in _fits(colours, linearize, levels, before):
            levels, before = candidate.levels, candidate
            trip = measure(render, candidate)
            trip = replace(trip, maximum=max(trip.maximum, largest))
            if trip.worth < reached.worth:
                best, reached = candidate, trip
            if reached.worth <= MARGIN:
                break
        if reached.worth <= MARGIN:
            break
    jpeg = colours.jpeg[:: max(len(colours.jpeg) // MEASURED, 1)]
    departure = float(np.linalg.norm(best(jpeg) - linearize(jpeg), axis=1).mean())
    return best, replace(reached, departure=departure)


@dataclass(frozen=True, eq=False)
class _Colours:
    """Colours that a render makes: raw → jpeg (n, 3), and inner (n, 3), the same in front of its response.

    curve: the inverse of the response, (CURVE_SIZE, 3): the axes on which the lattice is linear.
    """

    render: Render
    curve: Array
    raw: Array
    jpeg: Array
    inner: Array

    @classmethod
    def of(cls, render: Render) -> "_Colours":
        curve = curve_inverse(render.response, CURVE_SIZE)
        curve[0], curve[-1] = 0.0, 1.0
        even = qmc.Sobol(3, rng=5).random(POOL)
        spread = np.stack([np.interp(even[:, c], np.linspace(0, 1, len(axis)), axis) for c, axis in
                           enumerate(render.levels)], axis=1)  # fmt: skip
        face = even.copy()
        face[np.arange(POOL), np.arange(POOL) % 3] = np.arange(POOL) // 3 % 2
        raw = np.concatenate([spread, even, even**2, face**2])
        jpeg = render(raw)
        return cls(render, curve, raw, jpeg, through(curve, jpeg))

    def chosen(self, which: Index) -> "_Colours":
        """Some of them."""
        return replace(self, raw=self.raw[which], jpeg=self.jpeg[which], inner=self.inner[which])

    def joined(self, other: "_Colours") -> "_Colours":
        """Both."""
        parts = ((getattr(self, name), getattr(other, name)) for name in ("raw", "jpeg", "inner"))
        raw, jpeg, inner = (np.concatenate(pair) for pair in parts)
        return replace(self, raw=raw, jpeg=jpeg, inner=inner)

    def left(self, knots: Levels, values: Array) -> Array:
        """What is left of each, there and back, (n,)."""
        raw = interpolate(self.inner, knots, values, "tetrahedral")
        return np.asarray(np.linalg.norm(self.render(raw) - self.jpeg, axis=1))

    def knots(self, levels: Levels) -> Levels:
        """Node levels of the JPEG on the axes of the lattice."""
        r, g, b = through(self.curve, np.stack(levels, axis=1)).T
        return (np.ascontiguousarray(r), np.ascontiguousarray(g), np.ascontiguousarray(b))

    def filled(self, knots: Levels, values: Array, seed: int) -> "_Colours":
        """With more colours in the cells that have few, as far as the render makes such: at the rim of its gamut."""
        size = len(knots[0])
        count = np.bincount(_cells(self.inner, knots), minlength=(size - 1) ** 3)
        cells = np.repeat(np.arange(len(count)), np.maximum(PER_CELL - count, 0))
        place = np.stack(np.unravel_index(cells, (size - 1,) * 3), axis=1)
        inside = np.random.default_rng(seed).random(place.shape)
        sides = zip(knots, place.T, inside.T, strict=True)
        inner = np.stack([axis[p] + f * (axis[p + 1] - axis[p]) for axis, p, f in sides], axis=1)
        jpeg = through(self.render.response, inner)
        raw, found = preimages(self.render, inner, jpeg, interpolate(inner, knots, values, "tetrahedral"))
        return self.joined(replace(self, raw=raw[found], jpeg=jpeg[found], inner=inner[found]))


def _fits(pool: _Colours, own: Lut, levels: Levels, before: Lut | None) -> Iterator[tuple[Lut, float]]:
    """Ever nearer inverses of one size, each as its file holds it, and the largest error over the pool.

    before: an inverse to begin from, of another size.
    """
    size = len(levels[0])
    if before is None:
        levels, values = _first(pool, own, _snapped(levels))
    else:
        levels = _snapped(levels)
        values = before(grid(levels))
    knots, prior = pool.knots(levels), own(grid(levels))
    colours = pool.chosen(_thinned(pool.inner, knots, PER_CELL)).filled(knots, values, size)
    for number in range(ROUNDS):
        values = refine(pool.render, colours.jpeg, places(colours.inner, knots), values, prior, STEPS)
        error = pool.left(knots, values)
        yield _as_lut(own, pool, levels, values), float(error.max())
        worst = np.flatnonzero(error > WORST * MAX_GOAL)
        worst = worst[np.argsort(-error[worst], kind="stable")]
        worst = worst[_thinned(pool.inner[worst], knots, WORST_PER_CELL)]
        colours = colours.joined(pool.chosen(worst)).filled(knots, values, size + 100 * (number + 1))


def _first(pool: _Colours, own: Lut, levels: Levels) -> tuple[Levels, Array]:
    """The fit to exact inverses, and node levels moved to where it is worst."""
    knots = pool.knots(levels)
    colours = pool.chosen(_thinned(pool.inner, knots, PER_CELL))
    values = _exact(colours, knots, own(colours.jpeg), own(grid(levels)))
    error = colours.left(knots, values) ** 2
    levels = _snapped(_encoded(pool, equidistributed_levels(colours.inner, error, knots)))
    old, knots = knots, pool.knots(levels)
    start = interpolate(grid(knots), old, values, "tetrahedral")
    colours = pool.chosen(_thinned(pool.inner, knots, PER_CELL)).filled(knots, start, len(levels[0]))
    return levels, _exact(colours, knots, interpolate(colours.inner, old, values, "tetrahedral"), own(grid(levels)))


def _exact(colours: _Colours, knots: Levels, start: Array, prior: Array) -> Array:
    """Node values fitted to the RAW of each colour, searched from `start` (n, 3)."""
    raw, found = preimages(colours.render, colours.inner, colours.jpeg, start)
    raw[~found] = colours.raw[~found]
    return fit_lattice(
        colours.inner, raw, knots, SMOOTHNESS, method="tetrahedral", prior=Prior(prior, np.full(prior.shape, HOLD)),
        tolerance=1e-4,
    ).values  # fmt: skip


def _as_lut(own: Lut, colours: _Colours, levels: Levels, values: Array) -> Lut:
    curve = None if len(colours.render.response) == 2 else colours.curve
    return compact(
        replace(
            own,
            levels=levels,
            cube=values,
            matrix=np.eye(3),
            shaper_size=CURVE_SIZE,
            interpolation="tetrahedral",
            curve=curve,
            response=None,
        )
    )


def _even_levels(colours: _Colours, size: int) -> Levels:
    """Node levels of the JPEG, most of them evenly spread on it, the rest on the axes of the lattice."""
    even = np.linspace(0.0, 1.0, size)
    bent = _encoded(colours, uniform_levels(size))
    r, g, b = (0.75 * even + 0.25 * axis for axis in bent)
    return (r, g, b)


def _encoded(colours: _Colours, inner: Levels) -> Levels:
    """Levels on the axes of the lattice as levels of the JPEG."""
    r, g, b = through(colours.render.response, np.stack(inner, axis=1)).T
    return (r, g, b)


def _snapped(levels: Levels) -> Levels:
    r, g, b = (snap_levels(axis, CURVE_SIZE) for axis in levels)
    return (r, g, b)


def _cells(x: Array, knots: Levels) -> Index:
    """The cell of each colour, numbered (n,)."""
    size = len(knots[0]) - 1
    cell = np.zeros(len(x), dtype=np.int64)
    for channel, axis in enumerate(knots):
        cell = cell * size + np.clip(np.searchsorted(axis, x[:, channel], side="right") - 1, 0, size - 1)
    return cell


def _thinned(x: Array, knots: Levels, most: int) -> Index:
    """Which colours to keep so that no cell has more than `most`: the first of each."""
    cell = _cells(x, knots)
    order = np.argsort(cell, kind="stable")
    sorted_cells = cell[order]
    begins = np.concatenate([[True], sorted_cells[1:] != sorted_cells[:-1]]) if len(x) else np.zeros(0, dtype=bool)
    first = np.maximum.accumulate(np.where(begins, np.arange(len(x)), 0))
    return np.asarray(order[np.arange(len(x)) - first < most])
