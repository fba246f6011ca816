"""Whether one camera can have made a set of samples, and what spoils it as a whole where none can.

Matrix and response are fitted to the samples, and the fit is judged by what any camera's has, in codes of 255:

- unsaturated colours lie near it;
- its greys are grey under the multipliers that the files tell;
- each channel of the JPEG is mostly that of the RAW;
- light rises as a power of JPEG values that is neither 1 nor far above 2, and white is not reached deep in the dark.

Each cause is a change of the samples that undoes it. The changed samples are fitted by the same fit, and the cause is
named where it explains them far better. Where none does, and the fit is as bad as no camera's, only that is said.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import linear_sum_assignment

from lutforge.arrays import Array
from lutforge.calibration.lattice.monochrome import is_monochrome
from lutforge.calibration.matrix_and_response import encoded_residual, fit_matrix_and_response, with_matrix_of_all
from lutforge.colour.srgb import srgb_encode
from lutforge.errors import CalibrationError
from lutforge.model.profile import Diagnosis
from lutforge.samples.clipping import unclipped_colours
from lutforge.samples.sample_set import SampleSet

FAR_BETTER = 2.5
"""A cause must divide the misfit by so much, and lower it by four codes; causes of good sets do not."""
LEAST_GAIN = 4.0
NOT_ONE_CAMERA = "these samples do not look like one camera's rendering"
"""The cause where none is known; single shots may be to blame."""
NO_CAMERA = 12.0
"""Mean residual of unsaturated colours, in codes, that no camera has: of thirteen real ones the worst has 8."""
BLACK_LEVELS = (0.004, 0.0065, 0.01, 0.015, 0.025, 0.04)
"""Black levels, as shares of white, that are tried as left in the RAW or as taken from it twice."""
LEAST_POWER, MOST_POWER, PER_POWER = 1.05, 2.4, 50
"""Light rises as a power of JPEG values between these; each step of 1 beyond them is as wrong as 50 codes."""
WHITE_IN_THE_DARK, PER_STOP_OF_WHITE = -1.9, 30
"""Stops below a usual white where no camera's white lies, and what each stop beyond is worth in codes."""
USUAL_POWER = 2.2
CODES_PER_STOP, EXCHANGED = 40, 100
"""A stop of light in codes, about; what channels of the JPEG that are others of the RAW are worth in codes."""
FAR_OFF = 0.25
"""Encoded residuals count no more than this: what is further off is as wrong."""
TONED, COLOURFUL, LEAST_TINT = 2, 0.2, 3
"""A toned picture: channels within 2 codes of a function of green, RAW of which a tenth differs by this share, and a
tint of so many codes."""
SLIPPED = 0.85
"""Rows are shifted if the error of others is below this share of their own."""
TINY = 1e-6
"""Light counts as this at least, so that ratios and logarithms stay finite."""


@dataclass(frozen=True, eq=False)
class _Colours:
    """Samples of one style, each (n, 3). known: the files tell the multipliers."""

    raw: Array
    encoded: Array
    multipliers: Array
    known: bool


@dataclass(frozen=True, eq=False)
class _Judgement:
    """The fit of some samples. rendered: (n, 3), of all; residual: of unsaturated colours, in codes; tint: of greys.

    misfit: in codes, all that no camera's fit has. white: RAW of a grey that is rendered to white, beside a usual one,
    in stops.
    """

    rendered: Array
    residual: float
    tint: Array
    power: float
    white: float
    misfit: float


def implausible(samples: SampleSet, multipliers: Array) -> tuple[Diagnosis, ...]:
    """Diagnose the samples of one camera; return an empty tuple where a camera can have made them.

    multipliers: (n, 3), the white balance of every sample, estimated where the files do not state it. At most one cause
    is named per style, because further ones may be consequences of the first.
    """
    found: dict[str, Diagnosis] = {}
    for style in np.unique(samples.style):
        rows = samples.style == style
        cause = _of_style(samples.select(rows), multipliers[rows])
        if cause is not None:
            found.setdefault(cause.cause, cause)
    return tuple(found.values())


def _of_style(samples: SampleSet, multipliers: Array) -> Diagnosis | None:
    """Diagnose the samples of one style; None where they are plausible, black and white, or too few."""
    inside = unclipped_colours(samples.srgb, samples.raw)
    samples, multipliers = samples.select(inside), multipliers[inside]
    balanced = samples.raw * multipliers
    if len(samples) < 24 or is_monochrome(balanced, samples.srgb):
        return None
    colours = _Colours(samples.raw, samples.srgb, multipliers, bool(np.all(np.isfinite(samples.wb))))
    given = _judged(colours)
    if given is None:
        return None
    diagnosis = _toned(colours) or _shifted_rows(given, samples)
    if diagnosis is not None or np.any(samples.raw_space != ""):  # programs may render anything
        return diagnosis
    best = min(given.misfit / FAR_BETTER, given.misfit - LEAST_GAIN)
    for cause, advice, undone in _causes(colours, given) if best > 0.0 else ():
        least = given.misfit
        for changed in undone:
            judged = _judged(changed)
            if judged is None or judged.misfit > least + LEAST_GAIN:  # more of it makes it worse
                break
            least = min(least, judged.misfit)
        if least < best:
            evidence = f"samples are {given.misfit:.0f} codes off what cameras make, without it {least:.1f}"
            best, diagnosis = least, Diagnosis(cause, evidence, advice)
            if 10 * best < given.misfit:  # nothing can be far better than that
                break
    if diagnosis is None and colours.known and given.residual > NO_CAMERA:
        return Diagnosis(
            NOT_ONE_CAMERA,
            f"unsaturated colours lie {given.residual:.0f} codes off the best matrix and response, cameras' at most 8",
            "look at pictures and settings: one style, no automatic tone, RAW and JPEG of the same shots",
        )
    return diagnosis


def _judged(colours: _Colours) -> _Judgement | None:
    """Fit samples and judge the fit; None where they cannot be fitted."""
    x, encoded = colours.raw * colours.multipliers, np.clip(colours.encoded, 0.0, 1.0)
    some = np.random.default_rng(0).permutation(len(x))[:1000]
    everything, x, encoded = x, x[some], encoded[some]
    try:
        fit = fit_matrix_and_response(x, encoded)
        whole = with_matrix_of_all(fit, x, encoded)
    except (CalibrationError, np.linalg.LinAlgError):
        return None
    residual = 255 * np.average(
        np.minimum(encoded_residual(fit.response, fit.matrix, x, encoded), FAR_OFF), weights=fit.in_gamut + TINY / 1000
    )
    dark, bright = np.percentile(encoded.mean(axis=1), (10, 90))
    greys = np.linspace(dark, bright, 9)
    light = np.log2(np.maximum(fit.response.linearize(np.repeat(greys[:, None], 3, axis=1)), 10 * TINY))
    tint = np.median(light - light.mean(axis=1, keepdims=True), axis=0)
    power = float(np.polyfit(np.log2(greys), light.mean(axis=1), 1)[0])
    white = float(np.median((light.mean(axis=1) - USUAL_POWER * np.log2(greys))[4:]))
    order = linear_sum_assignment(-whole.matrix)[1]
    misfit = EXCHANGED * float(np.any(order != np.arange(3)))
    misfit += PER_POWER * (max(0.0, LEAST_POWER - power) + max(0.0, power - MOST_POWER))
    misfit += PER_STOP_OF_WHITE * max(0.0, WHITE_IN_THE_DARK - white)
    if colours.known:  # else it may be the estimated multipliers that are wrong
        misfit += residual + CODES_PER_STOP * float(np.ptp(tint))
    return _Judgement(whole.render(everything), float(residual), tint, power, white, float(misfit))


def _causes(colours: _Colours, given: _Judgement) -> Iterator[tuple[str, str, list[_Colours]]]:
    """Yield each cause that could apply with what to do, and the samples without it, or without ever more of it."""
    raw, encoded, by = colours.raw, colours.encoded, colours.multipliers
    again = "read the file as RGB, not BGR, and sample again"
    yield "red and blue of the JPEG are swapped", again, [replace(colours, encoded=encoded[:, ::-1])]
    pattern = "read the filter pattern as RGGB, not BGGR, and sample again"
    yield "red and blue of the RAW are swapped", pattern, [replace(colours, raw=raw[:, ::-1])]
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
    advice = "sample RAW before white balance, or leave the columns wb_r, wb_g, wb_b out"
    yield "the RAW is white-balanced already", advice, [replace(colours, multipliers=np.ones_like(by))]
    advice = "set the camera's white-balance shift to 0, or keep it so for every picture"
    if np.ptp(given.tint) < 0.6:
        neutral = 2.0 ** (given.tint - given.tint[1])
        yield "the white balance is shifted in the camera", advice, [replace(colours, multipliers=by * neutral)]


def _toned(colours: _Colours) -> Diagnosis | None:
    """Diagnose sepia and other toned pictures: one channel determines the others, though the RAW is colourful."""
    red, _, blue = 255 * colours.encoded.T
    powers = np.vander(colours.encoded[:, 1], 6)
    left = [channel - powers @ np.linalg.lstsq(powers, channel, rcond=None)[0] for channel in (red, blue)]
    tint = float(np.median(np.ptp(255 * colours.encoded, axis=1)))
    balanced = colours.raw * colours.multipliers
    colourful = np.ptp(balanced / np.maximum(balanced.mean(axis=1, keepdims=True), TINY), axis=1)
    if max(np.std(left[0]), np.std(left[1])) > TONED or np.percentile(colourful, 90) < COLOURFUL or tint < LEAST_TINT:
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
