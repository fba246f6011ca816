"""A render and a linearization that undo each other: Gauss–Newton on ‖render(linearization(I)) − I‖², over both cubes.

Each sample couples the three outputs of the nodes of the linearization around it through the slopes of the render, and
these with the nodes of the render around where they lead. The equations of a step are never formed: conjugate gradients
apply them sample by sample, with the 3 × 3 block of each node as the preconditioner. The linearization's change from a
prior is kept smooth, which continues it where no colour is; the render is held to its own values, so that it moves only
where it takes two scenes to one colour and nothing could take both back. O(n + N³) an iteration.
"""

from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from lutforge.interpolation import Levels
from lutforge.ocio.joint_equations import (
    CHUNKS,
    OUTSIDE,
    add_smoothness,
    gather,
    locate_in_tetrahedra,
    own_blocks,
    own_diagonal,
    residuals,
    through_and_back,
)
from lutforge.ocio.preimage import Render
from lutforge.solvers.smoothness import second_difference, to_bands
from lutforge.threads import run, slabs

Array = NDArray[np.float64]
Index = NDArray[np.int64]

SMOOTHNESS = 1e-2
"""Weight of the second differences of the change from the prior, beside the data's. A linearization that bends to where
a render folds loses its neighbours: the render is to give way there instead."""
RENDER_SMOOTHNESS = 1e-2
"""The same of the render, beside as many colours as there are to a node, in encoded values."""
TOLERATED = 0.02
"""Change of a node of the render, encoded, from where on it is held ever more firmly."""
EMPHASIS = 2e-3
"""Residual at which a colour begins to count more than others, so that the largest come down."""
CAUTION, MOST_CAUTION, LEAST_CAUTION = 1e-4, 1e2, 1e-6
"""How firmly a colour is held to where it is, beside the mean square of the slopes: at first, at most, at least."""
NOTABLE, WORSE = 1e-3, 1.5
"""A residual above this that grows, its square by this factor, makes for more caution."""
DAMPING = 1e-5
"""Of the diagonal, so that nodes without data have a place."""
BLOCK = 4096
"""Samples that a thread takes at once."""
TRIALS = 6
"""Most attempts at a step."""
ENOUGH = 0.97
"""Share of the cost that a step must leave less than, to be followed by another."""


@dataclass(frozen=True, eq=False)
class Places:
    """Samples in a lattice of tetrahedra: the four nodes (n, 4) that each lies between, and their weights (n, 4)."""

    nodes: Index
    weights: Array


@dataclass(frozen=True, eq=False)
class Cubes:
    """Node values: back (N, N, N, 3), JPEG → RAW; render (M, M, M, 3), RAW → in front of the response."""

    back: Array
    render: Array


def places(x: Array, levels: Levels) -> Places:
    """Where x (n, 3) lies in a lattice."""
    nodes, weights = np.empty((len(x), 4), dtype=np.int64), np.empty((len(x), 4))
    locate = partial(locate_in_tetrahedra, np.ascontiguousarray(x), np.stack(levels), nodes, weights)
    run(locate, slabs(0, len(x), BLOCK, len(x)))
    return Places(nodes, weights)


def refine(
    render: Render,
    jpeg: Array,
    at: Places,
    start: Cubes,
    prior: Cubes,
    free: NDArray[np.bool_],
    held: Array,
    aim: Array,
    steps: int,
    power: float,
    hold: float,
) -> Cubes:
    """Cubes that bring the JPEG colours (n, 3) at `at` nearer to themselves than `start` does.

    prior: towards which the change of `back` is smooth, and the values that the render is held to; free: (N³ + M³,),
    which nodes of both may move, the linearization's first; held: (N³,), how firmly each of these is held beside the
    colours of a node, and aim: (N, N, N, 3), to what; hold: the render, beside a colour; power: how much more large
    residuals count. O(n + N³ + M³) a step.
    """
    problem = _Problem.of(render, jpeg, at, prior, free, held, aim, hold)
    state = problem.state(np.concatenate([start.back.reshape(-1, 3), start.render.reshape(-1, 3)]))
    caution = np.full(len(jpeg), CAUTION)
    for _ in range(steps):
        squares = np.einsum("ni,ni->n", state.left, state.left)
        emphasis = (np.sqrt(squares) + EMPHASIS) ** power
        emphasis /= emphasis.mean()
        system = problem.system(state, emphasis)
        right = system.gathered(state.left) - system.penalty(state.values - problem.origin) + system.drawn
        cost = problem.cost(state, emphasis, system)
        for _ in range(TRIALS):
            trial = problem.state(state.values + system.solve(right, caution))
            worse = np.einsum("ni,ni->n", trial.left, trial.left) > np.maximum(WORSE * squares, NOTABLE**2)
            caution = np.clip(np.where(worse, caution * 30, caution / 5), LEAST_CAUTION, MOST_CAUTION)
            reached = problem.cost(trial, emphasis, system)
            if reached < cost:
                break
            caution *= 4
        else:
            break
        state = trial
        if reached > ENOUGH * cost:
            break
    count = problem.count
    return Cubes(state.values[:count].reshape(start.back.shape), state.values[count:].reshape(start.render.shape))


@dataclass(frozen=True, eq=False)
class _State:
    """values (N³ + M³, 3) of both cubes, and there for each sample: left (n, 3); its slopes by RAW (n, 3, 3) and by
    what the render's cube gives, steep (n, 3); the render's nodes (n, K) around the RAW and their weights (n, K)."""

    values: Array
    left: Array
    slopes: Array
    steep: Array
    nodes: Index
    weights: Array


@dataclass(frozen=True, eq=False)
class _Problem:
    """What stays the same from step to step. origin: (N³ + M³, 3), what both cubes are held to; free: (N³ + M³, 1), 1
    or 0; sizes: N and M; node_steep: (M³, 3), slope of the response at the render's nodes; hold: of these; held:
    (N³, 1), of the linearization's; aim: (N³ + M³, 3), from the origin to where the hold draws."""

    render: Render
    jpeg: Array
    at: Places
    origin: Array
    free: Array
    sizes: tuple[int, int]
    node_steep: Array
    held: Array
    aim: Array
    hold: float

    @classmethod
    def of(
        cls,
        render: Render,
        jpeg: Array,
        at: Places,
        prior: Cubes,
        free: NDArray[np.bool_],
        held: Array,
        aim: Array,
        hold: float,
    ) -> "_Problem":
        origin = np.concatenate([prior.back.reshape(-1, 3), prior.render.reshape(-1, 3)])
        last = len(render.response) - 1
        rise = np.diff(render.response, axis=0) * last
        y = prior.render.reshape(-1, 3)
        steep = np.take_along_axis(rise, np.clip((y * last).astype(np.int64), 0, last - 1), axis=0)
        steep = np.where((y < 0) | (y > 1), OUTSIDE, np.maximum(steep, OUTSIDE))
        sizes = (len(prior.back), len(prior.render))
        aims = np.zeros_like(origin)
        aims[: len(held)] = (aim - prior.back).reshape(-1, 3)
        moves = free[:, None].astype(np.float64)
        return cls(render, jpeg, at, origin, moves, sizes, steep, held[:, None], aims, hold)

    @property
    def count(self) -> int:
        """Nodes of the linearization."""
        return self.sizes[0] ** 3

    def state(self, values: Array) -> _State:
        """The residuals and their slopes at node values."""
        n, corners = len(self.jpeg), 4 if self.render.tetrahedral else 8
        left, slopes, steep = np.empty((n, 3)), np.empty((n, 3, 3)), np.empty((n, 3))
        nodes, weights = np.empty((n, corners), dtype=np.int64), np.empty((n, corners))
        cube = values[self.count :].reshape(*(self.sizes[1],) * 3, 3)
        fill = partial(
            residuals, cube, self.render.levels, self.render.tetrahedral, self.render.response, self.jpeg,
            self.at.nodes, self.at.weights, values, left, slopes, steep, nodes, weights,
        )  # fmt: skip
        run(fill, slabs(0, n, BLOCK, n))
        return _State(values, left, slopes, steep, nodes + self.count, weights)

    def system(self, state: _State, emphasis: Array) -> "_System":
        """The equations of a step from there; emphasis: weights (n,)."""
        root = np.sqrt(emphasis)
        slopes, steep = state.slopes * root[:, None, None], state.steep * root[:, None]
        square = float(np.sum(slopes * slopes)) / 3
        a_node, colours = (  # to a node that may move
            total / max(float(np.sum(part)), 1.0)
            for total, part in ((square, self.free[: self.count]), (len(self.jpeg), self.free[self.count :]))
        )
        n, m = self.sizes
        bands = (
            _bands(n, SMOOTHNESS * a_node),
            _bands(m, RENDER_SMOOTHNESS * colours * float(np.mean(self.node_steep**2))),
        )
        hold = np.empty_like(self.origin)
        hold[: self.count] = self.held * a_node
        moved = (state.values - self.origin)[self.count :] * self.node_steep
        firmer = 1.0 + np.einsum("ni,ni->n", moved, moved)[:, None] / TOLERATED**2
        hold[self.count :] = self.hold * colours * self.node_steep**2 * firmer
        return _System(self, state, slopes, steep, root, bands, hold, square / len(self.jpeg))

    def cost(self, state: _State, emphasis: Array, system: "_System") -> float:
        """What a step is to bring down."""
        change = state.values - self.origin
        data = float(np.einsum("ni,ni,n->", state.left, state.left, emphasis))
        drawn = float(np.sum(system.drawn * (self.aim - 2 * change)))
        return data + drawn + float(np.sum(change * system.penalty(change)))


def _bands(size: int, weight: float) -> Array:
    bend = second_difference(np.linspace(0.0, 1.0, size))
    return weight * to_bands(bend.T @ bend)


@dataclass(frozen=True, eq=False)
class _System:
    """The equations of one step. slopes, steep: times the root of each sample's weight, root (n,); bands: λ S'S of an
    axis of each cube, (N, 5), (M, 5); hold (N³ + M³, 3); square: mean of the squared slopes."""

    problem: _Problem
    state: _State
    slopes: Array
    steep: Array
    root: Array
    bands: tuple[Array, Array]
    hold: Array
    square: float

    @property
    def drawn(self) -> Array:
        """hold aim: (N³ + M³, 3)."""
        return self.hold * self.problem.aim * self.problem.free

    def gathered(self, left: Array) -> Array:
        """J'Ω left: (N³ + M³, 3)."""
        at, state = self.problem.at, self.state
        total = np.zeros_like(self.hold)
        weighted = left * self.root[:, None]
        gather(at.nodes, at.weights, state.nodes, state.weights, self.slopes, self.steep, weighted, total)
        return total * self.problem.free

    def penalty(self, change: Array) -> Array:
        """(λ S'S + hold) change."""
        result = self.hold * change
        count, begin = self.problem.count, 0
        for bands, end in zip(self.bands, (count, len(change)), strict=True):
            shape = (*(len(bands),) * 3, 3)
            add_smoothness(bands, change[begin:end].reshape(shape), result[begin:end].reshape(shape))
            begin = end
        return result * self.problem.free

    def solve(self, right: Array, caution: Array, most: int = 30, goal: float = 1e-3) -> Array:
        """Conjugate gradients; right (N³ + M³, 3) → step; caution: (n,)."""
        at, state = self.problem.at, self.state
        hold = caution * self.root**2 * self.square
        blocks, single, extra = self._diagonal(hold, caution)
        step, residual = np.zeros_like(right), right.copy()
        towards = _preconditioned(blocks, single, residual)
        direction = towards.copy()
        rho = first = float(np.sum(residual * towards))
        chunks = slabs(0, CHUNKS, 1, CHUNKS)
        for _ in range(most):
            if rho <= goal * first:
                break
            sums = np.zeros((CHUNKS, *right.shape))
            there = (at.nodes, at.weights, state.nodes, state.weights)
            run(partial(through_and_back, *there, self.slopes, self.steep, hold, caution, direction, sums), chunks)
            image = sums.sum(axis=0)
            image *= self.problem.free
            image += self.penalty(direction) + extra * direction
            length = rho / float(np.sum(direction * image))
            step += length * direction
            residual -= length * image
            towards = _preconditioned(blocks, single, residual)
            rho, previous = float(np.sum(residual * towards)), rho
            direction = towards + rho / previous * direction
        return step

    def _diagonal(self, hold: Array, caution: Array) -> tuple[Array, Array, Array]:
        """Inverses of the diagonal: blocks (N³, 3, 3) of the linearization, single (M³, 3) of the render; and what was
        added to it (N³ + M³, 3)."""
        at, state, count = self.problem.at, self.state, self.problem.count
        blocks, single = np.zeros((count, 3, 3)), np.zeros((len(self.hold) - count, 3))
        own_blocks(at.nodes, at.weights, self.slopes, hold, blocks)
        own_diagonal(state.nodes - count, state.weights, self.steep * np.sqrt(1 + caution)[:, None], single)
        diagonal = np.concatenate([np.einsum("njj->nj", blocks), single])
        extra = DAMPING * diagonal
        extra[:count] += DAMPING * 1e-3 * diagonal[:count].mean()
        extra[count:] += DAMPING * 1e-3 * diagonal[count:].mean()
        bend, render_bend = (
            (b[:, None, None] + b[None, :, None] + b[None, None, :]).reshape(-1, 1)
            for b in (bands[:, 2] for bands in self.bands)
        )
        blocks[:, range(3), range(3)] += extra[:count] + bend + self.hold[:count]
        inverses = np.asarray(np.linalg.inv(blocks), dtype=np.float64)
        return inverses, 1.0 / (single + extra[count:] + render_bend + self.hold[count:]), extra


def _preconditioned(blocks: Array, single: Array, residual: Array) -> Array:
    count = len(blocks)
    return np.concatenate([np.einsum("nij,nj->ni", blocks, residual[:count]), single * residual[count:]])
