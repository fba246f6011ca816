"""The dark end of samples: whether RAW and JPEG values of greys go to black together, in every channel.

A black level that is off, video levels and a veil show nowhere else: a response takes them up without a residual.
"""

from dataclasses import dataclass

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
LEAST_DARKEST = 8
"""The tones by which the dark end is judged are of so many greys, at least."""
STANDARD_ERRORS = 10
"""An offset is sure beyond so many of its standard errors."""
OFFSET_WEIGHTS = RobustWeights(cauchy, multiple=2.0, least=1e-4)
LEAST_DARK_POWER, MOST_DARK_POWER, STEEPEST_DARK_POWER = 0.5, 1.8, 3.0
"""RAW rises about with the first power of dark JPEG values. Beyond the first two powers the two do not go to black
together, if JPEG values are lifted in the second case; beyond the last one no response is so flat (displays have 2.6).
"""
LIFTED, VIDEO_BLACK, VIDEO_WHITE = 15.5, 24.0, 235.5
"""Codes: darkest ones above the first are lifted, and below the second they may be those of video levels, if none lies
above the third."""
BLACK_CODE, LEAST_BLACK = 0.5, 5
"""A channel is black at this code or below; so many black greys are evidence by their RAW."""
LEAST_SPAN = 0.2
"""Tones that span fewer stops of codes determine no power."""
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

        dark = (codes.max(axis=1) < DARK_GREY) & (samples.raw[rows].max(axis=1) < 0.98)
        is_black = dark & (codes.max(axis=1) <= BLACK_CODE)
        inside = dark & (codes.min(axis=1) > BLACK_CODE)
        grey = inside & (np.ptp(codes, axis=1) < np.maximum(NEAR_GREY, NEAR_GREY_SHARE * codes.max(axis=1)))
        if np.count_nonzero(grey | is_black) < LEAST_DARK_GREYS or np.count_nonzero(grey) < LEAST_DARKEST:
            continue
        if is_monochrome(balanced[grey], samples.srgb[rows][grey]):
            continue

        greys = _DarkGreys(codes[grey], balanced[grey], balanced[is_black])
        note = _note_on_black(codes, greys, _channel_offset(greys))
        notes += [f'style "{style}": {note}'] if note else []
    return tuple(notes)


@dataclass(frozen=True, eq=False)
class _DarkGreys:
    """Dark greys of a style. codes, balanced: (m, 3) JPEG codes and balanced RAW; black: (b, 3), that of black ones."""

    codes: Array
    balanced: Array
    black: Array


@dataclass(frozen=True, eq=False)
class _ChannelOffset:
    """By how much balanced RAW of a channel is off from the others, in a sentence, and for each channel, (3,)."""

    words: str
    offsets: Array


def _channel_offset(dark_greys: _DarkGreys) -> _ChannelOffset | None:
    """The channel whose RAW does not go to zero with the others; None where all do."""
    greys, balanced = dark_greys.codes, dark_greys.balanced
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
        return None
    name = "red" if abs(offsets[0]) > abs(offsets[1]) else "blue"
    if sure.all() and np.ptp(offsets) < 0.5 * np.abs(offsets).max():  # both are off alike: it is green
        name = "green"
    by = float(offsets[np.argmax(np.abs(offsets))]) * (-1 if name == "green" else 1)
    of_channels = np.where(np.array(["red", "green", "blue"]) == name, by, 0.0)
    others = ", or all channels are off the other way" if name == "green" else ""
    return _ChannelOffset(
        f"dark greys of the RAW do not go to zero together, {name} is off by {by:+.3f} of white{others}: "
        "check the black level of each channel",
        of_channels,
    )


def _note_on_black(codes: Array, greys: _DarkGreys, offset: _ChannelOffset | None) -> str:
    """A sentence where RAW stays above black, or JPEG values do, or the RAW of one channel is off; "" elsewhere.

    codes: (n, 3), of all samples of the style. Where RAW stays above black even after the offset of one channel is
    taken from it, a black level was left in all channels, and not only in that one.
    """
    balanced = greys.balanced - (0.0 if offset is None else offset.offsets)
    power = _dark_power(greys.codes.mean(axis=1), balanced.mean(axis=1), greys.black.mean(axis=1))
    lifted = codes.min() > LIFTED
    floor = float(np.min(balanced[:, 1]))
    if power < LEAST_DARK_POWER and not lifted and floor > MOST_OFFSET:
        return (
            f"where JPEG values go to black, RAW stays at {floor:.1%} of white: "
            "a black level left in the RAW, or JPEGs whose contrast was stretched"
        )
    if power > STEEPEST_DARK_POWER and not lifted:
        return (
            f"RAW goes to black where JPEG values are still at {greys.codes.mean(axis=1).min():.0f}: "
            "more than the black level is taken from the RAW"
        )
    if offset is not None:
        return offset.words
    if lifted and not power <= MOST_DARK_POWER:  # true of tones that a veil leaves too alike to determine a power
        above = " or above 235" if codes.min() < VIDEO_BLACK and codes.max() < VIDEO_WHITE else ""
        reason = "video levels, 16 to 235" if above else "a veil, or black that was lifted"
        return f"no JPEG value lies below {codes.min():.0f}{above}, though RAW goes to black: {reason}"
    return ""


def _dark_power(level: Array, balanced: Array, black: Array) -> float:
    """The power of JPEG codes that RAW is proportional to near black; NaN where codes are too alike to determine it.

    level, balanced: (m,) codes and RAW of greys; black: (b,), RAW of those whose JPEG is black. The power is that of
    the darkest greys that span a stop of codes. Black greys count as one more grey, of the code `BLACK_CODE`.
    """
    order = np.argsort(level)
    stops = np.log2(level[order])
    count = max(LEAST_DARKEST, int(np.searchsorted(stops, stops[0] + 1.0)) + 1)
    darkest = order[:count]
    levels, values = level[darkest], balanced[darkest]
    if len(black) >= LEAST_BLACK:
        levels = np.append(np.median(levels), BLACK_CODE)
        values = np.append(np.median(values), np.median(black))
    if np.ptp(np.log2(levels)) < LEAST_SPAN:
        return np.nan
    if np.median(values) <= 0.0:
        return np.inf
    return float(np.polyfit(np.log2(levels), np.log2(np.maximum(values, LEAST_POSITIVE)), 1)[0])
