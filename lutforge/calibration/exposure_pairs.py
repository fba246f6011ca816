"""Exposure pairs: the same surface under the same illuminant in two shots of different exposure (thesis 3.2)."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from lutforge.arrays import Array, Mask
from lutforge.calibration.matrix_and_response import saturation
from lutforge.errors import CalibrationError
from lutforge.model.response import Response
from lutforge.samples.sample_set import SampleSet

NEAR_AN_END = 1.5 / 255
"""JPEG values this near 0 or 1 in any channel are clipped."""
END_GUARD = 4 / 255
"""So are cells of a bracket this near its black or white, which compression and noise move."""
LEAST_STOPS, MOST_STOPS = 0.15, 3.5
"""Between two shots; those further apart share too few unclipped surfaces, and their shifts are larger (thesis 3.2)."""
LEAST_PAIRS = 6
"""Pairs of colours that two shots must share to be compared."""
TIME_SPREAD, RAW_SPREAD = 0.03, 0.003
"""Expected error of the logarithm of an exposure time, and of a ratio that RAW values tell."""
FLAT = (0.01, 0.03)
"""A cell is flat whose standard deviation is below the first and this share of its mean."""
SAME_SCENE = 0.12
"""All surfaces of one scene have the same RAW ratio; a wider spread of its logarithm means another scene."""
DARK_RAW, NEAR_AN_END_RAW = 0.004, 0.999


@dataclass(frozen=True, eq=False)
class ExposurePairs:
    """Colours of the same surfaces at two exposures.

    first, second: JPEG values (n, 3); log_ratio: log k' (n,) of second over first.

    raw_first, raw_second: (n, 3), NaN where there is no RAW. first_row, second_row: (n,) rows of the sample table, or
    cells of the images. shots: names; first_shot, second_shot: (n,) indices into it; shot_exposure: (shots,) log
    exposure as stated, with mean 0 over each group of shots that pairs connect; spread: its expected error.
    black, white: (3,) the JPEG values that were scaled to 0 and 1: not every camera's are, and film has a fog.
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
    def of_shots(self) -> NDArray[np.intp]:
        """(n,): which two shots a pair is of, first_shot · number of shots + second_shot."""
        return self.first_shot * len(self.shots) + self.second_shot

    @property
    def saturation(self) -> Array:
        """(n,): the larger HSV saturation of the two colours of a pair."""
        return np.maximum(saturation(self.first), saturation(self.second))

    def departure(self, response: Response) -> Array:
        """I' − τ(I) (n, 3), where τ is what a response makes of each pair's own ratio (3.1)."""
        ratio = np.exp(self.log_ratio)[:, None]
        return self.second - response.encode(ratio * response.linearize(self.first))

    def corrected(self, shot_error: Mapping[str, float]) -> "ExposurePairs":
        """The pairs with exposure errors taken out: the log of true over stated exposure, by shot."""
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
        for one, other in names:
            ends = {index.get(one, -1), index.get(other, -1)}
            keep &= ~(np.isin(self.first_shot, list(ends)) & np.isin(self.second_shot, list(ends)))
        return self.select(keep)


@dataclass(frozen=True, eq=False)
class _Exposure:
    """One shot's surfaces, unclipped or not, in the same order as the other shots of its group."""

    name: str
    log_time: float
    encoded: Array
    raw: Array
    usable: Mask
    row: NDArray[np.intp]


def pairs_of_samples(samples: SampleSet) -> ExposurePairs:
    """All exposure pairs of a sample table: same style and white balance, same patch, other shot.

    With RAW the ratio is that of the RAW values, which are linear, and pairs of shots whose surfaces have no common
    ratio are other scenes and left out; without, it is that of the exposure times.
    Raises CalibrationError where no two shots are a pair.
    """
    parts: list[tuple[_Exposure, _Exposure, Mask, float]] = []
    from_raw = bool(np.all(samples.raw_camera == samples.camera)) and bool(np.any(samples.raw > 0))
    for group in _groups(samples):
        for one, other in combinations(sorted(group, key=lambda shot: shot.log_time), 2):
            both = one.usable & other.usable
            ratio = _log_ratio(one, other, both, from_raw)
            if ratio is not None and LEAST_STOPS <= abs(ratio) / np.log(2) <= MOST_STOPS:
                parts.append((one, other, both, ratio) if ratio > 0 else (other, one, both, -ratio))
    if not parts:
        raise CalibrationError(
            "no two shots show the same surfaces at different exposures: "
            "shoot the same chart at several shutter speeds, with all other settings the same"
        )
    return _join(parts, RAW_SPREAD if from_raw else TIME_SPREAD)


def pairs_of_bracket(names: Sequence[str], encoded: Iterable[Array], exposure_s: Sequence[float]) -> ExposurePairs:
    """Exposure pairs of registered JPEGs of one scene: flat cells of 8 × 8 pixels.

    encoded: images (h, w, 3) in [0, 1], all of one size, taken one at a time; exposure_s: relative times, with all
    other settings the same. Black and white are found from the outermost shots.
    Raises CalibrationError below two exposures, on sizes that differ, or where nothing is flat and unclipped.
    """
    if len(set(exposure_s)) < 2:
        raise CalibrationError(
            "one exposure only: the response needs a bracket; shoot the same scene at several shutter speeds"
        )
    shapes, measured = set(), []
    for image in encoded:  # one at a time: large photographs do not all fit into memory
        shapes.add(image.shape)
        measured.append(_cells(np.asarray(image, dtype=np.float64), 8))
    if len(shapes) != 1 or len(names) != len(measured) or len(names) != len(exposure_s):
        raise CalibrationError("the shots of a bracket must have one size, and each its name and exposure time")
    order = np.argsort(exposure_s)
    cells = [measured[place] for place in order]
    stops = np.log2(np.asarray(exposure_s)[order])
    within = np.flatnonzero(stops - stops[0] <= MOST_STOPS)[-1]  # nearer, dark tones would pass for black, too
    black, low = _insensitive(cells[0][0], cells[within][0], NEAR_AN_END, dark=True)
    white, high = _insensitive(cells[-1][0], cells[-2][0], NEAR_AN_END, dark=False)
    shots = []
    for place, (mean, spread) in zip(order, cells, strict=True):
        flat = spread.max(axis=1) < FLAT[0] + FLAT[1] * mean.max(axis=1)
        usable = flat & np.all((mean > low + END_GUARD) & (mean < high - END_GUARD), axis=1)
        log_time = float(np.log(exposure_s[place]))
        inside = (mean - black) / (white - black)
        nothing = np.full_like(mean, np.nan)
        shots.append(_Exposure(names[place], log_time, inside, nothing, usable, np.arange(len(mean))))
    parts = []
    for one, other in combinations(shots, 2):
        both = one.usable & other.usable
        ratio = other.log_time - one.log_time
        if both.sum() >= LEAST_PAIRS and LEAST_STOPS <= ratio / np.log(2) <= MOST_STOPS:
            parts.append((one, other, _over_tones(one.encoded, both), ratio))
    if not parts:
        raise CalibrationError("no two shots of the bracket share flat, unclipped surfaces: shoot smaller steps")
    return replace(_join(parts, TIME_SPREAD), black=black, white=white)


def _insensitive(outer: Array, inner: Array, noise_of_code: float, *, dark: bool) -> tuple[Array, Array]:
    """Find the JPEG values (3,) where a channel no longer follows the exposure, and where the noise there ends.

    They are of the cells (n, 3) of two shots: the black of two dark shots of a bracket, or the white of its brightest
    two. noise_of_code: cells that differ by no more do not follow the exposure.
    """
    ends = np.zeros(3) if dark else np.ones(3)
    noise = ends.copy()
    for channel in range(3):
        one, other = outer[:, channel], inner[:, channel]
        side = other < 0.25 if dark else other > 0.75
        same = one[side & (np.abs(one - other) <= noise_of_code)]
        # A thousandth of the cells must not follow the exposure for their value to be the black or white
        if len(same) >= 1e-3 * one.size:
            ends[channel] = np.median(same)
            spread = 3 * np.median(np.abs(same - ends[channel]))
            noise[channel] = ends[channel] + (spread if dark else -spread)
    return ends, noise


def _over_tones(encoded: Array, usable: Mask) -> Mask:
    """Choose at most 400 of the usable cells (n,), evenly over the tones: a dark wall must not outweigh all else."""
    rows = np.random.default_rng(0).permutation(np.flatnonzero(usable))
    tone = np.minimum((encoded[rows].mean(axis=1) * 16).astype(np.intp), 15)
    order = np.argsort(tone, kind="stable")
    rank = np.empty(len(rows), dtype=np.intp)
    rank[order] = np.arange(len(rows)) - np.searchsorted(tone[order], tone[order])
    chosen = np.zeros_like(usable)
    chosen[rows[np.argsort(rank, kind="stable")[:400]]] = True
    return chosen


def _cells(image: Array, cell: int) -> tuple[Array, Array]:
    """Mean and standard deviation (cells, 3) of non-overlapping cells; the grid is the same for every image."""
    height, width = image.shape[0] // cell, image.shape[1] // cell
    cells = image[: height * cell, : width * cell].reshape(height, cell, width, cell, 3)
    return cells.mean(axis=(1, 3)).reshape(-1, 3), cells.std(axis=(1, 3)).reshape(-1, 3)


def _groups(samples: SampleSet) -> Iterator[list[_Exposure]]:
    """Per style and white balance, the shots over the patches of the group (rows that a shot lacks are unusable)."""
    for style in np.unique(samples.style):
        for balance in np.unique(samples.white_balance[samples.style == style]):
            inside = np.flatnonzero((samples.style == style) & (samples.white_balance == balance))
            patches = np.unique(samples.patch[inside])
            group = []
            for name in np.unique(samples.shot[inside]):
                rows = inside[samples.shot[inside] == name]
                shot = samples.select(rows)
                place = np.searchsorted(patches, shot.patch)
                encoded, raw = np.full((len(patches), 3), np.nan), np.full((len(patches), 3), np.nan)
                encoded[place], raw[place] = shot.srgb, shot.raw
                row = np.full(len(patches), -1)
                row[place] = rows
                with np.errstate(invalid="ignore"):
                    usable = np.all((encoded > NEAR_AN_END) & (encoded < 1 - NEAR_AN_END), axis=1)
                    usable &= ~np.any(raw >= NEAR_AN_END_RAW, axis=1)
                time = shot.exposure_s[np.isfinite(shot.exposure_s)]
                log_time = float(np.log(np.median(time))) if len(time) else np.nan
                group.append(_Exposure(str(name), log_time, encoded, raw, usable, row))
            yield group


def _log_ratio(one: _Exposure, other: _Exposure, both: Mask, from_raw: bool) -> float | None:
    """log k' of other over one; None where they are no pair."""
    if both.sum() < LEAST_PAIRS:
        return None
    if not from_raw:
        ratio = other.log_time - one.log_time
        return float(ratio) if np.isfinite(ratio) else None
    bright = both & np.all((one.raw > DARK_RAW) & (other.raw > DARK_RAW), axis=1)
    if bright.sum() < LEAST_PAIRS:
        return None
    logs = np.log(other.raw[bright] / one.raw[bright])
    middle = float(np.median(logs))
    return middle if float(np.median(np.abs(logs - middle))) < SAME_SCENE else None


def _join(parts: list[tuple[_Exposure, _Exposure, Mask, float]], spread: float) -> ExposurePairs:
    names = sorted({shot.name for one, other, _, _ in parts for shot in (one, other)})
    index = {name: place for place, name in enumerate(names)}
    counts = [int(both.sum()) for _, _, both, _ in parts]
    ratios = np.array([ratio for *_, ratio in parts])
    ends = np.array([(index[one.name], index[other.name]) for one, other, _, _ in parts])
    incidence = np.zeros((len(parts), len(names)))
    incidence[np.arange(len(parts)), ends[:, 0]] = -1.0
    incidence[np.arange(len(parts)), ends[:, 1]] = 1.0
    return ExposurePairs(
        first=np.concatenate([one.encoded[both] for one, _, both, _ in parts]),
        second=np.concatenate([other.encoded[both] for _, other, both, _ in parts]),
        raw_first=np.concatenate([one.raw[both] for one, _, both, _ in parts]),
        raw_second=np.concatenate([other.raw[both] for _, other, both, _ in parts]),
        first_row=np.concatenate([one.row[both] for one, _, both, _ in parts]),
        second_row=np.concatenate([other.row[both] for _, other, both, _ in parts]),
        log_ratio=np.repeat(ratios, counts),
        shots=tuple(names),
        first_shot=np.repeat(ends[:, 0], counts),
        second_shot=np.repeat(ends[:, 1], counts),
        shot_exposure=np.linalg.lstsq(incidence, ratios, rcond=None)[0],  # of least norm: mean 0 in each group
        spread=spread,
    )
