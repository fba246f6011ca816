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
from lutforge.calibration.options import PhysicalOptions, Preset
from lutforge.calibration.physical.curve_basis import emor_basis, spline_basis
from lutforge.calibration.physical.joint_diagonal import jointly_diagonal
from lutforge.calibration.physical.matrix import LEAST_CONDITION, hue_spread
from lutforge.calibration.physical.matrix_and_response import RobustFitOptions, Tones, encoding_slope, fit_channel
from lutforge.calibration.physical.physical_model import response_of_exposures
from lutforge.calibration.physical.plain_curves import srgb_response
from lutforge.calibration.physical.unsaturated import BETA, LEAST_UNSATURATED, saturation, untouched_odds
from lutforge.calibration.physical.white_balance import estimated_multipliers, neutral_weight
from lutforge.errors import CalibrationError
from lutforge.model.response import Response
from lutforge.samples.clipping import unclipped_colours
from lutforge.samples.sample_set import SampleSet
from lutforge.solvers.robust_weights import RobustWeights, cauchy, weighted_median

LEAST_COLOURS = 12


@dataclass(frozen=True, eq=False)
class OwnRaw:
    """Samples whose RAW is the camera's own, as far as a reference camera tells it.

    samples: those that neither the JPEG nor the reference's RAW clips, with the multipliers of the camera; transfer: Tc
    (3, 3), the reference's RAW → the camera's.
    """

    samples: SampleSet
    transfer: Array


def own_raw(samples: SampleSet, preset: Preset = "lutforge", physical: PhysicalOptions | None = None) -> OwnRaw:
    """Carry a reference camera's RAW to the camera that was sampled with it.

    RAW is scaled so that balanced RAW of 1 is what the JPEG's brightest code stands for. Raises CalibrationError, in
    one line with what to shoot, where the samples do not determine f or Tz of a white balance, or contradict every one.
    """
    inside = samples.select(unclipped_colours(samples.srgb, samples.raw))
    if len(inside) < LEAST_COLOURS:
        raise CalibrationError(
            f"{len(inside)} samples are unclipped in both the JPEG and the reference camera's RAW: expose less"
        )
    automatic = np.char.add("auto of ", inside.shot)
    setting = np.where(inside.white_balance == "auto", automatic, inside.white_balance)
    linear, trust, white, gain = _linear_light(inside, setting, preset, physical or PhysicalOptions())
    even = replace(inside, raw=gain[:, None] * inside.raw)
    transfer, matrix, balances = jointly_diagonal(
        {str(name): _inverse(linear, even, setting == name, str(name), preset) for name in np.unique(setting)}
    )
    multipliers = np.array([balances[str(name)] / balances[str(name)][1] for name in setting])
    balanced = inside.raw @ transfer.T * multipliers
    level = np.log(np.maximum(linear.sum(axis=1), 1e-6) / np.maximum((balanced @ matrix.T).sum(axis=1), 1e-6))
    shots, scale = _gains(inside, setting, level, trust * (inside.srgb.max(axis=1) > 0.2))
    gain = gain if preset == "thesis" else shots
    top = np.quantile((gain[:, None] * balanced)[trust > 0.5], 0.999)
    transfer = transfer / max(float(top), float(np.max(white / scale)))
    raw = gain[:, None] * inside.raw @ transfer.T
    carried = replace(inside, raw=raw, wb=multipliers, raw_camera=inside.camera.copy())
    return OwnRaw(carried, transfer)


def _gains(samples: SampleSet, setting: NDArray[np.str_], level: Array, weight: Array) -> tuple[Array, Array]:
    """What the RAW of each shot (n,) is multiplied by, and the scale of f⁻¹ of each style (n,).

    level: (n,) log of f⁻¹(I) over Ts Tw Tc E'; weight: (n,). The shots of a style tell the scale of its f⁻¹. A setting
    whose shots agree on a level of their own beyond the scatter (three standard errors) keeps it: there the camera
    multiplies by more than its white balance.
    """
    _, first, shot = np.unique(samples.shot, return_index=True, return_inverse=True)
    of_shot = np.array([weighted_median(level[shot == k], weight[shot == k] + 1e-9) for k in range(len(first))])
    style, balance = samples.style[first], setting[first]
    scale = np.array([np.median(of_shot[style == name]) for name in style])
    rest = of_shot - scale
    own = np.array([np.median(rest[balance == name]) for name in balance])
    count = np.array([np.count_nonzero(balance == name) for name in balance])
    doubt = 3.0 * float(np.std(rest - own if np.any(count > 1) else rest)) / np.sqrt(count)
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
                fit = _response_of_exposures(samples.select(rows), setting[rows], physical)
            else:
                fit = _fit_response(samples.select(rows), setting[rows], RobustFitOptions(physical))
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


def _fit_response(samples: SampleSet, setting: NDArray[np.str_], options: RobustFitOptions) -> _StyleFit:
    """Fit f, every Tz and the shots' gains of a style in robust rounds, as `fit_matrix_and_response` does f and Ts.

    A round fits the relative change of the gains, in which f⁻¹(I) = Tz E' (1 + change) is linear. Were they fitted
    after f, f would bend where the shots of some tones are all too bright, and leave a part of that to them.
    """
    raw, encoded = samples.raw, samples.srgb
    names, place = np.unique(setting, return_inverse=True)
    votes = np.bincount(place, neutral_weight(raw, encoded))
    first = int(np.argmax(votes))
    multipliers, _ = estimated_multipliers(raw[place == first], encoded[place == first])
    chroma = saturation(encoded)
    beta = max(options.physical.beta, float(np.partition(chroma, LEAST_UNSATURATED - 1)[LEAST_UNSATURATED - 1]))
    near = chroma < options.reach * beta
    mixed = [_columns(raw[near], place[near], first, multipliers, channel) for channel in range(3)]
    changes = _gain_changes(raw, place, samples.shot)
    gain, predicted, free = np.ones(len(raw)), np.zeros((near.sum(), 3)), changes.shape[1]
    tones = Tones(encoded[near].mean(axis=1), untouched_odds(chroma[near], beta), options)
    weight, response = tones.prior, srgb_response()
    for spline in (False, True):  # as there: EMoR's shape first, then what it cannot follow
        basis = spline_basis(response.inverse.mean(axis=1)) if spline else emor_basis()
        for _ in range(options.most_rounds):
            slope = encoding_slope(response, encoded[near])
            terms = [
                np.column_stack([predicted[:, [c]] * changes[near], gain[near, None] * mixed[c]]) for c in range(3)
            ]
            fits = [fit_channel(terms[c], encoded[near, c], weight * slope[:, c] ** 2, basis) for c in range(3)]
            response = Response(np.stack([table for table, _ in fits], axis=1))
            shares = [m[free:] for _, m in fits]
            change = changes @ np.mean([m[:free] for _, m in fits], axis=0)
            gain *= np.exp(np.clip(change, -0.5, 0.5))  # a first step may be far too long
            light = np.stack([x[:, -1] + x[:, :-1] @ m for x, m in zip(mixed, shares, strict=True)], axis=1)
            predicted = gain[near, None] * light
            before, weight = weight, tones.weights(np.linalg.norm(response.encode(predicted) - encoded[near], axis=1))
            if np.abs(weight - before).sum() < options.settled * weight.sum():
                break
    matrices = {str(name): np.zeros((3, 3)) for name in names}
    for channel, m in enumerate(shares):
        others = [c for c in range(3) if c != channel]
        own = matrices[str(names[first])][channel]
        own[others], own[channel] = m[:2], 1.0 - m[:2].sum()
        own *= multipliers
        for index, balance in enumerate(np.delete(names, first)):
            matrices[str(balance)][channel] = m[2 + 3 * index : 5 + 3 * index]
    of_sample = np.array([matrices[str(name)] for name in names])[place]
    _check(response, of_sample, gain[:, None] * raw, encoded, chroma < beta)
    return _StyleFit(response, matrices, gain, untouched_odds(chroma, beta))


def _response_of_exposures(samples: SampleSet, setting: NDArray[np.str_], physical: PhysicalOptions) -> _StyleFit:
    """Take f of a style from its exposure pairs (4.2.1), and Tz of the colours below β by plain least squares."""
    response = response_of_exposures(samples, "thesis", physical)
    low = saturation(samples.srgb) < physical.beta
    linear = response.linearize(samples.srgb)
    matrices = {
        str(name): np.linalg.lstsq(samples.raw[rows], linear[rows])[0].T
        for name in np.unique(setting)
        for rows in [low & (setting == name)]
    }
    return _StyleFit(response, matrices, np.ones(len(samples)), low.astype(np.float64))


def _gain_changes(raw: Array, place: NDArray[np.intp], shot: NDArray[np.str_]) -> Array:
    """The changes of the shots' log gains, sample by sample, that RAW and JPEG tell, as columns (n, q).

    One gain for all shots of a white balance is a part of its Tz; gains that go with the light of the shots are hardly
    told from a power of f, and shutters do not err so.
    """
    _, first, index = np.unique(shot, return_index=True, return_inverse=True)
    light = np.bincount(index, np.log(np.maximum(raw.sum(axis=1), 1e-4))) / np.bincount(index)
    untold = np.vstack([np.unique(place)[:, None] == place[first], light])
    return np.asarray(null_space(untold, rcond=1e-6)[index])


def _columns(raw: Array, place: NDArray[np.intp], first: int, multipliers: Array, channel: int) -> Array:
    """The terms (n, 3 settings) of a channel of Tz E', the last one with coefficient 1.

    The rows of Ts of the first setting sum to 1, which settles the scale; the coefficients of all others are free.
    """
    balanced = np.where((place == first)[:, None], raw * multipliers, 0.0)
    own = balanced[:, channel]
    terms = [balanced[:, c] - own for c in range(3) if c != channel]
    for other in range(place.max() + 1):
        if other != first:
            terms += list(np.where((place == other)[:, None], raw, 0.0).T)
    return np.column_stack([*terms, own])


def _check(response: Response, matrices: Array, raw: Array, encoded: Array, plain: Mask) -> None:
    """Raise CalibrationError where f and Tz (n, 3, 3), sample by sample, do not explain the unsaturated colours."""
    rendered = response.encode(np.einsum("nij,nj->ni", matrices, raw))
    error = float(np.median(np.linalg.norm(rendered - encoded, axis=1)[plain]))
    if error > 0.08:  # the chart cameras have 0.002 … 0.03
        raise CalibrationError(
            f"no matrix takes the reference camera's RAW to these JPEGs (median error {255 * error:.0f} codes): "
            "were both taken of the same scene, in the same order, in manual mode?"
        )


def _inverse(linear: Array, samples: SampleSet, rows: Mask, name: str, preset: Preset) -> tuple[Array, Array]:
    """Tz⁻¹ (3, 3) of one white balance, f⁻¹(I) → E', and the precision (3, 3) of each of its rows.

    Colours count by their relative error, as E' departs by a share of itself; in (4.10) all alike. Raises
    CalibrationError where the colours do not determine it, or contradict every matrix.
    """
    x, y, chroma = linear[rows], samples.raw[rows], saturation(samples.srgb[rows])
    for beta in (BETA, 0.4, 0.5, 0.7):  # on a small chart hardly any unsaturated colour is not grey
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
    level = np.maximum(level, 0.05 * np.quantile(level, 0.95))  # darker ones hold noise
    weight, outliers = odds, RobustWeights(cauchy, multiple=2.0, least=2e-4)
    for _ in range(10 if robust else 1):
        root = np.sqrt(weight) / level if robust else weight
        inverse = np.linalg.lstsq(x * root[:, None], y * root[:, None])[0].T
        error = np.linalg.norm(y - x @ inverse.T, axis=1) / level
        scale = outliers.scale(error[plain]) / 2.0
        weight = odds * outliers(error, error[plain])
    if scale > 0.5 or np.linalg.cond(inverse) > 100.0 or np.any(inverse.sum(axis=1) <= 0):
        raise CalibrationError(
            f'white balance "{name}": no matrix takes the reference camera\'s RAW to these JPEGs (they differ by '
            f"{100 * scale:.0f} %): were both taken of the same scene, in the same order, in manual mode?"
        )
    weighted = x * root[:, None] / scale
    return inverse, weighted.T @ weighted
