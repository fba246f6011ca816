"""The likelihood of a picture's noise under a rendering, which turns the known photon noise of RAW into noise of codes.

The variance of a photon count is proportional to its mean. So the variance of white-balanced channel c at x_c is s m_c
x_c, with one factor s for the camera. With the slopes J of the rendering, a plane of the JPEG with channel weights w
has the variance Σ_c (w J)_c² s m_c x_c. With a wrong tone curve, matrix or white balance these variances do not fit
those of the picture's colours. (Takamatsu, Matsushita & Ikeuchi 2008, "Estimating radiometric response functions from
image noise variance", https://doi.org/10.1007/978-3-540-88693-8_46, for one channel; here for the whole rendering.)

Demosaicking, scaling and noise reduction change s with the frequency, alike for red and blue but not for green, and mix
the channels. So each DCT coefficient has four free factors. Texture can only add to the variance. So a colour with more
noise than predicted is weak evidence, and one with less is strong evidence.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np
import scipy

from lutforge.arrays import Array, Mask
from lutforge.identification.noise_tally import LEVELS, NoiseTally


@dataclass(frozen=True)
class NoiseOptions:
    """Limits of the evidence of one colour.

    slope_error: relative error of variances that a calibrated rendering predicts. above, below: the largest amount by
    which a colour with more, or less, noise than predicted lowers the log-likelihood of a coefficient. rounding:
    variance in codes² of what any 8-bit JPEG rounds before its DCT: RGB codes, then those of YCbCr (1/12). starts: mean
    variances, in codes², that the search begins from.
    """

    slope_error: float = 0.2
    above: float = 2.0
    below: float = 6.0
    rounding: float = 0.12
    starts: tuple[float, ...] = (0.3, 1.5, 6.0, 25.0)


def noise_parts(scene: Array, slopes: Array, weights: Array, multipliers: Array) -> Array:
    """The variances of a plane's four noise terms, up to their factors: (w, n, 4).

    scene: white-balanced RAW (n, 3) of the colours; slopes: of the rendering (n, 3, 3) in codes; weights: of the plane
    (n, 3); multipliers: (w, 3). Terms: red and blue samples, green ones, and both with what leaks into other channels.
    """
    gain = np.einsum("no,noi->ni", weights, slopes)
    light = np.maximum(scene, 0.0)[None] * multipliers[:, None]
    # A demosaicking with gradient correction (Malvar 2004) lets a third of a channel's noise into the others.
    leaking = gain + 0.35 * (gain.sum(axis=1, keepdims=True) - gain)
    own, mixed = light * gain**2, light * leaking**2
    return np.stack([own[..., 0] + own[..., 2], own[..., 1], mixed[..., 1], mixed[..., 0] + mixed[..., 2]], axis=-1)


def noise_log_likelihood(tally: NoiseTally, parts: Array, options: NoiseOptions | None = None) -> Array:
    """The robust log-likelihood (w,) of the counts under the variances of `noise_parts`, with their factors fitted."""
    options = NoiseOptions() if options is None else options
    scale = parts.mean(axis=1, keepdims=True) + 1e-12
    fits = (
        _fitted(parts / scale, tally.counts[:, k], float(step), options) for k, step in enumerate(tally.steps.tolist())
    )
    return np.asarray(sum(fits))


def _fitted(parts: Array, counts: Array, step: float, options: NoiseOptions) -> Array:
    """Return the log-likelihood (w,) of one coefficient's counts, with the factors of its noise fitted.

    The factors are nonnegative, and found by Fisher scoring from the best of a few starts.
    """
    colours = _Colours.of(counts, options)

    def judged(factors: Array) -> State:
        ratio = 0.5 * np.log(np.einsum("wnp,wp->wn", parts, factors) + options.rounding) - np.log(step)
        place = _place(ratio)
        most = np.where(ratio < colours.own, options.above, options.below)
        kept = np.exp(-colours.share * (colours.best - _look(colours.told, place)) / most)
        return place, -(most * (1.0 - kept)).sum(axis=1), kept * colours.share

    terms = parts.shape[2]
    factors = np.full((len(parts), terms), options.starts[0] / terms)
    state = judged(factors)
    for start in options.starts[1:]:
        factors, state, _ = _better(judged, factors, state, np.full_like(factors, start / terms))
    damping = np.full(len(parts), 0.1)
    for _ in range(6):
        change = _scoring_step(parts, colours, step, factors, state, damping)
        factors, state, better = _better(judged, factors, state, np.maximum(factors + change, 0.0))
        damping = np.where(better, damping * 0.3, np.maximum(damping, 1e-3) * 6.0)
    return state[1]


@dataclass(frozen=True, eq=False)
class _Colours:
    """What the counts of n colours tell of log (σ / step), tabulated at the ratios of `_odds` where it says (…, n).

    told, slope: log-likelihood and its slope (r, n); information (r, n); best, own: the largest log-likelihood of each
    colour, and where it is (n,); share: of each colour's log-likelihood that counts (n,).
    """

    told: Array
    slope: Array
    information: Array
    best: Array
    own: Array
    share: Array

    @classmethod
    def of(cls, counts: Array, options: NoiseOptions) -> "_Colours":
        odds, total = _odds(), counts.sum(axis=1)
        told, information = odds.log_odds @ counts.T, odds.information[:, None] * total
        own = told.argmax(axis=0)
        # A colour that many blocks show is known more surely than the rendering.
        known = information[own, np.arange(len(total))] * 0.25 * options.slope_error**2
        return cls(told, odds.slope @ counts.T, information, told.max(axis=0), odds.ratios[own], 1.0 / (1.0 + known))


State = tuple[Array, Array, Array]


def _better(judged: Callable[[Array], State], factors: Array, state: State, tried: Array) -> tuple[Array, State, Mask]:
    """Choose, for each candidate, the likelier of its factors and those tried.

    Returns the chosen factors, their state, and the mask of candidates whose tried factors are the likelier.
    """
    new = judged(tried)
    better = new[1] > state[1]
    pick = better[:, None]
    chosen = np.where(pick, new[0], state[0]), np.where(better, new[1], state[1]), np.where(pick, new[2], state[2])
    return np.where(pick, tried, factors), chosen, better


def _scoring_step(parts: Array, colours: _Colours, step: float, factors: Array, state: State, damping: Array) -> Array:
    place, _, weight = state
    twice = 0.5 / (step * np.exp(_odds().ratios[0] + place * _odds().spacing)) ** 2  # d log σ / d variance
    score = _look(colours.slope, place) * twice * weight
    information = _look(colours.information, place) * twice**2 * weight
    weighted = information[..., None] * parts
    normal = np.swapaxes(weighted, 1, 2) @ parts
    gradient = np.einsum("wn,wnp->wp", score, parts)
    held = (factors <= 0) & (gradient < 0)
    normal[held[:, :, None] | held[:, None, :]] = 0.0
    gradient[held] = 0.0
    diagonal = np.einsum("wpp->wp", normal)
    ridge = damping[:, None] * diagonal + held + 1e-6 * diagonal.max(axis=1, keepdims=True) + 1e-9
    system = normal + ridge[:, :, None] * np.eye(parts.shape[2])
    return np.asarray(np.linalg.solve(system, gradient[..., None])[..., 0])


@dataclass(frozen=True, eq=False)
class _Odds:
    """By the logarithm of σ / step: log P of each size, its slope, and Fisher's information about log σ."""

    ratios: Array
    log_odds: Array
    slope: Array
    information: Array

    @property
    def spacing(self) -> float:
        """Between two ratios."""
        return float(self.ratios[1] - self.ratios[0])


@cache
def _odds() -> _Odds:
    """A normal coefficient, quantized; three in a hundred are four times as wide, as flat blocks are not all flat."""
    ratios = np.linspace(np.log(0.05), np.log(8.0), 400)
    size = np.arange(LEVELS)

    def quantized(sigma: Array) -> Array:
        above, below = scipy.special.ndtr((size + 0.5) / sigma), scipy.special.ndtr((size - 0.5) / sigma)
        return np.asarray((above - below) * np.where(size == 0, 1.0, 2.0))

    sigma = np.exp(ratios)[:, None]
    log_odds = np.log(0.97 * quantized(sigma) + 0.03 * quantized(4.0 * sigma) + 1e-5)
    slope = np.gradient(log_odds, ratios, axis=0)
    return _Odds(ratios, log_odds, slope, np.sum(np.exp(log_odds) * slope**2, axis=1))


def _place(ratio: Array) -> Array:
    """Return the places, in entries of the tables of `_odds`, of ratios log (σ / step)."""
    odds = _odds()
    return np.asarray(np.clip((ratio - odds.ratios[0]) / odds.spacing, 0.0, len(odds.ratios) - 1.001))


def _look(table: Array, place: Array) -> Array:
    """A table (r, n) at places (w, n), between its entries linearly."""
    low = place.astype(np.int64)
    flat = low * table.shape[1] + np.arange(table.shape[1])
    lower = table.take(flat)
    return np.asarray(lower + (place - low) * (table.take(flat + table.shape[1]) - lower))
