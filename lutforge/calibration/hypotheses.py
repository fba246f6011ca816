"""Causes that spoil samples when files are read: each is a hypothesis with the changes of the samples that undo it."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from lutforge.calibration.judgement import Judgement, StyleColours
from lutforge.colour.srgb import srgb_encode

OTHER_ORDERS = ((2, 1, 0), (1, 2, 0), (2, 0, 1), (1, 0, 2), (0, 2, 1))
"""The orders of red (0), green and blue that are not theirs."""
LARGEST_RAW = 4.0
"""RAW above this, after its white level was corrected, was not divided by too high a one."""
BLACK_LEVELS = (0.004, 0.0065, 0.01, 0.015, 0.025, 0.04)
"""Black levels, as shares of white, that are tried as left in the RAW or as taken from it twice."""
LARGEST_BALANCE_SHIFT = 0.6
"""Stops between two channels of greys; cameras let users shift their white balance by less."""


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """A cause that could apply to samples.

    advice: what to do then; corrections: the samples with the cause undone, in strengths from the weakest on.
    """

    cause: str
    advice: str
    corrections: Sequence[StyleColours]


def hypotheses(colours: StyleColours, judgement: Judgement) -> Iterator[Hypothesis]:
    """The causes that could apply to the samples of a style, by the judgement of its base."""
    yield from _exchanged_channels(colours)
    yield from _wrong_levels(colours, judgement)
    if colours.has_stated_balance:
        yield from _wrong_white_balances(colours, judgement)


def _exchanged_channels(colours: StyleColours) -> Iterator[Hypothesis]:
    """Red, green and blue were read in another order."""
    for order in OTHER_ORDERS:
        original = list(np.argsort(order))
        letters = ", ".join("RGB"[channel] for channel in order)
        yield Hypothesis(
            _cause_of_order("JPEG", order),
            f"read the file as R, G, B, not {letters}, and sample again",
            [replace(colours, encoded=colours.encoded[:, original])],
        )
        yield Hypothesis(
            _cause_of_order("RAW", order),
            f"read the filter pattern of the RAW as R, G, B, not {letters}, and sample again",
            [replace(colours, raw=colours.raw[:, original])],
        )


def _cause_of_order(file: str, order: tuple[int, int, int]) -> str:
    """The cause that the channels of the JPEG or RAW are in an order, in words."""
    if order == (2, 1, 0):
        return f"red and blue of the {file} are swapped"
    return f"the channels of the {file} are {', '.join('RGB'[channel] for channel in order)}"


def _wrong_levels(colours: StyleColours, judgement: Judgement) -> Iterator[Hypothesis]:
    """JPEG values are linear, or the RAW has another white or black level."""
    yield Hypothesis(
        "the JPEG values are linear",
        "use the camera's JPEG as it is, encoded",
        [replace(colours, encoded=srgb_encode(colours.encoded))],
    )

    brighter = colours.raw * 2.0**-judgement.white
    if brighter.max() < LARGEST_RAW:
        yield Hypothesis(
            "RAW is divided by too high a white level",
            "divide by the level at which this sensor saturates, and sample again",
            [replace(colours, raw=brighter)],
        )

    for cause, sign in (("the black level is left in", -1.0), ("more than the black level is taken from", 1.0)):
        yield Hypothesis(
            f"{cause} the RAW",
            "subtract the sensor's own black level, once, before the samples are taken",
            [replace(colours, raw=colours.raw + sign * level) for level in BLACK_LEVELS],
        )
        for channel, name in enumerate(("red", "green", "blue")):
            of_channel = np.eye(3)[channel]
            yield Hypothesis(
                f"{cause} {name} of the RAW",
                "subtract the sensor's own black level of each channel, once, before the samples are taken",
                [replace(colours, raw=colours.raw + sign * level * of_channel) for level in BLACK_LEVELS],
            )


def _wrong_white_balances(colours: StyleColours, judgement: Judgement) -> Iterator[Hypothesis]:
    """The multipliers that the files state are not those of the RAW."""
    yield Hypothesis(
        "green of the RAW is counted twice",
        "take the mean of the two green pixels, not their sum, and sample again",
        [replace(colours, raw=colours.raw * [1.0, 0.5, 1.0])],
    )
    yield Hypothesis(
        "the white-balance multipliers are inverted",
        "give the multipliers of RAW, not their reciprocals, or leave the columns wb_r, wb_g, wb_b out",
        [replace(colours, multipliers=1.0 / colours.multipliers)],
    )
    yield Hypothesis(
        "the RAW is white-balanced already",
        "sample RAW before white balance, or leave the columns wb_r, wb_g, wb_b out",
        [replace(colours, multipliers=np.ones_like(colours.multipliers))],
    )
    if np.ptp(judgement.tint) < LARGEST_BALANCE_SHIFT:
        neutral = 2.0 ** (judgement.tint - judgement.tint[1])
        yield Hypothesis(
            "the white balance is shifted in the camera",
            "set the camera's white-balance shift to 0, or keep it so for every picture",
            [replace(colours, multipliers=colours.multipliers * neutral)],
        )
