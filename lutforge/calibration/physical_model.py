"""The thesis's camera model I = f(h(Ts Tw E)), stage by stage: f, then Ts and Tw, then h and h⁻¹ (thesis 4.2).

Ts and Tw are fitted together by least squares (4.2.2, equation 4.5),

    minimize Σ_i Σ_j ‖Ts⁻¹ X_ij − Tw_i E_ij‖²,  X = f⁻¹(I), on colours that the gamut map leaves alone.

Where the files tell the multipliers of a setting its Tw is known; one unknown setting is fixed to I, which leaves the
problem linear.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lutforge.arrays import Array, Mask
from lutforge.calibration.curve_basis import log_emor_basis
from lutforge.calibration.matrix_and_response import (
    check_tones,
    fit_matrix_and_response,
    saturation,
    starting_beta,
    untouched,
)
from lutforge.calibration.options import PhysicalOptions, Preset
from lutforge.calibration.response_from_exposures import fit_response_to_exposures, pairs_of_samples
from lutforge.errors import CalibrationError
from lutforge.model.profile_data import PhysicalModel
from lutforge.model.response import Response
from lutforge.samples.sample_set import SampleSet
from lutforge.solvers.robust_weights import RobustWeights, geman_mcclure
from lutforge.thesis.gamut_map import fit_gamut_map

ROBUST = RobustWeights(geman_mcclure, multiple=3.0, least=2e-3)
KNOWN = "\t"
"""The setting of colours whose multipliers are known: no setting's name."""
LEAST_COLOURS = 8
LEAST_CONDITION = 8e-3
"""The chromaticities (shares of r, g, b) of the unsaturated colours must spread in two directions by this much."""


def fit_matrix(
    linear: Array,
    raw: Array,
    setting: NDArray[np.str_],
    *,
    trusted: Array,
    neutral: Array | None = None,
    preset: Preset = "lutforge",
) -> tuple[Array, dict[str, Array]]:
    """Solve (4.5): Ts (3, 3), for multipliers with green = 1, and the multipliers (3,) of the settings not known.

    linear: X = f⁻¹(I) (n, 3); raw: E (n, 3); setting: (n,) white-balance name, KNOWN where E is balanced already;
    trusted: (n,) weights, 1 for colours that are surely untouched by the gamut map; neutral: (3,) what f⁻¹ makes of
    neutral JPEG values, up to a factor, None where its curves are alike.

    Without any known multipliers, what Ts and Tw share is settled by neutrals: what the camera renders neutral is equal
    RAW values after its white balance. Raises CalibrationError where the colours do not determine Ts.
    """
    names = [str(name) for name in np.unique(setting)]
    fixed = KNOWN if KNOWN in names else names[0]
    free = [name for name in names if name != fixed]
    _check(linear, trusted)
    inverse, solved = _solve(linear, raw, setting, free, trusted)
    for _ in range(0 if preset == "thesis" else 9):  # then the weights hardly change
        balanced = raw * np.array([solved.get(str(name), np.ones(3)) for name in setting])
        # Photon noise, and rounding behind a response like a power of ½, grow with the root of the level, above this.
        level = np.maximum(np.linalg.norm(balanced, axis=1), 0.005)
        residual = np.linalg.norm(linear @ inverse.T - balanced, axis=1) / np.sqrt(level)
        weight = trusted * ROBUST(residual, residual[trusted >= 0.5 * trusted.max()]) / level
        inverse, solved = _solve(linear, raw, setting, free, weight)
    solved[fixed] = np.ones(3)
    if fixed != KNOWN:  # R of (4.6): neutral stays neutral
        neutral = inverse @ (np.ones(3) if neutral is None else neutral)
        if np.min(neutral) <= 0:
            raise CalibrationError(
                "the unsaturated colours give no white balance: add a shot of a grey or colour chart"
            )
        inverse = inverse / neutral[:, None]
        solved = {name: value / neutral for name, value in solved.items()}
    middle = float(np.median([value[1] for value in solved.values()]))
    matrix = np.asarray(np.linalg.inv(inverse / middle), dtype=np.float64)
    return matrix, {name: value / value[1] for name, value in solved.items()}


def _check(linear: Array, trusted: Array) -> None:
    # Colours of less weight do not count as unsaturated
    used = trusted > 0.1
    count = int(used.sum())
    if count < LEAST_COLOURS:
        raise CalibrationError(
            f"{count} unsaturated colours; the matrix needs {LEAST_COLOURS}: shoot a colour chart, not clipped"
        )
    if hue_spread(linear[used]) < LEAST_CONDITION:
        raise CalibrationError(
            "the unsaturated colours are all one hue or grey and cannot tell the matrix: shoot a colour chart"
        )


def hue_spread(linear: Array) -> float:
    """How far chromaticities of linear colours (n, 3) spread in their second principal direction, root mean square."""
    if len(linear) < 2:
        return 0.0
    shares = linear / np.maximum(linear.sum(axis=1, keepdims=True), 1e-9)
    return float(np.linalg.svd(shares - shares.mean(axis=0), compute_uv=False)[1] / np.sqrt(len(linear)))


def _solve(
    linear: Array, raw: Array, setting: NDArray[np.str_], free: list[str], weight: Array
) -> tuple[Array, dict[str, Array]]:
    """One weighted solve, a channel at a time: row · X − tw_i E = known part. Unknown: 3, and one a free setting."""
    root, is_free = np.sqrt(weight), setting[:, None] == np.array(free, dtype=np.str_)
    answers = []
    for channel in range(3):
        design = np.hstack([linear, np.where(is_free, -raw[:, [channel]], 0.0)])
        target = np.where(is_free.any(axis=1), 0.0, raw[:, channel])
        answer, _, rank, _ = np.linalg.lstsq(design * root[:, None], target * root, rcond=1e-10)
        if rank < design.shape[1]:
            raise CalibrationError(
                "the unsaturated colours do not determine the matrix and the white balances: "
                "shoot a colour chart under every white balance"
            )
        answers.append(answer)
    solution = np.array(answers)
    return solution[:, :3], dict(zip(free, solution[:, 3:].T, strict=True))


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
    # Known settings are applied sample by sample (a camera may change them from shot to shot): they become one.
    setting = np.where(known, KNOWN, samples.settings)
    responses: dict[str, Response] = {}
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
        balanced = np.where(known[:, None], samples.raw * multipliers, samples.raw)
        neutral = _neutral(samples, responses, trusted)
        matrix, fitted = fit_matrix(linear, balanced, setting, trusted=trusted, neutral=neutral, preset=preset)
        if settled or turn == most_turns - 1:
            break
        before, multipliers = multipliers, multipliers.copy()
        for key in np.unique(setting[~known]):
            rows = setting == key
            multipliers[rows] = fitted[str(key)] * multipliers[rows, 1:2]
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
            for limit in (physical.beta, 0.4, 0.5):  # where those below β are all alike, as on a small chart
                low = untouched(samples.srgb, limit)
                if hue_spread(response.linearize(samples.srgb[low])) >= LEAST_CONDITION:
                    break
            response = _scaled_to_raw(response, balanced[low], samples.srgb[low])
            return response, low.astype(np.float64)
        chroma = saturation(samples.srgb)
        check_tones(samples.srgb, chroma < starting_beta(chroma, preset, physical.beta))
        fit = fit_matrix_and_response(balanced, samples.srgb, physical, saturates=samples.is_own_raw)
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


def _scaled_to_raw(response: Response, balanced: Array, encoded: Array) -> Response:
    """f⁻¹ with the scale of RAW, by which the rows of A in f⁻¹(I) = A x sum to 1: exposure pairs leave it open."""
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
    maps = (
        fit_gamut_map(*pair, groups=shot, most=physical.centres, rho=physical.rho)
        for pair in ((linear, mapped), (mapped, linear))
    )
    return PhysicalModel(white_balances, matrix, response, *maps)
