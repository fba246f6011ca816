"""The thesis's camera model I = f(h(Ts Tw E)), stage by stage: f, then Ts and Tw, then h and h⁻¹ (thesis 4.2)."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lutforge.arrays import Array, Mask
from lutforge.calibration.options import PhysicalOptions, Preset
from lutforge.calibration.physical.curve_basis import log_emor_basis
from lutforge.calibration.physical.exposure_pairs import pairs_of_samples
from lutforge.calibration.physical.gamut_map import fit_gamut_map
from lutforge.calibration.physical.matrix import LEAST_CONDITION, fit_matrix, hue_spread
from lutforge.calibration.physical.matrix_and_response import fit_matrix_and_response
from lutforge.calibration.physical.response_from_exposures import fit_response_to_exposures
from lutforge.calibration.physical.unsaturated import check_tones, saturation, starting_beta, untouched
from lutforge.errors import CalibrationError
from lutforge.model.profile_data import PhysicalModel
from lutforge.model.response import Response
from lutforge.samples.sample_set import SampleSet

AUTO_OF_SHOT = "auto\x00"
"""Under auto every shot has a white balance of its own: settings "auto\\0shot"."""


@dataclass(frozen=True, eq=False)
class CameraStages:
    """The stages before the gamut maps. matrix: Ts (3, 3), one for all styles; responses: f by style.

    multipliers: Tw (n, 3) of the samples given, fitted where they were not known.
    """

    matrix: Array
    multipliers: Array
    responses: Mapping[str, Response]


def fit_stages(
    samples: SampleSet,
    multipliers: Array,
    known: Mask,
    preset: Preset = "lutforge",
    physical: PhysicalOptions | None = None,
) -> CameraStages:
    """f of every style, Ts and the unknown Tw, of unclipped samples of one camera.

    multipliers: (n, 3), good guesses where known (n,) is False. The "thesis" preset takes f from exposure pairs and all
    colours below the saturation β; "lutforge" takes f and Ts from RAW/JPEG pairs together and weighs by residual.
    Raises CalibrationError, in one line with what to shoot, where a stage is not determined.
    """
    names = [str(name) for name in np.unique(samples.style)]
    automatic = samples.white_balance == "auto"
    setting = np.where(automatic, np.char.add(AUTO_OF_SHOT, samples.shot), samples.white_balance)
    responses: dict[str, Response] = {}
    matrix = np.eye(3)
    settled, most_turns = bool(known.all()), 15
    for turn in range(most_turns):
        linear = np.zeros_like(samples.raw)
        trusted = np.zeros(len(samples))
        for name in names:
            rows = samples.style == name
            responses[name], trusted[rows] = _fit_style(
                samples.select(rows), multipliers[rows], name, preset, physical or PhysicalOptions()
            )
            linear[rows] = responses[name].linearize(samples.srgb[rows])
        given = {
            str(key): np.median(multipliers[(setting == key) & known], axis=0) for key in np.unique(setting[known])
        }
        # Known settings are applied sample by sample (a camera may change them from shot to shot): they become one.
        balanced = np.where(known[:, None], samples.raw * multipliers, samples.raw)
        label = np.where(known, "known", setting)
        fit = fit_matrix(
            linear,
            balanced,
            label,
            {"known": np.ones(3)} if given else {},
            trusted=trusted,
            neutral=_neutral(samples, responses, trusted),
            preset=preset,
        )
        matrix = fit.matrix
        if settled or turn == most_turns - 1:
            break
        before, multipliers = multipliers, multipliers.copy()
        for key in np.unique(setting[~known]):
            rows = (setting == key) & ~known
            multipliers[rows] = fit.multipliers[str(key)] * multipliers[rows, 1:2]
        settled = bool(np.max(np.abs(multipliers / before - 1.0)) < 5e-4)
    return CameraStages(matrix, multipliers, responses)


def _neutral(samples: SampleSet, responses: Mapping[str, Response], trusted: Array) -> Array:
    """f⁻¹ of neutral JPEG values, (3,), relative to each other: the factors between the channels' curves.

    Bright trusted colours decide: they tell a factor best, and curves that differ do so least near white.
    """
    products = np.zeros(3)
    for name, response in responses.items():
        rows = samples.style == name
        value = samples.srgb[rows].mean(axis=1, keepdims=True)
        linear = response.linearize(np.repeat(value, 3, axis=1))
        products += (trusted[rows] * linear.mean(axis=1) ** 2) @ linear
    return np.asarray(products / products.mean())


def _fit_style(
    samples: SampleSet, multipliers: Array, name: str, preset: Preset, physical: PhysicalOptions
) -> tuple[Response, Array]:
    """Fit f of a style before its gamut map; with weights (n,) of the samples that the map leaves alone."""
    balanced = samples.raw * multipliers
    try:
        if preset == "thesis":
            response = response_of_exposures(samples, preset, physical)
            low = _unsaturated(samples.srgb, response, physical.beta)
            response = _scaled_to_raw(response, balanced[low], samples.srgb[low])
            return response, low.astype(np.float64)
        chroma = saturation(samples.srgb)
        check_tones(samples.srgb, chroma < starting_beta(chroma, preset, physical.beta))
        fit = fit_matrix_and_response(balanced, samples.srgb, physical)
    except CalibrationError as error:
        raise CalibrationError(f'style "{name}": {error}') from None
    return fit.response, fit.trust


def response_of_exposures(samples: SampleSet, preset: Preset, physical: PhysicalOptions) -> Response:
    """f of one style from its exposure pairs, without those that the options leave out. Raises CalibrationError."""
    try:
        pairs = pairs_of_samples(samples).without(physical.without_pairs)
    except CalibrationError as error:
        raise CalibrationError(f"{error}, or take the preset lutforge, which needs no such shots") from None
    return fit_response_to_exposures(pairs, preset, physical.beta, log_emor_basis(physical.curves)).response


def _unsaturated(encoded: Array, response: Response, beta: float) -> Mask:
    """(n,) colours below β; where these are all alike, as on a small chart, below a larger one."""
    linear = response.linearize(encoded)
    for limit in (beta, 0.4, 0.5):
        low = untouched(encoded, limit)
        if hue_spread(linear[low]) >= LEAST_CONDITION:
            break
    return low


def _scaled_to_raw(response: Response, balanced: Array, encoded: Array) -> Response:
    """f⁻¹ with the scale of RAW: exposure pairs leave a factor per channel open, which f(1) = 1 only guesses.

    Of f⁻¹(I) = A x the rows of A must sum to 1, as neutral RAW is neutral light.
    """
    linear = response.linearize(encoded)
    level = np.maximum(linear.mean(axis=1, keepdims=True), 0.02)
    transposed, _, rank, _ = np.linalg.lstsq(balanced / level, linear / level, rcond=1e-6)
    factors = transposed.sum(axis=0)
    if rank < 3 or not np.all(factors > 0):
        raise CalibrationError(
            "the unsaturated colours are all one hue or grey and cannot tell the matrix: shoot a colour chart"
        )
    return Response(response.inverse / factors)


def fit_gamut_maps(
    balanced: Array,
    encoded: Array,
    shot: NDArray[np.str_],
    matrix: Array,
    response: Response,
    white_balances: tuple[str, ...],
    physical: PhysicalOptions,
) -> PhysicalModel:
    """h and h⁻¹ of one style, on all its unclipped samples, saturated colours included; all white balances together.

    balanced: Tw E (n, 3); encoded: I (n, 3); shot: (n,). Both are on linear values, and all residuals count alike, as
    (4.8) has it.
    """
    linear, mapped = balanced @ matrix.T, response.linearize(encoded)
    forward = fit_gamut_map(linear, mapped, groups=shot, most=physical.centres, nugget=physical.nugget)
    back = fit_gamut_map(mapped, linear, groups=shot, most=physical.centres, nugget=physical.nugget)
    return PhysicalModel(white_balances, matrix, response, forward.gamut_map, back.gamut_map)
