"""The dark end of samples: whether RAW and JPEG values of greys go to black together, in every channel.

A black level that is off, video levels and a veil show nowhere else: a response takes them up without a residual.
"""

from collections.abc import Iterator

import numpy as np

from lutforge.arrays import Array
from lutforge.calibration.lattice.monochrome import is_monochrome
from lutforge.calibration.white_balance import LEAST_POSITIVE
from lutforge.samples.sample_set import SampleSet
from lutforge.solvers.robust_weights import RobustWeights, cauchy

LEAST_DARK_GREYS = 24
"""Fewer dark greys of a style are not judged."""
MOST_OFFSET = 0.002
"""Share of white by which dark greys of one channel may be off from those of another; of sound sets at most half."""
STANDARD_ERRORS = 10
"""An offset is sure beyond so many of its standard errors."""
OFFSET_WEIGHTS = RobustWeights(cauchy, multiple=2.0, least=1e-4)
LEAST_DARK_POWER, MOST_DARK_POWER = 0.5, 1.8
"""RAW rises about with the first power of dark JPEG values. Beyond these powers the two do not go to black together."""
LIFTED, VIDEO_BLACK, VIDEO_WHITE = 15.5, 24.0, 235.5
"""Codes: darkest ones above the first are lifted, and below the second they may be those of video levels, if none lies
above the third."""
DARK_GREY, NEAR_GREY, NEAR_GREY_SHARE = 110, 8, 0.12
"""Codes below which a grey is dark, and by which channels of a grey differ at most: so many, or so large a share."""


def dark_end_notes(samples: SampleSet, multipliers: Array) -> tuple[str, ...]:
    """Notes on RAW and JPEG values of dark greys that do not go to black together.

    multipliers: (n, 3), what makes RAW white-balanced.
    """
    notes = []
    for style in np.unique(samples.style[samples.raw_space == ""]):
        rows = samples.style == style
        codes = 255 * samples.srgb[rows]
        balanced = samples.raw[rows] * multipliers[rows]

        inside = (codes.min(axis=1) > 0.5) & (codes.max(axis=1) < DARK_GREY) & (samples.raw[rows].max(axis=1) < 0.98)
        grey = inside & (np.ptp(codes, axis=1) < np.maximum(NEAR_GREY, NEAR_GREY_SHARE * codes.max(axis=1)))
        if np.count_nonzero(grey) < LEAST_DARK_GREYS or is_monochrome(balanced[grey], samples.srgb[rows][grey]):
            continue

        offset = _channel_offset(codes[grey], balanced[grey])
        style_notes = [offset] if offset else _black_ends(codes, codes[grey], balanced[grey])
        notes += [f'style "{style}": {note}' for note in style_notes]
    return tuple(notes)


def _channel_offset(greys: Array, balanced: Array) -> str:
    """A sentence on the channel whose RAW does not go to zero with the others; "" where all do.

    greys, balanced: (m, 3), codes and balanced RAW of dark greys.
    """
    green = balanced[:, 1]
    weight_of_tone = 1.0 / (np.abs(green) + 0.002)
    offsets, sure = np.zeros(2), np.zeros(2, dtype=np.bool_)
    for place, channel in enumerate((0, 2)):
        # RAW of the channel = a · green + offset + b · what the JPEG's tint explains
        tinted = (greys[:, channel] - greys[:, 1]) / np.maximum(greys[:, 1], 1.0) * green
        columns = np.column_stack([green, np.ones_like(green), tinted])
        weight = weight_of_tone
        for _ in range(8):
            solution = np.linalg.lstsq(columns * weight[:, None], balanced[:, channel] * weight, rcond=None)[0]
            residual = (balanced[:, channel] - columns @ solution) * weight_of_tone
            weight = weight_of_tone * np.sqrt(OFFSET_WEIGHTS(np.abs(residual)))

        spread = np.linalg.pinv((columns * weight[:, None]).T @ (columns * weight[:, None]))[1, 1]
        error = np.sqrt(spread * np.mean((weight / weight_of_tone * residual) ** 2))
        offsets[place] = solution[1]
        sure[place] = abs(solution[1]) > max(MOST_OFFSET, STANDARD_ERRORS * error)

    if not np.any(sure):
        return ""
    name = "red" if abs(offsets[0]) > abs(offsets[1]) else "blue"
    if sure.all() and np.ptp(offsets) < 0.5 * np.abs(offsets).max():  # both are off alike: it is green
        name = "green"
    by = float(offsets[np.argmax(np.abs(offsets))]) * (-1 if name == "green" else 1)
    return (
        f"dark greys of the RAW do not go to zero together, {name} is off by {by:+.3f} of white: "
        "check the black level of each channel"
    )


def _black_ends(codes: Array, greys: Array, balanced: Array) -> Iterator[str]:
    """Yield a sentence where RAW stays above black, or JPEG values do. codes: (n, 3), of all samples of the style."""
    level = greys.mean(axis=1)
    dark = level <= np.percentile(level, 30)
    lifted = codes.min() > LIFTED
    if np.ptp(np.log2(level[dark])) < (0.2 if lifted else 1.0):  # too few tones for a power
        power = np.inf if lifted else 1.0
    else:
        stops = np.log2(np.maximum(balanced[dark].mean(axis=1), LEAST_POSITIVE))
        power = float(np.polyfit(np.log2(level[dark]), stops, 1)[0])

    if power < LEAST_DARK_POWER:
        floor = 100 * float(np.median(balanced[level <= np.percentile(level, 10), 1]))
        yield (
            f"where JPEG values go to black, RAW stays at {floor:.1f} % of white: "
            "a black level left in the RAW, or JPEGs whose contrast was stretched"
        )
    elif power > MOST_DARK_POWER and lifted:
        above = " or above 235" if codes.min() < VIDEO_BLACK and codes.max() < VIDEO_WHITE else ""
        reason = "video levels, 16 to 235" if above else "a veil, or black that was lifted"
        yield f"no JPEG value lies below {codes.min():.0f}{above}, though RAW goes to black: {reason}"
