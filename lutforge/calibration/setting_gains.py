"""Gains of white-balance settings: by how much the camera exposes a setting's JPEGs brighter (thesis 4.2.2).

A gain is the third number of a white balance Tw, which multipliers with green = 1 do not state.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from lutforge.arrays import Array, Mask
from lutforge.calibration.matrix_and_response import MatrixAndResponseFit
from lutforge.calibration.white_balance import LEAST_POSITIVE, LEAST_RAW
from lutforge.model.white_balance import WhiteBalance
from lutforge.samples.sample_set import SampleSet
from lutforge.solvers.robust_weights import weighted_median

SURE = 3
"""A setting keeps a gain or a level of its own beyond so many standard errors."""
LEAST_LOG_GAIN = 0.01
"""A setting's gain is kept beyond this logarithm, which moves no colour by a code."""
SETTLED_GAINS = 0.02
"""Gains are settled when they change by less than this share of the least gain."""
ROUNDED = 0.2
"""Colours without a JPEG value above this are not compared, because rounding rules there."""
LEAST_COMPARED_WEIGHT = 0.1
"""Colours of less weight are not compared."""
LEAST_COLOURS_OF_SHOT = 3
"""Shots with fewer colours are not compared."""


def gains_of(white_balances: Mapping[str, WhiteBalance]) -> dict[str, float]:
    """The gains of white balances by their names."""
    return {name: balance.gain for name, balance in white_balances.items()}


def multiplied_by_gains(samples: SampleSet, multipliers: Array, gains: Mapping[str, float]) -> Array:
    """Tw (n, 3): multipliers (n, 3) with green = 1 times gains by names of settings, 1 for settings without one."""
    factors = np.array([gains.get(str(name), 1.0) for name in samples.white_balance])
    return np.asarray(multipliers * factors[:, None])


def refined_gains(
    samples: SampleSet,
    multipliers: Array,
    usable: Mask,
    bases: Mapping[str, MatrixAndResponseFit],
    gains: Mapping[str, float],
) -> dict[str, float]:
    """The gains of settings after a further round; the same ones where they are settled.

    multipliers: Tw (n, 3) with the gains of the round before; usable: (n,) unclipped samples; bases: by style, fitted
    to just these; gains: of the round before. Gains are relative to the median setting. One is kept only where its
    shots agree on it beyond their scatter (three standard errors), and above 1 %, which moves no colour by a code; else
    it is 1. A single shot of a setting scatters as those of other settings do: where these disagree, its exposure may
    be off as well.
    """
    logs, doubt = _residuals_of_settings(samples, multipliers, usable, bases, list(gains))
    logs -= np.median(logs)
    total = np.log(list(gains.values())) + logs
    sure = np.abs(total) > np.maximum(SURE * doubt, LEAST_LOG_GAIN)
    if not np.any(sure & (np.abs(logs) > SETTLED_GAINS * LEAST_LOG_GAIN)):
        return dict(gains)
    return dict(zip(gains, np.where(sure, np.exp(total), 1.0).tolist(), strict=True))


def _residuals_of_settings(
    samples: SampleSet, multipliers: Array, usable: Mask, bases: Mapping[str, MatrixAndResponseFit], names: list[str]
) -> tuple[Array, Array]:
    """By setting, the log of how much brighter its JPEGs are than f(Ts Tw E), and the standard error of that."""
    ratio, weight = np.zeros(len(samples)), np.zeros(len(samples))
    for style, base in bases.items():
        rows = usable & (samples.style == style)
        encoded = samples.srgb[rows]
        linear = base.response.linearize(encoded).sum(axis=1)
        predicted = np.maximum((samples.raw[rows] * multipliers[rows]) @ base.matrix.T, LEAST_RAW)
        ratio[rows] = np.log(np.maximum(linear, LEAST_POSITIVE) / predicted.sum(axis=1))
        weight[rows] = base.in_gamut * (encoded.max(axis=1) > ROUNDED)

    logs, within, medians_of_settings = np.zeros(len(names)), np.full(len(names), np.inf), list[Array]()
    for place, name in enumerate(names):
        rows = (samples.white_balance == name) & (weight > LEAST_COMPARED_WEIGHT)
        shots = [rows & (samples.shot == shot) for shot in np.unique(samples.shot[rows])]
        medians = np.array(
            [weighted_median(ratio[shot], weight[shot]) for shot in shots if shot.sum() >= LEAST_COLOURS_OF_SHOT]
        )
        medians_of_settings.append(medians)
        if len(medians):
            logs[place] = float(np.median(medians))
            within[place] = float(np.std(ratio[rows])) / np.sqrt(rows.sum())

    scatter = _scatter(medians_of_settings)
    between = [
        float(np.std(medians, ddof=1)) / np.sqrt(len(medians)) if len(medians) > 1 else scatter
        for medians in medians_of_settings
    ]
    return logs, np.maximum(within, between)


def _scatter(logs_of_settings: Sequence[Array]) -> float:
    """The standard deviation of shots of one setting, from those of all settings with several; 0 where there is none.

    It is that of their mean absolute deviation, on which a single shot that is off has less influence than on squares
    (Geary 1935, https://doi.org/10.1093/biomet/27.3-4.310).
    """
    deviations = [
        np.abs(logs - logs.mean()) * np.sqrt(len(logs) / (len(logs) - 1)) for logs in logs_of_settings if len(logs) > 1
    ]
    return float(np.sqrt(np.pi / 2.0) * np.mean(np.concatenate(deviations))) if deviations else 0.0
