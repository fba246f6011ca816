"""White-balance multipliers that files do not state, read from the colours of the samples (thesis 4.2.2)."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from lutforge.arrays import Array
from lutforge.calibration.curve_basis import emor_basis, srgb_response
from lutforge.calibration.matrix_and_response import JointFit
from lutforge.calibration.robust_fit import ToneWeights, robust_fit
from lutforge.colour.saturation import saturation
from lutforge.errors import CalibrationError
from lutforge.model.white_balance import WhiteBalance
from lutforge.samples.sample_set import SampleSet
from lutforge.solvers.robust_weights import weighted_median

LEAST_READ, MOST_READ = 0.08, 0.95
"""JPEG values whose brightest channel lies between these are read for a white balance."""
NEUTRAL_SATURATION = 0.12
"""Standard deviation, in HSV saturation, by which near-neutral colours count."""
ENOUGH_NEUTRAL = 3
"""Summed weight below which there is nothing neutral to read a white balance from."""
LEAST_POSITIVE = 1e-6
"""Smaller linear values are raised to this before a logarithm or a division."""
LEAST_RAW = 1e-4
"""RAW values above which colours are compared."""
LEAST_COLOURS = 24
"""Colours, none of them neutral, that determine multipliers."""
LEAST_RAW_SPREAD = 1e-3
"""Colours whose RAW spreads less than this in any direction, root mean square, are all alike."""


def fill_in_known_multipliers(samples: SampleSet, white_balances: Mapping[str, WhiteBalance]) -> SampleSet:
    """Return the samples with the multipliers of white balances by their names, where the files state none."""
    multipliers = samples.wb.copy()
    unknown = ~np.all(np.isfinite(multipliers), axis=1)
    for name, balance in white_balances.items():
        multipliers[unknown & (samples.white_balance == name)] = balance.multipliers
    return replace(samples, wb=multipliers)


def complete_multipliers(samples: SampleSet) -> tuple[Array, tuple[str, ...]]:
    """The multipliers (n, 3) of every sample, green = 1, estimated per shot and setting where the table has none.

    What the camera rendered neutral was neutral after white balance: the multipliers are the weighted median of G / R
    and G / B over near-neutral JPEG colours; where there are none, the colours decide. Returns them with one note per
    estimate. Raises CalibrationError, naming the setting, where its colours do not determine a white balance.
    """
    multipliers = samples.wb.copy()
    notes = []
    unknown = ~np.all(np.isfinite(multipliers), axis=1)
    for name in np.unique(samples.settings[unknown]):
        rows = unknown & (samples.settings == name)
        label = str(name) or "unnamed"
        raw, srgb = samples.raw[rows], samples.srgb[rows]
        try:
            estimate, source = estimated_multipliers(raw, srgb)
        except CalibrationError as error:
            raise CalibrationError(
                f"white balance {label}: the files give no multipliers, and {error}; "
                "add a shot with something grey in it, or the columns wb_r,wb_g,wb_b"
            ) from error
        multipliers[rows] = estimate
        notes.append(f"white balance {label}: multipliers {estimate[0]:.3f}, 1, {estimate[2]:.3f} read from {source}")
    return multipliers, tuple(notes)


def neutral_weight(raw: Array, srgb: Array) -> Array:
    """The weights (n,), from 0 to 1, by which JPEG colours (n, 3) vote for the multipliers of their RAW (n, 3)."""
    high = srgb.max(axis=1)
    weight = np.exp(-((saturation(srgb) / NEUTRAL_SATURATION) ** 2))
    weight[(high > MOST_READ) | (high < LEAST_READ) | (raw.min(axis=1) <= LEAST_RAW)] = 0.0
    return np.asarray(weight)


def estimated_multipliers(raw: Array, srgb: Array) -> tuple[Array, str]:
    """Read multipliers (3,) from near-neutral colours (n, 3), or from all, and name which. Raises CalibrationError."""
    weight = neutral_weight(raw, srgb)
    if weight.sum() < ENOUGH_NEUTRAL:
        return multipliers_from_colours(raw, srgb), "colours, none of them neutral"
    ratios = [weighted_median(raw[:, 1] / np.maximum(raw[:, c], LEAST_POSITIVE), weight) for c in range(3)]
    return np.array(ratios), "near-neutral colours"


def multipliers_from_colours(raw: Array, encoded: Array) -> Array:
    """Multipliers (3,) with green = 1 from RAW (n, 3) and JPEG values (n, 3) of any colours under one white balance.

    f⁻¹(I) = A E with one response f for the three channels, f(1) = 1, and A = Ts Tw. The RAW that renders neutral is
    A⁻¹ (1, 1, 1), and the multipliers are its reciprocals. Raises CalibrationError where the colours do not determine
    them: too few, or all alike.
    """
    count = len(raw)
    rank = np.linalg.matrix_rank(raw - raw.mean(axis=0), tol=LEAST_RAW_SPREAD * np.sqrt(count))
    if count < LEAST_COLOURS or rank < 3:
        raise CalibrationError(f"{count} colours, too few or too alike to tell a white balance from")
    weights = ToneWeights(encoded.mean(axis=1), np.ones(count), multiple=4, least=2 / 255)

    def columns(x: Array) -> tuple[Array, Array]:
        return np.zeros_like(x), np.repeat(x[:, None, :], 3, axis=1)

    fit = JointFit(raw, encoded, weights, columns, response=srgb_response(), alike=True)
    robust_fit(fit, emor_basis().with_white_at_one())
    neutral = np.linalg.solve(fit.coefficients, np.ones(3))
    if not np.all(neutral > 0) or not np.all(np.abs(np.log10(neutral[1] / neutral)) < 1):
        raise CalibrationError("the colours contradict any white balance: is the JPEG the camera's own?")
    return np.asarray(neutral[1] / neutral)
