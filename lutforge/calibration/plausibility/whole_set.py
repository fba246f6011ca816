"""Finds causes that spoil all samples alike, such as swapped channels, by a likelihood ratio for each cause.

Every cause is a hypothesis with a way to undo it. The samples without the cause are computed, the colour chain is
fitted again, and its likelihood among known cameras is compared with that of the samples as they are. A cause is
reported only where the ratio exceeds a threshold, so that a good camera is hardly ever accused.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lutforge.arrays import Array, Mask
from lutforge.calibration.plausibility.colour_chain import CODE, ColourChain, fit_chain
from lutforge.calibration.plausibility.known_cameras import (
    log_likelihood,
    seen_tones,
    stops,
    typical_matrix,
    typical_response,
)
from lutforge.calibration.plausibility.lifted_codes import lift
from lutforge.colour.rgb_spaces import matrix_between, rgb_space
from lutforge.colour.srgb import srgb_decode, srgb_encode
from lutforge.errors import CalibrationError
from lutforge.model.diagnosis import Diagnosis
from lutforge.samples.clipping import unclipped_colours

LEAST_GAIN = 3.5
"""Natural logarithm of the likelihood ratio above which a cause is named: one good set in a hundred is accused then."""


@dataclass(frozen=True, eq=False)
class Colours:
    """The samples of one style.

    raw: E (n, 3); encoded: I (n, 3); multipliers: (n, 3); setting: the white balances' names (n,); known: the files
    state the multipliers; inside: (n,) which samples were usable before a cause was undone, None for samples as given.
    """

    raw: Array
    encoded: Array
    multipliers: Array
    setting: NDArray[np.str_]
    known: bool
    inside: Mask | None = None

    def usable(self) -> Mask:
        """Mask (n,) of samples that are not clipped in RAW or JPEG, now and before a cause was undone."""
        inside = unclipped_colours(self.encoded, self.raw)
        return inside if self.inside is None else np.asarray(inside & self.inside)

    def changed(self, raw: Array | None = None, encoded: Array | None = None, by: Array | None = None) -> "Colours":
        """Return the colours with the given columns replaced."""
        return Colours(
            self.raw if raw is None else raw,
            self.encoded if encoded is None else encoded,
            self.multipliers if by is None else by,
            self.setting, self.known, self.usable(),
        )  # fmt: skip


@dataclass(frozen=True, eq=False)
class Cause:
    """A hypothesis: its name, the evidence, the advice, the samples without it, and its prior log odds."""

    cause: str
    evidence: str
    advice: str
    undone: Colours
    log_odds: float = 0.0


def whole_set_cause(colours: Colours) -> Diagnosis | None:
    """Return the likeliest cause that spoils all samples; None where the samples are good or too few.

    Only the likeliest cause is reported, although a second one may hide behind it.
    """
    try:
        given = fitted_chain(colours)
    except CalibrationError:
        return None
    before, best, found = _score(given, colours), LEAST_GAIN, None
    for cause in _causes(colours, given):
        try:
            chain = fitted_chain(cause.undone)
        except (CalibrationError, np.linalg.LinAlgError):
            continue
        recoded = given if cause.undone.encoded is not colours.encoded else None
        gain = _score(chain, cause.undone, recoded) + cause.log_odds - before
        if gain > best:
            best, found = gain, cause
    if found is None:
        return None
    evidence = f"{found.evidence} (likelier by a factor of 10^{best / np.log(10):.0f})"
    return Diagnosis(found.cause, evidence, found.advice)


def fitted_chain(colours: Colours) -> ColourChain:
    """Fit the chain to the usable samples. Raises CalibrationError where they are too few."""
    rows = colours.usable()
    balanced = colours.raw[rows] * colours.multipliers[rows]
    return fit_chain(balanced, colours.encoded[rows], colours.multipliers[rows])


def _score(chain: ColourChain, colours: Colours, given: ColourChain | None = None) -> float:
    """The log-likelihood of a chain; given: that of the samples as they are, where JPEG values were recoded."""
    rms = None if given is None else given.rms
    return log_likelihood(chain, known_multipliers=colours.known, rms=rms)


def _causes(colours: Colours, given: ColourChain) -> Iterator[Cause]:
    """Yield every cause that could apply, with the samples without it."""
    yield from _channel_causes(colours)
    yield from _encoding_causes(colours, given)
    yield from _level_causes(colours, given)
    if colours.known:
        yield from _balance_causes(colours, given)


def _channel_causes(colours: Colours) -> Iterator[Cause]:
    swap = [2, 1, 0]
    again = "read the file as RGB, not BGR, and sample again"
    yield Cause(
        "red and blue of the JPEG are swapped",
        "the matrix is a camera's only with them exchanged",
        again,
        colours.changed(encoded=colours.encoded[:, swap]),
    )
    yield Cause(
        "red and blue of the RAW are swapped",
        "the matrix is a camera's only with them exchanged",
        "read the filter pattern as RGGB, not BGGR, and sample again",
        colours.changed(raw=colours.raw[:, swap]),
    )
    if colours.known:
        half = np.array([1.0, 0.5, 1.0])
        yield Cause(
            "green of the RAW is counted twice",
            "neutral colours have twice the green that the multipliers tell",
            "take the mean of the two green pixels, not their sum, and sample again",
            colours.changed(raw=colours.raw * half),
        )


def _encoding_causes(colours: Colours, given: ColourChain) -> Iterator[Cause]:
    tones, power = typical_response().tones[1:], 9.0
    tones = tones[tones >= given.low]
    if len(tones) > 1:
        power = float(np.ptp(stops(given)[-len(tones) :]) / np.ptp(np.log2(tones)))
    if 0.7 < power < 1.55:  # of cameras it is 1.75 to 2.2
        yield Cause(
            "the JPEG values are linear",
            f"light rises as their power of {power:.1f}, of cameras' as about their square",
            "use the camera's JPEG as it is, encoded",
            colours.changed(encoded=srgb_encode(colours.encoded)),
        )
    linear = rgb_space("adobe-rgb").decode(colours.encoded) @ matrix_between("adobe-rgb", "srgb").T
    yield Cause(
        "the JPEGs are in Adobe RGB, and nothing says so",
        "reds are as dull as in that space read as sRGB, and no colour is one that only sRGB can show",
        "convert them to sRGB, or set the camera to sRGB",
        colours.changed(encoded=srgb_encode(np.clip(linear, 0.0, 1.0))),
        log_odds=_adobe_odds(colours, linear),
    )


def _adobe_odds(colours: Colours, linear: Array) -> float:
    """The log odds of Adobe RGB by the saturation of colours. linear: the samples read as Adobe RGB, in linear sRGB.

    Many cyans and greens of surfaces lie beyond sRGB. Rendered for sRGB they have almost no red, rendered for Adobe RGB
    they keep some; six such samples count at most. A sample that lies outside sRGB when it is read as Adobe RGB speaks
    for sRGB.
    """
    rows = colours.usable()
    balanced = colours.raw[rows] * colours.multipliers[rows]
    rendered, values = balanced @ typical_matrix().T, srgb_decode(colours.encoded[rows])
    beyond = (rendered[:, 0] < 0.15 * rendered[:, 1]) & (rendered[:, 1] > 0.02)
    count = int(beyond.sum())
    strong = float((values[beyond, 0] < 0.27 * values[beyond, 1]).mean()) if count else 0.0
    odds = min(count, 6) * (strong * np.log(0.05 / 0.7) + (1.0 - strong) * np.log(0.95 / 0.3))
    outside = float((linear[rows].min(axis=1) < -0.01).mean())
    return float(odds - 200.0 * outside)


def _level_causes(colours: Colours, given: ColourChain) -> Iterator[Cause]:
    seen = seen_tones(given)
    if seen.any():
        brighter = float(np.mean((typical_response().stops - stops(given))[seen][-2:]))
        if abs(brighter) > 0.75:
            yield _exposure_cause(colours, brighter)
    offset = given.offset
    if abs(offset) > 0.002 and given.offset_error < 0.3 * abs(offset):
        evidence = f"RAW is {abs(offset):.2%} of its range too {'high' if offset > 0 else 'low'} in the dark"
        cause = (
            "the black level is left in the RAW" if offset > 0 else "more than the black level is taken from the RAW"
        )
        advice = f"subtract the sensor's own black level, {'' if offset > 0 else 'once, '}before the samples are taken"
        yield Cause(cause, evidence, advice, colours.changed(raw=colours.raw - offset))
    rows = colours.usable()
    linear = given.predicted(colours.raw[rows] * colours.multipliers[rows], colours.multipliers[rows])
    black, odds = lift(colours.encoded[rows], linear)
    if black > 3.0 and odds > 4.0:
        yield Cause(
            f"JPEG values are lifted by about {black:.0f} codes",
            f"black is at code {black:.0f}, not at 0",
            "use the JPEG as the camera wrote it, full range, not a video's 16-235",
            colours.changed(encoded=colours.encoded - black * CODE),
            log_odds=odds,
        )


def _exposure_cause(colours: Colours, brighter: float) -> Cause:
    """RAW and JPEG of different exposure. brighter: by how many stops the JPEG is brighter than usual."""
    evidence = (
        f"the JPEG is {abs(brighter):.1f} EV {'brighter' if brighter > 0 else 'darker'} than cameras render such RAW"
    )
    undone = colours.changed(raw=np.clip(colours.raw * 2.0**brighter, 0.0, None))
    if brighter > 1.5 and float(np.max(colours.raw)) * 2.0**brighter < 1.6:
        return Cause(
            "RAW is divided by too high a white level",
            evidence,
            "divide by the level at which this sensor saturates, and sample again",
            undone,
        )
    return Cause(
        f"the JPEGs are developed {brighter:+.1f} EV",
        evidence,
        "use the camera's own JPEG, with exposure compensation and dynamic-range expansion off",
        undone,
    )


def _balance_causes(colours: Colours, given: ColourChain) -> Iterator[Cause]:
    ones = np.ones_like(colours.multipliers)
    yield Cause(
        "the RAW is white-balanced already",
        "with its multipliers neutral colours are not neutral, without they are",
        "sample RAW before white balance, or leave the columns wb_r, wb_g, wb_b out",
        colours.changed(by=ones),
    )
    names = [str(name) for name in np.unique(colours.setting)]
    for first, name in enumerate(names):
        for other in names[first + 1 :]:
            a, b = (np.median(colours.multipliers[colours.setting == each], axis=0) for each in (name, other))
            if np.abs(np.log(a / b)).max() > 0.1:
                yield _exchanged(colours, name, other, len(names) * (len(names) - 1) // 2)
    neutral = given.neutral / given.neutral[1]
    if neutral.min() < 0.1:
        return
    shift = np.abs(np.log(neutral)).max()
    if shift > 0.02:
        yield Cause(
            "the white balance is shifted in the camera",
            f"neutral JPEG values have {neutral[0] - 1:+.0%} red and "
            f"{neutral[2] - 1:+.0%} blue beside the multipliers that the files tell",
            "set the camera's white-balance shift to 0, or keep it so for every picture",
            colours.changed(by=colours.multipliers / neutral),
        )


def _exchanged(colours: Colours, name: str, other: str, pairs: int) -> Cause:
    """The cause that two settings have each other's multipliers; pairs: the number of pairs that are tried."""
    a, b = colours.setting == name, colours.setting == other
    by = colours.multipliers.copy()
    by[a], by[b] = np.median(colours.multipliers[b], axis=0), np.median(colours.multipliers[a], axis=0)
    return Cause(
        f'the white balances "{name}" and "{other}" are exchanged',
        "each is neutral with the other's multipliers",
        "exchange their names or their multipliers in the table",
        colours.changed(by=by),
        log_odds=-np.log(pairs),
    )
