"""Make the render and the linearization of a config each other's inverse, where a profile's own directions disagree.

A profile fits both directions to the same samples, each for the least error of its own output, so JPEG → scene → JPEG
comes back only as near as both fits allow. In a config every program goes there and back, so its linearization is made
anew as the inverse of the baked render: its axes run through the inverse of the render's response, on which a camera is
nearly linear; each colour that the render makes is taken back exactly (`ocio.preimage`), to the scene next to the
profile's own answer where several make it; the lattice is fitted to these, then for what is left after the render
(`ocio.joint_fit`): at first all of it, then only around the cells that still lose most, with more colours there. The
change from the profile's own answer is kept smooth, which continues it to colours that the render never makes.

A channel that is clipped says only that the scene is beyond: codes of 0 and 1 have a layer of nodes of their own, which
may lie far enough beyond to stay clipped between them, while the codes beside do not move.

Where a render is flat, in black, in a shoulder and beyond white, it does not tell which scene it shows, and the fit
would be free to tint greys. So the nodes around neutrals are held, lightly, to the profile's own answer, brightened or
darkened where the render disagrees; black and white are these themselves.

Just inside the rim of its gamut, among colours that no sample showed, a fitted render folds: two scenes make one
colour, and the way back would have to jump between them, which no continuous lattice does, however fine. So the
render's own nodes give way there, by a few codes at most, while neutrals stay as they are.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation

from lutforge.interpolation import Levels, interpolate, through
from lutforge.luts.lut import Lut, padded_levels
from lutforge.model.lattice import grid, uniform_levels
from lutforge.model.transform import Transform
from lutforge.ocio.joint_fit import Cubes, places, refine
from lutforge.ocio.lut_files import CURVE_SIZE, compact, rounded
from lutforge.ocio.made_colours import MadeColours, cells, climbed, scattered, tetrahedra, thinned
from lutforge.ocio.preimage import Render, as_render, preimages
from lutforge.ocio.round_trip import MAX_GOAL, RoundTrip, measure, summary
from lutforge.regression.lattice_regression import Prior, Regularisation, fit_lattice
from lutforge.regression.node_levels import equidistributed_levels, resized_levels, snap_levels

Array = NDArray[np.float64]
Index = NDArray[np.int64]

MARGIN, ENOUGH = 0.75, 0.9
"""Share of the goals at which the fit tries other colours than its own, and that these may reach."""
SIZES = ((33, 0), (49, 49))
"""Nodes per axis that are tried: of the linearization, and of the render, at least, by more between its own."""
LAYER = 8
"""Entry of the shaper at which the second level stands, within half an 8-bit code of the first; likewise at the end."""
ROUNDS: tuple[float, ...] = (0.3, 0.1)
"""How firmly the render is held, which gives way last, in each of the rounds over all colours at the first size."""
REPAIRS = (0.03, 0.03, 0.01, 0.01, 0.003, 0.003, 0.001, 0.001)
"""The same in the rounds around what loses most, which follow."""
NEAR = 2.5
"""Share of the goals up to which the next size is tried: beyond it, it would not reach them either."""
STEPS, POWER = 4, 0.5
"""Most Gauss–Newton steps of a round, and how much more large residuals count."""
POOL = 1 << 15
"""Colours of a pool, see `made_colours.spread`: of one that stays, and of another in each round; and 8-bit codes."""
WORST, WORST_PER_TETRAHEDRON = 0.3, 3
"""Share of the largest goal above which a colour of the pool takes part, up to so many between the same four nodes."""
HOT = 0.4
"""Share of the largest goal above which a repair is made around a colour."""
FROM_TETRAHEDRON, PER_TETRAHEDRON = 2, 8
"""In a repair: colours between the same four nodes that others are scattered around, and most of all kinds."""
SMOOTHNESS = Regularisation(smoothness=1e-4, twist=1e-4, anchor=0.0, thin_plate=0.0)
HOLD = 1e-4
"""Of the exact fit: how firmly a node is held to the profile's own answer beside one colour."""
HELD, NEUTRAL_HELD = 1e-6, 1e-4
"""Of the joint fit: how firmly a node of the linearization is held to the profile's own answer, and one of a cell that
neutrals run through, beside the colours of a node: the render decides where it is steep, the profile where it is flat.
"""
HALF_CODE = 0.5 / 255
"""Of an 8-bit code."""
MEASURED = 1 << 15


def consistent(render: Lut, linearize: Lut, model: Transform | None = None) -> tuple[Lut, Lut, RoundTrip]:
    """A render and a linearization that are each other's inverse, and what is left.

    Both compact; render: white-balanced RAW → JPEG, linearize: back; model: what the render was baked from, whose
    colours shall come back, too. The given ones come back where they meet the goals by far, or where no fit is nearer.
    O(size³) a round, of at most 20.
    """
    best, reached = (render, linearize), measure(render, linearize)
    if reached.worth <= MARGIN:
        return render, linearize, reached
    pool = MadeColours.of(as_render(_clamped(render)), POOL, 5, model)
    pool = _greys(pool, linearize).joined(pool).joined(pool.as_8_bit())
    levels = before = None
    for size, of_render in SIZES:
        pool = replace(pool, render=finer(pool.render, of_render))
        levels = resized_levels(levels, size - 2) if levels else _even_levels(pool, size - 2)
        for candidate, trip in _fits(pool, linearize, levels, before):
            levels, before = _unlayered(candidate[1].levels), candidate
            content = trip.worth <= MARGIN
            if content:  # so far: more colours than the fit looked at
                trip = trip.or_worse(measure(*candidate, count=4 * MEASURED))
            if trip.worth < reached.worth:
                best, reached = candidate, trip
            if content and trip.worth <= ENOUGH:
                break
        if reached.worth <= ENOUGH or reached.worth > NEAR:
            break
    if best[1] is linearize:
        return render, linearize, reached
    seen = measure(*best, count=4 * MEASURED)
    jpeg = pool.jpeg[:: max(len(pool.jpeg) // MEASURED, 1)]
    departure = float(np.linalg.norm(best[1](jpeg) - linearize(jpeg), axis=1).mean())
    return *best, RoundTrip(seen.mean, max(seen.maximum, reached.maximum), departure)


def _clamped(render: Lut) -> Lut:
    """With a response, behind which a cube may leave the range: so clips are sharp between its nodes."""
    return render if render.response is not None else replace(render, response=np.repeat([[0.0], [1.0]], 3, axis=1))


def finer(render: Render, size: int) -> Render:
    """The same with at least so many nodes per axis, by more between those it has."""
    if render.lut.size >= size:
        return render
    r, g, b = (snap_levels(padded_levels(axis, size), CURVE_SIZE) for axis in render.lut.levels)
    cube = render.lut.inner(grid((r, g, b)))
    return as_render(compact(replace(render.lut, levels=(r, g, b), cube=cube, shaper_size=CURVE_SIZE)))


def _fits(
    pool: MadeColours, own: Lut, levels: Levels, before: tuple[Lut, Lut] | None
) -> Iterator[tuple[tuple[Lut, Lut], RoundTrip]]:
    """Ever nearer pairs of one size, render and linearization, each as its file holds it, and their round trip.

    levels: without those of clipped channels; before: a pair to begin from, of another size.
    """
    first = pool.render
    if before is None:
        levels, back = _first(pool, own, levels)
        cubes, rounds = Cubes(back, first.values), ROUNDS
    else:
        levels = _layered(levels)
        moved = before[0].inner(grid(first.lut.levels))
        cubes, rounds = Cubes(before[1](grid(levels)), moved), ROUNDS[-1:]
    knots, prior = pool.knots(levels), Cubes(own(grid(levels)), first.values)
    neutral, aim, fixed = _neutral(levels), prior.back.copy(), np.zeros(cubes.back.shape[:3], dtype=np.bool_)
    aim[neutral] = _told(first, own, grid(levels)[neutral])
    aim[0, 0, 0] = prior.back[0, 0, 0]
    fixed[0, 0, 0] = fixed[-1, -1, -1] = True
    cubes.back[fixed] = aim[fixed]
    of_render = _neutral((first.levels[0], first.levels[1], first.levels[2]))
    movable = ~np.concatenate([fixed.ravel(), of_render.ravel()])
    held = np.where(neutral, NEUTRAL_HELD, HELD).ravel()
    pool = pool.rendered(cubes.render)
    colours = pool.few(knots).filled(knots, cubes.back, 0)
    some, free = colours, movable
    for number, hold in enumerate(rounds + REPAIRS):
        cubes = refine(first, some.jpeg, places(some.inner, knots), cubes, prior, free, held, aim, STEPS, POWER, hold)
        pool = pool.rendered(rounded(cubes.render))
        colours = colours.rendered(pool.render.values)
        seen, lost = _seen(pool.joined(colours), knots, cubes.back, number)
        yield (pool.render.lut, _as_lut(own, pool, levels, cubes.back)), summary(lost)
        worst = np.flatnonzero(lost > WORST * MAX_GOAL)
        worst = worst[np.argsort(-lost[worst], kind="stable")]
        worst = worst[thinned(tetrahedra(seen.inner[worst], knots), WORST_PER_TETRAHEDRON)]
        colours = colours.joined(seen.chosen(worst)).filled(knots, cubes.back, number + 1)
        some, free = colours, movable
        if number + 1 >= len(rounds) and lost.max() > HOT * MAX_GOAL:
            some, near = _around(seen, lost, knots, cubes)
            free = movable & near


def _seen(known: MadeColours, knots: Levels, values: Array, seed: int) -> tuple[MadeColours, Array]:
    """Known colours, other ones, and those near the worst of both that are worse, and what is left of each."""

    def left(raw: Array) -> Array:
        return MadeColours.made(known.render, raw).left(knots, values)

    others = MadeColours.of(known.render, POOL, 100 + seed)
    seen = others.as_8_bit().joined(others).joined(known)
    errors = seen.left(knots, values)
    peaks = MadeColours.made(known.render, climbed(left, seen.raw, errors, seed))
    return peaks.joined(seen), np.concatenate([peaks.left(knots, values), errors])


def _around(seen: MadeColours, lost: Array, knots: Levels, cubes: Cubes) -> tuple[MadeColours, NDArray[np.bool_]]:
    """Colours near those of the seen that lose most (n,), in the JPEG or where they lead, and which nodes of both
    cubes, (N³ + M³,), are next to these."""
    worst = np.flatnonzero(lost > HOT * MAX_GOAL)
    some = worst[thinned(tetrahedra(seen.inner[worst], knots), FROM_TETRAHEDRON)]
    colours = seen.joined(MadeColours.made(seen.render, scattered(seen.raw[some], len(some))))
    hot = np.zeros(len(colours.jpeg), dtype=np.bool_)
    hot[worst] = True
    raw = np.clip(interpolate(colours.inner, knots, cubes.back, "tetrahedral"), 0.0, 1.0)
    touched, free, cube = np.zeros(len(hot), dtype=np.bool_), [], np.ones((3, 3, 3))
    for x, axes in ((colours.inner, knots), (raw, tuple(colours.render.levels))):
        size = len(axes[0])
        cell = cells(x, axes)
        near = np.zeros((size - 1) ** 3, dtype=np.bool_)
        near[cell[hot]] = True
        near = binary_dilation(near.reshape((size - 1,) * 3), cube)
        nodes = np.zeros((size,) * 3, dtype=np.bool_)
        nodes[:-1, :-1, :-1] = near
        free.append(binary_dilation(nodes, np.ones((2, 2, 2)), origin=-1).ravel())
        touched |= binary_dilation(near, cube).ravel()[cell]
    which = np.flatnonzero(touched)
    which = which[thinned(tetrahedra(colours.inner[which], knots), PER_TETRAHEDRON)]
    return colours.chosen(which), np.concatenate(free)


def _neutral(levels: Levels) -> NDArray[np.bool_]:
    """The nodes of all cells that neutrals run through, black to white, (N, N, N)."""
    grey = np.linspace(0.0, 1.0, 4 * CURVE_SIZE)
    r, g, b = (np.clip(np.searchsorted(axis, grey, side="right") - 1, 0, len(axis) - 2) for axis in levels)
    there = np.zeros(tuple(len(axis) for axis in levels), dtype=np.bool_)
    for corner in range(8):
        there[r + (corner >> 2), g + ((corner >> 1) & 1), b + (corner & 1)] = True
    return there


def _greys(pool: MadeColours, own: Lut) -> MadeColours:
    """The neutral 8-bit codes that the render makes."""
    jpeg = np.repeat(np.linspace(0.0, 1.0, 256)[:, None], 3, axis=1)
    inner = through(pool.curve, jpeg)
    raw, found = preimages(pool.render, inner, jpeg, own(jpeg))
    return replace(pool, raw=raw[found], jpeg=jpeg[found], inner=inner[found])


def _told(render: Render, own: Lut, jpeg: Array) -> Array:
    """The scenes of JPEG colours (n, 3): the profile's own answer; where the render does not take that to the colour,
    brighter or darker by as little as brings it as near as can be, no more tinted."""
    answer, steps = own(jpeg), np.geomspace(1e-5, 1.0, 200)
    best, nearest = answer.copy(), np.full(len(jpeg), np.inf)
    for step in (0.0, *np.stack([steps, -steps], axis=1).ravel()):
        scene = np.clip(answer + step, np.minimum(answer, 0.0), np.maximum(answer, 1.0))
        away = np.maximum(np.linalg.norm(render(scene) - jpeg, axis=1), HALF_CODE)
        nearer = away < nearest
        best[nearer], nearest[nearer] = scene[nearer], away[nearer]
    return best


def _first(pool: MadeColours, own: Lut, levels: Levels) -> tuple[Levels, Array]:
    """The fit to exact inverses, and node levels moved to where it is worst."""
    levels = _layered(levels)
    knots = pool.knots(levels)
    colours = pool.few(knots)
    values = _exact(colours, knots, own(colours.jpeg), own(grid(levels)))
    error = colours.left(knots, values) ** 2
    moved = equidistributed_levels(colours.inner, error, pool.knots(_unlayered(levels)))
    levels = _layered(pool.encoded(moved))
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


def _layered(levels: Levels) -> Levels:
    """Snapped to the shaper, with two levels more: next to the first and next to the last."""
    step = LAYER / (CURVE_SIZE - 1)
    r, g, b = (
        np.concatenate([[0.0, step], np.clip(axis[1:-1], 1.5 * step, 1 - 1.5 * step), [1 - step, 1.0]])
        for axis in levels
    )
    return (snap_levels(r, CURVE_SIZE), snap_levels(g, CURVE_SIZE), snap_levels(b, CURVE_SIZE))


def _unlayered(levels: Levels) -> Levels:
    """Without these two."""
    r, g, b = (np.delete(axis, [1, -2]) for axis in levels)
    return (r, g, b)
