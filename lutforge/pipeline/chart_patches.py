"""The patches of a colour chart in pictures of a camera without RAW: found, measured, and checked."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from lutforge.arrays import Array, Mask, Single
from lutforge.calibration.exposure_pairs import NEAR_AN_END
from lutforge.colour.srgb import srgb_encode
from lutforge.errors import CalibrationError
from lutforge.pipeline.response import Bracket, colours_of
from lutforge.progress import Progress
from lutforge.samples.chart import ChartKind
from lutforge.samples.chart_search import RESEMBLANCE, LocatedChart, detector_note, find_chart, patch_codes, resemblance

SPACE = "acescg"
"""The linear space of the chart's colours: it contains the colours of all surfaces, and is near those of cameras."""


def measured_patches(
    bracket: Bracket, kind: ChartKind, light: str, corners: Array | None, progress: Progress
) -> tuple[Array, tuple[str, ...]]:
    """JPEG values (shots, n, 3) of the patches, NaN where clipped or outside, and the shots in which it was found.

    corners: (4, 2), of the chart in all shots; None where it is searched for. Raises CalibrationError where no chart is
    found, or where the patches do not have its colours.
    """
    colours = np.clip(kind.linear_srgb(light), 0.0, 1.0)
    reference: Array = 255.0 * srgb_encode(colours)
    if corners is None:
        places = _found_places(bracket, kind, reference, progress)
    else:
        places = dict.fromkeys(range(len(bracket.files)), corners)

    # A shot in which the chart was not found has it where the shot of the nearest exposure has it.
    times = bracket.exposure_s
    values = np.full((len(bracket.files), len(reference), 3), np.nan)
    likeness = 0.0
    for index, file in enumerate(bracket.files):
        progress(file.name, 0.5 + 0.5 * index / len(bracket.files))
        nearest = min(places, key=lambda shot: abs(np.log(times[shot] / times[index])))
        patches = patch_codes(_codes_of(file), LocatedChart(places[nearest], kind))
        clipped = np.any((patches.maximum >= 254) | (patches.minimum <= 1), axis=1)  # the limits of JPEG pixels
        values[index] = np.where(clipped[:, None], np.nan, patches.mean / 255.0)
        unclipped = np.isfinite(values[index]).all(axis=1)
        if unclipped.sum() > 4:  # an affine map explains any four colours
            likeness = max(likeness, resemblance(patches.mean[unclipped], reference[unclipped]))
    if likeness < RESEMBLANCE:
        raise CalibrationError(
            f"what lies between these corners is no {kind.name}: name them clockwise, the first patch's first"
        )

    # The camera may clip below 1: values near the highest one are clipped where there are four or more of them. A
    # single patch may be the brightest without being clipped.
    near_highest = values > np.nanmax(values, axis=(0, 1)) - NEAR_AN_END
    clipped_values = near_highest & (np.count_nonzero(near_highest, axis=(0, 1)) >= 4)
    values[clipped_values.any(axis=2)] = np.nan
    return values, tuple(bracket.files[index].name for index in sorted(places))


def _found_places(bracket: Bracket, kind: ChartKind, reference: Array, progress: Progress) -> dict[int, Array]:
    """The corners (4, 2) of the chart by the number of the shot. Raises CalibrationError where it is in none of them.

    reference: (n, 3), the codes of its patches.
    """
    places: dict[int, Array] = {}
    for index, file in enumerate(bracket.files):
        progress(f"{file.name}: looking for the chart", 0.5 * index / len(bracket.files))
        chart = find_chart(np.rint(_codes_of(file)).astype(np.uint8), kind, reference)
        if chart is not None:
            places[index] = chart.corners
    if not places:
        reason = detector_note() if kind.detector else "OpenCV has no detector for it"
        raise CalibrationError(
            f"{_some(bracket.names)}: no {kind.name} ({reason or 'none was found'}); give its corners, clockwise from "
            'the first patch\'s, --corners "x,y x,y x,y x,y"'
        )
    return places


def _codes_of(file: Path) -> Single:
    """A picture (h, w, 3) in codes 0 … 255; more than 8 bits give fractions."""
    return np.asarray(np.clip(255.0 * colours_of(file), 0.0, 255.0), dtype=np.float32)


def near_neutral(colours: Array) -> Mask:
    """Mask (n,) of the colours (n, 3) of a chart that are near neutral."""
    neutral: Mask = 1.0 - colours.min(axis=1) / colours.max(axis=1) < 0.12
    return neutral


def not_charted(names: Sequence[str], charted: Sequence[str], corners: Array | None) -> str:
    """The end of a message, on pictures in which no chart was found; "" where it was in all, or corners are given."""
    missing = [name for name in names if name not in charted] if corners is None else []
    return f"; no chart was found in {_some(missing)}" if missing else ""


def _some(names: Sequence[str]) -> str:
    """The first names of a list, and the number of the others."""
    listed = ", ".join(names[:4])
    return f"{listed} and {len(names) - 4} others" if len(names) > 4 else listed
