"""White balances Tw and the matrix Ts together, by least squares (thesis 4.2.2, equation 4.5).

minimize Σ_i Σ_j ‖Ts⁻¹ X_ij − Tw_i E_ij‖²,  X = f⁻¹(I), on colours that the gamut map leaves alone. Where the files tell
the multipliers of a setting its Tw is known; one unknown setting is fixed to I, which leaves the problem linear.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from lutforge.arrays import Array
from lutforge.calibration.options import Preset
from lutforge.errors import CalibrationError
from lutforge.solvers.robust_weights import RobustWeights, geman_mcclure

ROBUST = RobustWeights(geman_mcclure, multiple=3.0, least=2e-3)
LEAST_COLOURS = 8
LEAST_CONDITION = 8e-3
"""The chromaticities (shares of r, g, b) of the unsaturated colours must spread in two directions by this much."""


@dataclass(frozen=True, eq=False)
class MatrixFit:
    """The fitted matrix Ts (3, 3), for multipliers with green = 1, and the multipliers (3,) by setting."""

    matrix: Array
    multipliers: Mapping[str, Array]


def fit_matrix(
    linear: Array,
    raw: Array,
    setting: NDArray[np.str_],
    known: Mapping[str, Array],
    *,
    trusted: Array,
    neutral: Array | None = None,
    preset: Preset = "lutforge",
) -> MatrixFit:
    """Solve (4.5).

    linear: X = f⁻¹(I) (n, 3); raw: E (n, 3); setting: (n,) white-balance name; known: multipliers (3,) with green = 1
    by setting; trusted: (n,) weights, 1 for colours that are surely untouched by the gamut map; neutral: (3,) what f⁻¹
    makes of neutral JPEG values, up to a factor, None where its curves are alike.

    Without any known multipliers, what Ts and Tw share is settled by neutrals: what the camera renders neutral is equal
    RAW values after its white balance. Raises CalibrationError where the colours do not determine Ts.
    """
    names = [str(name) for name in np.unique(setting)]
    unknown = [name for name in names if name not in known]
    fixed = dict(known) if known else {unknown[0]: np.ones(3)}
    free = [name for name in names if name not in fixed]
    _check(linear, trusted)
    solve = partial(_solve, linear, raw, setting, fixed, free)
    inverse, solved = solve(trusted)
    for _ in range(0 if preset == "thesis" else 9):  # then the weights hardly change
        tw = np.array([solved[str(name)] for name in setting])
        # Photon noise, and rounding behind a response like a power of ½, grow with the root of the level, above this.
        level = np.maximum(np.linalg.norm(tw * raw, axis=1), 0.005)
        residual = np.linalg.norm(linear @ inverse.T - tw * raw, axis=1) / np.sqrt(level)
        inverse, solved = solve(trusted * ROBUST(residual, residual[trusted >= 0.5 * trusted.max()]) / level)
    if not known:  # R of (4.6): neutral stays neutral
        neutral = inverse @ (np.ones(3) if neutral is None else neutral)
        if np.min(neutral) <= 0:
            raise CalibrationError(
                "the unsaturated colours give no white balance: add a shot of a grey or colour chart"
            )
        inverse = inverse / neutral[:, None]
        solved = {name: value / neutral for name, value in solved.items()}
    middle = float(np.median([value[1] for value in solved.values()]))
    matrix = np.asarray(np.linalg.inv(inverse / middle), dtype=np.float64)
    return MatrixFit(matrix, {name: value / value[1] for name, value in solved.items()})


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
    """Return how far the chromaticities of linear colours (n, 3) spread along the second of their principal directions.

    It is a root mean square; below LEAST_CONDITION the colours are grey or of one hue.
    """
    if len(linear) < 2:
        return 0.0
    shares = linear / np.maximum(linear.sum(axis=1, keepdims=True), 1e-9)
    return float(np.linalg.svd(shares - shares.mean(axis=0), compute_uv=False)[1] / np.sqrt(len(linear)))


def _solve(
    linear: Array,
    raw: Array,
    setting: NDArray[np.str_],
    fixed: Mapping[str, Array],
    free: list[str],
    weight: Array,
) -> tuple[Array, dict[str, Array]]:
    """One weighted solve, a channel at a time: row · X − tw_i E = known part. Unknown: 3, and one a free setting."""
    root = np.sqrt(weight)
    inverse = np.zeros((3, 3))
    solved = {name: np.array(value, dtype=np.float64) for name, value in fixed.items()}
    solved |= {name: np.ones(3) for name in free}
    for channel in range(3):
        design = np.zeros((len(raw), 3 + len(free)))
        design[:, :3] = linear
        target = np.zeros(len(raw))
        for name, value in fixed.items():
            rows = setting == name
            target[rows] = value[channel] * raw[rows, channel]
        for place, name in enumerate(free):
            rows = setting == name
            design[rows, 3 + place] = -raw[rows, channel]
        answer, _, rank, _ = np.linalg.lstsq(design * root[:, None], target * root, rcond=1e-10)
        if rank < design.shape[1]:
            raise CalibrationError(
                "the unsaturated colours do not determine the matrix and the white balances: "
                "shoot a colour chart under every white balance"
            )
        inverse[channel] = answer[:3]
        for place, name in enumerate(free):
            solved[name][channel] = answer[3 + place]
    return inverse, solved
