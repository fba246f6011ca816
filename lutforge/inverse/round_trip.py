"""The round trip JPEG → RAW → JPEG: its errors, and the colours on which a linearization is fitted and measured.

The errors are measured on colours that a render makes of RAW, and on the 8-bit codes nearest to them, as files have.
"""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import permutations, product

import numpy as np

from lutforge.arrays import Array, Mask
from lutforge.interpolation import Levels
from lutforge.model.lattice import grid
from lutforge.sobol import sobol


def in_every_cell(levels: Levels, rng: np.random.Generator) -> Array:
    """Colours (n, 3) in every cell of a lattice, which determine its interpolation.

    They are the nodes, and one colour in each tetrahedron of each cell. On the faces and the edges of the cube, where
    channels are clipped, they are one colour in each triangle or segment. The first and the last cell of each axis
    separate clipped colours from others; they have no colours but their nodes.
    """
    nodes = grid(levels).reshape(-1, 3)
    r, g, b = (axis[1:-1] for axis in levels)
    levels = (r, g, b)
    parts = [fixed for fixed in product((None, 0.0, 1.0), repeat=3) if None in fixed]
    return np.concatenate([nodes, *(_within(levels, fixed, rng) for fixed in parts)])


def _within(levels: Levels, fixed: tuple[float | None, ...], rng: np.random.Generator) -> Array:
    """Return a colour in each part of each cell, (n, 3). fixed: the value 0 or 1 of a channel; None: it is free."""
    free = [channel for channel, end in enumerate(fixed) if end is None]
    sizes = [len(levels[channel]) - 1 for channel in free]
    cells = np.stack([index.ravel() for index in np.indices(sizes)], axis=1)
    found = []
    for order in permutations(range(len(free))):
        place = np.sort(rng.random(cells.shape), axis=1)[:, order]  # each order of the fractions is one tetrahedron
        colours = np.empty((len(cells), 3))
        for channel, end in enumerate(fixed):
            if end is not None:
                colours[:, channel] = end
        for number, channel in enumerate(free):
            axis, cell = levels[channel], cells[:, number]
            colours[:, channel] = axis[cell] + place[:, number] * (axis[cell + 1] - axis[cell])
        found.append(colours)
    return np.concatenate(found)


def raw_colours(count: int, seed: int) -> Array:
    """RAW colours (5 count, 3): over the whole range, its faces and edges, the darks of each, and near neutrals."""
    even, number = sobol(count, seed=seed), np.arange(count)
    face = even.copy()
    face[number, number % 3] = number // 3 % 2
    edge = face.copy()
    edge[number, (number + 1) % 3] = number // 6 % 2
    grey = np.clip(even[:, :1] ** 2 * (0.75 + 0.5 * even[:, ::-1]), 0.0, 1.0)
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


def searched_near(error: Callable[[Array], Array], x: Array, errors: Array, seed: int) -> Array:
    """Search near the colours of largest error for larger errors, so that no narrow peak is overlooked.

    errors: (n,), of x (n, 3) in [0, 1]. The search begins at the worst colour of each of 33³ boxes, 512 at most, and
    tries random steps around it in six rounds; each round has half the step of the one before. Returned are the colours
    of the largest errors that were found, (up to 512, 3).
    """
    rng = np.random.default_rng(seed)
    count = min(32768, len(errors))
    worst = np.flatnonzero(errors >= np.partition(errors, -count)[-count])  # only these are sorted, which is faster
    worst = worst[np.argsort(-errors[worst], kind="stable")][:count]
    boxes = (x[worst] * 32).astype(np.int64) @ np.array([1089, 33, 1])
    at = x[worst[np.sort(np.unique(boxes, return_index=True)[1])]][:512]
    for reach in 0.06 * 0.5 ** np.arange(6):
        near = at[:, None] + reach * (0.1 + at[:, None]) * rng.uniform(-1, 1, (len(at), 16, 3))
        near[:, 0] = at
        near = np.clip(near, 0.0, 1.0)
        at = near[np.arange(len(at)), error(near.reshape(-1, 3)).reshape(len(at), 16).argmax(axis=1)]
    return at


MAX_GOAL = 0.02
"""The largest acceptable error of a round trip, RGB norm of encoded values: five codes."""


@dataclass(frozen=True)
class RoundTrip:
    """The error of JPEG → RAW → JPEG: mean, 99.9th percentile and maximum of the RGB norm, encoded.

    These are over colours that the render makes. worst: the 8-bit code nearest to the colour of the maximum. shown: the
    maximum over colours that the samples contain, 0 where it is at most MAX_GOAL, None where the samples are not known.
    beyond: the share of the whole JPEG cube whose error is above MAX_GOAL, because no RAW renders to these colours.
    """

    mean: float
    p999: float
    maximum: float
    worst: tuple[int, ...] = ()
    shown: float | None = None
    beyond: float = 0.0

    def __str__(self) -> str:
        """Lines of a key and a value each."""
        text = "round trip of: the JPEG colours that the render makes"
        if self.beyond >= 5e-4:
            text += f"; of all codes {100 * self.beyond:.1f} % are others, and come back with more than {MAX_GOAL:g}"
        text += f"\nround trip mean: {rounded_up(self.mean)}\nround trip max: {rounded_up(self.maximum)}"
        text += f"\nround trip quantile: 99.9 % within {rounded_up(self.p999)}"
        if self.maximum <= MAX_GOAL:
            return text
        text += f"\nround trip worst: at JPEG code {' '.join(map(str, self.worst))}"
        if self.shown is None:
            return text
        if self.shown == 0:
            return f"{text}; more than {MAX_GOAL:g} only for colours that no sample showed"
        return f"{text}; {rounded_up(self.shown)} for colours that samples showed"


def rounded_up(value: float) -> str:
    """A measured error rounded up to two digits."""
    if value <= 0:
        return "0"
    unit = 10.0 ** (np.floor(np.log10(value)) - 1)
    return f"{np.ceil(value / unit - 1e-9) * unit:.2g}"


def measure(
    render: Callable[[Array], Array],
    linearize: Callable[[Array], Array],
    count: int = 1 << 15,
    seed: int = 11,
    shown: Callable[[Array], Mask] | None = None,
) -> RoundTrip:
    """Measure the round trip of the renderings of 5 · `count` RAW colours, in floats and in 8 bits, and near the worst.

    render, linearize: as their files evaluate them; shown: a function of JPEG colours (n, 3) that returns the mask (n,)
    of those that the samples contain.
    """

    def error_of(jpeg: Array) -> Array:
        return np.asarray(np.linalg.norm(np.clip(render(linearize(jpeg)), 0.0, 1.0) - jpeg, axis=1))

    def rendered(raw: Array) -> Array:
        return np.clip(render(raw), 0.0, 1.0)

    raw = raw_colours(count, seed)
    jpeg = rendered(raw)
    errors, of_codes = error_of(jpeg), error_of(as_8_bit(jpeg))
    climb = rendered(searched_near(lambda near: error_of(rendered(near)), raw, errors, seed))
    every = np.concatenate([errors, of_codes, error_of(climb)])
    colours = np.concatenate([jpeg, as_8_bit(jpeg), climb])
    largest, beyond = int(every.argmax()), every > MAX_GOAL
    return RoundTrip(
        max(float(part.mean()) for part in (errors, of_codes)),
        max(float(np.quantile(part, 0.999)) for part in (errors, of_codes)),
        float(every[largest]),
        tuple(int(code) for code in np.rint(255 * colours[largest])),
        None if shown is None else float(np.max(every[beyond], where=shown(colours[beyond]), initial=0.0)),
        float(np.mean(error_of(sobol(count, seed=seed)) > MAX_GOAL)),
    )
