"""The verdict on exposure pairs whether the response f is a fixed property of the camera (thesis 3.2).

It is fixed where unsaturated colours keep to the transfer function f(k f⁻¹(I)) in all shots, and where a curve of its
own for each shot would not predict left-out surfaces much better (`curves_by_shot`).
"""

from dataclasses import dataclass

import numpy as np

from lutforge.calibration.brightness_transfer import OUTLIER
from lutforge.calibration.curves_by_shot import share_explained_by_shots
from lutforge.calibration.exposure_pairs import ExposurePairs
from lutforge.calibration.options import BETA
from lutforge.calibration.response_from_exposures import fit_response_to_exposures
from lutforge.model.response import Response

LARGEST_SHIFT = 3 / 255
"""A fixed response shifts no whole shot by more: a shutter that is 5 % off moves middle grey so far."""
LARGEST_SHARE_BY_SHOT = 0.1
"""Curves of single shots explain no larger share of the variance where the response is fixed. It is at most 1 % of 48
fixed simulated cameras, and 3 and 6 % of two real brackets."""
LEAST_SPREAD_RAW = 0.02
"""RAW values above which the spread of RAW ratios is not that of noise."""
LEAST_COLOURS_OF_PAIR = 3
"""Colours of two shots from which on their median is taken."""


@dataclass(frozen=True)
class ResponseVerdict:
    """The verdict whether the response is a fixed property of the camera, in figures.

    outliers: share of the colours that leave the common function, of whole colours; outliers_by_channel: by channel.
    inlier_saturation, outlier_saturation: their median HSV saturation.
    shift: of the worst shot, 1 = full scale. The shift of a pair of shots is the median residual of its unsaturated
    colours, in that channel of three whose residual is the middle one; a shot has the median over its pairs.
    raw_spread: spread of the logarithm of RAW ratios within a pair of shots, of the worst pair.
    explained_by_shots: share of the variance of left-out unsaturated pairs that a curve for each shot explains beyond
    the common one. fixed: whether the shift and this share are small.
    """

    outliers: float
    outliers_by_channel: tuple[float, float, float]
    inlier_saturation: float
    outlier_saturation: float
    shift: float
    raw_spread: float
    explained_by_shots: float
    fixed: bool

    @property
    def words(self) -> str:
        """The verdict in words, with its figures."""
        return (
            f"the response {'is a fixed property of this camera' if self.fixed else 'is not the same in all shots'}: "
            f"unsaturated colours of the worst shot deviate by {255 * self.shift:.1f} codes, "
            f"{100 * self.outliers:.0f} % of all colours by more than 3; a curve of its own for each shot explains "
            f"{100 * max(self.explained_by_shots, 0.0):.0f} % of what is left (10 % or more: something adapts to the "
            "scene)"
        )


def judge(pairs: ExposurePairs, response: Response | None = None) -> ResponseVerdict:
    """The verdict on exposure pairs. response: f; by default the one that is fitted to the pairs.

    Raises CalibrationError where the pairs do not determine a response.
    """
    response = response or fit_response_to_exposures(pairs).response
    residuals = pairs.residuals(response)
    is_far = np.abs(residuals) > OUTLIER
    outlier = is_far.any(axis=1)
    saturation = pairs.saturation
    unsaturated = saturation < BETA

    shifts: dict[int, list[float]] = {}
    raw_spreads = [0.0]
    for number in np.unique(pairs.shot_pair):
        rows = pairs.shot_pair == number
        unsaturated_rows = rows & unsaturated
        if unsaturated_rows.sum() >= LEAST_COLOURS_OF_PAIR:
            # The middle one of the channels: the gamut map may move one alone; an exposure, a white balance or
            # another response moves two.
            shift = float(np.median(np.abs(np.median(residuals[unsaturated_rows], axis=0))))
            for shot in divmod(int(number), len(pairs.shots)):
                shifts.setdefault(shot, []).append(shift)
        bright = rows & np.all(pairs.raw_first > LEAST_SPREAD_RAW, axis=1)
        if bright.sum() >= LEAST_COLOURS_OF_PAIR:
            logs = np.log(pairs.raw_second[bright] / pairs.raw_first[bright])
            raw_spreads.append(float(np.median(np.abs(logs - np.median(logs)))))

    explained = share_explained_by_shots(pairs, response, unsaturated)
    worst = max((float(np.median(of_shot)) for of_shot in shifts.values()), default=0.0)
    r, g, b = (float(share) for share in is_far.mean(axis=0))
    return ResponseVerdict(
        outliers=float(outlier.mean()),
        outliers_by_channel=(r, g, b),
        inlier_saturation=float(np.median(saturation[~outlier])) if (~outlier).any() else float("nan"),
        outlier_saturation=float(np.median(saturation[outlier])) if outlier.any() else float("nan"),
        shift=worst,
        raw_spread=max(raw_spreads),
        explained_by_shots=explained,
        fixed=worst < LARGEST_SHIFT and explained < LARGEST_SHARE_BY_SHOT,
    )
