"""Exposure pairs: the same surface under the same illuminant in two shots of different exposure (thesis 3.2)."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from lutforge.arrays import Array, Mask
from lutforge.colour.saturation import saturation
from lutforge.model.response import Response

NEAR_AN_END = 1.5 / 255
"""JPEG values this near 0 or 1 in any channel are clipped."""
LEAST_STOPS, MOST_STOPS = 0.15, 3.5
"""Limits of the ratio of two exposures. Shots further apart share too few unclipped surfaces, and their shifts are
larger (thesis 3.2)."""
LEAST_SHARED_SURFACES = 6
"""Surfaces that two shots must share to be compared."""
TIME_SPREAD = 0.03
"""Expected error of the logarithm of a stated exposure time."""


@dataclass(frozen=True, eq=False)
class ExposurePairs:
    """Colours of the same surfaces at two exposures.

    first, second: JPEG values (n, 3); log_ratio: log k' (n,) of second over first.

    raw_first, raw_second: (n, 3), NaN where there is no RAW. first_row, second_row: (n,) rows of the sample table, or
    cells of the images. shots: names; first_shot, second_shot: (n,) indices into it. shot_exposure: (shots,) log
    exposure as stated, with mean 0 over each group of shots that pairs connect; spread: its expected error.
    black, white: (3,) the JPEG values that were scaled to 0 and 1: on film and in files of some cameras, black is above
    0 and white below 1.
    """

    first: Array
    second: Array
    raw_first: Array
    raw_second: Array
    first_row: NDArray[np.intp]
    second_row: NDArray[np.intp]
    log_ratio: Array
    shots: tuple[str, ...]
    first_shot: NDArray[np.intp]
    second_shot: NDArray[np.intp]
    shot_exposure: Array
    spread: float
    black: Array = field(default_factory=lambda: np.zeros(3))
    white: Array = field(default_factory=lambda: np.ones(3))

    def __len__(self) -> int:
        return len(self.log_ratio)

    @property
    def shot_pair(self) -> NDArray[np.intp]:
        """The number (n,) of the two shots of each pair: first_shot · number of shots + second_shot."""
        return self.first_shot * len(self.shots) + self.second_shot

    @property
    def saturation(self) -> Array:
        """The larger HSV saturation (n,) of the two colours of each pair."""
        return np.maximum(saturation(self.first), saturation(self.second))

    def residuals(self, response: Response) -> Array:
        """The residuals I' − τ(I) (n, 3); τ is the transfer function by a response for a pair's ratio (3.1)."""
        ratio = np.exp(self.log_ratio)[:, None]
        return self.second - response.encode(ratio * response.linearize(self.first))

    def corrected(self, shot_error: Mapping[str, float]) -> "ExposurePairs":
        """The pairs with true exposure ratios. shot_error: the log of true over stated exposure, by shot."""
        logs = np.array([shot_error[name] for name in self.shots])
        return replace(self, log_ratio=self.log_ratio + logs[self.second_shot] - logs[self.first_shot])

    def select(self, rows: Mask) -> "ExposurePairs":
        """The pairs of a mask (n,), of the same shots."""
        by_pair = (
            "first", "second", "raw_first", "raw_second", "first_row", "second_row", "log_ratio", "first_shot",
            "second_shot",
        )  # fmt: skip
        return replace(self, **{name: getattr(self, name)[rows] for name in by_pair})

    def without(self, names: Iterable[tuple[str, str]]) -> "ExposurePairs":
        """Return the pairs without those between two shots that `names` lists together, in either order."""
        index = {name: place for place, name in enumerate(self.shots)}
        keep = np.ones(len(self), dtype=np.bool_)
        for shot_a, shot_b in names:
            two_shots = [index.get(shot_a, -1), index.get(shot_b, -1)]
            keep &= ~(np.isin(self.first_shot, two_shots) & np.isin(self.second_shot, two_shots))
        return self.select(keep)


@dataclass(frozen=True, eq=False)
class ShotColours:
    """The colours of the surfaces that a group of shots shows, in one shot, in an order that the whole group has.

    log_time: the logarithm of the exposure time, NaN where unknown; encoded, raw: (n, 3), NaN where the shot lacks a
    surface; usable: mask (n,) of unclipped colours; row: (n,) of the sample table, or cells of the image.
    """

    name: str
    log_time: float
    encoded: Array
    raw: Array
    usable: Mask
    row: NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class ShotPair:
    """Two shots to compare. surfaces: mask (n,) of those compared; log_ratio: of longer over shorter exposure."""

    shorter: ShotColours
    longer: ShotColours
    surfaces: Mask
    log_ratio: float


def are_comparable(log_ratio: float) -> bool:
    """True where two exposures differ by LEAST_STOPS to MOST_STOPS, in either direction."""
    return bool(LEAST_STOPS <= abs(log_ratio) / np.log(2) <= MOST_STOPS)


def joined(shot_pairs: Sequence[ShotPair], spread: float) -> ExposurePairs:
    """The pairs of colours of all pairs of shots. spread: the expected error of the logarithm of an exposure."""
    names = sorted({shot.name for pair in shot_pairs for shot in (pair.shorter, pair.longer)})
    index = {name: place for place, name in enumerate(names)}
    shots = np.array([(index[pair.shorter.name], index[pair.longer.name]) for pair in shot_pairs])
    counts = [int(pair.surfaces.sum()) for pair in shot_pairs]
    ratios = np.array([pair.log_ratio for pair in shot_pairs])

    # Each ratio is the difference of the log exposures of two shots: least squares gives the log exposures.
    differences = np.zeros((len(shot_pairs), len(names)))
    differences[np.arange(len(shot_pairs)), shots[:, 0]] = -1.0
    differences[np.arange(len(shot_pairs)), shots[:, 1]] = 1.0
    exposure = np.linalg.lstsq(differences, ratios, rcond=None)[0]  # of least norm: mean 0 in each group

    return ExposurePairs(
        first=np.concatenate([pair.shorter.encoded[pair.surfaces] for pair in shot_pairs]),
        second=np.concatenate([pair.longer.encoded[pair.surfaces] for pair in shot_pairs]),
        raw_first=np.concatenate([pair.shorter.raw[pair.surfaces] for pair in shot_pairs]),
        raw_second=np.concatenate([pair.longer.raw[pair.surfaces] for pair in shot_pairs]),
        first_row=np.concatenate([pair.shorter.row[pair.surfaces] for pair in shot_pairs]),
        second_row=np.concatenate([pair.longer.row[pair.surfaces] for pair in shot_pairs]),
        log_ratio=np.repeat(ratios, counts),
        shots=tuple(names),
        first_shot=np.repeat(shots[:, 0], counts),
        second_shot=np.repeat(shots[:, 1], counts),
        shot_exposure=exposure,
        spread=spread,
    )
