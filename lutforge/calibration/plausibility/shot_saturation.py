"""Shots of another style or sensor, told by their saturation beside the other shots': a ratio of marginal likelihoods.

What the chain of all shots leaves over is a linear mixed model e = F b + Σ_s U u_s + noise. F b is common to all shots:
a cubic polynomial of the colours, and a tone curve per channel. u_s is a shot's own departure, as good shots have it:
exposure, white balance, a little saturation, contrast and matrix. All are Gaussian, so they integrate out in closed
form (Rasmussen & Williams, Gaussian Processes for Machine Learning, 2006, 2.7, https://gaussianprocess.org/gpml); the
variances of noise, exposure and b are those of the highest marginal likelihood. A group of shots with a saturation and
contrast of its own is likelier than none by a ratio that stays near 1 where its colours do not tell. It needs no
colours that other shots have too, as a free rendering of each group does: saturation is seen in any colours.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammaln

from lutforge.arrays import Array, Mask
from lutforge.calibration.plausibility.colour_chain import CODE, ColourChain, cubic_terms, curve_terms
from lutforge.solvers.blas import one_blas_thread
from lutforge.solvers.robust_weights import RobustWeights, cauchy

HATS = 10
"""Piecewise linear functions of the tone curve of each channel."""
COMMON = 60 + 3 * HATS
"""Features that all shots share: 20 terms of a cubic polynomial and the tone curve, for each channel."""
SATURATION, CONTRAST = COMMON + 3, COMMON + 4
STYLE = np.array([SATURATION, CONTRAST])
MATRIX = np.arange(COMMON + 5, COMMON + 14)
"""Places of a shot's own features behind the common ones; exposure, red and blue come before them."""
SHOT_SPREAD = np.concatenate([[0.0, 0.015, 0.015, 0.04, 0.1], np.full(9, 0.015)])
"""Standard deviations between good shots: of exposure (estimated), red, blue, saturation, contrast and the matrix.

In 180 good sets of measured sensors and chart cameras they are 0.010, 0.009, 0.020, 0.045 and 0.005 to 0.019. Contrast
is freer yet, since bright shots of few colours bend it.
"""

Sums = tuple[Array, Array, float, float]
"""Products (m, k, k), pulls (m, k), square and count, as `_sums` returns them."""


@dataclass(frozen=True, eq=False)
class _Fit:
    """The mixed model with the shots' own departures integrated out, in units of the noise.

    log_likelihood: marginal, up to a constant; products (m, k, k), pulls (m, k): of m shots and all k features;
    doubt: covariance of b (COMMON, COMMON); common: b; noise: encoded; size: standard deviation of b;
    spread (14,): of u; sums: as given.
    """

    log_likelihood: float
    products: Array
    pulls: Array
    doubt: Array
    common: Array
    noise: float
    size: float
    spread: Array
    sums: Sums


@dataclass(frozen=True, eq=False)
class OddGroup:
    """shots: (m,), at most half; log_odds: that they have a saturation and contrast of their own; fit: of all shots."""

    shots: Mask
    log_odds: float
    fit: _Fit

    def sensor_is_likelier(self, group: Mask) -> bool:
        """Whether a group (m,) is of another sensor, which leaves the tones as they are, rather than another style."""
        spread = self.fit.spread.copy()
        spread[CONTRAST - COMMON] = 0.02  # of tones that both groups have, no style gives more
        fit = _integrated(self.fit.sums, self.fit.noise, self.fit.size, spread)
        lively = _gain(fit, group, STYLE[:1], np.array([0.25]))
        contrasty = _gain(fit, group, STYLE, np.array([0.25, 0.06]))
        return bool(contrasty < lively < _gain(fit, group, MATRIX, np.full(9, 0.12)))


@one_blas_thread
def odd_group(chain: ColourChain, x: Array, encoded: Array, index: NDArray[np.intp]) -> OddGroup:
    """Return the group of shots that most likely is of another style or sensor.

    x: balanced RAW (n, 3) without its offset, encoded (n, 3), both unclipped; index (n,): shots 0 … m − 1.
    """
    x, encoded, index = _cells(x, encoded, index)
    linear = x @ chain.matrix.T
    rendered = chain.encoded(linear)
    fit = _fitted(_features(chain, x, linear, rendered), encoded - rendered, index)
    return OddGroup(*_likeliest_group(fit, STYLE, np.array([0.25, 0.1])), fit)


def _cells(x: Array, encoded: Array, index: NDArray[np.intp]) -> tuple[Array, Array, NDArray[np.intp]]:
    """Means of each shot's colours that are alike, within 12 codes: they tell as much as one."""
    key = np.column_stack([index, np.floor(encoded / (12 * CODE)).astype(np.intp)])
    cells, place, count = np.unique(key, axis=0, return_inverse=True, return_counts=True)
    sums = np.zeros((len(cells), 6))
    np.add.at(sums, place.ravel(), np.hstack([x, encoded]))
    means = sums / count[:, None]
    return means[:, :3], means[:, 3:], cells[:, 0]


def _features(chain: ColourChain, x: Array, linear: Array, rendered: Array) -> Array:
    """What moves rendered (n, 3): polynomial and tones, which are common, and what a shot has of its own."""
    cubic = cubic_terms(rendered)
    features = np.zeros((len(x), COMMON + 14, 3))
    ends = [curve_terms(np.clip(rendered + step, 0.0, 1.0)) @ chain.curve for step in (-1e-3, 1e-3)]
    slope = 1.0 / np.maximum((ends[1] - ends[0]) / 2e-3, 0.05)
    for channel in range(3):
        features[:, 20 * channel : 20 * channel + 20, channel] = cubic
        hats = np.maximum(1.0 - np.abs(rendered[:, channel, None] * (HATS - 1) - np.arange(HATS)), 0.0)
        features[:, 60 + HATS * channel : 60 + HATS * (channel + 1), channel] = hats
        features[:, MATRIX[3 * channel] : MATRIX[3 * channel] + 3, channel] = slope[:, channel, None] * x
    features[:, COMMON] = slope * linear * np.log(2.0)
    features[:, COMMON + 1] = slope * x[:, :1] * chain.matrix[:, 0]
    features[:, COMMON + 2] = slope * x[:, 2:] * chain.matrix[:, 2]
    features[:, SATURATION] = rendered - (rendered @ [0.25, 0.5, 0.25])[:, None]
    features[:, CONTRAST] = 2.0 * rendered * (1.0 - rendered) * (2.0 * rendered - 1.0)
    return features


def _sums(features: Array, left: Array, index: NDArray[np.intp], weight: Array) -> Sums:
    """Per shot, products of features (m, k, k) and with what is left (m, k); its square and the count, of all."""
    rows = [index == shot for shot in range(index.max() + 1)]
    flat = [features[mine].transpose(0, 2, 1).reshape(-1, features.shape[1]) for mine in rows]
    counts = [np.repeat(weight[mine], 3) for mine in rows]
    pulled = [each.T @ (count * left[mine].ravel()) for each, count, mine in zip(flat, counts, rows, strict=True)]
    products = [each.T @ (each * count[:, None]) for each, count in zip(flat, counts, strict=True)]
    return np.array(products), np.array(pulled), float(weight @ np.sum(left**2, axis=1)), float(3 * weight.sum())


def _integrated(sums: Sums, noise: float, size: float, spread: Array) -> _Fit:
    """Integrate the shots' own departures, then the common part."""
    products, pulls, square, count = sums
    own = products[:, COMMON:, COMMON:] / noise**2 + np.diag(spread**-2.0)
    shrunk = np.linalg.solve(own, products[:, COMMON:] / noise**2)
    left = (products - np.swapaxes(products[:, COMMON:], 1, 2) @ shrunk) / noise**2
    pulled = (pulls - np.einsum("mua,mu->ma", shrunk, pulls[:, COMMON:])) / noise**2
    drawn = np.linalg.solve(own, pulls[:, COMMON:, None])[..., 0]
    square = square / noise**2 - float(np.sum(pulls[:, COMMON:] * drawn)) / noise**4
    precision = left[:, :COMMON, :COMMON].sum(axis=0) + np.eye(COMMON) / size**2
    doubt, pull = np.linalg.inv(precision), pulled[:, :COMMON].sum(axis=0)
    common = doubt @ pull
    determinants = np.linalg.slogdet(own)[1].sum() + np.linalg.slogdet(precision)[1]
    widths = count * np.log(noise) + len(pulls) * np.log(spread).sum() + COMMON * np.log(size)
    likelihood = -0.5 * (square - pull @ common) - 0.5 * determinants - widths
    return _Fit(float(likelihood), left, pulled, doubt, common, noise, size, spread, sums)


def _fitted(features: Array, left: Array, index: NDArray[np.intp]) -> _Fit:
    """The fit of the likeliest variances, with robust weights by what it leaves."""
    weight, robust = np.ones(len(left)), RobustWeights(cauchy, 3.0, CODE)
    for turn in range(3):
        sums = _sums(features, left, index, weight)
        noises = np.array([0.3, 0.45, 0.7, 1.0, 1.4, 2.0, 3.0, 4.5]) * CODE
        best = _likeliest(_integrated(sums, noise, 0.05, _spread(0.03)) for noise in noises)
        sizes = product((0.01, 0.03, 0.1), (0.02, 0.05, 0.1))
        best = _likeliest(_integrated(sums, best.noise, size, _spread(exposure)) for exposure, size in sizes)
        if turn < 2:
            products, pulls = sums[:2]
            own = products[:, COMMON:, COMMON:] + np.diag((best.noise / best.spread) ** 2)
            pull = pulls[:, COMMON:] - products[:, COMMON:, :COMMON] @ best.common
            departures = np.linalg.solve(own, pull[..., None])[..., 0]
            coefficients = np.hstack([np.tile(best.common, (len(departures), 1)), departures])
            weight = robust(np.linalg.norm(left - np.einsum("nkc,nk->nc", features, coefficients[index]), axis=1))
    return best


def _likeliest(fits: Iterable[_Fit]) -> _Fit:
    return max(fits, key=lambda fit: fit.log_likelihood)


def _spread(exposure: float) -> Array:
    return np.concatenate([[exposure], SHOT_SPREAD[1:]])


def _gain(fit: _Fit, groups: Mask, place: NDArray[np.intp], width: Array) -> Array:
    """The logarithm of the ratio of marginal likelihoods (…,) with features `place` of each group's own, and without.

    groups: (…, m); width: their standard deviations.
    """
    chosen = groups.astype(np.float64)
    crossed = chosen @ fit.products[:, place, :COMMON].reshape(len(fit.products), -1)
    crossed = crossed.reshape(*groups.shape[:-1], len(place), COMMON)
    own = np.tensordot(chosen, fit.products[:, place[:, None], place], axes=1)
    precision = own - crossed @ fit.doubt @ np.swapaxes(crossed, -1, -2) + np.diag(width**-2.0)
    pull = chosen @ fit.pulls[:, place] - crossed @ fit.common
    drawn = np.linalg.solve(precision, pull[..., None])[..., 0]
    return np.asarray(0.5 * np.sum(pull * drawn, axis=-1) - 0.5 * np.linalg.slogdet(precision)[1] - np.log(width).sum())


def _likeliest_group(fit: _Fit, place: NDArray[np.intp], width: Array) -> tuple[Mask, float]:
    """The group of at most half of the shots with the highest odds, grown shot by shot from the likeliest five.

    A group of k of m shots is one of (m / 2) C(m, k), which its odds pay for.
    """
    single = np.eye(len(fit.products), dtype=np.bool_)
    best, found = -np.inf, single[0]
    for start in np.argsort(-_gain(fit, single, place, width))[:5]:
        group = single[start]
        for _ in range(len(single) // 2):
            k, m = group.sum(), len(single)
            cost = np.log(m / 2) + gammaln(m + 1) - gammaln(k + 1) - gammaln(m - k + 1)
            odds = float(_gain(fit, group, place, width)) - cost
            if odds > best:
                best, found = odds, group
            larger = group | single[~group]
            group = larger[np.argmax(_gain(fit, larger, place, width))]
    return found, best
