"""The thesis's camera model I = f(h(Ts Tw E)), stage by stage: f, then Ts and Tw, then h and h⁻¹ (thesis 4.2).

Ts and Tw are fitted together by least squares (4.2.2, equation 4.5),

    minimize Σ_i Σ_j ‖Ts⁻¹ X_ij − Tw_i E_ij‖²,  X = f⁻¹(I), on colours that the gamut map leaves alone.

Where the files state the multipliers of a setting its Tw is known; one unknown setting is fixed to I, which leaves the
problem linear.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lutforge.arrays import Array, Mask
from lutforge.calibration.curve_basis import log_emor_basis
from lutforge.calibration.matrix_and_response import (
    LEAST_HUE_SPREAD,
    LEAST_UNSATURATED,
    plainly_unsaturated,
)
from lutforge.calibration.pairs_of_samples import pairs_of_samples
from lutforge.calibration.response_from_exposures import fit_response_by_least_squares
from lutforge.colour.saturation import hue_spread
from lutforge.errors import CalibrationError
from lutforge.model.profile import CameraModel
from lutforge.model.response import Response
from lutforge.samples.sample_set import SampleSet
from lutforge.thesis.gamut_map import fit_gamut_map
from lutforge.thesis.options import ThesisOptions

KNOWN = "\t"
"""The setting of colours whose multipliers are known: no setting's name."""
MOST_TURNS = 15
"""The largest number of turns in which responses and unknown multipliers are fitted by each other."""
SETTLED_MULTIPLIERS = 5e-4
"""Multipliers are settled when they change by less than this share."""


@dataclass(frozen=True, eq=False)
class CameraStages:
    """The stages before the gamut maps. matrix: Ts (3, 3), one for all styles; responses: f by style.

    multipliers: Tw (n, 3) of the samples given, fitted where they were not known.
    """

    matrix: Array
    multipliers: Array
    responses: Mapping[str, Response]


def fit_stages(
    samples: SampleSet, multipliers: Array, known: Mask, options: ThesisOptions | None = None
) -> CameraStages:
    """Fit f of every style, Ts and the unknown Tw to unclipped samples of one camera.

    multipliers: (n, 3), good guesses where known (n,) is False. f comes from exposure pairs, and Ts and Tw from all
    colours below the saturation β. Raises CalibrationError, in one line with what to shoot, where a stage is not
    determined.
    """
    options = options or ThesisOptions()
    names = [str(name) for name in np.unique(samples.style)]
    # Known settings are applied sample by sample (a camera may change them from shot to shot): they become one.
    setting = np.where(known, KNOWN, samples.settings)
    responses: dict[str, Response] = {}
    settled = bool(known.all())

    for turn in range(MOST_TURNS):
        linear = np.zeros_like(samples.raw)
        unsaturated = np.zeros(len(samples), dtype=np.bool_)
        for name in names:
            rows = samples.style == name
            responses[name], unsaturated[rows] = _fit_style(samples.select(rows), multipliers[rows], name, options)
            linear[rows] = responses[name].linearize(samples.srgb[rows])
        balanced = np.where(known[:, None], samples.raw * multipliers, samples.raw)
        neutral = _neutral(samples, responses, unsaturated)
        matrix, fitted = fit_matrix(linear, balanced, setting, unsaturated=unsaturated, neutral=neutral)
        if settled or turn == MOST_TURNS - 1:
            break

        last_multipliers = multipliers
        multipliers = multipliers.copy()
        for key in np.unique(setting[~known]):
            rows = setting == key
            multipliers[rows] = fitted[str(key)] * multipliers[rows, 1:2]
        settled = bool(np.max(np.abs(multipliers / last_multipliers - 1.0)) < SETTLED_MULTIPLIERS)
    return CameraStages(matrix, multipliers, responses)


def fit_matrix(
    linear: Array, raw: Array, setting: NDArray[np.str_], *, unsaturated: Mask, neutral: Array | None = None
) -> tuple[Array, dict[str, Array]]:
    """Solve (4.5): Ts (3, 3), for multipliers with green = 1, and the multipliers (3,) of the settings not known.

    linear: X = f⁻¹(I) (n, 3); raw: E (n, 3); setting: (n,) white-balance name, KNOWN where E is balanced already;
    unsaturated: (n,) the colours that the gamut map does not change; neutral: (3,) f⁻¹ of neutral JPEG values, up to a
    factor, None where the curves of the channels are equal.

    Without any known multipliers, a factor per channel may belong to Ts or to Tw. Neutral colours decide: what the
    camera renders neutral has equal RAW values after its white balance. Raises CalibrationError where the colours do
    not determine Ts.
    """
    names = [str(name) for name in np.unique(setting)]
    fixed = KNOWN if KNOWN in names else names[0]
    free = [name for name in names if name != fixed]
    _check(linear, unsaturated)
    inverse, solved = _solve(linear, raw, setting, free, unsaturated)

    solved[fixed] = np.ones(3)
    if fixed != KNOWN:  # R of (4.6): neutral stays neutral
        white = inverse @ (np.ones(3) if neutral is None else neutral)
        if np.min(white) <= 0:
            raise CalibrationError(
                "the unsaturated colours give no white balance: add a shot of a grey or colour chart"
            )
        inverse = inverse / white[:, None]
        solved = {name: value / white for name, value in solved.items()}
    middle = float(np.median([value[1] for value in solved.values()]))
    matrix = np.asarray(np.linalg.inv(inverse / middle), dtype=np.float64)
    return matrix, {name: value / value[1] for name, value in solved.items()}


def _check(linear: Array, unsaturated: Mask) -> None:
    """Raise CalibrationError where the colours are too few, or of too few hues, to determine Ts."""
    count = int(unsaturated.sum())
    if count < LEAST_UNSATURATED:
        raise CalibrationError(
            f"{count} unsaturated colours; the matrix needs {LEAST_UNSATURATED}: shoot a colour chart, not clipped"
        )
    if hue_spread(linear[unsaturated]) < LEAST_HUE_SPREAD:
        raise CalibrationError(
            "the unsaturated colours are all one hue or grey and cannot determine the matrix: shoot a colour chart"
        )


def _solve(
    linear: Array, raw: Array, setting: NDArray[np.str_], free: list[str], unsaturated: Mask
) -> tuple[Array, dict[str, Array]]:
    """Solve a channel at a time: row · X − tw_i E = E of fixed settings. Unknown: 3, and one for each free setting."""
    is_free = setting[:, None] == np.array(free, dtype=np.str_)
    answers = []
    for channel in range(3):
        design = np.hstack([linear, np.where(is_free, -raw[:, [channel]], 0.0)])
        target = np.where(is_free.any(axis=1), 0.0, raw[:, channel])
        answer, _, rank, _ = np.linalg.lstsq(design[unsaturated], target[unsaturated], rcond=1e-10)
        if rank < design.shape[1]:
            raise CalibrationError(
                "the unsaturated colours do not determine the matrix and the white balances: "
                "shoot a colour chart under every white balance"
            )
        answers.append(answer)
    solution = np.array(answers)
    return solution[:, :3], dict(zip(free, solution[:, 3:].T, strict=True))


def _neutral(samples: SampleSet, responses: Mapping[str, Response], unsaturated: Mask) -> Array:
    """f⁻¹ of neutral JPEG values, (3,), relative to each other: the factors between the channels' curves.

    Bright colours decide: they determine a factor best, and curves that differ do so least near white.
    """
    products = np.zeros(3)
    for name, response in responses.items():
        rows = unsaturated & (samples.style == name)
        value = samples.srgb[rows].mean(axis=1, keepdims=True)
        linear = response.linearize(np.repeat(value, 3, axis=1))
        products += linear.mean(axis=1) ** 2 @ linear
    return np.asarray(products / products.mean())


def _fit_style(samples: SampleSet, multipliers: Array, name: str, options: ThesisOptions) -> tuple[Response, Mask]:
    """Fit f of a style before its gamut map; with the samples (n,) that the map leaves alone."""
    balanced = samples.raw * multipliers
    try:
        response = response_of_exposures(samples, options)
        for limit in (options.beta, 0.4, 0.5):  # where those below β are of one hue, as on a small chart
            unsaturated = plainly_unsaturated(samples.srgb, limit)
            if hue_spread(response.linearize(samples.srgb[unsaturated])) >= LEAST_HUE_SPREAD:
                break
        return _scaled_to_raw(response, balanced[unsaturated], samples.srgb[unsaturated]), unsaturated
    except CalibrationError as error:
        raise CalibrationError(f'style "{name}": {error}') from None


def response_of_exposures(samples: SampleSet, options: ThesisOptions) -> Response:
    """f of one style from its exposure pairs, without those that the options leave out. Raises CalibrationError."""
    try:
        pairs = pairs_of_samples(samples).without(options.without_pairs)
    except CalibrationError as error:
        raise CalibrationError(f"{error}, or take the preset lutforge, which needs no such shots") from None
    return fit_response_by_least_squares(pairs, options.beta, log_emor_basis(options.curves)).response


def _scaled_to_raw(response: Response, balanced: Array, encoded: Array) -> Response:
    """f⁻¹ with the scale of RAW, by which the rows of A in f⁻¹(I) = A x sum to 1: exposure pairs leave it open."""
    linear = response.linearize(encoded)
    level = np.maximum(linear.mean(axis=1, keepdims=True), 0.02)
    transposed, _, rank, _ = np.linalg.lstsq(balanced / level, linear / level, rcond=1e-6)
    factors = transposed.sum(axis=0)
    if rank < 3 or not np.all(factors > 0):
        raise CalibrationError(
            "the unsaturated colours are all one hue or grey and cannot determine the matrix: shoot a colour chart"
        )
    return Response(response.inverse / factors)


def fit_gamut_maps(
    balanced: Array,
    encoded: Array,
    shot: NDArray[np.str_],
    matrix: Array,
    response: Response,
    white_balances: tuple[str, ...],
    options: ThesisOptions,
) -> CameraModel:
    """Fit h and h⁻¹ of one style to all its unclipped samples, saturated ones included; all white balances together.

    balanced: Tw E (n, 3); encoded: I (n, 3); shot: (n,). Both maps are fitted to linear values, and all residuals have
    equal weight, as in (4.8).
    """
    linear = balanced @ matrix.T
    mapped = response.linearize(encoded)
    maps = (
        fit_gamut_map(*pair, groups=shot, most=options.centres, rho=options.rho)
        for pair in ((linear, mapped), (mapped, linear))
    )
    return CameraModel(white_balances, matrix, response, *maps)
