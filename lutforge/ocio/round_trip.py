"""Make the render and the linearization of a config each other's inverse, where a profile's own directions disagree.

A profile fits both directions to the same samples, each for the least error of its own output, so JPEG → scene → JPEG
comes back only as near as both fits allow. In a config every program goes there and back, so its linearization is made
anew as the inverse of the baked render: its axes run through the inverse of the render's response, on which a camera is
nearly linear; each colour that the render makes is taken back exactly (`ocio.preimage`), to the scene next to the
profile's own answer where several make it; the lattice is fitted to these, then for what is left after the render
(`ocio.joint_fit`), with more colours where that is most. The change from the profile's own answer is kept smooth,
which continues it to colours that the render never makes.

Just inside the rim of its gamut, among colours that no sample showed, a fitted render folds: two scenes make one
colour, and the way back would have to jump between them, which no continuous lattice does, however fine. So the
render's own nodes give way there, by a few codes at most, while neutrals stay as they are.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lutforge.interpolation import Levels, interpolate
from lutforge.luts.lut import Lut
from lutforge.model.lattice import grid, uniform_levels
from lutforge.model.transform import Transform
from lutforge.ocio.joint_fit import Cubes, places, refine
from lutforge.ocio.lut_files import CURVE_SIZE, compact, rounded
from lutforge.ocio.made_colours import MadeColours, climbed, spread, tetrahedra, thinned
from lutforge.ocio.preimage import Render, as_render, preimages
from lutforge.regression.lattice_regression import Prior, Regularisation, fit_lattice
from lutforge.regression.node_levels import equidistributed_levels, resized_levels, snap_levels

Array = NDArray[np.float64]

MEAN_GOAL, MAX_GOAL = 0.002, 0.02
"""What a colour space of a config may lose to the reference and back, RGB norm of encoded values."""
MARGIN, ENOUGH = 0.65, 0.9
"""Share of the goals at which the fit is content, since other colours than its own will be tried, and at which it tries
no larger size."""
SIZES = (33, 49)
"""Nodes per axis that are tried."""
ROUNDS = ((0.5, 0.3), (0.5, 0.1), (0.5, 0.03), (1.0, 0.03), (1.0, 0.03), (1.0, 0.03))
"""At the first size: how much more large residuals count, and how firmly the render is held, which gives way last."""
MORE_ROUNDS = ROUNDS[-2:]
"""The same at the next size."""
NEAR = 1.5
"""Share of the goals up to which the next size is tried: beyond it, it would not reach them either."""
STEPS = 4
"""Most Gauss–Newton steps of a round."""
POOL = 1 << 16
"""Colours of a pool, see `made_colours.spread`: of one that stays, and of another in each round."""
WORST, WORST_PER_TETRAHEDRON = 0.3, 3
"""Share of the largest goal above which a colour of the pool takes part, up to so many between the same four nodes."""
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
        text = f"round trip mean {rounded_up(self.mean)}, max {rounded_up(self.maximum)}"
        if self.departure:
            text += f", by LUTs fitted to each other (mean change of linearize {self.departure:.2g} of saturation)"
        if not self.met:
            text += f": beyond {MEAN_GOAL:g} and {MAX_GOAL:g}, since the render takes different scenes to one colour"
        return text


def rounded_up(value: float) -> str:
    """A measured error to two digits, never said smaller than it is."""
    if value <= 0:
        return "0"
    unit = 10.0 ** (np.floor(np.log10(value)) - 1)
    return f"{np.ceil(value / unit - 1e-9) * unit:.2g}"


def measure(render: Lut, linearize: Lut, count: int = MEASURED, seed: int = 11) -> RoundTrip:
    """The round trip over RAW colours spread over the whole range and over its darks, as files hold what they make."""

    def left(raw: Array) -> Array:
        jpeg = np.clip(render(raw), 0.0, 1.0)
        return np.asarray(np.linalg.norm(np.clip(render(linearize(jpeg)), 0.0, 1.0) - jpeg, axis=1))

    raw = spread(count, seed)
    errors = left(raw)
    trip = _trip(errors)
    return replace(trip, maximum=max(trip.maximum, float(left(climbed(left, raw, errors, seed)).max())))


def _trip(*errors: Array) -> RoundTrip:
    return RoundTrip(max(float(e.mean()) for e in errors), max(float(e.max()) for e in errors))


def consistent(render: Lut, linearize: Lut, model: Transform | None = None) -> tuple[Lut, Lut, RoundTrip]:
    """A render and a linearization that are each other's inverse, and what is left.

    Both compact; render: white-balanced RAW → JPEG, linearize: back; model: what the render was baked from, whose
    colours shall come back, too. The given ones come back where they meet the goals by far, or where no fit is nearer.
    Time O(size³), ten seconds for 33³.
    """
    best, reached = (render, linearize), measure(render, linearize)
    if reached.worth <= MARGIN:
        return render, linearize, reached
    first = as_render(render)
    pool = MadeColours.of(first, POOL, 5, model)
    levels = before = None
    for size in SIZES:
        levels = resized_levels(levels, size) if levels else _even_levels(pool, size)
        for candidate, trip in _fits(pool, linearize, levels, before):
            levels, before = candidate[1].levels, candidate
            if trip.worth < reached.worth:
                best, reached = candidate, trip
            if reached.worth <= MARGIN:
                break
        if best[1] is not linearize:  # more colours than the fits looked at
            held = measure(*best, count=4 * POOL)
            reached = RoundTrip(max(reached.mean, held.mean), max(reached.maximum, held.maximum))
        if reached.worth <= ENOUGH or reached.worth > NEAR:
            break
    if best[1] is linearize:
        return render, linearize, reached
    jpeg = pool.jpeg[:: max(len(pool.jpeg) // MEASURED, 1)]
    departure = float(np.linalg.norm(best[1](jpeg) - linearize(jpeg), axis=1).mean())
    return *best, replace(reached, departure=departure)


def _fits(
    pool: MadeColours, own: Lut, levels: Levels, before: tuple[Lut, Lut] | None
) -> Iterator[tuple[tuple[Lut, Lut], RoundTrip]]:
    """Ever nearer pairs of one size, render and linearization, each as its file holds it, and their round trip.

    before: a pair to begin from, of another size.
    """
    first, size = pool.render, len(levels[0])
    levels = _snapped(levels)
    if before is None:
        levels, back = _first(pool, own, levels)
        cubes = Cubes(back, first.values)
    else:
        cubes = Cubes(before[1](grid(levels)), before[0].cube)
    knots, prior, free = pool.knots(levels), Cubes(own(grid(levels)), first.values), _free(first)
    pool = pool.rendered(cubes.render)
    colours = pool.few(knots).filled(knots, cubes.back, size)
    for number, (power, hold) in enumerate(ROUNDS if before is None else MORE_ROUNDS):
        at = places(colours.inner, knots)
        cubes = refine(first, colours.jpeg, at, cubes, prior, free, STEPS, power, hold)
        if len(first.response) == 2:  # no curve behind it clamps
            cubes = Cubes(cubes.back, np.clip(cubes.render, *_range(first.values)))
        pool = pool.rendered(rounded(cubes.render))
        others = MadeColours.of(pool.render, POOL, 100 + number)
        errors = [some.left(knots, cubes.back) for some in (pool, others)]
        peaks = _peaks(others, knots, cubes.back, errors[1], number)
        trip, at_peaks = _trip(*errors), peaks.left(knots, cubes.back)
        trip = replace(trip, maximum=max(trip.maximum, float(at_peaks.max())))
        yield (pool.render.lut, _as_lut(own, pool, levels, cubes.back)), trip
        both, error = pool.joined(others).joined(peaks), np.concatenate([*errors, at_peaks])
        worst = np.flatnonzero(error > WORST * MAX_GOAL)
        worst = worst[np.argsort(-error[worst], kind="stable")]
        worst = worst[thinned(tetrahedra(both.inner[worst], knots), WORST_PER_TETRAHEDRON)]
        colours = colours.joined(both.chosen(worst)).filled(knots, cubes.back, size + 100 * (number + 1))


def _range(values: Array) -> tuple[float, float]:
    """[0, 1], or what values go beyond it."""
    return min(0.0, float(values.min())), max(1.0, float(values.max()))


def _peaks(colours: MadeColours, knots: Levels, values: Array, errors: Array, seed: int) -> MadeColours:
    """Colours around those that come back worst, that come back worse."""

    def left(raw: Array) -> Array:
        return MadeColours.made(colours.render, raw).left(knots, values)

    return MadeColours.made(colours.render, climbed(left, colours.raw, errors, seed))


def _free(render: Render) -> NDArray[np.bool_]:
    """Nodes of a render that may move, (M, M, M): none of a cell that neutrals run through, black to white."""
    grey = np.linspace(0.0, 1.0, 4 * CURVE_SIZE)
    r, g, b = (np.clip(np.searchsorted(axis, grey, side="right") - 1, 0, len(axis) - 2) for axis in render.levels)
    free = np.ones(render.values.shape[:3], dtype=np.bool_)
    for corner in range(8):
        free[r + (corner >> 2), g + ((corner >> 1) & 1), b + (corner & 1)] = False
    return free


def _first(pool: MadeColours, own: Lut, levels: Levels) -> tuple[Levels, Array]:
    """The fit to exact inverses, and node levels moved to where it is worst."""
    knots = pool.knots(levels)
    colours = pool.few(knots)
    values = _exact(colours, knots, own(colours.jpeg), own(grid(levels)))
    error = colours.left(knots, values) ** 2
    levels = _snapped(pool.encoded(equidistributed_levels(colours.inner, error, knots)))
    old, knots = knots, pool.knots(levels)
    start = interpolate(grid(knots), old, values, "tetrahedral")
    colours = pool.few(knots).filled(knots, start, len(levels[0]))
    return levels, _exact(colours, knots, interpolate(colours.inner, old, values, "tetrahedral"), own(grid(levels)))


def _exact(colours: MadeColours, knots: Levels, start: Array, prior: Array) -> Array:
    """Node values fitted to the RAW of each colour, searched from `start` (n, 3)."""
    raw, found = preimages(colours.render, colours.inner, colours.jpeg, start)
    raw[~found] = colours.raw[~found]
    return fit_lattice(
        colours.inner, raw, knots, SMOOTHNESS, method="tetrahedral", prior=Prior(prior, np.full(prior.shape, HOLD)),
        tolerance=1e-4,
    ).values  # fmt: skip


def _as_lut(own: Lut, colours: MadeColours, levels: Levels, values: Array) -> Lut:
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


def _even_levels(colours: MadeColours, size: int) -> Levels:
    """Node levels of the JPEG, most of them evenly spread on it, the rest on the axes of the lattice."""
    even = np.linspace(0.0, 1.0, size)
    bent = colours.encoded(uniform_levels(size))
    r, g, b = (0.75 * even + 0.25 * axis for axis in bent)
    return (r, g, b)


def _snapped(levels: Levels) -> Levels:
    r, g, b = (snap_levels(axis, CURVE_SIZE) for axis in levels)
    return (r, g, b)
