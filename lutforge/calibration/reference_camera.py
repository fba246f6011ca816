"""Cameras without RAW: a reference camera's RAW E' of the same scene stands in (thesis 4.2.4, equations 4.9, 4.10).

I = f(h(Ts Tw Tc E')). One Tc, the same for all white balances, takes the reference's RAW to what the camera's own would
have been; of that the camera is calibrated like any other. Three steps of least squares find it, of colours that the
gamut map h leaves alone:

- f of each style and Tz_i = Ts Tw_i Tc of each white balance together, as f⁻¹(I) = Tz_i E' is linear in both;
- with f known, Tz_i⁻¹ of f⁻¹(I) to E' (4.10), in this direction because f⁻¹(I) is known to a code, while E' holds what
  one sensor tells apart and the other does not, which would shrink the saturation of every Tz_i fitted to it;
- Tz_i⁻¹ = Tc⁻¹ Tw_i⁻¹ Ts⁻¹ with diagonal Tw_i, which two white balances and more determine. What they leave open,
  all of Tc for a single one, makes no difference: Ts and h hold it.

Two shutters and two metering systems do not agree to a per cent, nor do clouds: each shot has a gain of its own, which
is fitted with f and Tz.

With the preset "thesis" these are as written there: f from exposure pairs, then (4.10) over all colours below the
saturation β, which count alike; shots have no gains.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import null_space

from lutforge.arrays import Array, Mask
from lutforge.calibration.curve_basis import emor_basis, spline_basis, srgb_response
from lutforge.calibration.matrix_and_response import (
    BETA,
    LEAST_UNSATURATED,
    REACH,
    JointFit,
    matrix_of_rows,
    neutral_rows,
    saturation,
    untouched_odds,
)
from lutforge.calibration.options import PhysicalOptions, Preset
from lutforge.calibration.physical_model import LEAST_CONDITION, hue_spread, response_of_exposures
from lutforge.calibration.robust_fit import ToneWeights, robust_fit
from lutforge.calibration.white_balance import estimated_multipliers, neutral_weight
from lutforge.errors import CalibrationError
from lutforge.model.response import Response
from lutforge.samples.sample_set import SampleSet, unclipped_colours
from lutforge.solvers.gauss_newton import gauss_newton
from lutforge.solvers.robust_weights import RobustWeights, cauchy, weighted_median

LEAST_COLOURS = 12
TINY = 1e-6
"""Light counts as this at least, so that ratios and logarithms stay finite."""
ROUNDED = 0.2
"""Below this JPEG value rounding rules."""
WORST_ERROR = 0.08
"""Median encoded error beyond which RAW and JPEG are not of one scene; the chart cameras have 0.002 … 0.03."""
WIDER = (BETA, 0.4, 0.5, 0.7)
"""Values of β that are tried in turn: on a small chart hardly any unsaturated colour is not grey."""
DARK = 0.05
"""Colours below this share of the bright ones hold noise."""
LARGEST_CONDITION = 100
STEP = 1e-6
"""Step of a numerical derivative."""


def own_raw(
    samples: SampleSet, preset: Preset = "lutforge", physical: PhysicalOptions | None = None
) -> tuple[SampleSet, Array]:
    """Carry a reference camera's RAW to the camera that was sampled with it: the samples, and Tc (3, 3).

    Those stay that neither the JPEG nor the reference clips, with the multipliers of the camera. RAW is scaled so that
    balanced RAW of 1 is what the JPEG's brightest code stands for. Raises CalibrationError, in one line with what to
    shoot, where the samples do not determine f or Tz of a white balance, or contradict every one.
    """
    inside = samples.select(unclipped_colours(samples.srgb, samples.raw))
    if len(inside) < LEAST_COLOURS:
        raise CalibrationError(
            f"{len(inside)} samples are unclipped in both the JPEG and the reference camera's RAW: expose less"
        )
    setting = inside.settings
    linear, trust, white, gain = _linear_light(inside, setting, preset, physical or PhysicalOptions())
    even = replace(inside, raw=gain[:, None] * inside.raw)
    transfer, matrix, balances = _jointly_diagonal(
        {str(name): _inverse(linear, even, setting == name, str(name), preset) for name in np.unique(setting)}
    )
    multipliers = np.array([balances[str(name)] / balances[str(name)][1] for name in setting])
    balanced = inside.raw @ transfer.T * multipliers
    level = np.log(np.maximum(linear.sum(axis=1), TINY) / np.maximum((balanced @ matrix.T).sum(axis=1), TINY))
    shots, scale = _gains(inside, setting, level, trust * (inside.srgb.max(axis=1) > ROUNDED))
    gain = gain if preset == "thesis" else shots
    top = np.quantile((gain[:, None] * balanced)[trust > 0.5], 0.999)
    transfer = transfer / max(float(top), float(np.max(white / scale)))
    raw = gain[:, None] * inside.raw @ transfer.T
    return replace(inside, raw=raw, wb=multipliers, raw_camera=inside.camera.copy()), transfer


def _gains(samples: SampleSet, setting: NDArray[np.str_], level: Array, weight: Array) -> tuple[Array, Array]:
    """What the RAW of each shot (n,) is multiplied by, and the scale of f⁻¹ of each style (n,).

    level: (n,) log of f⁻¹(I) over Ts Tw Tc E'; weight: (n,). The shots of a style tell the scale of its f⁻¹. A setting
    whose shots agree on a level of their own beyond the scatter (three standard errors) keeps it: there the camera
    multiplies by more than its white balance.
    """
    _, first, shot = np.unique(samples.shot, return_index=True, return_inverse=True)
    of_shot = np.array([weighted_median(level[shot == k], weight[shot == k] + TINY / 1000) for k in range(len(first))])
    style, balance = samples.style[first], setting[first]
    scale = np.array([np.median(of_shot[style == name]) for name in style])
    rest = of_shot - scale
    own = np.array([np.median(rest[balance == name]) for name in balance])
    count = np.array([np.count_nonzero(balance == name) for name in balance])
    doubt = 3 * float(np.std(rest - own if np.any(count > 1) else rest)) / np.sqrt(count)
    kept = np.where((np.abs(own) > doubt) & (count > 1), own, 0.0)
    return np.exp(rest - kept)[shot], np.exp(scale)[shot]


def _linear_light(
    samples: SampleSet, setting: NDArray[np.str_], preset: Preset, physical: PhysicalOptions
) -> tuple[Array, Array, Array, Array]:
    """f⁻¹(I) (n, 3) on about one scale, the odds that h leaves a colour alone, the style's f⁻¹(1), and gains, all (n,).

    Gains are those of the shots of a style and a white balance beside each other.
    """
    linear, (trust, white, gain) = np.zeros_like(samples.raw), np.zeros((3, len(samples)))
    names, counts = np.unique(samples.style, return_counts=True)
    anchors: dict[str, Array] = {}
    for name in names[np.argsort(-counts)]:
        rows = samples.style == name
        try:
            if preset == "thesis":
                # f from the exposure pairs (4.2.1), and Tz of the colours below β by plain least squares.
                style = samples.select(rows)
                response = response_of_exposures(style, preset, physical)
                low, light = saturation(style.srgb) < physical.beta, response.linearize(style.srgb)
                parts = {str(key): low & (setting[rows] == key) for key in np.unique(setting[rows])}
                tz = {key: np.linalg.lstsq(style.raw[mine], light[mine])[0].T for key, mine in parts.items()}
                fit = _StyleFit(response, tz, np.ones(len(style)), low.astype(np.float64))
            else:
                fit = _fit_response(samples.select(rows), setting[rows], physical)
        except CalibrationError as error:
            raise CalibrationError(f'style "{name}": {error}') from None
        common = [balance for balance in fit.matrices if balance in anchors]
        sums = [float(np.sum(anchors[balance]) / np.sum(fit.matrices[balance])) for balance in common]
        scale = float(np.median(sums)) if sums else 1.0
        for balance, matrix in fit.matrices.items():
            anchors.setdefault(balance, scale * matrix)
        linear[rows] = scale * fit.response.linearize(samples.srgb[rows])
        trust[rows], gain[rows] = fit.trust, fit.gain
        white[rows] = scale * float(fit.response.inverse[-1].max())
    return linear, trust, white, gain


@dataclass(frozen=True, eq=False)
class _StyleFit:
    """f of a style, Tz (3, 3) by white balance, gains of shots (n,), and the odds (n,) that h leaves a colour alone."""

    response: Response
    matrices: Mapping[str, Array]
    gain: Array
    trust: Array


def _fit_response(samples: SampleSet, setting: NDArray[np.str_], options: PhysicalOptions) -> _StyleFit:
    """Fit f, every Tz and the shots' gains of a style together (`JointFit`).

    Were gains fitted after f, f would bend where the shots of some tones are all too bright, and leave a part of that
    to them.
    """
    raw, encoded = samples.raw, samples.srgb
    names, place = np.unique(setting, return_inverse=True)
    votes = np.bincount(place, neutral_weight(raw, encoded))
    first = int(np.argmax(votes))
    multipliers, _ = estimated_multipliers(raw[place == first], encoded[place == first])
    chroma = saturation(encoded)
    beta = max(options.beta, float(np.partition(chroma, LEAST_UNSATURATED - 1)[LEAST_UNSATURATED - 1]))
    near = chroma < REACH * beta
    is_of = np.eye(len(names))[place]
    others = np.delete(is_of, first, axis=1)

    def columns(x: Array) -> tuple[Array, Array]:
        # The rows of Ts of the first setting sum to 1, which settles the scale; the coefficients of all others are free
        known, own = neutral_rows(x * multipliers * is_of[near, first, None])
        free = (others[near, :, None] * x[:, None, :]).reshape(len(x), 1, -1)
        return known, np.concatenate([own, np.repeat(free, 3, axis=1)], axis=2)

    weights = ToneWeights(encoded[near].mean(axis=1), untouched_odds(chroma[near], beta), options.weighting)
    # The changes of the shots' log gains, sample by sample, that RAW and JPEG tell, as columns (n, q). One gain for all
    # shots of a white balance is a part of its Tz; gains that go with the light of the shots are hardly told from a
    # power of f, and shutters do not err so.
    _, of_shot, index = np.unique(samples.shot, return_index=True, return_inverse=True)
    light = np.bincount(index, np.log(np.maximum(raw.sum(axis=1), 100 * TINY))) / np.bincount(index)
    untold = np.vstack([np.unique(place)[:, None] == place[of_shot], light])
    changes = np.asarray(null_space(untold, rcond=TINY)[index])
    fit = JointFit(raw[near], encoded[near], weights, columns, changes[near], srgb_response())
    robust_fit(fit, emor_basis())  # as there: EMoR's shape first, then what it cannot follow
    robust_fit(fit, spline_basis(fit.response.inverse.mean(axis=1)))
    gain = np.exp(changes @ fit.logs)
    free = fit.coefficients[:, 2:].reshape(3, len(names) - 1, 3)
    matrices = {str(names[first]): matrix_of_rows(fit.coefficients[:, :2]) * multipliers}
    matrices |= {str(name): free[:, index] for index, name in enumerate(np.delete(names, first))}
    of_sample = np.array([matrices[str(name)] for name in names])[place]
    rendered = fit.response.encode(np.einsum("nij,nj->ni", of_sample, gain[:, None] * raw))
    error = float(np.median(np.linalg.norm(rendered - encoded, axis=1)[chroma < beta]))
    if error > WORST_ERROR:
        raise CalibrationError(
            f"no matrix takes the reference camera's RAW to these JPEGs (median error {255 * error:.0f} codes): "
            "were both taken of the same scene, in the same order, in manual mode?"
        )
    return _StyleFit(fit.response, matrices, gain, untouched_odds(chroma, beta))


def _inverse(linear: Array, samples: SampleSet, rows: Mask, name: str, preset: Preset) -> tuple[Array, Array]:
    """Tz⁻¹ (3, 3) of one white balance, f⁻¹(I) → E', and the precision (3, 3) of each of its rows.

    Colours count by their relative error, as E' departs by a share of itself; in (4.10) all alike. Raises
    CalibrationError where the colours do not determine it, or contradict every matrix.
    """
    x, y, chroma = linear[rows], samples.raw[rows], saturation(samples.srgb[rows])
    for beta in WIDER:
        plain = chroma < beta
        if plain.sum() >= LEAST_COLOURS and hue_spread(x[plain]) >= LEAST_CONDITION:
            break
    else:
        raise CalibrationError(
            f'white balance "{name}": {int(plain.sum())} unsaturated colours, and {LEAST_COLOURS} of several hues are '
            "needed: shoot a colour chart with both cameras"
        )
    robust = preset == "lutforge"
    odds = untouched_odds(chroma, beta) if robust else plain.astype(np.float64)
    level = np.linalg.norm(y, axis=1)
    level = np.maximum(level, DARK * np.percentile(level, 95))
    weight, outliers = odds, RobustWeights(cauchy, multiple=2.0, least=2e-4)
    for _ in range(10 if robust else 1):
        root = np.sqrt(weight) / level if robust else weight
        inverse = np.linalg.lstsq(x * root[:, None], y * root[:, None])[0].T
        error = np.linalg.norm(y - x @ inverse.T, axis=1) / level
        scale = outliers.scale(error[plain]) / 2.0
        weight = odds * outliers(error, error[plain])
    if scale > 0.5 or np.linalg.cond(inverse) > LARGEST_CONDITION or np.any(inverse.sum(axis=1) <= 0):
        raise CalibrationError(
            f'white balance "{name}": no matrix takes the reference camera\'s RAW to these JPEGs (they differ by '
            f"{100 * scale:.0f} %): were both taken of the same scene, in the same order, in manual mode?"
        )
    weighted = x * root[:, None] / scale
    return inverse, weighted.T @ weighted


def _jointly_diagonal(fits: Mapping[str, tuple[Array, Array]]) -> tuple[Array, Array, dict[str, Array]]:
    """Split the matrices of several white balances, Tz_i = Ts Tw_i Tc with diagonal Tw_i, into one Ts and one Tc.

    The way is that of a joint diagonalization: B. N. Flury & W. Gautschi (1986), https://doi.org/10.1137/0907013.
    Returns Tc with ones on its diagonal, Ts, and Tw (3,) by white balance, of Tz⁻¹ = Tc⁻¹ Tw⁻¹ Ts⁻¹ and its precision.

    The other six entries of Tc are expected to be 0 within a half, which settles what the white balances leave open.
    """
    inverses = np.stack([inverse for inverse, _ in fits.values()])
    roots = np.stack([np.linalg.cholesky(precision) for _, precision in fits.values()])
    off = ~np.eye(3, dtype=np.bool_)

    def parts(unknown: Array) -> tuple[Array, Array, Array]:
        transfer, from_linear = np.eye(3), np.eye(3)
        transfer[off] = unknown[:6]
        from_linear[off] = unknown[6:12]
        from_linear[np.diag_indices(3)] -= from_linear.sum(axis=1) - 1.0
        return transfer, from_linear, np.exp(unknown[12:].reshape(-1, 3))

    def residuals(unknown: Array) -> Array:
        transfer, from_linear, balances = parts(unknown)
        modelled = np.linalg.inv(transfer) @ (from_linear / balances[..., None])
        return np.concatenate([((modelled - inverses) @ roots).ravel(), unknown[:6] / 0.5])

    def linearize(unknown: Array, _: NDArray[np.intp]) -> tuple[Array, Array]:
        values = residuals(unknown[0])
        steps = STEP * np.eye(unknown.shape[1])
        slopes = [(residuals(unknown[0] + step) - residuals(unknown[0] - step)) / (2 * STEP) for step in steps]
        return values[None], np.stack(slopes, axis=1)[None]

    sums = inverses.sum(axis=2)
    first = inverses[0] / sums[0][:, None]
    start = np.concatenate([np.zeros(6), first[off], -np.log(sums).ravel()])
    transfer, from_linear, balances = parts(gauss_newton(linearize, start[None], most=200).value[0])
    return transfer, np.asarray(np.linalg.inv(from_linear), dtype=np.float64), dict(zip(fits, balances, strict=True))
