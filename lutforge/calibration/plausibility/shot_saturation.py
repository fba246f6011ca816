"""Finds shots of another style or sensor by their saturation, with a ratio of marginal likelihoods.

The residuals of the chain of all shots follow a linear mixed model, e = F b + Σ_s U u_s + noise. F b is common to all
shots: a cubic polynomial of the colours, and a tone curve per channel. u_s is what one shot departs by even if it is a
good one: in exposure, white balance and, a little, in saturation, contrast and matrix. All are Gaussian, so they are
integrated out in closed form (Rasmussen & Williams, Gaussian Processes for Machine Learning, 2006, section 2.7,
https://gaussianprocess.org/gpml). The variances of noise, exposure and b maximize the marginal likelihood.

A group of shots is compared with none by the ratio of the marginal likelihoods with and without a saturation and a
contrast of its own. The ratio stays near 1 where the colours of the group do not determine these. A group needs no
colours in common with the other shots, because saturation shows in any colours.
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
"""The departure of a shot or a group (14,): exposure (EV), red, blue, saturation, contrast, and the matrix by rows."""


def _departures(
    *, exposure: float = 0.0, balance: float = 0.0, saturation: float = 0.0, contrast: float = 0.0, matrix: float = 0.0
) -> Departures:
    """Standard deviations of a departure; 0 where there is none."""
    return np.array([exposure, balance, balance, saturation, contrast] + 9 * [matrix])


@dataclass(frozen=True)
class ShotSaturationOptions:
    """Standard deviations by which good shots of one style depart, and groups of another style or sensor.

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

    knots: of the piecewise linear tone curve of each channel; with five one good set is accused. cell: codes
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
    knots: int = 10
    cell: float = 12.0
    turns: int = 3
    starts: int = 5

    def of_good_shots(self, exposure: float) -> Departures:
        """The standard deviations of the departures of good shots, given that of their exposure."""
        return _departures(
            exposure=exposure, balance=self.balance, saturation=self.saturation, contrast=self.contrast,
            matrix=self.matrix,
        )  # fmt: skip


Sums = tuple[Array, Array, float, float]
"""Weighted sums over samples with k features F and residuals e. By shot: FᵀF (m, k, k) and Fᵀe (m, k); in all: eᵀe and
the weights."""


@dataclass(frozen=True, eq=False)
class _Fit:
    """The mixed model with the shots' own departures integrated out, in units of the noise.

    log_likelihood: marginal, up to a constant; products (m, k, k), cross (m, k): FᵀF and Fᵀe of m shots and all k
    features, with departures integrated out; covariance: of b (c, c), whose features come first; common: the mean of b;
    noise: its standard deviation, encoded; size: the prior standard deviation of b; spread: that of u (14,); sums: as
    given.
    """

    log_likelihood: float
    products: Array
    cross: Array
    covariance: Array
    common: Array
    noise: float
    size: float
    spread: Departures
    sums: Sums


@dataclass(frozen=True, eq=False)
class OddGroup:
    """The group of shots that most likely has a saturation and a contrast of its own.

    shots: (m,), at most half; log_odds: that they have these; fit: of all shots; options: those of the fit.
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
        lively = _log_ratio(fit, group, _departures(saturation=options.style_saturation))
        contrasty = _log_ratio(
            fit, group, _departures(saturation=options.style_saturation, contrast=options.tone_contrast)
        )
        return bool(contrasty < lively < _log_ratio(fit, group, _departures(matrix=options.sensor_matrix)))


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
    features = np.hstack([_common_features(rendered, options.knots), _own_features(chain, x, linear, rendered)])
    fit = _fitted(features, encoded - rendered, index, options)
    style = _departures(saturation=options.style_saturation, contrast=options.style_contrast)
    return OddGroup(*_likeliest_group(fit, style, options.starts), fit, options)


def _cells(x: Array, encoded: Array, index: NDArray[np.intp], width: float) -> tuple[Array, Array, NDArray[np.intp]]:
    """Average each shot's colours within cells of this encoded width."""
    key = np.column_stack([index, np.floor(encoded / width).astype(np.intp)])
    cells, place, count = np.unique(key, axis=0, return_inverse=True, return_counts=True)
    sums = np.zeros((len(cells), 6))
    np.add.at(sums, place.ravel(), np.hstack([x, encoded]))
    means = sums / count[:, None]
    return means[:, :3], means[:, 3:], cells[:, 0]


def _common_features(rendered: Array, knots: int) -> Array:
    """F (n, c, 3), common to all shots: a cubic polynomial of the colours and then a tone curve, for each channel."""
    cubic = np.repeat(cubic_terms(rendered)[:, None], 3, axis=1)
    curve = np.maximum(1.0 - np.abs(rendered[..., None] * (knots - 1) - np.arange(knots)), 0.0)
    return np.hstack([_by_channel(cubic), _by_channel(curve)])


def _own_features(chain: ColourChain, x: Array, linear: Array, rendered: Array) -> Array:
    """U (n, 14, 3): the change of a shot's colours by a unit of each of its `Departures`."""
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


def _sums(features: Array, residual: Array, index: NDArray[np.intp], weight: Array) -> Sums:
    """The weighted sums of features (n, k, 3) and residuals (n, 3), by shot."""
    rows = [index == shot for shot in range(index.max() + 1)]
    flat = [features[mine].transpose(0, 2, 1).reshape(-1, features.shape[1]) for mine in rows]
    weights = [np.repeat(weight[mine], 3) for mine in rows]
    cross = [each.T @ (own * residual[mine].ravel()) for each, own, mine in zip(flat, weights, rows, strict=True)]
    products = [each.T @ (each * own[:, None]) for each, own in zip(flat, weights, strict=True)]
    return np.array(products), np.array(cross), float(weight @ np.sum(residual**2, axis=1)), float(3 * weight.sum())


def _integrated(sums: Sums, noise: float, size: float, spread: Departures) -> _Fit:
    """Integrate out the shots' own departures, then the common part."""
    products, cross, square, count = sums
    shared = products.shape[1] - len(spread)
    own = products[:, shared:, shared:] / noise**2 + np.diag(spread**-2.0)  # the precision of u_s
    regression = np.linalg.solve(own, products[:, shared:] / noise**2)
    marginal = (products - np.swapaxes(products[:, shared:], 1, 2) @ regression) / noise**2
    marginal_cross = (cross - np.einsum("mua,mu->ma", regression, cross[:, shared:])) / noise**2
    explained = np.linalg.solve(own, cross[:, shared:, None])[..., 0]
    square = square / noise**2 - float(np.sum(cross[:, shared:] * explained)) / noise**4
    precision = marginal[:, :shared, :shared].sum(axis=0) + np.eye(shared) / size**2
    covariance, right_side = np.linalg.inv(precision), marginal_cross[:, :shared].sum(axis=0)
    common = covariance @ right_side
    determinants = np.linalg.slogdet(own)[1].sum() + np.linalg.slogdet(precision)[1]
    deviations = count * np.log(noise) + len(cross) * np.log(spread).sum() + shared * np.log(size)
    likelihood = -0.5 * (square - right_side @ common) - 0.5 * determinants - deviations
    return _Fit(float(likelihood), marginal, marginal_cross, covariance, common, noise, size, spread, sums)


def _fitted(features: Array, residual: Array, index: NDArray[np.intp], options: ShotSaturationOptions) -> _Fit:
    """The fit with the likeliest variances, and with robust weights by its own residuals."""
    weight, robust = np.ones(len(residual)), RobustWeights(cauchy, 3.0, CODE)
    grid = list(product(options.exposures, options.sizes))
    exposure, size = grid[len(grid) // 2]
    for _ in range(options.turns):
        sums = _sums(features, residual, index, weight)
        spread = options.of_good_shots(exposure)
        fit = _likeliest(_integrated(sums, noise * CODE, size, spread) for noise in options.noises)
        fit = _likeliest(_integrated(sums, fit.noise, wide, options.of_good_shots(ev)) for ev, wide in grid)
        departures = np.hstack([np.tile(fit.common, (len(fit.products), 1)), _posterior_departures(fit)])
        weight = robust(np.linalg.norm(residual - np.einsum("nkc,nk->nc", features, departures[index]), axis=1))
    return fit


def _posterior_departures(fit: _Fit) -> Array:
    """The posterior means (m, 14) of the shots' departures, given b."""
    products, cross = fit.sums[:2]
    shared = len(fit.common)
    own = products[:, shared:, shared:] + np.diag((fit.noise / fit.spread) ** 2)
    right_side = cross[:, shared:] - products[:, shared:, :shared] @ fit.common
    return np.asarray(np.linalg.solve(own, right_side[..., None])[..., 0])


def _likeliest(fits: Iterable[_Fit]) -> _Fit:
    return max(fits, key=lambda fit: fit.log_likelihood)


def _log_ratio(fit: _Fit, groups: Mask, spreads: Departures) -> Array:
    """The log ratio of the marginal likelihoods (…,) with and without a departure of each group's own.

    groups: (…, m); spreads: the standard deviations of a group's departure.
    """
    place = np.flatnonzero(spreads)
    spread, shared = spreads[place], len(fit.common)
    place = place + shared
    chosen = groups.astype(np.float64)
    crossed = chosen @ fit.products[:, place, :shared].reshape(len(fit.products), -1)
    crossed = crossed.reshape(*groups.shape[:-1], len(place), shared)
    own = np.tensordot(chosen, fit.products[:, place[:, None], place], axes=1)
    precision = own - crossed @ fit.covariance @ np.swapaxes(crossed, -1, -2) + np.diag(spread**-2.0)
    right_side = chosen @ fit.cross[:, place] - crossed @ fit.common
    mean = np.linalg.solve(precision, right_side[..., None])[..., 0]
    explained, determinant = 0.5 * np.sum(right_side * mean, axis=-1), 0.5 * np.linalg.slogdet(precision)[1]
    return np.asarray(explained - determinant - np.log(spread).sum())


def _likeliest_group(fit: _Fit, spreads: Departures, starts: int) -> tuple[Mask, float]:
    """Return the group of at most half of the shots with the highest odds, grown shot by shot, and its log odds.

    The prior probability of a group of k of m shots is 1 / ((m / 2) C(m, k)): all sizes are alike, and all groups of a
    size.
    """
    single = np.eye(len(fit.products), dtype=np.bool_)
    best, found = -np.inf, single[0]
    for start in np.argsort(-_log_ratio(fit, single, spreads))[:starts]:
        group = single[start]
        for _ in range(len(single) // 2):
            k, m = group.sum(), len(single)
            groups_alike = np.log(m / 2) + gammaln(m + 1) - gammaln(k + 1) - gammaln(m - k + 1)
            odds = float(_log_ratio(fit, group, spreads)) - groups_alike
            if odds > best:
                best, found = odds, group
            larger = group | single[~group]
            group = larger[np.argmax(_log_ratio(fit, larger, spreads))]
    return found, best
