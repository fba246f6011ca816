"""Colours that a render makes, for fitting its inverse to them and for measuring it: the whole gamut with its rim."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from lutforge.interpolation import Levels, interpolate, through
from lutforge.model.transform import ColourFunction
from lutforge.ocio.lut_files import CURVE_SIZE
from lutforge.ocio.preimage import Render, curve_inverse, preimages

Array = NDArray[np.float64]
Index = NDArray[np.int64]

PER_CELL = 4
"""Colours in each cell of a lattice that a fit begins with, as far as the render makes such."""
CLIMBERS, CLIMBS, TRIES, FIRST_STEP = 512, 6, 16, 0.06
"""Colours of large errors, and how often each looks how far around it for a larger one, in steps that halve."""
NEAR_NEUTRAL = 0.25
"""Most by which a channel of a near neutral differs from the darkest to the brightest, as a share."""


def spread(count: int, seed: int) -> Array:
    """RAW colours (5 count, 3): over the whole range, its faces and edges, where channels are 0 or clipped, the darks
    of each, and near neutrals."""
    even, number = qmc.Sobol(3, rng=seed).random(count), np.arange(count)
    face = even.copy()
    face[number, number % 3] = number // 3 % 2
    edge = face.copy()
    edge[number, (number + 1) % 3] = number // 6 % 2
    grey = np.clip(even[:, :1] ** 2 * (1 + NEAR_NEUTRAL * (2 * even[:, ::-1] - 1)), 0.0, 1.0)
    half = count // 2
    return np.concatenate(
        [
            even, even[:half] ** 2, even[half:] ** 3, face[:half], face[half:] ** 2, face[:half] ** 3,
            edge[half:] ** 2, grey,
        ]
    )  # fmt: skip


def as_8_bit(jpeg: Array) -> Array:
    """The nearest 8-bit codes of colours in [0, 1], in [0, 1]."""
    return np.asarray(np.rint(jpeg * 255) / 255)


def climbed(error: Callable[[Array], Array], x: Array, errors: Array, seed: int) -> Array:
    """Up to CLIMBERS colours (n, 3) of larger error near those of the largest: so that no narrow peak is overlooked.

    errors: (n,), of x (n, 3) in [0, 1]; of those close together the largest is begun from.
    """
    rng = np.random.default_rng(seed)
    worst = np.argsort(-errors, kind="stable")[: 64 * CLIMBERS]
    at = x[worst[np.sort(thinned((x[worst] * 32).astype(np.int64) @ np.array([1089, 33, 1]), 1))]][:CLIMBERS]
    reach = FIRST_STEP
    for _ in range(CLIMBS):
        near = _around(at, reach, rng)
        at = near[np.arange(len(at)), error(near.reshape(-1, 3)).reshape(len(at), TRIES).argmax(axis=1)]
        reach /= 2
    return at


def scattered(x: Array, seed: int) -> Array:
    """TRIES colours around each of x (n, 3) in [0, 1]: (TRIES n, 3)."""
    return _around(x, FIRST_STEP / 2, np.random.default_rng(seed)).reshape(-1, 3)


def _around(x: Array, reach: float, rng: np.random.Generator) -> Array:
    """(n, TRIES, 3), the first of each being itself."""
    near = x[:, None] + reach * (0.1 + x[:, None]) * rng.uniform(-1, 1, (len(x), TRIES, 3))
    near[:, 0] = x
    return np.asarray(np.clip(near, 0.0, 1.0))


@dataclass(frozen=True, eq=False)
class MadeColours:
    """Colours that a render makes of raw (n, 3): jpeg (n, 3), and inner (n, 3), the same in front of its response.

    curve: the inverse of the response, (CURVE_SIZE, 3): the axes on which a linearization is nearly linear.
    """

    render: Render
    curve: Array
    raw: Array
    jpeg: Array
    inner: Array

    @classmethod
    def of(cls, render: Render, count: int, seed: int, model: ColourFunction | None = None) -> "MadeColours":
        """Of a `spread`. model: what makes the colours instead, the render being near it."""
        return cls.made(render, spread(count, seed), model)

    @classmethod
    def made(cls, render: Render, raw: Array, model: ColourFunction | None = None) -> "MadeColours":
        """Of RAW colours (n, 3)."""
        curve = curve_inverse(render.response, CURVE_SIZE)
        curve[0], curve[-1] = 0.0, 1.0
        jpeg = render(raw) if model is None else np.clip(model(raw), 0.0, 1.0)
        return cls(render, curve, raw, jpeg, through(curve, jpeg))

    def as_8_bit(self) -> "MadeColours":
        """The 8-bit codes nearest to them, which may be just outside of the gamut."""
        jpeg = as_8_bit(self.jpeg)
        return replace(self, jpeg=jpeg, inner=self.on_axes(jpeg))

    def chosen(self, which: Index) -> "MadeColours":
        """Some of them."""
        return replace(self, raw=self.raw[which], jpeg=self.jpeg[which], inner=self.inner[which])

    def joined(self, other: "MadeColours") -> "MadeColours":
        """Both, of the other's render."""
        parts = ((getattr(self, name), getattr(other, name)) for name in ("raw", "jpeg", "inner"))
        raw, jpeg, inner = (np.concatenate(pair) for pair in parts)
        return replace(other, raw=raw, jpeg=jpeg, inner=inner)

    def rendered(self, values: Array) -> "MadeColours":
        """The same colours, for a render with another cube."""
        return replace(self, render=replace(self.render, lut=replace(self.render.lut, cube=values), values=values))

    def left(self, knots: Levels, values: Array) -> Array:
        """What is left of each, there through a lattice of the linearization and back, (n,)."""
        raw = interpolate(self.inner, knots, values, "tetrahedral")
        return np.asarray(np.linalg.norm(self.render(raw) - self.jpeg, axis=1))

    def on_axes(self, jpeg: Array) -> Array:
        """JPEG colours (…, 3) on the axes of the lattice."""
        return through(self.curve, jpeg)

    def knots(self, levels: Levels) -> Levels:
        """Node levels of the JPEG on the axes of the lattice."""
        r, g, b = through(self.curve, np.stack(levels, axis=1)).T
        return (np.ascontiguousarray(r), np.ascontiguousarray(g), np.ascontiguousarray(b))

    def encoded(self, inner: Levels) -> Levels:
        """Levels on the axes of the lattice as levels of the JPEG."""
        r, g, b = through(self.render.response, np.stack(inner, axis=1)).T
        return (r, g, b)

    def few(self, knots: Levels, crowd: int = 1) -> "MadeColours":
        """PER_CELL of each cell of the lattice, `crowd` times as many with each clipped channel."""
        most = crowded(PER_CELL, self.inner, crowd)
        return self.chosen(thinned(8 * cells(self.inner, knots) + _clipped(self.inner), most))

    def filled(self, knots: Levels, values: Array, seed: int) -> "MadeColours":
        """With more colours in the cells that have few, as far as the render makes such: at the rim of its gamut."""
        size = len(knots[0])
        count = np.bincount(cells(self.inner, knots), minlength=(size - 1) ** 3)
        lacking = np.repeat(np.arange(len(count)), np.maximum(PER_CELL - count, 0))
        place = np.stack(np.unravel_index(lacking, (size - 1,) * 3), axis=1)
        inside = np.random.default_rng(seed).random(place.shape)
        sides = zip(knots, place.T, inside.T, strict=True)
        inner = np.stack([axis[p] + f * (axis[p + 1] - axis[p]) for axis, p, f in sides], axis=1)
        jpeg = through(self.render.response, inner)
        raw, found = preimages(self.render, inner, jpeg, interpolate(inner, knots, values, "tetrahedral"))
        found &= np.all((raw >= 0) & (raw <= 1), axis=1)
        return self.joined(replace(self, raw=raw[found], jpeg=jpeg[found], inner=inner[found]))


def cells(x: Array, knots: Levels) -> Index:
    """The cell of each colour (n, 3), numbered (n,)."""
    return _located(x, knots)[0]


def tetrahedra(x: Array, knots: Levels) -> Index:
    """The tetrahedron of each colour (n, 3), numbered (n,), with clipped ones apart."""
    cell, inside = _located(x, knots)
    r, g, b = inside.T
    return np.asarray(64 * cell + 32 * (r > g) + 16 * (g > b) + 8 * (r > b) + _clipped(x), dtype=np.int64)


def _clipped(x: Array) -> Index:
    """Which channels of each colour (n, 3) are at an end, as a number below 8: such colours are many, and all of them
    hang on the nodes of a face, an edge or a corner."""
    r, g, b = ((x <= 0.0) | (x >= 1.0)).T
    return np.asarray(4 * r + 2 * g + b, dtype=np.int64)


def crowded(most: int, x: Array, crowd: int) -> Index:
    """How many of the kind of each colour (n, 3) may stay: `crowd` times as many with each clipped channel."""
    return np.asarray(most * crowd ** ((x <= 0.0) | (x >= 1.0)).sum(axis=1), dtype=np.int64)


def thinned(cell: Index, most: int | Index) -> Index:
    """Which to keep so that no cell (n,) has more than `most`, one number or that of each (n,): the first of each."""
    order = np.argsort(cell, kind="stable")
    begins = np.diff(cell[order], prepend=-1) != 0
    number = np.arange(len(cell))
    first = np.maximum.accumulate(np.where(begins, number, 0))
    return np.asarray(order[number - first < np.broadcast_to(most, len(cell))[order]])


def _located(x: Array, knots: Levels) -> tuple[Index, Array]:
    """The cell of each colour, numbered (n,), and where in it, (n, 3)."""
    size = len(knots[0]) - 1
    cell, inside = np.zeros(len(x), dtype=np.int64), np.empty(x.shape)
    for channel, axis in enumerate(knots):
        low = np.clip(np.searchsorted(axis, x[:, channel], side="right") - 1, 0, size - 1)
        cell = cell * size + low
        inside[:, channel] = (x[:, channel] - axis[low]) / (axis[low + 1] - axis[low])
    return cell, inside
