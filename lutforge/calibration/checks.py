"""Sanity checks of samples before a calibration: whether one camera can have made them, and what spoils them if not.

The base, a fit of matrix and response, is judged by what that of every camera has, in codes of 255:

- unsaturated colours lie near it;
- its greys are grey under the multipliers that the files state;
- each channel of the JPEG is mostly that of the RAW;
- RAW rises as a power of JPEG values that is neither 1 nor far above 2, and white is not reached deep in the dark.

Each cause is a change of the samples that undoes it. The changed samples are fitted anew, and the cause is named where
they are as a camera's, and far better than before. Where none does that, and colours lie as far off as no camera's,
only this is reported.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import linear_sum_assignment

from lutforge.arrays import Array
from lutforge.calibration.matrix_and_response import (
    MatrixAndResponse,
    encoded_residual,
    fit_matrix_and_response,
    fit_typical_response,
    in_gamut_weight,
    saturation,
    with_matrix_of_all,
)
from lutforge.calibration.options import BETA
from lutforge.colour.srgb import srgb_encode
from lutforge.errors import CalibrationError
from lutforge.model.profile import Diagnosis
from lutforge.samples.clipping import unclipped_colours
from lutforge.samples.sample_set import SampleSet

LEAST_TO_CHECK = 24
"""Fewer samples of a style are not judged."""
FAR_BETTER = 2.5
"""A cause must divide the misfit by so much, and lower it by four codes; causes of good sets do not."""
LEAST_GAIN = 4.0
NOT_ONE_CAMERA = "these samples do not look like one camera's rendering"
"""The cause where none is known; single shots may be to blame."""
NO_CAMERA = 12.0
"""Misfit in codes that no camera has: of thirteen real ones the worst has 8, of 48 styles of simulated ones too."""
OTHER_ORDERS = ((2, 1, 0), (1, 2, 0), (2, 0, 1), (1, 0, 2), (0, 2, 1))
"""The orders of red (0), green and blue that are not theirs."""
BLACK_LEVELS = (0.004, 0.0065, 0.01, 0.015, 0.025, 0.04)
"""Black levels, as shares of white, that are tried as left in the RAW or as taken from it twice."""
LEAST_POWER, MOST_POWER, PER_POWER = 1.05, 2.4, 50
"""RAW rises as a power of JPEG values between these; each step of 1 beyond them is as wrong as 50 codes."""
WHITE_IN_THE_DARK, PER_STOP_OF_WHITE = -1.9, 30
"""Stops below a usual white where no camera's white lies, and the codes that each stop beyond counts."""
USUAL_POWER = 2.2
CODES_PER_STOP, EXCHANGED = 40, 100
"""A stop in codes, about; the codes that channels of the JPEG which are others of the RAW count."""
FAR_OFF = 0.25
"""Encoded residuals count no more than this: what is further off is as wrong."""
LEAST_WEIGHT = 1e-9
"""What a colour counts at least, so that samples without unsaturated colours have a mean."""
LEAST_LINEAR, LEAST_MEAN = 1e-5, 1e-6
"""Least linear value of a grey that has a logarithm, and least mean of a colour whose ratios are taken."""
MOST_COMPARED = 1000
"""The largest number of samples that a hypothesis is fitted to."""
TONED, COLOURFUL, LEAST_TINT = 2, 0.2, 3
"""A toned picture: channels within 2 codes of a function of green, RAW of which a tenth differs by this share, and a
tint of so many codes."""
SLIPPED = 0.85
"""Rows are shifted if the error of others is below this share of their own."""


@dataclass(frozen=True, eq=False)
class _Colours:
    """Samples of one style, each (n, 3). known: the files state the multipliers."""

    raw: Array
    encoded: Array
    multipliers: Array
    known: bool


@dataclass(frozen=True, eq=False)
class _Judgement:
    """A base as judged by samples. rendered: (n, 3), of all.

    tint: (3,) of greys, in stops; white: RAW of a grey that is rendered to white, compared with a usual one, in stops;
    colours_off: in codes, what no camera's fit has of residuals, of tints, and of channels that are exchanged; misfit:
    that, and what no camera's response has.
    """

    rendered: Array
    tint: Array
    white: float
    colours_off: float
    misfit: float


def implausible(
    samples: SampleSet,
    multipliers: Array,
    bases: Mapping[str, MatrixAndResponse],
    bases_of_unsaturated: Mapping[str, MatrixAndResponse],
) -> tuple[Diagnosis, ...]:
    """Diagnose the samples of one camera; return an empty tuple where a camera can have made them.

    multipliers: (n, 3), the white balance of every sample, estimated where the files do not state it; bases: the
    matrix and response of each style that is judged, by all of its colours; bases_of_unsaturated: by those that a gamut
    map leaves alone, which strong colours do not pull away from the others. A style's pictures may be toned, and rows
    of its shots shifted. Any other cause lies in how files were read, which spoils all styles alike: one style that
    looks as if it were spoilt, among others that do not, is a style of much contrast.
    """
    diagnoses: list[Diagnosis] = []
    causes_of_reading: list[Diagnosis | None] = []
    for style, base in bases.items():
        rows = (samples.style == style) & unclipped_colours(samples.srgb, samples.raw)
        of_style = samples.select(rows)
        known = bool(np.all(np.isfinite(of_style.wb)))
        colours = _Colours(of_style.raw, of_style.srgb, multipliers[rows], known)
        given = _judged(colours, base)

        diagnosis = _toned(colours) or _shifted_rows(given, of_style)
        if diagnosis is not None:
            diagnoses.append(diagnosis)
        elif not np.any(of_style.raw_space != ""):  # programs may render anything
            causes_of_reading.append(_cause_of_reading(colours, given))
            of_unsaturated = _judged(colours, bases_of_unsaturated[style])
            nearer = min(given, of_unsaturated, key=lambda judgement: judgement.colours_off)
            if causes_of_reading[-1] is None and nearer.colours_off > NO_CAMERA:
                diagnoses.append(_no_camera(nearer))

    if all(causes_of_reading):
        diagnoses += [diagnosis for diagnosis in causes_of_reading if diagnosis is not None]
    by_cause: dict[str, Diagnosis] = {}
    for diagnosis in diagnoses:
        by_cause.setdefault(diagnosis.cause, diagnosis)
    return tuple(by_cause.values())


def _cause_of_reading(colours: _Colours, given: _Judgement) -> Diagnosis | None:
    """The cause whose correction explains the samples of a style best; None where none explains them far better.

    One at most, because further ones may be consequences of the first.
    """
    diagnosis = None
    best = min(given.misfit / FAR_BETTER, given.misfit - LEAST_GAIN, NO_CAMERA)
    if best <= 0.0:
        return None
    typical = _misfit(colours, fit_typical_response)
    for cause, advice, corrections in _causes(colours, given):
        # Fits of typical responses take a third of the time, and show that most causes are wrong.
        misfits = [_misfit(corrected, fit_typical_response) for corrected in corrections]
        place = int(np.argmin(misfits))
        misfit = _misfit(corrections[place], fit_matrix_and_response) if misfits[place] < typical else np.inf
        if misfit < best:
            evidence = f"samples are {given.misfit:.0f} codes off what cameras make, without it {misfit:.1f}"
            best, diagnosis = misfit, Diagnosis(cause, evidence, advice)
    return diagnosis


def _misfit(colours: _Colours, fit: Callable[[Array, Array], MatrixAndResponse]) -> float:
    """The misfit of samples to a base that `fit` makes of white-balanced RAW and JPEG values; infinite if it fails."""
    some = np.random.default_rng(0).permutation(len(colours.raw))[:MOST_COMPARED]
    balanced = colours.raw[some] * colours.multipliers[some]
    encoded = np.clip(colours.encoded[some], 0.0, 1.0)
    try:
        base = with_matrix_of_all(fit(balanced, encoded), balanced, encoded)
    except (CalibrationError, np.linalg.LinAlgError):
        return np.inf
    return _judged(colours, base).misfit


def _no_camera(given: _Judgement) -> Diagnosis:
    """The diagnosis of a fit as bad as no camera's, where no cause is known."""
    return Diagnosis(
        NOT_ONE_CAMERA,
        f"samples are {given.colours_off:.0f} codes off what cameras make, whose own are at most 8",
        "look at pictures and settings: one style, no automatic tone, RAW and JPEG of the same shots",
    )


def _judged(colours: _Colours, base: MatrixAndResponse) -> _Judgement:
    """Judge the base of samples."""
    balanced = colours.raw * colours.multipliers
    encoded = np.clip(colours.encoded, 0.0, 1.0)
    off = np.minimum(encoded_residual(base.response, base.matrix, balanced, encoded), FAR_OFF)
    residual = 255 * np.average(off, weights=in_gamut_weight(saturation(encoded), BETA) + LEAST_WEIGHT)

    dark, bright = np.percentile(encoded.mean(axis=1), (10, 90))
    greys = np.linspace(dark, bright, 9)
    linear = base.response.linearize(np.repeat(greys[:, None], 3, axis=1))
    stops = np.log2(np.maximum(linear, LEAST_LINEAR))
    tint = np.median(stops - stops.mean(axis=1, keepdims=True), axis=0)
    power = float(np.polyfit(np.log2(greys), stops.mean(axis=1), 1)[0])
    white = float(np.median((stops.mean(axis=1) - USUAL_POWER * np.log2(greys))[4:]))

    order = linear_sum_assignment(-base.matrix)[1]
    colours_off = EXCHANGED * float(np.any(order != np.arange(3)))
    if colours.known:  # else it may be the estimated multipliers that are wrong
        colours_off += float(residual) + CODES_PER_STOP * float(np.ptp(tint))
    tones_off = PER_POWER * (max(0.0, LEAST_POWER - power) + max(0.0, power - MOST_POWER))
    tones_off += PER_STOP_OF_WHITE * max(0.0, WHITE_IN_THE_DARK - white)
    return _Judgement(base.render(balanced), tint, white, colours_off, colours_off + tones_off)


def _causes(colours: _Colours, given: _Judgement) -> Iterator[tuple[str, str, list[_Colours]]]:
    """Yield each cause that could apply, what to do, and its corrections: samples with it partly or wholly undone."""
    raw, encoded, multipliers = colours.raw, colours.encoded, colours.multipliers

    for order in OTHER_ORDERS:
        back = list(np.argsort(order))
        letters = ", ".join("RGB"[channel] for channel in order)
        swapped = (
            "red and blue of the {} are swapped" if order == (2, 1, 0) else f"the channels of the {{}} are {letters}"
        )
        advice = f"read the file as R, G, B, not {letters}, and sample again"
        yield swapped.format("JPEG"), advice, [replace(colours, encoded=encoded[:, back])]
        advice = f"read the filter pattern of the RAW as R, G, B, not {letters}, and sample again"
        yield swapped.format("RAW"), advice, [replace(colours, raw=raw[:, back])]

    advice = "use the camera's JPEG as it is, encoded"
    yield "the JPEG values are linear", advice, [replace(colours, encoded=srgb_encode(encoded))]

    advice = "divide by the level at which this sensor saturates, and sample again"
    if raw.max() * 2.0**-given.white < 4:
        yield "RAW is divided by too high a white level", advice, [replace(colours, raw=raw * 2.0**-given.white)]

    advice = "subtract the sensor's own black level, once, before the samples are taken"
    for cause, sign in (("the black level is left in", -1.0), ("more than the black level is taken from", 1.0)):
        yield f"{cause} the RAW", advice, [replace(colours, raw=raw + sign * level) for level in BLACK_LEVELS]

    if not colours.known:
        return
    advice = "take the mean of the two green pixels, not their sum, and sample again"
    yield "green of the RAW is counted twice", advice, [replace(colours, raw=raw * [1.0, 0.5, 1.0])]

    advice = "give the multipliers of RAW, not their reciprocals, or leave the columns wb_r, wb_g, wb_b out"
    yield "the white-balance multipliers are inverted", advice, [replace(colours, multipliers=1.0 / multipliers)]

    advice = "sample RAW before white balance, or leave the columns wb_r, wb_g, wb_b out"
    yield "the RAW is white-balanced already", advice, [replace(colours, multipliers=np.ones_like(multipliers))]

    advice = "set the camera's white-balance shift to 0, or keep it so for every picture"
    if np.ptp(given.tint) < 0.6:
        neutral = 2.0 ** (given.tint - given.tint[1])
        yield (
            "the white balance is shifted in the camera",
            advice,
            [replace(colours, multipliers=multipliers * neutral)],
        )


def _toned(colours: _Colours) -> Diagnosis | None:
    """Diagnose sepia and other toned pictures: one channel determines the others, though the RAW is colourful."""
    red, _, blue = 255 * colours.encoded.T
    powers = np.vander(colours.encoded[:, 1], 6)
    residuals = [channel - powers @ np.linalg.lstsq(powers, channel, rcond=None)[0] for channel in (red, blue)]
    tint = float(np.median(np.ptp(255 * colours.encoded, axis=1)))

    balanced = colours.raw * colours.multipliers
    colourful = np.ptp(balanced / np.maximum(balanced.mean(axis=1, keepdims=True), LEAST_MEAN), axis=1)
    if max(map(np.std, residuals)) > TONED or np.percentile(colourful, 90) < COLOURFUL or tint < LEAST_TINT:
        return None
    evidence = f"all their colours are one tint, {tint:.0f} codes from grey, though the RAW is colourful"
    return Diagnosis("the JPEGs are toned", evidence, "shoot with a colour style, or a plain black-and-white one")


def _shifted_rows(given: _Judgement, samples: SampleSet) -> Diagnosis | None:
    """Diagnose shots whose JPEG values fit RAW values a few rows up or down far better than their own."""
    slipped = []
    for name in np.unique(samples.shot):
        rendered, encoded = given.rendered[samples.shot == name], samples.srgb[samples.shot == name]
        if len(encoded) < 16:
            continue
        errors = {}
        for step in range(-8, 9):
            first, last = max(-step, 0), len(encoded) - max(step, 0)
            distance = np.linalg.norm(rendered[first:last] - encoded[first + step : last + step], axis=1)
            errors[step] = 255 * float(np.minimum(distance, FAR_OFF / 2).mean())
        best = min(errors, key=lambda step: errors[step])
        if best and errors[0] > 2.0 and errors[best] < SLIPPED * errors[0]:
            slipped.append(f"{name} (by {best:+d})")
    if not slipped:
        return None
    return Diagnosis(
        f"the rows of {len(slipped)} of {len(np.unique(samples.shot))} shots are shifted",
        f"JPEG values fit the RAW of other rows: {', '.join(slipped[:4])}",
        "pair the columns anew",
    )
