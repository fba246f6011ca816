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
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import null_space

from lutforge.arrays import Array, Mask
from lutforge.calibration.curve_basis import emor_basis, spline_basis, srgb_response
from lutforge.calibration.matrix_and_response import (
    LEAST_HUE_SPREAD,
    LEAST_UNSATURATED,
    MOST_BETAS,
    JointFit,
    hue_spread,
    in_gamut_weight,
    matrix_of_rows,
    neutral_rows,
    saturation,
)
from lutforge.calibration.options import BETA, CURVES
from lutforge.calibration.robust_fit import ToneWeights, robust_fit
from lutforge.calibration.white_balance import LEAST_POSITIVE, LEAST_RAW, ROUNDED, estimated_multipliers, neutral_weight
from lutforge.errors import CalibrationError
from lutforge.model.response import Response
from lutforge.samples.clipping import unclipped_colours
from lutforge.samples.sample_set import SampleSet
from lutforge.solvers.gauss_newton import gauss_newton
from lutforge.solvers.reweighted import reweighted
from lutforge.solvers.robust_weights import RobustWeights, cauchy, weighted_median

LEAST_MATCHED_COLOURS = 12
LEAST_WEIGHT = 1e-9
"""Weight that every colour has at least, so that shots without near-neutral colours have a weighted median."""
RANK = 1e-6
"""Singular values below this share of the largest are 0."""
WORST_ERROR = 0.08
"""Median encoded error beyond which RAW and JPEG are not of one scene; the chart cameras have 0.002 … 0.03."""
WIDER = (BETA, 0.4, 0.5, 0.7)
"""Values of β that are tried in turn: on a small chart hardly any unsaturated colour is not grey."""
NOISY_SHARE = 0.05
"""Colours below this share of the bright ones hold noise."""
LARGEST_CONDITION = 100
DERIVATIVE_STEP = 1e-6
"""Step of a numerical derivative."""


@dataclass(frozen=True, eq=False)
class StyleFit:
    """A style's response f, its matrices Tz (3, 3) by white balance, gains of its shots (n,), in-gamut weights (n,)."""

    response: Response
    matrices: Mapping[str, Array]
    gain: Array
    in_gamut: Array


@dataclass(frozen=True, eq=False)
class LinearValues:
    """f⁻¹(I) (n, 3) of samples of all styles, on about one scale; in-gamut weights, f⁻¹(1) and gains, each (n,)."""

    linear: Array
    in_gamut: Array
    white: Array
    gain: Array


def own_raw(samples: SampleSet, beta: float = BETA, curves: int = CURVES) -> tuple[SampleSet, Array]:
    """Transform a reference camera's RAW to that of the camera that was sampled with it: the samples, and Tc (3, 3).

    Those stay that neither the JPEG nor the reference clips, with the multipliers of the camera. RAW is scaled so that
    balanced RAW of 1 is what the JPEG's brightest code stands for. beta: saturation below which a colour surely counts;
    curves: number of EMoR curves of f⁻¹. Raises CalibrationError, in one line with what to shoot, where the samples do
    not determine f or Tz of a white balance, or contradict every one.
    """
    inside = unclipped_pairs(samples)
    setting = inside.settings
    values = linear_values(inside, setting, lambda style, of: _fit_style(style, of, beta, curves))
    even = replace(inside, raw=values.gain[:, None] * inside.raw)
    inverses = {str(name): _inverse(values.linear, even, setting == name, str(name)) for name in np.unique(setting)}
    transfer, matrix, balances = jointly_diagonal(inverses)
    multipliers = np.array([balances[str(name)] / balances[str(name)][1] for name in setting])
    gain, scale = gains_and_scale(inside, setting, values, transfer, matrix, multipliers)
    return transformed(inside, values, transfer, multipliers, gain, scale)


def unclipped_pairs(samples: SampleSet) -> SampleSet:
    """The samples that neither the JPEG nor the reference clips. Raises CalibrationError where they are too few."""
    inside = samples.select(unclipped_colours(samples.srgb, samples.raw))
    if len(inside) < LEAST_MATCHED_COLOURS:
        raise CalibrationError(
            f"{len(inside)} samples are unclipped in both the JPEG and the reference camera's RAW: expose less"
        )
    return inside


def transformed(
    samples: SampleSet, values: LinearValues, transfer: Array, multipliers: Array, gain: Array, scale: Array
) -> tuple[SampleSet, Array]:
    """The samples with the camera's own RAW, and Tc (3, 3), scaled so that balanced RAW of 1 is the brightest code.

    transfer: Tc up to a factor; multipliers: (n, 3); gain: of the RAW (n,); scale: of each sample's f⁻¹ (n,).
    """
    exposed = gain[:, None] * samples.raw
    top = np.quantile((exposed @ transfer.T * multipliers)[values.in_gamut > 0.5], 0.999)
    transfer = transfer / max(float(top), float(np.max(values.white / scale)))
    with_camera_raw = replace(samples, raw=exposed @ transfer.T, wb=multipliers, raw_camera=samples.camera.copy())
    return with_camera_raw, transfer


def gains_and_scale(
    samples: SampleSet,
    setting: NDArray[np.str_],
    values: LinearValues,
    transfer: Array,
    matrix: Array,
    multipliers: Array,
) -> tuple[Array, Array]:
    """The gain of each shot's RAW (n,), and the scale of f⁻¹ of each style (n,), by the levels that are left."""
    balanced = samples.raw @ transfer.T * multipliers
    rendered = np.maximum((balanced @ matrix.T).sum(axis=1), LEAST_POSITIVE)
    level = np.log(np.maximum(values.linear.sum(axis=1), LEAST_POSITIVE) / rendered)
    return _gains(samples, setting, level, values.in_gamut * (samples.srgb.max(axis=1) > ROUNDED))


def _gains(samples: SampleSet, setting: NDArray[np.str_], level: Array, weight: Array) -> tuple[Array, Array]:
    """What the RAW of each shot (n,) is multiplied by, and the scale of f⁻¹ of each style (n,).

    level: (n,) log of f⁻¹(I) over Ts Tw Tc E'; weight: (n,). The shots of a style tell the scale of its f⁻¹. A setting
    whose shots agree on a level of their own beyond the scatter (three standard errors) keeps it: there the camera
    multiplies by more than its white balance.
    """
    _, first, shot = np.unique(samples.shot, return_index=True, return_inverse=True)
    of_shot = np.array([weighted_median(level[shot == k], weight[shot == k] + LEAST_WEIGHT) for k in range(len(first))])
    style, balance = samples.style[first], setting[first]
    scale = np.array([np.median(of_shot[style == name]) for name in style])
    remaining = of_shot - scale
    of_setting = np.array([np.median(remaining[balance == name]) for name in balance])
    count = np.array([np.count_nonzero(balance == name) for name in balance])
    doubt = 3 * float(np.std(remaining - of_setting if np.any(count > 1) else remaining)) / np.sqrt(count)
    kept = np.where((np.abs(of_setting) > doubt) & (count > 1), of_setting, 0.0)
    return np.exp(remaining - kept)[shot], np.exp(scale)[shot]


def linear_values(
    samples: SampleSet,
    setting: NDArray[np.str_],
    fit_style: Callable[[SampleSet, NDArray[np.str_]], StyleFit],
) -> LinearValues:
    """Fit every style by itself, and bring f⁻¹(I) of all to one scale. Raises CalibrationError, naming the style.

    fit_style: of a style's samples and their settings (m,), its fit.
    """
    linear = np.zeros_like(samples.raw)
    in_gamut, white, gain = np.zeros((3, len(samples)))
    names, counts = np.unique(samples.style, return_counts=True)
    anchors: dict[str, Array] = {}
    for name in names[np.argsort(-counts)]:
        rows = samples.style == name
        try:
            fit = fit_style(samples.select(rows), setting[rows])
        except CalibrationError as error:
            raise CalibrationError(f'style "{name}": {error}') from None
        common = [balance for balance in fit.matrices if balance in anchors]
        sums = [float(np.sum(anchors[balance]) / np.sum(fit.matrices[balance])) for balance in common]
        scale = float(np.median(sums)) if sums else 1.0
        for balance, matrix in fit.matrices.items():
            anchors.setdefault(balance, scale * matrix)
        linear[rows] = scale * fit.response.linearize(samples.srgb[rows])
        in_gamut[rows] = fit.in_gamut
        gain[rows] = fit.gain
        white[rows] = scale * float(fit.response.inverse[-1].max())
    return LinearValues(linear, in_gamut, white, gain)


def _fit_style(samples: SampleSet, setting: NDArray[np.str_], beta: float, curves: int) -> StyleFit:
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
    beta = max(beta, float(np.partition(chroma, LEAST_UNSATURATED - 1)[LEAST_UNSATURATED - 1]))
    near = chroma < MOST_BETAS * beta
    is_of = np.eye(len(names))[place]
    is_of_other = np.delete(is_of, first, axis=1)

    def columns(x: Array) -> tuple[Array, Array]:
        # The rows of Ts of the first setting sum to 1, which settles the scale; the coefficients of all others are free
        known, of_first = neutral_rows(x * multipliers * is_of[near, first, None])
        free = (is_of_other[near, :, None] * x[:, None, :]).reshape(len(x), 1, -1)
        return known, np.concatenate([of_first, np.repeat(free, 3, axis=1)], axis=2)

    weights = ToneWeights(encoded[near].mean(axis=1), in_gamut_weight(chroma[near], beta))
    # The changes of the shots' log gains, sample by sample, that RAW and JPEG tell, as columns (n, q). One gain for all
    # shots of a white balance is a part of its Tz; gains that go with the light of the shots are hardly told from a
    # power of f, and shutters do not err so.
    _, of_shot, index = np.unique(samples.shot, return_index=True, return_inverse=True)
    light = np.bincount(index, np.log(np.maximum(raw.sum(axis=1), LEAST_RAW))) / np.bincount(index)
    untold = np.vstack([np.unique(place)[:, None] == place[of_shot], light])
    changes = np.asarray(null_space(untold, rcond=RANK)[index])
    fit = JointFit(raw[near], encoded[near], weights, columns, changes[near], srgb_response())
    robust_fit(fit, emor_basis(curves))  # as there: EMoR's shape first, then what it cannot follow
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
    return StyleFit(fit.response, matrices, gain, in_gamut_weight(chroma, beta))


def _inverse(linear: Array, samples: SampleSet, rows: Mask, name: str) -> tuple[Array, Array]:
    """Tz⁻¹ (3, 3) of one white balance, f⁻¹(I) → E', and the precision (3, 3) of each of its rows.

    Colours count by their relative error, as E' deviates by a share of itself. Raises CalibrationError where the
    colours do not determine it, or contradict every matrix.
    """
    x, y, chroma = linear[rows], samples.raw[rows], saturation(samples.srgb[rows])
    plain, beta = unsaturated_of_several_hues(x, chroma, name)
    in_gamut = in_gamut_weight(chroma, beta)
    level = level_of(y)
    outliers = RobustWeights(cauchy, multiple=2.0, least=2e-4)

    def solve(weight: Array) -> tuple[Array, Array]:
        root = np.sqrt(weight) / level
        return np.asarray(np.linalg.lstsq(x * root[:, None], y * root[:, None])[0].T, dtype=np.float64), root

    def error_of(inverse: Array) -> Array:
        return np.asarray(np.linalg.norm(y - x @ inverse.T, axis=1) / level)

    def weights(fit: tuple[Array, Array]) -> Array:
        error = error_of(fit[0])
        return in_gamut * outliers(error, error[plain])

    inverse, root = reweighted(solve, weights, in_gamut, rounds=10)
    scale = outliers.scale(error_of(inverse)[plain]) / 2.0
    check_inverse(inverse, scale, name)
    weighted = x * root[:, None] / scale
    return inverse, weighted.T @ weighted


def unsaturated_of_several_hues(linear: Array, chroma: Array, name: str) -> tuple[Mask, float]:
    """The colours (n,) below the least saturation β by which they are enough, and that β. Raises CalibrationError."""
    for beta in WIDER:
        plain = chroma < beta
        if plain.sum() >= LEAST_MATCHED_COLOURS and hue_spread(linear[plain]) >= LEAST_HUE_SPREAD:
            return plain, beta
    raise CalibrationError(
        f'white balance "{name}": {int(plain.sum())} unsaturated colours, and {LEAST_MATCHED_COLOURS} of several hues '
        "are needed: shoot a colour chart with both cameras"
    )


def level_of(raw: Array) -> Array:
    """The brightness (n,) of RAW (n, 3), at least a share of the bright ones: darker colours hold noise."""
    level = np.linalg.norm(raw, axis=1)
    return np.asarray(np.maximum(level, NOISY_SHARE * np.percentile(level, 95)))


def check_inverse(inverse: Array, scale: float, name: str) -> None:
    """Raise CalibrationError where Tz⁻¹ (3, 3) of a white balance is of no two cameras. scale: its relative error."""
    if scale > 0.5 or np.linalg.cond(inverse) > LARGEST_CONDITION or np.any(inverse.sum(axis=1) <= 0):
        raise CalibrationError(
            f'white balance "{name}": no matrix takes the reference camera\'s RAW to these JPEGs (they differ by '
            f"{100 * scale:.0f} %): were both taken of the same scene, in the same order, in manual mode?"
        )


def jointly_diagonal(fits: Mapping[str, tuple[Array, Array]]) -> tuple[Array, Array, dict[str, Array]]:
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
        steps = DERIVATIVE_STEP * np.eye(unknown.shape[1])
        slopes = [
            (residuals(unknown[0] + step) - residuals(unknown[0] - step)) / (2 * DERIVATIVE_STEP) for step in steps
        ]
        return values[None], np.stack(slopes, axis=1)[None]

    sums = inverses.sum(axis=2)
    first = inverses[0] / sums[0][:, None]
    start = np.concatenate([np.zeros(6), first[off], -np.log(sums).ravel()])
    transfer, from_linear, balances = parts(gauss_newton(linearize, start[None], most=200).value[0])
    return transfer, np.asarray(np.linalg.inv(from_linear), dtype=np.float64), dict(zip(fits, balances, strict=True))
