"""Cameras without RAW: a reference camera's RAW of the same scene stands in (thesis 4.2.4, equations 4.9, 4.10)."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from lutforge.calibration.options import CalibrationOptions
from lutforge.calibration.physical.exposure_pairs import pairs_of_samples
from lutforge.calibration.physical.physical_model import fit_shared_gamut_maps
from lutforge.calibration.physical.response_from_exposures import fit_response_to_exposures
from lutforge.calibration.physical.unsaturated import saturation, starting_beta
from lutforge.errors import CalibrationError
from lutforge.model.camera_profile import CameraProfile, PhysicalModel, PictureStyle
from lutforge.model.response import Response
from lutforge.model.white_balance import WhiteBalance
from lutforge.samples.sample_set import SampleSet

Array = NDArray[np.float64]

CODE = 1.0 / 255.0
LEAST_COLOURS = 12
ROUNDS = 10
OUTLIER = 3.0


def fit_reference_matrix(linear: Array, reference_raw: Array, trusted: NDArray[np.float64]) -> Array:
    """Tz = Ts Tw Tc of one white balance: minimise Σ ‖Tz⁻¹ X − E'‖² (4.10), weighing by residual from the trusted on.

    linear: X = f⁻¹(I) (n, 3); reference_raw: E' (n, 3); trusted: (n,) 1 for unsaturated colours, else 0.
    Returns (3, 3). Raises CalibrationError where the colours do not determine it.
    """
    if (trusted > 0.5).sum() < LEAST_COLOURS:
        raise CalibrationError(
            f"{int((trusted > 0.5).sum())} unsaturated colours; {LEAST_COLOURS} are needed: "
            "shoot a colour chart with both cameras"
        )
    level = np.maximum(np.linalg.norm(reference_raw, axis=1), 1e-3)
    weight = trusted / level**2
    inverse = np.eye(3)
    for _ in range(ROUNDS):
        root = np.sqrt(weight)[:, None]
        answer, _, rank, _ = np.linalg.lstsq(linear * root, reference_raw * root, rcond=1e-8)
        if rank < 3:
            raise CalibrationError("the unsaturated colours are all of one hue: shoot a colour chart with both cameras")
        inverse = answer.T
        residual = np.linalg.norm(linear @ inverse.T - reference_raw, axis=1) / level
        scale = max(OUTLIER * float(np.median(residual[trusted > 0.5])), 2e-3)
        weight = 1.0 / (1.0 + (residual / scale) ** 2) ** 2 / level**2
    return np.asarray(np.linalg.inv(inverse), dtype=np.float64)


def calibrate_by_reference(
    samples: SampleSet, options: CalibrationOptions, progress: Callable[[str, float], None]
) -> CameraProfile:
    """A profile of a camera without RAW: per style f from exposure pairs, per white balance Tz, h and h⁻¹ over all.

    samples: `raw` holds the reference camera's values of the same patches. Refinishing works on such a profile;
    linearize to the camera's own RAW does not. Raises CalibrationError, in one line with what to shoot.
    """
    usable = np.all((samples.srgb >= 0.5 * CODE) & (samples.srgb <= 1 - 0.5 * CODE), axis=1) & np.all(
        (samples.raw > 0.0) & (samples.raw < 0.999), axis=1
    )
    inside = samples.select(usable)
    if len(inside) < LEAST_COLOURS:
        raise CalibrationError(
            f"{len(inside)} samples are unclipped in both the JPEG and the reference camera's RAW: expose less"
        )
    styles: dict[str, PictureStyle] = {}
    for index, name in enumerate(np.unique(inside.style)):
        progress(f"{name}: fitting", index / len(np.unique(inside.style)))
        styles[str(name)] = PictureStyle(physical=_fit_style(inside.select(inside.style == name), str(name), options))
    progress("done", 1.0)
    names = [str(name) for name in np.unique(inside.white_balance)]
    return CameraProfile(
        camera=str(samples.camera[0]),
        matrix=np.eye(3),
        white_balances={name: WhiteBalance((1.0, 1.0, 1.0)) for name in names},
        styles=styles,
        shots=tuple(name for name, _ in inside.by_shot()),
        options={**options.as_json(), "model": "rbf"},
        notes=(f"RAW of {samples.raw_camera[0]} stands in: refinishing works, linearizing to the own RAW cannot",),
        raw_camera=str(samples.raw_camera[0]),
    )


def _fit_style(samples: SampleSet, name: str, options: CalibrationOptions) -> tuple[PhysicalModel, ...]:
    """One physical model a white balance; they share f, h and h⁻¹."""
    response: Response = fit_response_to_exposures(pairs_of_samples(samples), options.preset).response
    linear = response.linearize(samples.srgb)
    chroma = saturation(samples.srgb)
    trusted = (chroma < starting_beta(chroma, options.preset)).astype(np.float64)
    matrices, mixed = {}, np.zeros_like(linear)
    for balance in np.unique(samples.white_balance):
        rows = samples.white_balance == balance
        try:
            matrices[str(balance)] = fit_reference_matrix(linear[rows], samples.raw[rows], trusted[rows])
        except CalibrationError as error:
            raise CalibrationError(f'style "{name}", white balance "{balance}": {error}') from None
        mixed[rows] = samples.raw[rows] @ matrices[str(balance)].T
    forward, back = fit_shared_gamut_maps(mixed, samples.srgb, samples.shot, response, preset=options.preset)
    return tuple(
        PhysicalModel((balance,), matrix, response, forward.gamut_map, back.gamut_map)
        for balance, matrix in matrices.items()
    )
