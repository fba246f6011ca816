"""White-balance multipliers of samples whose files do not tell them (thesis 4.2.2)."""

import numpy as np
from numpy.typing import NDArray

from lutforge.calibration.physical.blind_white_balance import multipliers_from_colours
from lutforge.calibration.physical.colour_temperature import with_temperatures
from lutforge.errors import CalibrationError
from lutforge.model.white_balance import WhiteBalance
from lutforge.samples.sample_set import SampleSet

Array = NDArray[np.float64]

NEUTRAL_SATURATION = 0.12
"""Standard deviation in HSV saturation of the weight by which near-neutral JPEG colours vote for the multipliers."""
LEAST_NEUTRALS = 3.0
"""Summed weight below which there is nothing neutral to read a white balance from."""


def complete_multipliers(samples: SampleSet) -> tuple[Array, tuple[str, ...]]:
    """The multipliers (n, 3) of every sample, green = 1, estimated per shot and setting where the table has none.

    What the camera rendered neutral was neutral after white balance: the multipliers are the weighted median of G / R
    and G / B over near-neutral JPEG colours; where there are none, the colours decide. Returns them with one note per
    estimate. Raises CalibrationError, naming the setting, where a white balance cannot be told.
    """
    multipliers = samples.wb.copy()
    notes = []
    unknown = ~np.all(np.isfinite(multipliers), axis=1)
    automatic = samples.white_balance == "auto"
    # One estimate per setting; under auto the camera may change it from shot to shot.
    setting = np.where(automatic, np.char.add("auto of ", samples.shot), samples.white_balance)
    for name in np.unique(setting[unknown]):
        rows = unknown & (setting == name)
        label = str(name) or "unnamed"
        raw, srgb = samples.raw[rows], samples.srgb[rows]
        found, source = _neutral_multipliers(raw, srgb), "near-neutral colours"
        if found is None:
            try:
                found, source = multipliers_from_colours(raw, srgb), "colours, none of them neutral"
            except CalibrationError as error:
                raise CalibrationError(
                    f"white balance {label}: the files give no multipliers, and {error}; "
                    "add a shot with something grey in it, or the columns wb_r,wb_g,wb_b"
                ) from error
        multipliers[rows] = found
        notes.append(f"white balance {label}: multipliers {found[0]:.3f}, 1, {found[2]:.3f} read from {source}")
    return multipliers, tuple(notes)


def _neutral_multipliers(raw: Array, srgb: Array) -> Array | None:
    """From near-neutral colours; None where there are too few."""
    high = srgb.max(axis=1)
    saturation = 1.0 - srgb.min(axis=1) / np.maximum(high, 1e-6)
    weight = np.exp(-((saturation / NEUTRAL_SATURATION) ** 2))
    weight[(high > 0.95) | (high < 0.08) | (raw.min(axis=1) <= 1e-4)] = 0.0
    if weight.sum() < LEAST_NEUTRALS:
        return None
    ratios = [_weighted_median(raw[:, 1] / np.maximum(raw[:, c], 1e-6), weight) for c in range(3)]
    return np.array(ratios)


def _weighted_median(values: Array, weight: Array) -> float:
    order = np.argsort(values)
    mass = np.cumsum(weight[order])
    return float(values[order][np.searchsorted(mass, 0.5 * mass[-1])])


def named_white_balances(samples: SampleSet, multipliers: Array, matrix: Array) -> dict[str, WhiteBalance]:
    """One entry per white-balance name: its middle shot, how far other shots depart from that, its temperature.

    The middle shot is the one nearest to the median of each channel, which no shot need have.

    matrix: Ts (3, 3), for temperatures that the name does not tell.
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
        result[str(name)] = WhiteBalance((r, 1.0, b), spread=spread)
    return with_temperatures(result, matrix)
