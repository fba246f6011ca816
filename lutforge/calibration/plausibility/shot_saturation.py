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
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammaln

from lutforge.arrays import Array, Mask
from lutforge.calibration.plausibility.colour_chain import CODE, ColourChain, cubic_terms, curve_terms
from lutforge.solvers.blas import one_blas_thread
from lutforge.solvers.robust_weights import RobustWeights, cauchy

Departures = NDArray[np.float64]
"""What a shot or a group departs by (14,): exposure (EV), red, blue, saturation, contrast, and the matrix by rows."""


def _departures(
    *, exposure: float = 0.0, balance: float = 0.0, saturation: float = 0.0, contrast: float = 0.0, matrix: float = 0.0
) -> Departures:
    """Standard deviations of departures; 0 for what does not depart."""
    return np.array([exposure, balance, balance, saturation, contrast] + 9 * [matrix])


@dataclass(frozen=True)
class ShotSaturationOptions:
    """What shots of one style depart by, and groups of another style or sensor.

    With the numbers here thirty sets of a Canon S40's photographs are all told, of which a tenth or half are of another
    style or a third of another sensor, by style or sensor too, and of 109 good sets none is accused.

    balance, saturation, contrast, matrix: standard deviations between good shots. In 180 good sets of measured sensors
    and chart cameras they are 0.009 to 0.010, 0.020, 0.045 and 0.005 to 0.019. Saturation and contrast have twice as
    much, since bright shots of few colours bend them. With half the saturation one good set is accused, with twice as
    much 15 of the 30 are told; half or twice the others change one set at most.

    noises, in codes, exposures in EV, sizes of the common part: those among which the likelihood chooses. Three noises,
    one exposure or one size change one set at most.

    style_saturation, style_contrast: of another style. Half of either or twice as much changes nothing.

    sensor_matrix: of another sensor's matrix. With half of it five sensors are taken for styles.

    same_contrast, tone_contrast: of good shots and of another style, where it is asked whether a group is of another
    style or sensor; tones that both have hold the contrast. With twice the first four are mistaken, with half the
    second one.

    hats: piecewise linear functions of the tone curve of each channel; with five one good set is accused. cell: codes
    within which a shot's colours are alike, and tell as much as one; with half one good set is accused, with twice four
    are mistaken. turns: fits, each with the weights of the one before. starts: of the search for a group, the likeliest
    single shots. One of either changes nothing in these sets.
    """

    balance: float = 0.015
    saturation: float = 0.04
    contrast: float = 0.1
    matrix: float = 0.015
    noises: tuple[float, ...] = (0.3, 0.45, 0.7, 1.0, 1.4, 2.0, 3.0, 4.5)
    exposures: tuple[float, ...] = (0.01, 0.03, 0.1)
    sizes: tuple[float, ...] = (0.02, 0.05, 0.1)
    style_saturation: float = 0.25
    style_contrast: float = 0.1
    sensor_matrix: float = 0.12
    same_contrast: float = 0.02
    tone_contrast: float = 0.06
    hats: int = 10
    cell: float = 12.0
    turns: int = 3
    starts: int = 5

    def of_good_shots(self, exposure: float) -> Departures:
        """What good shots depart by, given their exposure's standard deviation."""
        return _departures(
            exposure=exposure, balance=self.balance, saturation=self.saturation, contrast=self.contrast,
            matrix=self.matrix,
        )  # fmt: skip


Sums = tuple[Array, Array, float, float]
"""Products (m, k, k), pulls (m, k), square and count, as `_sums` returns them."""


@dataclass(frozen=True, eq=False)
class _Fit:
    """The mixed model with the shots' own departures integrated out, in units of the noise.

    log_likelihood: marginal, up to a constant; products (m, k, k), pulls (m, k): of m shots and all k features;
    doubt: covariance of b (c, c), whose features come first; common: b; noise: encoded; size: standard deviation of b;
    spread: of u (14,); sums: as given.
    """

    log_likelihood: float
    products: Array
    pulls: Array
    doubt: Array
    common: Array
    noise: float
    size: float
    spread: Departures
    sums: Sums


@dataclass(frozen=True, eq=False)
class OddGroup:
    """shots: (m,), at most half; log_odds: that they have a saturation and contrast of their own.

    fit: of all shots; options: that it was made with.
    """

    shots: Mask
    log_odds: float
    fit: _Fit
    options: ShotSaturationOptions

    def sensor_is_likelier(self, group: Mask) -> bool:
        """Whether a group (m,) is of another sensor, which leaves the tones as they are, rather than another style."""
        options, fit = self.options, self.fit
        spread = replace(options, contrast=options.same_contrast).of_good_shots(fit.spread[0])
        fit = _integrated(fit.sums, fit.noise, fit.size, spread)
        lively = _gain(fit, group, _departures(saturation=options.style_saturation))
        contrasty = _gain(fit, group, _departures(saturation=options.style_saturation, contrast=options.tone_contrast))
        return bool(contrasty < lively < _gain(fit, group, _departures(matrix=options.sensor_matrix)))


@one_blas_thread
def odd_group(
    chain: ColourChain, x: Array, encoded: Array, index: NDArray[np.intp], options: ShotSaturationOptions | None = None
) -> OddGroup:
    """Return the group of shots that most likely is of another style or sensor.

    x: balanced RAW (n, 3) without its offset, encoded (n, 3), both unclipped; index (n,): shots 0 … m − 1.
    """
    options = options or ShotSaturationOptions()
    x, encoded, index = _cells(x, encoded, index, options.cell * CODE)
    linear = x @ chain.matrix.T
    rendered = chain.encoded(linear)
    features = np.hstack([_common_features(rendered, options.hats), _own_features(chain, x, linear, rendered)])
    fit = _fitted(features, encoded - rendered, index, options)
    style = _departures(saturation=options.style_saturation, contrast=options.style_contrast)
    return OddGroup(*_likeliest_group(fit, style, options.starts), fit, options)


def _cells(x: Array, encoded: Array, index: NDArray[np.intp], width: float) -> tuple[Array, Array, NDArray[np.intp]]:
    """Means of each shot's colours that are alike, in cells of this encoded width."""
    key = np.column_stack([index, np.floor(encoded / width).astype(np.intp)])
    cells, place, count = np.unique(key, axis=0, return_inverse=True, return_counts=True)
    sums = np.zeros((len(cells), 6))
    np.add.at(sums, place.ravel(), np.hstack([x, encoded]))
    means = sums / count[:, None]
    return means[:, :3], means[:, 3:], cells[:, 0]


def _common_features(rendered: Array, hats: int) -> Array:
    """What all shots share (n, c, 3): a cubic polynomial of the colours, then a tone curve, for each channel."""
    cubic = np.repeat(cubic_terms(rendered)[:, None], 3, axis=1)
    curve = np.maximum(1.0 - np.abs(rendered[..., None] * (hats - 1) - np.arange(hats)), 0.0)
    return np.hstack([_by_channel(cubic), _by_channel(curve)])


def _own_features(chain: ColourChain, x: Array, linear: Array, rendered: Array) -> Array:
    """What `Departures` of a shot do to its colours (n, 14, 3)."""
    ends = [curve_terms(np.clip(rendered + step, 0.0, 1.0)) @ chain.curve for step in (-1e-3, 1e-3)]
    slope = 1.0 / np.maximum((ends[1] - ends[0]) / 2e-3, 0.05)
    exposure = slope * linear * np.log(2.0)
    red, blue = (slope * x[:, channel, None] * chain.matrix[:, channel] for channel in (0, 2))
    saturation = rendered - (rendered @ [0.25, 0.5, 0.25])[:, None]
    contrast = 2.0 * rendered * (1.0 - rendered) * (2.0 * rendered - 1.0)
    matrix = _by_channel(slope[..., None] * x[:, None])
    return np.hstack([np.stack([exposure, red, blue, saturation, contrast], axis=1), matrix])


def _by_channel(terms: Array) -> Array:
    """Features (n, 3 k, 3), each of one channel only, of its terms (n, 3, k)."""
    return np.asarray(np.einsum("nck,cd->nckd", terms, np.eye(3)).reshape(len(terms), -1, 3))


def _sums(features: Array, left: Array, index: NDArray[np.intp], weight: Array) -> Sums:
    """Per shot, products of features (m, k, k) and with what is left (m, k); its square and the count, of all."""
    rows = [index == shot for shot in range(index.max() + 1)]
    flat = [features[mine].transpose(0, 2, 1).reshape(-1, features.shape[1]) for mine in rows]
    counts = [np.repeat(weight[mine], 3) for mine in rows]
    pulled = [each.T @ (count * left[mine].ravel()) for each, count, mine in zip(flat, counts, rows, strict=True)]
    products = [each.T @ (each * count[:, None]) for each, count in zip(flat, counts, strict=True)]
    return np.array(products), np.array(pulled), float(weight @ np.sum(left**2, axis=1)), float(3 * weight.sum())


def _integrated(sums: Sums, noise: float, size: float, spread: Departures) -> _Fit:
    """Integrate the shots' own departures, then the common part."""
    products, pulls, square, count = sums
    shared = products.shape[1] - len(spread)
    own = products[:, shared:, shared:] / noise**2 + np.diag(spread**-2.0)
    shrunk = np.linalg.solve(own, products[:, shared:] / noise**2)
    left = (products - np.swapaxes(products[:, shared:], 1, 2) @ shrunk) / noise**2
    pulled = (pulls - np.einsum("mua,mu->ma", shrunk, pulls[:, shared:])) / noise**2
    drawn = np.linalg.solve(own, pulls[:, shared:, None])[..., 0]
    square = square / noise**2 - float(np.sum(pulls[:, shared:] * drawn)) / noise**4
    precision = left[:, :shared, :shared].sum(axis=0) + np.eye(shared) / size**2
    doubt, pull = np.linalg.inv(precision), pulled[:, :shared].sum(axis=0)
    common = doubt @ pull
    determinants = np.linalg.slogdet(own)[1].sum() + np.linalg.slogdet(precision)[1]
    widths = count * np.log(noise) + len(pulls) * np.log(spread).sum() + shared * np.log(size)
    likelihood = -0.5 * (square - pull @ common) - 0.5 * determinants - widths
    return _Fit(float(likelihood), left, pulled, doubt, common, noise, size, spread, sums)


def _fitted(features: Array, left: Array, index: NDArray[np.intp], options: ShotSaturationOptions) -> _Fit:
    """The fit of the likeliest variances, with robust weights by what it leaves."""
    weight, robust = np.ones(len(left)), RobustWeights(cauchy, 3.0, CODE)
    grid = list(product(options.exposures, options.sizes))
    exposure, size = grid[len(grid) // 2]
    for _ in range(options.turns):
        sums = _sums(features, left, index, weight)
        spread = options.of_good_shots(exposure)
        fit = _likeliest(_integrated(sums, noise * CODE, size, spread) for noise in options.noises)
        fit = _likeliest(_integrated(sums, fit.noise, wide, options.of_good_shots(ev)) for ev, wide in grid)
        departures = np.hstack([np.tile(fit.common, (len(fit.products), 1)), _drawn(fit)])
        weight = robust(np.linalg.norm(left - np.einsum("nkc,nk->nc", features, departures[index]), axis=1))
    return fit


def _drawn(fit: _Fit) -> Array:
    """The likeliest departures of the shots (m, 14)."""
    products, pulls = fit.sums[:2]
    shared = len(fit.common)
    own = products[:, shared:, shared:] + np.diag((fit.noise / fit.spread) ** 2)
    pull = pulls[:, shared:] - products[:, shared:, :shared] @ fit.common
    return np.asarray(np.linalg.solve(own, pull[..., None])[..., 0])


def _likeliest(fits: Iterable[_Fit]) -> _Fit:
    return max(fits, key=lambda fit: fit.log_likelihood)


def _gain(fit: _Fit, groups: Mask, widths: Departures) -> Array:
    """The logarithm of the ratio of marginal likelihoods (…,) with departures of each group's own, and without.

    groups: (…, m); widths: the departures' standard deviations.
    """
    place = np.flatnonzero(widths)
    width, shared = widths[place], len(fit.common)
    place = place + shared
    chosen = groups.astype(np.float64)
    crossed = chosen @ fit.products[:, place, :shared].reshape(len(fit.products), -1)
    crossed = crossed.reshape(*groups.shape[:-1], len(place), shared)
    own = np.tensordot(chosen, fit.products[:, place[:, None], place], axes=1)
    precision = own - crossed @ fit.doubt @ np.swapaxes(crossed, -1, -2) + np.diag(width**-2.0)
    pull = chosen @ fit.pulls[:, place] - crossed @ fit.common
    drawn = np.linalg.solve(precision, pull[..., None])[..., 0]
    return np.asarray(0.5 * np.sum(pull * drawn, axis=-1) - 0.5 * np.linalg.slogdet(precision)[1] - np.log(width).sum())


def _likeliest_group(fit: _Fit, widths: Departures, starts: int) -> tuple[Mask, float]:
    """The group of at most half of the shots with the highest odds, grown shot by shot from the likeliest.

    A group of k of m shots is one of (m / 2) C(m, k), which its odds pay for.
    """
    single = np.eye(len(fit.products), dtype=np.bool_)
    best, found = -np.inf, single[0]
    for start in np.argsort(-_gain(fit, single, widths))[:starts]:
        group = single[start]
        for _ in range(len(single) // 2):
            k, m = group.sum(), len(single)
            cost = np.log(m / 2) + gammaln(m + 1) - gammaln(k + 1) - gammaln(m - k + 1)
            odds = float(_gain(fit, group, widths)) - cost
            if odds > best:
                best, found = odds, group
            larger = group | single[~group]
            group = larger[np.argmax(_gain(fit, larger, widths))]
    return found, best
