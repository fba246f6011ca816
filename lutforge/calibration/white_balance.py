"""White-balance multipliers that files do not state (thesis 4.2.2), and the gains and names of settings."""

import re
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from lutforge.arrays import Array, Mask
from lutforge.calibration.curve_basis import emor_basis, srgb_response
from lutforge.calibration.matrix_and_response import JointFit, MatrixAndResponseFit, saturation
from lutforge.calibration.robust_fit import ToneWeights, robust_fit
from lutforge.colour.colour_temperature import (
    COOLEST,
    D65_KELVIN,
    HOTTEST,
    camera_from_xyz,
    locus,
    multipliers_of,
)
from lutforge.errors import CalibrationError
from lutforge.model.white_balance import NAMED_KELVIN, WhiteBalance
from lutforge.samples.sample_set import SampleSet
from lutforge.solvers.robust_weights import weighted_median

PRESETS = ("tungsten", "daylight", "cloudy", "shade")
"""Settings that a profile of automatic shots gets by its matrix."""

MATRIX_DEVIATION = (-0.95e-4, 0.0, -1.3e-4)
"""By how much the logarithm of a true multiplier grows beyond the matrix's for each mired from D65: r, g, b.

A matrix that is least squares under daylight takes warm light for less warm than it is. Medians of the 52 cameras whose
spectral sensitivities rawtoaces publishes: 2 % in red and 3 % in blue under tungsten, half of the error there. On 28
other cameras (Jiang et al. 2013) it takes a third off the error.
"""
SURE, LEAST_LOG_GAIN = 3, 0.01
"""A setting's gain is kept beyond so many standard errors, and beyond what moves no colour by a code."""
LEAST_READ, MOST_READ, ROUNDED = 0.08, 0.95, 0.2
"""JPEG values between the first two are read for a white balance; below the third rounding rules."""
NEUTRAL_SATURATION = 0.12
"""Standard deviation, in HSV saturation, by which near-neutral colours count."""
ENOUGH_NEUTRAL = 3
"""Summed weight below which there is nothing neutral to read a white balance from."""
LEAST_POSITIVE = 1e-6
"""Smaller linear values are raised to this before a logarithm or a division."""
LEAST_RAW = 1e-4
"""RAW values above which colours are compared."""
LEAST_NEUTRAL_WEIGHT = 0.1
"""Colours of less weight say nothing of a setting."""
SETTLED = 0.02
"""Gains are settled when they change by less than this share of the least gain."""


def complete_multipliers(samples: SampleSet) -> tuple[Array, tuple[str, ...]]:
    """The multipliers (n, 3) of every sample, green = 1, estimated per shot and setting where the table has none.

    What the camera rendered neutral was neutral after white balance: the multipliers are the weighted median of G / R
    and G / B over near-neutral JPEG colours; where there are none, the colours decide. Returns them with one note per
    estimate. Raises CalibrationError, naming the setting, where a white balance cannot be told.
    """
    multipliers = samples.wb.copy()
    notes = []
    unknown = ~np.all(np.isfinite(multipliers), axis=1)
    for name in np.unique(samples.settings[unknown]):
        rows = unknown & (samples.settings == name)
        label = str(name) or "unnamed"
        raw, srgb = samples.raw[rows], samples.srgb[rows]
        try:
            found, source = estimated_multipliers(raw, srgb)
        except CalibrationError as error:
            raise CalibrationError(
                f"white balance {label}: the files give no multipliers, and {error}; "
                "add a shot with something grey in it, or the columns wb_r,wb_g,wb_b"
            ) from error
        multipliers[rows] = found
        notes.append(f"white balance {label}: multipliers {found[0]:.3f}, 1, {found[2]:.3f} read from {source}")
    return multipliers, tuple(notes)


def fitted_gains(
    samples: SampleSet,
    multipliers: Array,
    usable: Mask,
    bases: Mapping[str, MatrixAndResponseFit],
    gains: Mapping[str, float],
) -> dict[str, float]:
    """The gains of settings, the third number of Tw (thesis 4.2.2), after one round; the same where they are settled.

    multipliers: Tw (n, 3) with the gains of the round before; usable: (n,) unclipped samples; bases: by style, fitted
    to just these. A camera may expose one setting's JPEGs brighter than another's, which multipliers with green = 1 do
    not say. Gains are relative to the median setting. One is kept only where its shots agree on it beyond their scatter
    (three standard errors), and above 1 %, which moves no colour by a code; else it is 1.
    """
    logs, doubt = _residuals_of_settings(samples, multipliers, usable, bases, list(gains))
    logs -= np.median(logs)
    total = np.log(list(gains.values())) + logs
    sure = np.abs(total) > np.maximum(SURE * doubt, LEAST_LOG_GAIN)
    if not np.any(sure & (np.abs(logs) > SETTLED * LEAST_LOG_GAIN)):
        return dict(gains)
    return dict(zip(gains, np.where(sure, np.exp(total), 1.0).tolist(), strict=True))


def _residuals_of_settings(
    samples: SampleSet, multipliers: Array, usable: Mask, bases: Mapping[str, MatrixAndResponseFit], names: list[str]
) -> tuple[Array, Array]:
    """Return by setting the log of how much brighter its JPEGs are than f(Ts Tw E), and the standard error of that."""
    ratio, weight = np.zeros(len(samples)), np.zeros(len(samples))
    for style, base in bases.items():
        rows = usable & (samples.style == style)
        encoded = samples.srgb[rows]
        linear = base.response.linearize(encoded).sum(axis=1)
        predicted = np.maximum((samples.raw[rows] * multipliers[rows]) @ base.matrix.T, LEAST_RAW)
        ratio[rows] = np.log(np.maximum(linear, LEAST_POSITIVE) / predicted.sum(axis=1))
        weight[rows] = base.in_gamut * (encoded.max(axis=1) > ROUNDED)

    logs, doubt = np.zeros(len(names)), np.full(len(names), np.inf)
    for place, name in enumerate(names):
        rows = (samples.white_balance == name) & (weight > LEAST_NEUTRAL_WEIGHT)
        shots = [rows & (samples.shot == shot) for shot in np.unique(samples.shot[rows])]
        medians = np.array([weighted_median(ratio[shot], weight[shot]) for shot in shots if shot.sum() >= 3])
        if len(medians):
            logs[place] = float(np.median(medians))
            within = float(np.std(ratio[rows])) / np.sqrt(rows.sum())
            between = float(np.std(medians, ddof=1)) / np.sqrt(len(medians)) if len(medians) > 1 else 0.0
            doubt[place] = max(within, between)
    return logs, doubt


def with_gains(samples: SampleSet, multipliers: Array, white_balances: Mapping[str, WhiteBalance]) -> Array:
    """Tw (n, 3): multipliers (n, 3) with green = 1 times the gains that a profile knows of the settings."""
    return times_gains(samples, multipliers, {name: balance.gain for name, balance in white_balances.items()})


def with_known_balances(samples: SampleSet, white_balances: Mapping[str, WhiteBalance]) -> SampleSet:
    """Return the samples with the multipliers of named white balances, where their files tell none."""
    multipliers = samples.wb.copy()
    unknown = ~np.all(np.isfinite(multipliers), axis=1)
    for name, balance in white_balances.items():
        multipliers[unknown & (samples.white_balance == name)] = balance.multipliers
    return replace(samples, wb=multipliers)


def times_gains(samples: SampleSet, multipliers: Array, gains: Mapping[str, float]) -> Array:
    """Tw (n, 3): multipliers (n, 3) with green = 1 times gains by names of settings, 1 where not there."""
    factors = np.array([gains.get(str(name), 1.0) for name in samples.white_balance])
    return np.asarray(multipliers * factors[:, None])


def neutral_weight(raw: Array, srgb: Array) -> Array:
    """How near-neutral JPEG colours (n, 3) vote for the multipliers of their RAW (n, 3): weights (n,) from 0 to 1."""
    high = srgb.max(axis=1)
    weight = np.exp(-((saturation(srgb) / NEUTRAL_SATURATION) ** 2))
    weight[(high > MOST_READ) | (high < LEAST_READ) | (raw.min(axis=1) <= LEAST_RAW)] = 0.0
    return np.asarray(weight)


def estimated_multipliers(raw: Array, srgb: Array) -> tuple[Array, str]:
    """Read multipliers (3,) from near-neutral colours (n, 3), or from all, and say which. Raises CalibrationError."""
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
    if count < 24 or np.linalg.matrix_rank(raw - raw.mean(axis=0), tol=1e-3 * np.sqrt(count)) < 3:
        raise CalibrationError(f"{count} colours, too few or too alike to tell a white balance from")
    weights = ToneWeights(encoded.mean(axis=1), np.ones(count), multiple=4, least=2 / 255)
    fit = JointFit(
        raw, encoded, weights, lambda x: (np.zeros_like(x), np.repeat(x[:, None, :], 3, axis=1)),
        response=srgb_response(), alike=True,
    )  # fmt: skip
    robust_fit(fit, emor_basis().with_white_at_one())
    neutral = np.linalg.solve(fit.coefficients, np.ones(3))
    if not np.all(neutral > 0) or not np.all(np.abs(np.log10(neutral[1] / neutral)) < 1):
        raise CalibrationError("the colours contradict any white balance: is the JPEG the camera's own?")
    return np.asarray(neutral[1] / neutral)


def named_white_balances(samples: SampleSet, multipliers: Array, matrix: Array) -> dict[str, WhiteBalance]:
    """One entry per white-balance name: its middle shot, how far other shots are from that, and its temperature.

    The middle shot is the one nearest to the median of each channel, which no shot need have.

    matrix: Ts (3, 3), for presets that no shot was taken with.
    """
    result = {}
    for name in np.unique(samples.white_balance):
        rows = samples.white_balance == name
        shots = np.array(
            [np.median(multipliers[rows & (samples.shot == shot)], axis=0) for shot in np.unique(samples.shot[rows])]
        )
        off = np.abs(np.log(shots / np.median(shots, axis=0))).max(axis=1)
        middle = shots[np.argmin(off)]
        r, b = float(middle[0] / middle[1]), float(middle[2] / middle[1])
        spread = float(np.max(np.abs(shots / middle - 1.0)))
        result[str(name)] = WhiteBalance((r, 1.0, b), named_temperature(str(name)), spread, float(middle[1]))
    return _with_presets(samples, result, matrix)


def _with_presets(samples: SampleSet, balances: dict[str, WhiteBalance], matrix: Array) -> dict[str, WhiteBalance]:
    """The white balances, with presets by matrix and locus where no setting states a temperature, as on automatic.

    The camera's colorimetric matrix serves, as in RAW developers. Where only its multipliers of light D65 are known,
    they anchor the fitted matrix, which contains the camera's look.
    """
    stated = [named_temperature(name) for name in balances if "fluorescent" not in name]
    if not samples.is_own_raw or any(stated):
        return balances

    colorimetric = colorimetric_matrix(samples)
    d65 = np.array([np.median(samples.d65_r), 1.0, np.median(samples.d65_b)])
    if colorimetric is not None:
        from_xyz, deviation = colorimetric, np.zeros(3)
    elif np.all(np.isfinite(d65)):
        from_xyz, deviation = camera_from_xyz(matrix, d65, D65_KELVIN), np.array(MATRIX_DEVIATION)
    else:
        return balances

    presets = {}
    for name in PRESETS:
        kelvin = NAMED_KELVIN[name]
        correction = np.exp(deviation * (1e6 / kelvin - 1e6 / D65_KELVIN))
        r, g, b = (float(value) for value in correction * multipliers_of(locus(kelvin), from_xyz))
        if min(r, b) > 0.0:  # the matrix of samples that no camera made may have no such light
            presets[name] = WhiteBalance((r, g, b), kelvin)
    return {**balances, **presets}


def colorimetric_matrix(samples: SampleSet) -> Array | None:
    """(3, 3) XYZ → RAW of the camera, as LibRaw or its DNG files have it; None where unknown."""
    matrix = np.median(samples.from_xyz, axis=0).reshape(3, 3)
    # A matrix that is none of a camera's has no multipliers for natural light
    whites = np.array([multipliers_of(locus(kelvin), matrix) for kelvin in (2500.0, 5000.0, 10000.0)])
    known = samples.is_own_raw and np.all(np.isfinite(whites)) and np.all(whites > 0.0)
    return matrix if known else None


def named_temperature(name: str) -> float | None:
    """The temperature in kelvin of a setting's name: "daylight", "5600k"; None where it has none."""
    number = re.fullmatch(r"(\d{4,5}) ?k(?:elvin)?", name)
    if number and COOLEST <= float(number[1]) <= HOTTEST:
        return float(number[1])
    return NAMED_KELVIN.get(name)
