"""The likelihood that a fitted colour chain is a camera's, from measured sensors and from known responses.

data/cameras.json holds mean and covariance of the matrices of 52 measured sensors, with its source and licence. A
response is described by the RAW values at which it reaches five JPEG values, in stops below saturation. White lies at
saturation within a quarter of a stop, and 18 % grey 2½ to 3½ stops below it, as in ISO 12232. Cameras differ more in
darker tones.
"""

import json
from dataclasses import dataclass
from functools import cache
from importlib.resources import files

import numpy as np

from lutforge.arrays import Array, Mask
from lutforge.calibration.plausibility.colour_chain import CODE, ColourChain


@dataclass(frozen=True, eq=False)
class TypicalResponse:
    """A response between sRGB's curve and a film-like one, and how cameras vary about it.

    tones: encoded (5,); stops: log2 of the RAW at which they are reached; covariance: of stops (5, 5).
    """

    tones: Array
    stops: Array
    covariance: Array


@cache
def known_cameras() -> dict[str, dict[str, list[float]]]:
    """The content of data/cameras.json, by quantity."""
    text = files("lutforge.calibration.plausibility").joinpath("data/cameras.json").read_text(encoding="utf-8")
    parsed: dict[str, dict[str, list[float]]] = json.loads(text)
    return parsed


@cache
def typical_response() -> TypicalResponse:
    """The response of data/cameras.json. Exposure moves all tones alike, and contrast moves darker ones more."""
    known = known_cameras()["response"]
    steps = np.array(known["spread"]) ** 2
    covariance = 0.2**2 + np.minimum(steps[:, None], steps[None, :])
    return TypicalResponse(np.array(known["values"]) / 255.0, np.array(known["stops"]), covariance)


def typical_matrix() -> Array:
    """The mean Ts (3, 3) of the measured sensors."""
    matrix = np.zeros((3, 3))
    matrix[~np.eye(3, dtype=np.bool_)] = known_cameras()["matrix"]["mean"]
    return np.asarray(matrix + np.diag(1.0 - matrix.sum(axis=1)))


def log_likelihood(chain: ColourChain, *, known_multipliers: bool, rms: float | None = None) -> float:
    """The log-likelihood of a chain, up to a constant: of its fit, and of its matrix, neutral, tones and offset.

    known_multipliers: the files state the multipliers, so that RAW times these should be neutral where the JPEG is.
    rms: the residual to use instead of the chain's own, in codes of the JPEG as given; needed where the chain was
    fitted to recoded JPEG values, whose codes are of another size.
    """
    total = -chain.independent * np.log((chain.rms if rms is None else rms) + 0.5 * CODE)
    covariance = _matrix_covariance(chain)
    known = known_cameras()["matrix"]
    # A quarter is the standard deviation of entries between picture styles, such as a lively and a calm one.
    spread = np.array(known["covariance"]) + 0.25**2 * np.eye(6) + covariance
    total += _student(chain.camera_matrix[~np.eye(3, dtype=np.bool_)] - np.array(known["mean"]), spread)
    if known_multipliers:
        neutral = np.log(np.maximum(chain.neutral[[0, 2]] / chain.neutral[1], 1e-3))
        # A few per cent: warm or cool renderings, and lights that the setting does not match exactly.
        total += _student(neutral, np.eye(2) * 0.025**2 + _neutral_covariance(chain))
    usual, seen = typical_response(), seen_tones(chain)
    if seen.any():
        total += _student((stops(chain) - usual.stops)[seen], usual.covariance[np.ix_(seen, seen)])
    # About a thousandth of saturation: black levels that drift or are rounded.
    total += _student(np.array([chain.offset]), np.array([[0.0008**2 + chain.offset_error**2]]))
    return float(total)


def seen_tones(chain: ColourChain) -> Mask:
    """(5,): which tones of the typical response lie among the samples."""
    tones = typical_response().tones
    return np.asarray((chain.low <= tones) & (chain.high >= tones))


def stops(chain: ColourChain) -> Array:
    """log2 of the RAW (5,) at which the chain reaches the tones of the typical response."""
    return np.asarray(np.log2(np.maximum(chain.light(typical_response().tones), 1e-4)))


def _student(departure: Array, covariance: Array, freedom: float = 8.0) -> float:
    """The logarithm of the density of Student's t at a departure (k,), relative to its maximum.

    freedom: degrees of it, so few that the tails are wide enough for good cameras with an unusual rendering.
    """
    distance = float(departure @ np.linalg.solve(covariance, departure))
    return -0.5 * (freedom + len(departure)) * float(np.log1p(distance / freedom))


def _neutral_covariance(chain: ColourChain) -> Array:
    """Return the covariance (2, 2) of log n_r / n_g and log n_b / n_g, n = A⁻¹ (1, 1, 1), as dn = -A⁻¹ dA n."""
    neutral = chain.neutral
    slopes = -np.einsum("ij,k->ijk", np.linalg.inv(chain.matrix), neutral).reshape(3, 9) / neutral[:, None]
    ratios = slopes[[0, 2]] - slopes[1]
    return np.asarray(ratios @ chain.covariance @ ratios.T)


def _matrix_covariance(chain: ColourChain) -> Array:
    """Return the covariance (6, 6) of the off-diagonal entries of Ts = A diag(A⁻¹ 1), from that of the entries of A."""
    inverse, neutral = np.linalg.inv(chain.matrix), chain.neutral
    rows = []
    for place in range(9):
        step = np.zeros((3, 3))
        step.flat[place] = 1.0
        rows.append((step * neutral - chain.matrix * (inverse @ (step @ neutral)))[~np.eye(3, dtype=np.bool_)])
    slopes = np.array(rows)
    return np.asarray(slopes.T @ chain.covariance @ slopes)
