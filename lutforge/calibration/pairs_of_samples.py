"""The exposure pairs of a sample table: shots of the same patches, with one style and white balance (thesis 3.2)."""

from collections.abc import Iterator
from itertools import combinations

import numpy as np

from lutforge.arrays import Mask
from lutforge.calibration.exposure_pairs import (
    LEAST_SHARED_SURFACES,
    NEAR_AN_END,
    TIME_SPREAD,
    ExposurePairs,
    ShotColours,
    ShotPair,
    are_comparable,
    joined,
)
from lutforge.errors import CalibrationError
from lutforge.samples.clipping import SATURATED
from lutforge.samples.sample_set import SampleSet

RAW_SPREAD = 0.003
"""Expected error of the logarithm of an exposure ratio that RAW values determine."""
SAME_SCENE = 0.12
"""All surfaces of one scene have the same RAW ratio; a wider spread of its logarithm means another scene."""
LEAST_RATIO_RAW = 0.004
"""RAW values above which a ratio is not dominated by noise."""


def pairs_of_samples(samples: SampleSet) -> ExposurePairs:
    """All exposure pairs of a sample table: same style and white balance, same patch, other shot.

    With RAW the ratio is that of the RAW values, which are linear. Shots whose surfaces have no common ratio show
    different scenes and are left out. Without RAW the ratio is that of the exposure times.
    Raises CalibrationError where no two shots are a pair.
    """
    shot_pairs: list[ShotPair] = []
    from_raw = bool(np.all(samples.raw_camera == samples.camera)) and bool(np.any(samples.raw > 0))
    for group in _groups(samples):
        for shot_a, shot_b in combinations(sorted(group, key=lambda shot: shot.log_time), 2):
            surfaces = shot_a.usable & shot_b.usable
            ratio = _log_ratio(shot_a, shot_b, surfaces, from_raw)
            if ratio is None or not are_comparable(ratio):
                continue
            # By their RAW the shot with the longer stated time may have the shorter exposure.
            shorter, longer = (shot_a, shot_b) if ratio > 0 else (shot_b, shot_a)
            shot_pairs.append(ShotPair(shorter, longer, surfaces, abs(ratio)))
    if not shot_pairs:
        raise CalibrationError(
            "no two shots show the same surfaces at different exposures: "
            "shoot the same chart at several shutter speeds, with all other settings the same"
        )
    return joined(shot_pairs, RAW_SPREAD if from_raw else TIME_SPREAD)


def _groups(samples: SampleSet) -> Iterator[list[ShotColours]]:
    """The shots of each style and white balance, all over the same patches; those that a shot lacks are unusable."""
    for style in np.unique(samples.style):
        for balance in np.unique(samples.white_balance[samples.style == style]):
            inside = np.flatnonzero((samples.style == style) & (samples.white_balance == balance))
            patches = np.unique(samples.patch[inside])
            group = []
            for name in np.unique(samples.shot[inside]):
                rows = inside[samples.shot[inside] == name]
                shot = samples.select(rows)
                place = np.searchsorted(patches, shot.patch)

                encoded = np.full((len(patches), 3), np.nan)
                raw = np.full((len(patches), 3), np.nan)
                row = np.full(len(patches), -1)
                encoded[place] = shot.srgb
                raw[place] = shot.raw
                row[place] = rows

                with np.errstate(invalid="ignore"):
                    usable = np.all((encoded > NEAR_AN_END) & (encoded < 1 - NEAR_AN_END), axis=1)
                    usable &= ~np.any(raw >= SATURATED, axis=1)
                time = shot.exposure_s[np.isfinite(shot.exposure_s)]
                log_time = float(np.log(np.median(time))) if len(time) else np.nan
                group.append(ShotColours(str(name), log_time, encoded, raw, usable, row))
            yield group


def _log_ratio(shot_a: ShotColours, shot_b: ShotColours, surfaces: Mask, from_raw: bool) -> float | None:
    """The logarithm of the exposure of shot_b over that of shot_a; None where the two shots cannot be compared."""
    if surfaces.sum() < LEAST_SHARED_SURFACES:
        return None
    if not from_raw:
        ratio = shot_b.log_time - shot_a.log_time
        return float(ratio) if np.isfinite(ratio) else None

    bright = surfaces & np.all((shot_a.raw > LEAST_RATIO_RAW) & (shot_b.raw > LEAST_RATIO_RAW), axis=1)
    if bright.sum() < LEAST_SHARED_SURFACES:
        return None
    logs = np.log(shot_b.raw[bright] / shot_a.raw[bright])
    median = float(np.median(logs))
    return median if float(np.median(np.abs(logs - median))) < SAME_SCENE else None
