"""Make the render and the linearization of a config each other's inverse, where a profile's own directions disagree.

A profile fits both directions to the same samples, each for the least error of its own output, so JPEG → scene → JPEG
comes back only as near as both fits allow. In a config every program goes there and back, so its linearization is made
anew as the inverse of the baked render: its axes run through the inverse of the render's response, on which a camera is
nearly linear; each colour that the render makes is taken back exactly (`ocio.preimage`), to the scene next to the
profile's own answer where several make it; the lattice is fitted to these, then for what is left after the render
(`ocio.pair_descent`). The change from the profile's own answer is kept smooth, which continues it to colours that the
render never makes.

A channel that is clipped says only that the scene is beyond: codes of 0 and 1 have a layer of nodes of their own, which
may lie far enough beyond to stay clipped between them, while the codes beside do not move.

Where a render is flat, in black, in a shoulder and beyond white, it does not tell which scene it shows, and the fit
would be free to tint greys. So the nodes around neutrals are held, lightly, to the profile's own answer, brightened or
darkened where the render disagrees; black and white are these themselves.

Among colours that no sample showed, a fitted render folds: two scenes make one colour, and the way back would have to
jump between them, which no continuous lattice does, however fine. Where it folds by a few codes at most, its own nodes
give way in the fit. Where that is not enough, or much of it folds, the render is unfolded first (`ocio.unfolding`),
least where samples are, and continued a little below RAW 0, where colours that it made before have their scenes; the
linearization begins as its exact inverse (`ocio.exact_inverse`). Else the fit goes on with more nodes. Neutrals stay
as they are.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from lutforge.calibration.lattice.node_levels import equidistributed_levels
from lutforge.interpolation import Levels, interpolate
from lutforge.luts.shaper import padded_levels
from lutforge.model.lattice import grid
from lutforge.model.node_levels import resized_levels, snap_levels
from lutforge.model.transform import ColourFunction
from lutforge.ocio.exact_inverse import exact_inverse
from lutforge.ocio.lattice_lut import LatticeLut as Lut
from lutforge.ocio.layered_levels import even_levels, layered, neutral_nodes, unlayered
from lutforge.ocio.lut_files import CURVE_SIZE, compact
from lutforge.ocio.made_colours import MadeColours
from lutforge.ocio.pair_descent import Beginning, descent
from lutforge.ocio.preimage import Render, as_render, preimages
from lutforge.ocio.round_trip import RoundTrip, measure
from lutforge.ocio.unfolding import folded_share, share_of_samples, unfolded
from lutforge.solvers.lattice_regression import Prior, Regularisation, fit_lattice

Array = NDArray[np.float64]

MARGIN, ENOUGH = 0.75, 0.9
"""Share of the goals at which the fit tries other colours than its own, and that these may reach."""
SIZE, FINER = 33, 49
"""Nodes per axis of the linearization; and where that is not enough, of both, the render's by more between its own."""
ROUNDS: tuple[float, ...] = (0.3, 0.1)
"""How firmly the render is held, which gives way last, in each of the rounds over all colours."""
REPAIRS = (0.03, 0.03, 0.01, 0.01, 0.003, 0.003, 0.001, 0.001)
"""The same in the rounds around what loses most, which follow."""
UNFOLDED_ROUNDS = (0.3, 0.1, 0.1, 0.1, 0.1)
"""How firmly a render is held in the rounds where it is unfolded."""
CROWD = 4
"""There: times as many colours with each clipped channel. They are few kinds, and much of a gamut."""
WIDELY = 0.05
"""Share of its range from which on a render that folds is unfolded at once."""
HOPELESS, TRIED = 2.5, 4
"""Share of the goals beyond which a fit to the render as it folds is not carried on, after so many rounds: what is
nearer gets there with more nodes, at less change of the render."""
POOL = 1 << 15
"""Colours of a pool, see `made_colours.spread`: of one that stays; and 8-bit codes."""
SMOOTHNESS = Regularisation(smoothness=1e-4, twist=1e-4, anchor=0.0, thin_plate=0.0)
HOLD = 1e-4
"""Of the exact fit: how firmly a node is held to the profile's own answer beside one colour."""
MEASURED = 1 << 15


def consistent(
    render: Lut, linearize: Lut, model: ColourFunction | None = None, support: Array | None = None
) -> tuple[Lut, Lut, RoundTrip]:
    """A render and a linearization that are each other's inverse, and what is left.

    Both compact; render: white-balanced RAW → JPEG, linearize: back; model: what the render was baked from, whose
    colours shall come back, too; support: what samples weigh at each node of the render, (N, N, N). The given ones come
    back where they meet the goals by far, or where no fit is nearer. O(size³) a round, of at most 17.
    """
    best, reached = (render, linearize), measure(render, linearize)
    if reached.worth <= MARGIN:
        return render, linearize, reached
    clamped = as_render(_clamped(render))
    pool = MadeColours.of(clamped, POOL, 5, model)
    pool = _greys(pool, linearize).joined(pool).joined(pool.as_8_bit())
    folds = folded_share(clamped) > WIDELY
    start = _without_folds(pool, linearize, support) if folds else _nearest_own(pool, linearize)
    for first in (True, False):
        for number, (candidate, trip) in enumerate(descent(start, linearize)):
            content = trip.worth <= MARGIN
            if content:  # so far: more colours than the fit looked at
                trip = trip.or_worse(measure(*candidate, count=4 * MEASURED))
            if trip.worth < reached.worth:
                best, reached = candidate, trip
            if content and trip.worth <= ENOUGH:
                break
            if first and not folds and number + 1 >= TRIED and trip.worth > HOPELESS:
                break
        if best[1] is not linearize:
            reached = reached.or_worse(measure(*best, count=4 * MEASURED))
        if folds or reached.worth <= ENOUGH:
            break
        if first:
            folds = reached.worth > HOPELESS
            start = _without_folds(pool, linearize, support) if folds else _with_more_nodes(start, linearize, best)
    if best[1] is linearize:
        return render, linearize, reached
    seen = measure(*best, count=4 * MEASURED)
    jpeg = pool.jpeg[:: max(len(pool.jpeg) // MEASURED, 1)]
    departure = float(np.linalg.norm(best[1](jpeg) - linearize(jpeg), axis=1).mean())
    moved = _moved(clamped, best[0], support) if best[0].lowest < 0 else 0.0
    return *best, RoundTrip(seen.mean, max(seen.maximum, reached.maximum), departure, moved)


def _clamped(render: Lut) -> Lut:
    """With a response, behind which a cube may leave the range: so clips are sharp between its nodes."""
    return render if render.response is not None else replace(render, response=np.repeat([[0.0], [1.0]], 3, axis=1))


def finer(render: Render, size: int) -> Render:
    """The same with at least so many nodes per axis, by more between those it has."""
    if render.lut.size >= size:
        return render
    lut = render.lut
    r, g, b = (snap_levels(padded_levels(axis, size), CURVE_SIZE) for axis in lut.levels)
    cube = lut.inner(lut.lowest + (1 - lut.lowest) * grid((r, g, b)))
    return as_render(compact(replace(lut, levels=(r, g, b), cube=cube, shaper_size=CURVE_SIZE)))


def _greys(pool: MadeColours, own: Lut) -> MadeColours:
    """The neutral 8-bit codes that the render makes."""
    jpeg = np.repeat(np.linspace(0.0, 1.0, 256)[:, None], 3, axis=1)
    inner = pool.on_axes(jpeg)
    raw, found = preimages(pool.render, inner, jpeg, own(jpeg))
    return replace(pool, raw=raw[found], jpeg=jpeg[found], inner=inner[found])


def _nearest_own(pool: MadeColours, own: Lut) -> Beginning:
    """The render as it is, and the fit to exact inverses next to the profile's own answers, with node levels moved to
    where it is worst."""
    levels = layered(even_levels(pool, SIZE - 2))
    knots = pool.knots(levels)
    colours = pool.few(knots)
    values = _exact(colours, knots, own(colours.jpeg), own(grid(levels)))
    error = colours.left(knots, values) ** 2
    moved = equidistributed_levels(colours.inner, error, pool.knots(unlayered(levels)))
    levels = layered(pool.encoded(moved))
    old, knots = knots, pool.knots(levels)
    start = interpolate(grid(knots), old, values, "tetrahedral")
    colours = pool.few(knots).filled(knots, start, len(levels[0]))
    prior = own(grid(levels))
    back = _exact(colours, knots, interpolate(colours.inner, old, values, "tetrahedral"), prior)
    return Beginning(pool, levels, back, prior, ROUNDS, REPAIRS)


def _exact(colours: MadeColours, knots: Levels, start: Array, prior: Array) -> Array:
    """Node values fitted to the RAW of each colour, searched from `start` (n, 3)."""
    raw, found = preimages(colours.render, colours.inner, colours.jpeg, start)
    raw[~found] = colours.raw[~found]
    return fit_lattice(
        colours.inner, raw, knots, SMOOTHNESS, method="tetrahedral", prior=Prior(prior, np.full(prior.shape, HOLD)),
        tolerance=1e-4,
    ).values  # fmt: skip


def _with_more_nodes(start: Beginning, own: Lut, reached: tuple[Lut, Lut]) -> Beginning:
    """The pair that a descent from `start` reached, on finer lattices."""
    pool = replace(start.pool, render=finer(start.pool.render, FINER))
    levels = layered(resized_levels(unlayered(start.levels), FINER - 2))
    codes, moved = grid(levels), reached[0].inner(grid(pool.render.lut.levels))
    return Beginning(pool, levels, reached[1](codes), own(codes), ROUNDS[-1:], REPAIRS, moved=moved)


def foldless(render: Render, support: Array | None) -> tuple[Render, Render]:
    """The render without folds, from below RAW 0 to 1, as its file holds it; and as it goes on beyond 1."""
    fitted = finer(render, SIZE)
    axes = (fitted.levels[0], fitted.levels[1], fitted.levels[2])
    if support is not None and support.shape == render.values.shape[:3]:
        weights = np.repeat(support[..., None], 3, axis=-1)
        support = interpolate(grid(axes), render.lut.knots, weights, "trilinear")[..., 0]
    beyond = unfolded(fitted, support, neutral_nodes(axes))
    low = float(beyond.levels[0, 0])
    r, g, b = (snap_levels((axis[:-1] - low) / (1 - low), CURVE_SIZE) for axis in beyond.levels)
    old = (beyond.levels[0], beyond.levels[1], beyond.levels[2])
    cube = interpolate(low + (1 - low) * grid((r, g, b)), old, beyond.values, fitted.lut.interpolation)
    lut = compact(replace(fitted.lut, levels=(r, g, b), cube=cube, shaper_size=CURVE_SIZE, lowest=low))
    return as_render(lut), beyond


def _without_folds(pool: MadeColours, own: Lut, support: Array | None) -> Beginning:
    """The render without folds, and its exact inverse at the nodes."""
    without, beyond = foldless(pool.render, support)
    made = MadeColours.of(finer(without, FINER), POOL, 5)
    pool = replace(pool, render=made.render).joined(made).joined(made.as_8_bit())
    levels = layered(even_levels(made, FINER - 2))
    inner, codes = grid(made.knots(levels)), grid(levels)
    flat = (values.reshape(-1, 3) for values in (inner, codes, own(codes)))
    back = exact_inverse(made, beyond, *flat).reshape(codes.shape)
    return Beginning(pool, levels, back, back, UNFOLDED_ROUNDS, (), CROWD)


def _moved(before: Render, after: Lut, support: Array | None) -> float:
    """Mean change of a render where samples are, encoded; everywhere where nothing is known of these."""
    raw = grid((before.levels[0], before.levels[1], before.levels[2])).reshape(-1, 3)
    change = np.linalg.norm(np.clip(after(raw), 0.0, 1.0) - before(raw), axis=1)
    known = support is not None and support.shape == before.values.shape[:3] and support.max() > 0
    weights = share_of_samples(support).ravel() if known and support is not None else np.ones(len(raw))
    return float(np.average(change, weights=weights))
