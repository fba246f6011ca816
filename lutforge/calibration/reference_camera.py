"""Cameras without RAW: a reference camera's RAW E' of the same scene replaces it (thesis 4.2.4, equations 4.9, 4.10).

I = f(h(Ts Tw Tc E')). One Tc, the same for all white balances, takes the reference's RAW to what the camera's own would
have been; of that the camera is calibrated like any other. Three steps of least squares find it, of colours that the
gamut map h leaves alone:

- f of each style and Tz_i = Ts Tw_i Tc of each white balance together, as f⁻¹(I) = Tz_i E' is linear in both;
- with f known, Tz_i⁻¹ of f⁻¹(I) to E' (4.10), in this direction because f⁻¹(I) is known to a code, while E' holds what
  one sensor distinguishes and the other does not, which would shrink the saturation of every Tz_i fitted to it;
- Tz_i⁻¹ = Tc⁻¹ Tw_i⁻¹ Ts⁻¹ with diagonal Tw_i, which two white balances and more determine (`joint_diagonalization`).
  What they leave open, all of Tc for a single one, makes no difference: Ts and h hold it.

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
from lutforge.calibration.joint_diagonalization import jointly_diagonal
from lutforge.calibration.matrix_and_response import (
    LEAST_HUE_SPREAD,
    LEAST_UNSATURATED,
    MOST_BETAS,
    JointFit,
    in_gamut_weight,
    matrix_of_rows,
    neutral_rows,
)
from lutforge.calibration.options import BETA, CURVES
from lutforge.calibration.robust_fit import ToneWeights, robust_fit
from lutforge.calibration.setting_gains import ROUNDED, SURE
from lutforge.calibration.white_balance import LEAST_POSITIVE, LEAST_RAW, estimated_multipliers, neutral_weight
from lutforge.colour.saturation import hue_spread, saturation
from lutforge.errors import CalibrationError
from lutforge.model.response import Response
from lutforge.samples.clipping import unclipped_colours
from lutforge.samples.sample_set import SampleSet
from lutforge.solvers.reweighted import reweighted
from lutforge.solvers.robust_weights import RobustWeights, cauchy, weighted_median

LEAST_MATCHED_COLOURS = 12
"""Colours that the matrix of a white balance needs at least."""
LEAST_MEDIAN_WEIGHT = 1e-9
"""Weight that every colour has at least, so that shots without near-neutral colours have a weighted median."""
RANK = 1e-6
"""Singular values below this share of the largest are 0."""
WORST_ERROR = 0.08
"""Median encoded error beyond which RAW and JPEG are not of one scene; the chart cameras have 0.002 … 0.03."""
BETAS = (BETA, 0.4, 0.5, 0.7)
"""Values of β that are tried in turn: on a small chart hardly any unsaturated colour is not grey."""
NOISY_SHARE = 0.05
"""Colours below this share of the bright ones hold noise."""
LARGEST_CONDITION, LARGEST_ERROR = 100, 0.5
"""Condition and relative error of Tz⁻¹ beyond which it is no matrix between two cameras."""
INVERSE_ROUNDS = 10
"""Rounds of reweighting of Tz⁻¹."""
INVERSE_OUTLIERS = RobustWeights(cauchy, multiple=2.0, least=2e-4)


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
    unclipped = unclipped_pairs(samples)
    setting = unclipped.settings
    values = linear_values(unclipped, setting, lambda style, of_style: _fit_style(style, of_style, beta, curves))

    with_gains = replace(unclipped, raw=values.gain[:, None] * unclipped.raw)
    names = [str(name) for name in np.unique(setting)]
    inverses = {name: _fit_inverse(values.linear, with_gains, setting == name, name) for name in names}
    transfer, matrix, balances = jointly_diagonal(inverses)

    multipliers = np.array([balances[str(name)] / balances[str(name)][1] for name in setting])
    gain, scale = gains_and_scale(unclipped, setting, values, transfer, matrix, multipliers)
    return transformed(unclipped, values, transfer, multipliers, gain, scale)


def unclipped_pairs(samples: SampleSet) -> SampleSet:
    """The samples that neither the JPEG nor the reference clips. Raises CalibrationError where they are too few."""
    unclipped = samples.select(unclipped_colours(samples.srgb, samples.raw))
    if len(unclipped) < LEAST_MATCHED_COLOURS:
        raise CalibrationError(
            f"{len(unclipped)} samples are unclipped in both the JPEG and the reference camera's RAW: expose less"
        )
    return unclipped


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
    """The factor of the RAW of each shot (n,), and the scale of f⁻¹ of each style (n,).

    level: (n,) log of f⁻¹(I) over Ts Tw Tc E'; weight: (n,). The level that the shots of a style have in common is the
    scale of its f⁻¹. A setting whose shots agree on a level of their own beyond the scatter (three standard errors)
    keeps it: there the camera multiplies by more than its white balance.
    """
    _, first_sample, shot = np.unique(samples.shot, return_index=True, return_inverse=True)
    level_of_shot = np.array(
        [
            weighted_median(level[shot == place], weight[shot == place] + LEAST_MEDIAN_WEIGHT)
            for place in range(len(first_sample))
        ]
    )
    style_of_shot, setting_of_shot = samples.style[first_sample], setting[first_sample]
    scale = np.array([np.median(level_of_shot[style_of_shot == name]) for name in style_of_shot])

    remaining = level_of_shot - scale
    level_of_setting = np.array([np.median(remaining[setting_of_shot == name]) for name in setting_of_shot])
    shots_of_setting = np.array([np.count_nonzero(setting_of_shot == name) for name in setting_of_shot])
    has_several = shots_of_setting > 1
    scatter = float(np.std(remaining - level_of_setting if np.any(has_several) else remaining))
    doubt = SURE * scatter / np.sqrt(shots_of_setting)
    own_level = np.where((np.abs(level_of_setting) > doubt) & has_several, level_of_setting, 0.0)
    return np.exp(remaining - own_level)[shot], np.exp(scale)[shot]


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
    raw, encoded, chroma = samples.raw, samples.srgb, saturation(samples.srgb)
    names, place = np.unique(setting, return_inverse=True)

    # β takes in as many colours as a response needs; far more saturated ones do not count.
    beta = max(beta, float(np.partition(chroma, LEAST_UNSATURATED - 1)[LEAST_UNSATURATED - 1]))
    counts = chroma < MOST_BETAS * beta
    weights = ToneWeights(encoded[counts].mean(axis=1), in_gamut_weight(chroma[counts], beta))
    columns = _MatrixColumns.of(samples, place, counts)
    changes = _changes_of_gains(samples, place)

    # EMoR's shape first, then a spline for what EMoR cannot follow, as in `fit_matrix_and_response`.
    fit = JointFit(raw[counts], encoded[counts], weights, columns, changes[counts], srgb_response())
    robust_fit(fit, emor_basis(curves))
    robust_fit(fit, spline_basis(fit.response.inverse.mean(axis=1)))

    gain = np.exp(changes @ fit.logs)
    matrices = columns.matrices(fit.coefficients)
    rendered = fit.response.encode(np.einsum("nij,nj->ni", matrices[place], gain[:, None] * raw))
    error = float(np.median(np.linalg.norm(rendered - encoded, axis=1)[chroma < beta]))
    if error > WORST_ERROR:
        raise CalibrationError(
            f"no matrix takes the reference camera's RAW to these JPEGs (median error {255 * error:.0f} codes): "
            "were both taken of the same scene, in the same order, in manual mode?"
        )
    by_name = {str(name): matrix for name, matrix in zip(names, matrices, strict=True)}
    return StyleFit(fit.response, by_name, gain, in_gamut_weight(chroma, beta))


@dataclass(frozen=True, eq=False)
class _MatrixColumns:
    """The columns of the matrices Tz of b settings, as `JointFit` takes them.

    The rows of Ts of one setting sum to 1, which settles the scale of f⁻¹: that with most colours near grey. All
    entries of the matrices of other settings are free. is_of: (n, b) 1 where a sample is of a setting, else 0; scaled:
    the place of the setting that settles the scale; multipliers: (3,), its estimated white balance.
    """

    is_of: Array
    scaled: int
    multipliers: Array

    @classmethod
    def of(cls, samples: SampleSet, place: NDArray[np.intp], counts: Mask) -> "_MatrixColumns":
        """The columns for the samples that count, a mask (n,). place: (n,) of the setting of each sample."""
        votes = np.bincount(place, neutral_weight(samples.raw, samples.srgb))
        scaled = int(np.argmax(votes))
        rows = place == scaled
        multipliers, _ = estimated_multipliers(samples.raw[rows], samples.srgb[rows])
        return cls(np.eye(len(votes))[place[counts]], scaled, multipliers)

    def __call__(self, x: Array) -> tuple[Array, Array]:
        """The light (n, 3) that known coefficients give of RAW (n, 3), and the columns (n, 3, q) of unknown ones."""
        known, of_scaled = neutral_rows(x * self.multipliers * self.is_of[:, self.scaled, None])
        is_of_others = np.delete(self.is_of, self.scaled, axis=1)
        of_others = (is_of_others[:, :, None] * x[:, None, :]).reshape(len(x), 1, -1)
        return known, np.concatenate([of_scaled, np.repeat(of_others, 3, axis=1)], axis=2)

    def matrices(self, coefficients: Array) -> Array:
        """The matrices (b, 3, 3) of fitted coefficients (3, q)."""
        of_scaled, of_others = coefficients[:, :2], coefficients[:, 2:]
        others = of_others.reshape(3, -1, 3).transpose(1, 0, 2)
        return np.insert(others, self.scaled, matrix_of_rows(of_scaled) * self.multipliers, axis=0)


def _changes_of_gains(samples: SampleSet, place: NDArray[np.intp]) -> Array:
    """The changes of the shots' log gains that RAW and JPEG determine, sample by sample, as columns (n, q).

    One gain for all shots of a setting is a part of its Tz; gains that go with the light of the shots are hardly
    distinguished from a power of f, and shutters do not err so. place: (n,) of the setting of each sample.
    """
    _, first_sample, shot = np.unique(samples.shot, return_index=True, return_inverse=True)
    logs = np.log(np.maximum(samples.raw.sum(axis=1), LEAST_RAW))
    light_of_shot = np.bincount(shot, logs) / np.bincount(shot)
    is_of_setting = np.unique(place)[:, None] == place[first_sample]
    undetermined = np.vstack([is_of_setting, light_of_shot])
    return np.asarray(null_space(undetermined, rcond=RANK)[shot])


def _fit_inverse(linear: Array, samples: SampleSet, rows: Mask, name: str) -> tuple[Array, Array]:
    """Tz⁻¹ (3, 3) of one white balance, f⁻¹(I) → E', and the precision (3, 3) of each of its rows.

    Colours count by their relative error, as E' deviates by a share of itself. Raises CalibrationError where the
    colours do not determine it, or contradict every matrix.
    """
    x, y, chroma = linear[rows], samples.raw[rows], saturation(samples.srgb[rows])
    unsaturated, beta = unsaturated_of_several_hues(x, chroma, name)
    in_gamut = in_gamut_weight(chroma, beta)
    level = level_of(y)

    def solve(weight: Array) -> tuple[Array, Array]:
        root = np.sqrt(weight) / level
        return np.asarray(np.linalg.lstsq(x * root[:, None], y * root[:, None])[0].T, dtype=np.float64), root

    def error_of(inverse: Array) -> Array:
        return np.asarray(np.linalg.norm(y - x @ inverse.T, axis=1) / level)

    def weights(fit: tuple[Array, Array]) -> Array:
        error = error_of(fit[0])
        return in_gamut * INVERSE_OUTLIERS(error, error[unsaturated])

    inverse, root = reweighted(solve, weights, in_gamut, rounds=INVERSE_ROUNDS)
    scale = INVERSE_OUTLIERS.scale(error_of(inverse)[unsaturated]) / INVERSE_OUTLIERS.multiple
    check_inverse(inverse, scale, name)
    weighted = x * root[:, None] / scale
    return inverse, weighted.T @ weighted


def unsaturated_of_several_hues(linear: Array, chroma: Array, name: str) -> tuple[Mask, float]:
    """The colours (n,) below the least saturation β by which they are enough, and that β. Raises CalibrationError."""
    for beta in BETAS:
        unsaturated = chroma < beta
        if unsaturated.sum() >= LEAST_MATCHED_COLOURS and hue_spread(linear[unsaturated]) >= LEAST_HUE_SPREAD:
            return unsaturated, beta
    raise CalibrationError(
        f'white balance "{name}": {int(unsaturated.sum())} unsaturated colours, and {LEAST_MATCHED_COLOURS} of several '
        "hues are needed: shoot a colour chart with both cameras"
    )


def level_of(raw: Array) -> Array:
    """The brightness (n,) of RAW (n, 3), at least a share of the bright ones: darker colours hold noise."""
    level = np.linalg.norm(raw, axis=1)
    return np.asarray(np.maximum(level, NOISY_SHARE * np.percentile(level, 95)))


def check_inverse(inverse: Array, scale: float, name: str) -> None:
    """Raise CalibrationError where Tz⁻¹ (3, 3) of a white balance is of no two cameras. scale: its relative error."""
    if scale > LARGEST_ERROR or np.linalg.cond(inverse) > LARGEST_CONDITION or np.any(inverse.sum(axis=1) <= 0):
        raise CalibrationError(
            f'white balance "{name}": no matrix takes the reference camera\'s RAW to these JPEGs (they differ by '
            f"{100 * scale:.0f} %): were both taken of the same scene, in the same order, in manual mode?"
        )
