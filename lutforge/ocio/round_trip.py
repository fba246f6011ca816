"""Make the linearization of a config the inverse of its render, where a profile's own two directions disagree.

A profile fits both directions to the same samples, each for the least error of its own output, so JPEG → scene → JPEG
comes back only as near as both fits allow. In a config every program goes there and back, so its linearization is
fitted anew: from the profile's own, by Gauss–Newton steps on ‖render(linearize(I)) − I‖² over colours I that the render
makes, with the change from the profile's own kept smooth. Where several scenes make one colour, the steps go to the one
next to the profile's answer; where none does, the smoothness continues the change.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.stats import qmc

from lutforge.interpolation import Levels, through
from lutforge.luts.lut import Lut
from lutforge.model.lattice import grid
from lutforge.ocio.lut_files import CURVE_SIZE, compact
from lutforge.regression.node_levels import equidistributed_levels, snap_levels
from lutforge.regression.smoothness import first_difference, second_difference

Array = NDArray[np.float64]

MEAN_GOAL, MAX_GOAL = 0.002, 0.02
"""What a colour space of a config may lose to the reference and back, RGB norm of encoded values."""
MARGIN = 0.75
"""Share of the goal at which the fit is content, since other colours than its own will be tried."""
SAMPLES = 1 << 14
"""Colours of each of three spreads."""
ROUNDS = 5
"""Most times that the node levels are placed anew."""
STEPS = 12
WORST, NEIGHBOURS = 512, 16
"""Colours that come back worst after a round, and how many beside each the next one fits too."""
SMOOTHNESS = 1e-4
OUTSIDE = 0.5
"""Slope of the residual beyond the RAW range, where the render itself is flat."""
EMPHASIS = 2e-3
"""Residual at which a colour begins to count more than others, so that the largest come down."""


@dataclass(frozen=True)
class RoundTrip:
    """JPEG → RAW → JPEG on colours that the render makes: RGB norm of the encoded difference. departure: mean norm of
    the change of the linearization from the profile's own, linear, 1 = saturation; 0 where it is the profile's own."""

    mean: float
    maximum: float
    departure: float = 0.0

    @property
    def met(self) -> bool:
        """Within the goals."""
        return self.mean <= MEAN_GOAL and self.maximum <= MAX_GOAL

    def __str__(self) -> str:
        text = f"round trip mean {self.mean:.2g}, max {self.maximum:.2g}"
        if self.departure:
            text += f", by a linearization fitted to the render (mean change {self.departure:.2g} of saturation)"
        return text


def measure(render: Lut, linearize: Lut, count: int = SAMPLES, seed: int = 11) -> RoundTrip:
    """The round trip over RAW colours spread over the whole range and over its darks."""
    jpeg = render(_spread(count, seed))
    error = np.linalg.norm(render(linearize(jpeg)) - jpeg, axis=1)
    return RoundTrip(float(error.mean()), float(error.max()))


def consistent(render: Lut, linearize: Lut) -> tuple[Lut, RoundTrip]:
    """The linearization, fitted to the render where the two do not meet the goals, and what is left.

    Both compact; render: white-balanced RAW → JPEG, linearize: back. The profile's own comes back where it does meet
    them, or where no fit is nearer. Time O(rounds · steps · (samples + N³)), a few seconds for 33³.
    """
    before = measure(render, linearize)
    if before.met:
        return linearize, before
    jpeg = render(_spread(SAMPLES, seed=5))
    best, reached = linearize, before
    current = _on_levels(linearize, linearize.levels)
    for number in range(ROUNDS):
        current = _fitted(render, current, jpeg)
        candidate = compact(current)
        found = measure(render, candidate)
        if _worth(found) < _worth(reached):
            best, reached = candidate, found
        if _worth(reached) <= MARGIN:
            break
        left = np.linalg.norm(render(current(jpeg)) - jpeg, axis=1)
        jpeg = np.concatenate([jpeg, _worst(render, current, seed=100 + number)])
        current = _on_levels(current, equidistributed_levels(jpeg[: len(left)], left, current.levels))
    departure = float(np.linalg.norm(best(jpeg) - linearize(jpeg), axis=1).mean())
    return best, replace(reached, departure=departure)


def _worst(render: Lut, linearize: Lut, seed: int) -> Array:
    """JPEG colours beside those of a fresh spread that come back worst: the next round has to mind them."""
    raw = _spread(SAMPLES, seed)
    jpeg = render(raw)
    error = np.linalg.norm(render(linearize(jpeg)) - jpeg, axis=1)
    found = np.argsort(error)[-WORST:]
    found = np.repeat(found[error[found] > MARGIN * MAX_GOAL / 2], NEIGHBOURS)
    near = raw[found] * np.random.default_rng(seed).uniform(0.97, 1.03, (len(found), 3))
    return render(np.clip(near, 0.0, 1.0))


def _worth(trip: RoundTrip) -> float:
    return max(trip.mean / MEAN_GOAL, trip.maximum / MAX_GOAL)


def _spread(count: int, seed: int) -> Array:
    """RAW colours (3 · count, 3): even, and with more and more of them dark."""
    even = qmc.Sobol(3, rng=seed).random(count)
    return np.concatenate([even, even**2, even**3])


def _on_levels(lut: Lut, levels: Levels) -> Lut:
    """The function of a LUT at other node levels, its matrix in the cube, interpolated as OpenColorIO does best."""
    r, g, b = (snap_levels(axis, CURVE_SIZE) for axis in levels)
    return replace(
        lut,
        levels=(r, g, b),
        cube=lut(grid((r, g, b))),
        matrix=np.eye(3),
        shaper_size=CURVE_SIZE,
        interpolation="tetrahedral",
    )


def _fitted(render: Lut, linearize: Lut, jpeg: Array) -> Lut:
    """Levenberg–Marquardt over the node values, from and towards those of `linearize`."""
    position = jpeg if linearize.curve is None else through(linearize.curve, jpeg)
    weights = _weights(position, linearize.knots)
    smooth = SMOOTHNESS * _smoothness(linearize.size)
    start = linearize.cube.reshape(-1, 3)
    values, damping = start.copy(), 1e-4
    raw = weights @ values
    residual = jpeg - _extended(render, raw)
    for _ in range(STEPS):
        emphasis = np.sqrt(np.linalg.norm(residual, axis=1) + EMPHASIS)
        emphasis /= emphasis.mean()
        jacobian = _jacobian(render, raw) * np.sqrt(emphasis)[:, None, None]
        system = _System(weights, np.einsum("nij,nik->njk", jacobian, jacobian), smooth)
        cost = _cost(residual, emphasis) + system.roughness(values - start)
        right = weights.T @ np.einsum("nij,ni->nj", jacobian, residual * np.sqrt(emphasis)[:, None])
        right -= system.smooth @ (values - start)
        for _ in range(5):
            trial = values + system.solve(right, damping)
            raw = weights @ trial
            left = jpeg - _extended(render, raw)
            if _cost(left, emphasis) + system.roughness(trial - start) < cost:
                values, residual, damping = trial, left, damping / 5
                break
            damping *= 10
        else:
            break
    return replace(linearize, cube=values.reshape(linearize.cube.shape))


def _cost(residual: Array, weight: Array) -> float:
    return float(np.einsum("ni,ni,n->", residual, residual, weight))


@dataclass(frozen=True, eq=False)
class _System:
    """The normal equations of one step: W' JᵀJ W + λ S, three coupled outputs a node. blocks: JᵀJ (n, 3, 3)."""

    weights: sp.csr_matrix
    blocks: Array
    unscaled: sp.csr_matrix

    @property
    def smooth(self) -> sp.csr_matrix:
        """λ S in the scale of the data."""
        return self.unscaled * float(np.einsum("njj->n", self.blocks).mean())

    def roughness(self, change: Array) -> float:
        """λ ‖S^½ change‖²."""
        return float(np.sum(change * (self.smooth @ change)))

    def solve(self, right: Array, damping: float, most: int = 60, goal: float = 1e-4) -> Array:
        """Conjugate gradients with a diagonal preconditioner; right (m, 3) → step (m, 3)."""
        smooth, transposed = self.smooth, self.weights.T.tocsr()
        diagonal = transposed.power(2) @ np.einsum("njj->nj", self.blocks)
        extra = damping * (diagonal + 1e-3 * diagonal.mean())
        inverse = 1 / (diagonal + extra + smooth.diagonal()[:, None])
        step, residual = np.zeros_like(right), right.copy()
        preconditioned = inverse * residual
        direction = preconditioned.copy()
        rho = first = float(np.sum(residual * preconditioned))
        for _ in range(most):
            if rho <= goal * first:
                break
            at_samples = np.einsum("njk,nk->nj", self.blocks, self.weights @ direction)
            image = transposed @ at_samples + smooth @ direction + extra * direction
            length = rho / float(np.sum(direction * image))
            step += length * direction
            residual -= length * image
            preconditioned = inverse * residual
            rho, previous = float(np.sum(residual * preconditioned)), rho
            direction = preconditioned + rho / previous * direction
        return step


def _extended(render: Callable[[Array], Array], raw: Array) -> Array:
    """The render, rising on beyond the RAW range, so that the inverse is drawn into it."""
    inside = np.clip(raw, 0.0, 1.0)
    return render(inside) + OUTSIDE * (raw - inside)


def _jacobian(render: Callable[[Array], Array], raw: Array, reach: float = 1e-4) -> Array:
    """d render / d raw, (n, 3, 3), by differences within the RAW range."""
    inside = np.clip(raw, 0.0, 1.0)
    jacobian = np.empty((len(raw), 3, 3))
    for channel in range(3):
        offset = reach * np.eye(3)[channel]
        high, low = np.clip(inside + offset, 0.0, 1.0), np.clip(inside - offset, 0.0, 1.0)
        jacobian[:, :, channel] = (render(high) - render(low)) / (high - low)[:, channel : channel + 1]
    outside = (raw < 0) | (raw > 1)
    return np.where(outside[:, None, :], OUTSIDE * np.eye(3), jacobian)


def _weights(x: Array, levels: Levels) -> sp.csr_matrix:
    """Tetrahedral interpolation at x (n, 3) as a matrix (n, N³), four weights a row."""
    size = len(levels[0])
    cells, parts = [], []
    for channel, axis in enumerate(levels):
        cell = np.clip(np.searchsorted(axis, x[:, channel], side="right") - 1, 0, size - 2)
        cells.append(cell)
        parts.append(np.clip((x[:, channel] - axis[cell]) / (axis[cell + 1] - axis[cell]), 0.0, 1.0))
    fraction = np.stack(parts, axis=1)
    order = np.argsort(-fraction, axis=1, kind="stable")  # the largest fraction steps first
    falling = np.take_along_axis(fraction, order, axis=1)
    strides = np.array([size * size, size, 1])
    corners = np.cumsum(np.column_stack([np.stack(cells, axis=1) @ strides, strides[order]]), axis=1)
    ones, zeros = np.ones((len(x), 1)), np.zeros((len(x), 1))
    weights = np.hstack([ones, falling]) - np.hstack([falling, zeros])
    return sp.csr_matrix((weights.ravel(), corners.ravel(), np.arange(0, 4 * len(x) + 1, 4)), shape=(len(x), size**3))


def _smoothness(size: int) -> sp.csr_matrix:
    """Second differences along each axis and mixed ones across each pair, in index space, (N³, N³)."""
    one = sp.identity(size)
    bend = sp.csr_matrix(second_difference(np.linspace(0.0, 1.0, size)))
    slope = sp.csr_matrix(first_difference(size))
    second, first = bend.T @ bend, slope.T @ slope
    total = sp.csr_matrix((size**3, size**3))
    for axis in range(3):
        along = [second if axis == other else one for other in range(3)]
        across = [one if axis == other else first for other in range(3)]
        for factors in (along, across):
            total = total + sp.kron(sp.kron(factors[0], factors[1]), factors[2])
    return total.tocsr()
