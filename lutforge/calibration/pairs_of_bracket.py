"""The exposure pairs of a bracket: registered JPEGs of one scene, compared in flat cells (thesis 3.2)."""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np

from lutforge.arrays import Array, Mask
from lutforge.calibration.exposure_pairs import (
    LEAST_SHARED_SURFACES,
    MOST_STOPS,
    NEAR_AN_END,
    TIME_SPREAD,
    ExposurePairs,
    ShotColours,
    ShotPair,
    are_comparable,
    joined,
)
from lutforge.errors import CalibrationError

CELL_SIDE = 8
"""Side of a cell in pixels: a block of JPEG's cosine transform."""
END_GUARD = 4 / 255
"""Cells this near the black or white of a bracket are clipped, since compression and noise move them."""
FLAT_DEVIATION, FLAT_SHARE = 0.01, 0.03
"""A cell is flat where its standard deviation is below the first, plus this share of its mean."""
TONE_BINS, MOST_CELLS = 16, 400
"""Cells of a pair of shots are chosen evenly from so many tones, so many in all."""


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
    shapes = set()
    measured = []
    for image in encoded:  # one at a time: large photographs do not all fit into memory
        shapes.add(image.shape)
        measured.append(_cells(np.asarray(image, dtype=np.float64), CELL_SIDE))
    if len(shapes) != 1 or len(names) != len(measured) or len(names) != len(exposure_s):
        raise CalibrationError("the shots of a bracket must have one size, and each its name and exposure time")
    order = np.argsort(exposure_s)
    cells = [measured[place] for place in order]

    # Black is compared with the brightest shot within MOST_STOPS of the darkest: between nearer shots dark tones hardly
    # change and would be taken for black, too.
    stops = np.log2(np.asarray(exposure_s)[order])
    within = np.flatnonzero(stops - stops[0] <= MOST_STOPS)[-1]
    black, low = _insensitive(cells[0][0], cells[within][0], NEAR_AN_END, dark=True)
    white, high = _insensitive(cells[-1][0], cells[-2][0], NEAR_AN_END, dark=False)

    shots = []
    for place, (mean, deviation) in zip(order, cells, strict=True):
        flat = deviation.max(axis=1) < FLAT_DEVIATION + FLAT_SHARE * mean.max(axis=1)
        usable = flat & np.all((mean > low + END_GUARD) & (mean < high - END_GUARD), axis=1)
        log_time = float(np.log(exposure_s[place]))
        scaled = (mean - black) / (white - black)
        no_raw = np.full_like(mean, np.nan)
        shots.append(ShotColours(names[place], log_time, scaled, no_raw, usable, np.arange(len(mean))))

    shot_pairs = []
    for shorter, longer in combinations(shots, 2):
        surfaces = shorter.usable & longer.usable
        ratio = longer.log_time - shorter.log_time
        if surfaces.sum() >= LEAST_SHARED_SURFACES and are_comparable(ratio):
            shot_pairs.append(ShotPair(shorter, longer, _over_tones(shorter.encoded, surfaces), ratio))
    if not shot_pairs:
        raise CalibrationError("no two shots of the bracket share flat, unclipped surfaces: shoot smaller steps")
    return replace(joined(shot_pairs, TIME_SPREAD), black=black, white=white)


def _cells(image: Array, side: int) -> tuple[Array, Array]:
    """Mean and standard deviation (cells, 3) of non-overlapping cells; the grid is the same for every image."""
    height = image.shape[0] // side
    width = image.shape[1] // side
    cells = image[: height * side, : width * side].reshape(height, side, width, side, 3)
    return cells.mean(axis=(1, 3)).reshape(-1, 3), cells.std(axis=(1, 3)).reshape(-1, 3)


def _insensitive(outer: Array, inner: Array, noise_of_code: float, *, dark: bool) -> tuple[Array, Array]:
    """The JPEG value (3,) at which a channel no longer follows the exposure, and the limit (3,) of the noise around it.

    outer, inner: cells (n, 3) of two shots: of two dark shots for the black of a bracket, of its brightest two for the
    white. noise_of_code: cells that differ by no more do not follow the exposure.
    """
    limit = np.zeros(3) if dark else np.ones(3)
    noise_limit = limit.copy()
    for channel in range(3):
        values = outer[:, channel]
        compared = inner[:, channel]
        is_near = compared < 0.25 if dark else compared > 0.75
        same = values[is_near & (np.abs(values - compared) <= noise_of_code)]
        # A thousandth of the cells must not follow the exposure for their value to be the black or white.
        if len(same) >= 1e-3 * values.size:
            limit[channel] = np.median(same)
            spread = 3 * np.median(np.abs(same - limit[channel]))
            noise_limit[channel] = limit[channel] + (spread if dark else -spread)
    return limit, noise_limit


def _over_tones(encoded: Array, usable: Mask) -> Mask:
    """Choose at most MOST_CELLS of the usable cells (n,), evenly over the tones.

    Otherwise one large wall would outweigh all other tones. Cells are numbered within their tone, in random
    order, and those with the lowest numbers are chosen.
    """
    rows = np.random.default_rng(0).permutation(np.flatnonzero(usable))
    tone = np.minimum((encoded[rows].mean(axis=1) * TONE_BINS).astype(np.intp), TONE_BINS - 1)
    by_tone = np.argsort(tone, kind="stable")
    number_in_tone = np.empty(len(rows), dtype=np.intp)
    number_in_tone[by_tone] = np.arange(len(rows)) - np.searchsorted(tone[by_tone], tone[by_tone])

    chosen = np.zeros_like(usable)
    chosen[rows[np.argsort(number_in_tone, kind="stable")[:MOST_CELLS]]] = True
    return chosen
