"""A Gaussian process over JPEG colours for a camera with a fixed rendering; each shot is predicted by the others.

y is the logarithm of the light of a scene colour, less that which an sRGB JPEG of the same codes stands for. Where the
rendering is fixed, y is a smooth function λ of the JPEG colour, the same for all shots.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve
from scipy.optimize import minimize

from lutforge.arrays import Array, Mask
from lutforge.model.shot_tone import tone_of
from lutforge.samples.sample_set import SampleSet

NOISE = 0.02
"""Standard deviation of the light of cells with one JPEG colour, in stops."""


@dataclass(frozen=True, eq=False)
class Cells:
    """Means over samples of similar colour in one part of one shot's picture.

    encoded, balanced: I and Tw E, (n, 3); y: (n,), as the head of this module defines it; tone: (n,), of `tone_of`;
    place: (n, 2), NaN where unknown; shot: (n,), indices into names; rounding: (n,), the variance of y by rounding of
    codes.
    """

    encoded: Array
    balanced: Array
    y: Array
    tone: Array
    place: Array
    shot: NDArray[np.intp]
    names: tuple[str, ...]
    rounding: Array

    @property
    def scatter(self) -> Array:
        """The variance (n,) of y by noise, NOISE, and by rounding."""
        return np.asarray(NOISE**2 + self.rounding)

    def select(self, rows: NDArray[np.intp]) -> "Cells":
        """The cells of some rows."""
        colours = (self.encoded[rows], self.balanced[rows], self.y[rows], self.tone[rows])
        return Cells(*colours, self.place[rows], self.shot[rows], self.names, self.rounding[rows])


@dataclass(frozen=True, eq=False)
class Departure:
    """The departure of one shot from the prediction by the other shots.

    error: (m,), by how many stops the JPEG is brighter than predicted, in each of the shot's cells; covariance: of
    error, (m, m); member: mask (n,) of the shot's cells.
    """

    error: Array
    covariance: Array
    member: Mask


def cells_of(samples: SampleSet, multipliers: Array) -> Cells:
    """Average the samples over cells of shot, place and colour, divided as finely as 1,500 cells allow."""
    most = 1500
    y = np.log2((samples.raw * multipliers).sum(axis=1)) - np.log2(1e-4 + light_of(samples.srgb))
    names, shot = np.unique(samples.shot, return_inverse=True)
    part = np.clip(np.nan_to_num(1.5 * (samples.position + 1.0), nan=0.0), 0, 2).astype(np.intp) @ [1, 3]
    for codes in (16, 24, 32, 48, 64, 96):
        colour = (255 * samples.srgb // codes).astype(np.intp) @ [1, 16, 256]
        key = (shot * 9 + part) * 4096 + colour
        _, cell, count = np.unique(key, return_inverse=True, return_counts=True)
        if len(count) <= most:
            break

    def mean(values: Array) -> Array:
        return np.asarray(np.bincount(cell, values, len(count)) / count)

    encoded, balanced, place = (
        np.stack([mean(column) for column in columns.T], axis=1)
        for columns in (samples.srgb, samples.raw * multipliers, samples.position)
    )
    rounding = 2.2 / np.log(2.0) * (0.5 / 255) / np.maximum(encoded.mean(axis=1), 0.02)  # of a power of 2.2
    owner = np.zeros(len(count), dtype=np.intp)
    owner[cell] = shot
    rows = np.sort(np.random.default_rng(0).permutation(len(count))[:most])
    cells = (encoded[rows], balanced[rows], mean(y)[rows], tone_of(encoded[rows]), place[rows], owner[rows])
    return Cells(*cells, tuple(map(str, names)), rounding[rows] ** 2)


def light_of(encoded: Array) -> Array:
    """The linear light (n,) that an sRGB JPEG stands for, which y is relative to."""
    return np.asarray(0.54 * np.exp2(2.5 * tone_of(encoded)))


def _matern(distance: Array) -> Array:
    """Matérn's covariance of smoothness 5/2, of distances in units of its length."""
    scaled = np.sqrt(5.0) * distance
    return np.asarray((1.0 + scaled + scaled**2 / 3.0) * np.exp(-scaled))


def covariance_of(cells: Cells, sizes: Sequence[float] = (1.0,) * 5) -> Array:
    """Return the covariance (n, n) of y between cells under a fixed rendering.

    sizes: five factors on standard deviations: of λ, of a shot's colours, of a shot as a whole, of noise and of
    rounding. At 1 they are broad enough for any camera: λ, for one, departs from a plane by half a stop over 90 codes.
    """
    plane = np.column_stack([np.ones(len(cells.y)), cells.encoded, cells.tone])
    curved, colours, whole, noise, rounding = np.square(sizes)
    distance = _distance(cells)
    common = 9.0 * plane @ plane.T + 0.25 * curved * _matern(distance / 0.35)
    scatter = noise * NOISE**2 + rounding * cells.rounding
    return np.asarray(common + _own(cells, distance, colours, whole) + np.diag(scatter))


def own_covariance(cells: Cells) -> Array:
    """Return the covariance (n, n) of a shot's departures under a fixed rendering.

    They are 3 % (0.04 EV) over 40 codes, because tiles are not quite flat, and 2 % over the whole shot, by lens flare.
    """
    return _own(cells, _distance(cells), 1.0, 1.0)


def _own(cells: Cells, distance: Array, colours: float, whole: float) -> Array:
    same = cells.shot[:, None] == cells.shot
    return np.asarray(same * (0.04**2 * colours * _matern(distance / 0.15) + 0.03**2 * whole))


def likeliest_sizes(cells: Cells, agreeing: Mask) -> tuple[float, ...]:
    """Return the sizes for `covariance_of` with the highest posterior, given the cells of shots that agree, (n,).

    This is empirical Bayes (Rasmussen & Williams 2006, equation 5.8) on at most 300 cells, with a standard normal prior
    for the logarithm of each size.
    """
    rows = np.flatnonzero(agreeing)
    rows = np.sort(np.random.default_rng(0).permutation(rows)[:300])
    few = cells.select(rows)
    units = np.stack([covariance_of(few, unit) for unit in np.vstack([np.zeros(5), np.eye(5)])])
    units[1:] -= units[0]

    def negative_log_posterior(logarithms: Array) -> float:
        factor = cho_factor(np.tensordot(np.exp(2.0 * np.append(0.0, logarithms)), units, 1), lower=True)
        likelihood = -0.5 * few.y @ cho_solve(factor, few.y) - np.log(np.diag(factor[0])).sum()
        return float(0.5 * logarithms @ logarithms - likelihood)

    start = np.vstack([np.zeros(5), -0.7 * np.eye(5)])
    options = {"initial_simplex": start, "xatol": 0.05, "fatol": 0.1}
    found = minimize(negative_log_posterior, start[0], method="Nelder-Mead", options=options)
    return tuple(np.exp(found.x).tolist())


def _distance(cells: Cells) -> Array:
    """Return the distances (n, n) between the JPEG colours of cells."""
    square = (cells.encoded**2).sum(axis=1)
    return np.asarray(np.sqrt(np.maximum(square[:, None] + square - 2.0 * cells.encoded @ cells.encoded.T, 0.0)))


def departures_of(cells: Cells, covariance: Array, freed: Mapping[int, Array]) -> list[Departure]:
    """Return the departure of each shot from the prediction by the others.

    freed: for some shots, columns (m, k) of a regression with a wide prior, in stops, so that what these explain does
    not affect the prediction of the other shots.
    """
    total = covariance.copy()
    for place, columns in freed.items():
        mine = np.flatnonzero(cells.shot == place)
        total[np.ix_(mine, mine)] += columns @ columns.T
    precision = np.linalg.inv(total)
    weighted = precision @ cells.y
    result = []
    for place in range(len(cells.names)):
        member = cells.shot == place
        own = np.linalg.inv(precision[np.ix_(member, member)])
        error = -own @ weighted[member]
        if place in freed:
            own = own - freed[place] @ freed[place].T
        result.append(Departure(error, own, member))
    return result
