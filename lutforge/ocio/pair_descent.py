"""The descent of a pair, render and linearization, towards each other's inverses, round by round (`ocio.joint_fit`).

At first over colours of the whole gamut, then only around the cells that still lose most, with more colours there,
while the render is held ever less firmly.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation

from lutforge.interpolation import Levels, interpolate
from lutforge.model.lattice import grid
from lutforge.ocio.joint_fit import Cubes, places, refine
from lutforge.ocio.lattice_lut import LatticeLut as Lut
from lutforge.ocio.layered_levels import neutral_nodes
from lutforge.ocio.lut_files import CURVE_SIZE, compact, rounded
from lutforge.ocio.made_colours import MadeColours, cells, climbed, crowded, scattered, tetrahedra, thinned
from lutforge.ocio.preimage import Render
from lutforge.ocio.round_trip import MAX_GOAL, RoundTrip, summary

Array = NDArray[np.float64]
Index = NDArray[np.int64]

STEPS, POWER = 4, 0.5
"""Most Gauss–Newton steps of a round, and how much more large residuals count."""
WORST, WORST_PER_TETRAHEDRON = 0.3, 3
"""Share of the largest goal above which a colour of the pool takes part, up to so many between the same four nodes."""
HOT = 0.4
"""Share of the largest goal above which a repair is made around a colour."""
FROM_TETRAHEDRON, PER_TETRAHEDRON = 2, 8
"""In a repair: colours between the same four nodes that others are scattered around, and most of all kinds."""
HELD, NEUTRAL_HELD = 1e-6, 1e-4
"""Of the joint fit: how firmly a node of the linearization is held to the prior, and one of a cell that neutrals run
through to the profile's own answer, beside the colours of a node: the render decides where it is steep, these where it
is flat."""
HALF_CODE = 0.5 / 255
"""Of an 8-bit code."""
SEEN = 1 << 15
"""Colours of another pool in each round, see `made_colours.spread`."""


@dataclass(frozen=True, eq=False)
class Beginning:
    """Where a descent begins. pool: colours, and the render that it is held to; levels: nodes of the linearization;
    back, prior: its node values (N, N, N, 3), and those that its change from is to be smooth.

    rounds: how firmly the render is held in each of the rounds over all colours; repairs: in those around what loses
    most; crowd: how many times as many colours may take part with each channel that is clipped; moved: node values of
    the render to begin from, where they are not those that it is held to.
    """

    pool: MadeColours
    levels: Levels
    back: Array
    prior: Array
    rounds: tuple[float, ...]
    repairs: tuple[float, ...]
    crowd: int = 1
    moved: Array | None = None


def descent(start: Beginning, own: Lut) -> Iterator[tuple[tuple[Lut, Lut], RoundTrip]]:
    """Ever nearer pairs, render and linearization, each as its file holds it, and their round trip; own: the profile's
    linearization."""
    pool, levels, crowd = start.pool, start.levels, start.crowd
    first, knots = pool.render, pool.knots(levels)
    moved = first.values if start.moved is None else start.moved
    pool = pool.rendered(moved)
    cubes, prior = Cubes(start.back.copy(), moved), Cubes(start.prior, first.values)
    neutral, aim, fixed = neutral_nodes(levels), prior.back.copy(), np.zeros(cubes.back.shape[:3], dtype=np.bool_)
    aim[neutral] = _told(first, own, grid(levels)[neutral])
    aim[0, 0, 0] = own(np.zeros(3))
    fixed[0, 0, 0] = fixed[-1, -1, -1] = True
    cubes.back[fixed] = aim[fixed]
    of_render = neutral_nodes((first.levels[0], first.levels[1], first.levels[2]))
    movable = ~np.concatenate([fixed.ravel(), of_render.ravel()])
    held = np.where(neutral, NEUTRAL_HELD, HELD).ravel()
    colours = pool.few(knots, crowd).filled(knots, cubes.back, 0)
    some, free = colours, movable
    for number, hold in enumerate(start.rounds + start.repairs):
        cubes = refine(first, some.jpeg, places(some.inner, knots), cubes, prior, free, held, aim, STEPS, POWER, hold)
        pool = pool.rendered(rounded(cubes.render))
        colours = colours.rendered(pool.render.values)
        seen, lost = _seen(pool.joined(colours), knots, cubes.back, number)
        yield (pool.render.lut, linearization_lut(own, pool, levels, cubes.back)), summary(lost)
        worst = np.flatnonzero(lost > WORST * MAX_GOAL)
        worst = worst[np.argsort(-lost[worst], kind="stable")]
        worst = worst[_thinned(seen.inner[worst], knots, WORST_PER_TETRAHEDRON, crowd)]
        colours = colours.joined(seen.chosen(worst)).filled(knots, cubes.back, number + 1)
        some, free = colours, movable
        if number + 1 >= len(start.rounds) and lost.max() > HOT * MAX_GOAL:
            some, near = _around(seen, lost, knots, cubes, crowd)
            free = movable & near


def _seen(known: MadeColours, knots: Levels, values: Array, seed: int) -> tuple[MadeColours, Array]:
    """Known colours, other ones, and those near the worst of both that are worse, and what is left of each."""

    def left(raw: Array) -> Array:
        return MadeColours.made(known.render, raw).left(knots, values)

    others = MadeColours.of(known.render, SEEN, 100 + seed)
    seen = others.as_8_bit().joined(others).joined(known)
    errors = seen.left(knots, values)
    peaks = MadeColours.made(known.render, climbed(left, seen.raw, errors, seed))
    return peaks.joined(seen), np.concatenate([peaks.left(knots, values), errors])


def _thinned(inner: Array, knots: Levels, most: int, crowd: int) -> Index:
    """Which of the colours (n, 3) to keep so that no tetrahedron has too many."""
    return thinned(tetrahedra(inner, knots), crowded(most, inner, crowd))


def _around(
    seen: MadeColours, lost: Array, knots: Levels, cubes: Cubes, crowd: int
) -> tuple[MadeColours, NDArray[np.bool_]]:
    """Colours near those of the seen that lose most (n,), in the JPEG or where they lead, and which nodes of both
    cubes, (N³ + M³,), are next to these."""
    worst = np.flatnonzero(lost > HOT * MAX_GOAL)
    some = worst[_thinned(seen.inner[worst], knots, FROM_TETRAHEDRON, crowd)]
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
    which = which[_thinned(colours.inner[which], knots, PER_TETRAHEDRON, crowd)]
    return colours.chosen(which), np.concatenate(free)


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


def linearization_lut(own: Lut, colours: MadeColours, levels: Levels, values: Array) -> Lut:
    """Node values of a linearization as its file holds them, with all else as the profile's own has it."""
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
