"""White-balance multipliers of samples whose files do not tell them (thesis 4.2.2), the gains and names of settings."""

import re
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from lutforge.arrays import Array, Mask
from lutforge.calibration.curve_basis import emor_basis, srgb_response
from lutforge.calibration.matrix_and_response import JointFit, fit_matrix_and_response, saturation
from lutforge.calibration.robust_fit import ToneWeights, robust_fit
from lutforge.colour.colour_temperature import (
    COOLEST,
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

D65_KELVIN = 6504.0
MATRIX_DEPARTURE = (-0.95e-4, 0.0, -1.3e-4)
"""By how much the logarithm of a true multiplier grows beyond the matrix's for each mired from D65: r, g, b.

A matrix that is least squares under daylight takes warm light for less warm than it is. Medians of the 52 cameras whose
spectral sensitivities rawtoaces publishes: 2 % in red and 3 % in blue under tungsten, half of the error there. On 28
other cameras (Jiang et al. 2013) it takes a third off the error.
"""
SURE, LEAST_GAIN = 3, 0.01
"""A setting's gain is kept beyond so many standard errors, and beyond what moves no colour by a code."""
DARK, BRIGHT, ROUNDED = 0.08, 0.95, 0.2
"""JPEG values between the first two are read for a white balance; below the third rounding rules."""
NEUTRAL = 0.12
"""Standard deviation, in HSV saturation, by which near-neutral colours count."""
ENOUGH_NEUTRAL = 3
"""Summed weight below which there is nothing neutral to read a white balance from."""
TINY = 1e-6
"""Light counts as this at least, so that ratios and logarithms stay finite."""


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


def with_fitted_gains(samples: SampleSet, multipliers: Array, usable: Mask) -> Array:
    """Tw (n, 3): the multipliers (n, 3) times a common factor of each setting, the third number of Tw (thesis 4.2.2).

    usable: (n,) unclipped samples. A camera may expose one setting's JPEGs brighter than another's, which multipliers
    with green = 1 do not say. Factors are relative to the median setting. One is kept only where its shots agree on it
    beyond their scatter (three standard errors), and above 1 %, which moves no colour by a code; else it is 1. Rounds
    start from a fit without gains: where settings have few tones in common, free gains would trade with the response.
    """
    names = [str(name) for name in np.unique(samples.white_balance[usable]) if name != "auto"]
    gains = dict.fromkeys(names, 1.0)
    for _ in range(6 if len(names) > 1 else 0):
        logs, doubt = _departures(samples, _times(samples, multipliers, gains), usable, names)
        logs -= np.median(logs)
        total = np.log(list(gains.values())) + logs
        sure = np.abs(total) > np.maximum(SURE * doubt, LEAST_GAIN)
        if not np.any(sure & (np.abs(logs) > LEAST_GAIN / 50)):
            break
        gains = dict(zip(names, np.where(sure, np.exp(total), 1.0).tolist(), strict=True))
    return _times(samples, multipliers, gains)


def _departures(samples: SampleSet, balanced_by: Array, usable: Mask, names: list[str]) -> tuple[Array, Array]:
    """Return by setting the log of how much brighter its JPEGs are than f(Ts Tw E), and the standard error of that."""
    ratio, weight = np.zeros(len(samples)), np.zeros(len(samples))
    for style in np.unique(samples.style[usable]):
        rows = usable & (samples.style == style)
        x, encoded = samples.raw[rows] * balanced_by[rows], samples.srgb[rows]
        fit = fit_matrix_and_response(x, encoded)
        linear, predicted = fit.response.linearize(encoded), np.maximum(x @ fit.matrix.T, 100 * TINY)
        ratio[rows] = np.log(np.maximum(linear.sum(axis=1), TINY) / predicted.sum(axis=1))
        weight[rows] = fit.in_gamut * (encoded.max(axis=1) > ROUNDED)
    logs, doubt = np.zeros(len(names)), np.full(len(names), np.inf)
    for place, name in enumerate(names):
        mine = (samples.white_balance == name) & (10 * weight > 1)
        shots = [mine & (samples.shot == shot) for shot in np.unique(samples.shot[mine])]
        parts = np.array([weighted_median(ratio[rows], weight[rows]) for rows in shots if rows.sum() >= 3])
        if len(parts):
            logs[place] = float(np.median(parts))
            within = float(np.std(ratio[mine])) / np.sqrt(mine.sum())
            between = float(np.std(parts, ddof=1)) / np.sqrt(len(parts)) if len(parts) > 1 else 0.0
            doubt[place] = max(within, between)
    return logs, doubt


def with_gains(samples: SampleSet, multipliers: Array, white_balances: Mapping[str, WhiteBalance]) -> Array:
    """Tw (n, 3): multipliers (n, 3) with green = 1 times the gains that a profile knows of the settings."""
    return _times(samples, multipliers, {name: balance.gain for name, balance in white_balances.items()})


def with_known_balances(samples: SampleSet, white_balances: Mapping[str, WhiteBalance]) -> SampleSet:
    """Return the samples with the multipliers of named white balances, where their files tell none."""
    multipliers = samples.wb.copy()
    unknown = ~np.all(np.isfinite(multipliers), axis=1)
    for name, balance in white_balances.items():
        multipliers[unknown & (samples.white_balance == name)] = balance.multipliers
    return replace(samples, wb=multipliers)


def _times(samples: SampleSet, multipliers: Array, gains: Mapping[str, float]) -> Array:
    factors = np.array([gains.get(str(name), 1.0) for name in samples.white_balance])
    return np.asarray(multipliers * factors[:, None])


def neutral_weight(raw: Array, srgb: Array) -> Array:
    """How near-neutral JPEG colours (n, 3) vote for the multipliers of their RAW (n, 3): weights (n,) from 0 to 1."""
    high = srgb.max(axis=1)
    weight = np.exp(-((saturation(srgb) / NEUTRAL) ** 2))
    weight[(high > BRIGHT) | (high < DARK) | (raw.min(axis=1) <= 100 * TINY)] = 0.0
    return np.asarray(weight)


def estimated_multipliers(raw: Array, srgb: Array) -> tuple[Array, str]:
    """Read multipliers (3,) from near-neutral colours (n, 3), or from all, and say which. Raises CalibrationError."""
    weight = neutral_weight(raw, srgb)
    if weight.sum() < ENOUGH_NEUTRAL:
        return multipliers_from_colours(raw, srgb), "colours, none of them neutral"
    ratios = [weighted_median(raw[:, 1] / np.maximum(raw[:, c], TINY), weight) for c in range(3)]
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
    """One entry per white-balance name: its middle shot, how far other shots depart from that, a told temperature.

    The middle shot is the one nearest to the median of each channel, which no shot need have.

    matrix: Ts (3, 3), for presets that no shot was taken with.
    """
    result = {}
    for name in np.unique(samples.white_balance):
        rows = samples.white_balance == name
        shots = np.array(
            [np.median(multipliers[rows & (samples.shot == shot)], axis=0) for shot in np.unique(samples.shot[rows])]
        )
        departures = np.abs(np.log(shots / np.median(shots, axis=0))).max(axis=1)
        middle = shots[np.argmin(departures)]
        r, b = float(middle[0] / middle[1]), float(middle[2] / middle[1])
        spread = float(np.max(np.abs(shots / middle - 1.0)))
        result[str(name)] = WhiteBalance((r, 1.0, b), named_temperature(str(name)), spread, float(middle[1]))
    return _with_presets(samples, result, matrix)


def _with_presets(samples: SampleSet, balances: dict[str, WhiteBalance], matrix: Array) -> dict[str, WhiteBalance]:
    """The white balances, with presets by matrix and locus where no setting tells a temperature, as on automatic.

    The light D65, whose multipliers LibRaw knows of the camera, is the anchor, as it is for RAW developers.
    """
    d65 = np.array([np.median(samples.d65_r), 1.0, np.median(samples.d65_b)])
    told = [named_temperature(name) for name in balances if "fluorescent" not in name]
    if not samples.is_own_raw or not np.all(np.isfinite(d65)) or any(told):
        return balances
    from_xyz = camera_from_xyz(matrix, d65, D65_KELVIN)
    presets = {}
    for name in PRESETS:
        kelvin = NAMED_KELVIN[name]
        logs = np.array(MATRIX_DEPARTURE) * (1e6 / kelvin - 1e6 / D65_KELVIN)
        r, g, b = (float(value) for value in np.exp(logs) * multipliers_of(locus(kelvin), from_xyz))
        presets[name] = WhiteBalance((r, g, b), kelvin)
    return {**balances, **presets}


def named_temperature(name: str) -> float | None:
    """The temperature in kelvin that a setting's name tells: "daylight", "5600k"; None where it tells none."""
    number = re.fullmatch(r"(\d{4,5}) ?k(?:elvin)?", name)
    if number and COOLEST <= float(number[1]) <= HOTTEST:
        return float(number[1])
    return NAMED_KELVIN.get(name)
