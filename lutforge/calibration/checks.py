"""Sanity checks of samples before a calibration: whether one camera can have made them, and what spoils them if not.

The base of each style is judged (`judgement`). Each cause that could apply is a hypothesis (`hypotheses`), a change of
the samples that undoes it. The changed samples are fitted anew, and the cause is named where they are as a camera's,
and far better than before. Where none does that, and colours lie as far off as no camera's, only this is reported.
"""

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from lutforge.arrays import Array
from lutforge.calibration.hypotheses import hypotheses
from lutforge.calibration.judgement import FAR_OFF, Judgement, StyleColours, judge_base
from lutforge.calibration.matrix_and_response import (
    MatrixAndResponse,
    fit_matrix_and_response,
    fit_typical_response,
    with_matrix_of_all,
)
from lutforge.errors import CalibrationError
from lutforge.model.profile import Diagnosis
from lutforge.samples.clipping import unclipped_colours
from lutforge.samples.sample_set import SampleSet

LEAST_TO_CHECK = 24
"""Fewer samples of a style are not judged."""
MOST_COMPARED = 1000
"""The largest number of samples that a hypothesis is fitted to."""

FAR_BETTER = 2.5
"""A cause is named only if its correction divides the misfit by so much; on good sets no correction does."""
LEAST_CODES_BETTER = 4.0
"""A cause is named only if its correction lowers the misfit by so many codes; on good sets no correction does."""
CLEARER = 1.0
"""A cause takes the place of one that is tried before it, a simpler one, only if it explains so many more codes."""
NOT_ONE_CAMERA = "these samples do not look like one camera's rendering"
"""The cause where none is known; single shots may be to blame."""
NO_CAMERA = 12.0
"""Misfit in codes that no camera has: of thirteen real ones the worst has 8, of 48 styles of simulated ones too."""

TONED_RESIDUAL = 2
"""Channels of a toned picture are within so many codes of a function of green."""
TONED_COLOURFUL = 0.2
"""The channels of a tenth of the RAW of a toned picture differ by this share of their mean, or more."""
LEAST_TINT = 3
"""A toned picture has a tint of so many codes."""
LEAST_MEAN = 1e-6
"""Least mean of the channels of a RAW colour whose ratios are taken."""

LEAST_ROWS = 16
"""Shots with fewer samples are not tested for shifted rows."""
FARTHEST_SHIFT = 8
"""The largest shift that is tried, in rows."""
UNSHIFTED_ERROR = 2.0
"""Rows of a smaller error, in codes, are not shifted."""
SHIFTED_ERROR = 0.85
"""Rows are shifted only if the error of others is below this share of their own."""


def diagnoses_of(
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
        has_stated_balance = bool(np.all(np.isfinite(of_style.wb)))
        colours = StyleColours(of_style.raw, of_style.srgb, multipliers[rows], has_stated_balance)
        judgement = judge_base(colours, base)

        diagnosis = _toned(colours) or _shifted_rows(judgement.rendered, of_style)
        if diagnosis is not None:
            diagnoses.append(diagnosis)
        elif not np.any(of_style.raw_space != ""):  # programs may render anything
            cause = _cause_of_reading(colours, judgement)
            causes_of_reading.append(cause)
            of_unsaturated = judge_base(colours, bases_of_unsaturated[style])
            colour_misfit = min(judgement.colour_misfit, of_unsaturated.colour_misfit)
            if cause is None and colour_misfit > NO_CAMERA:
                diagnoses.append(_no_camera(colour_misfit))

    if all(causes_of_reading):
        diagnoses += [diagnosis for diagnosis in causes_of_reading if diagnosis is not None]
    by_cause: dict[str, Diagnosis] = {}
    for diagnosis in diagnoses:
        by_cause.setdefault(diagnosis.cause, diagnosis)
    return tuple(by_cause.values())


def _cause_of_reading(colours: StyleColours, judgement: Judgement) -> Diagnosis | None:
    """The cause whose correction explains the samples of a style best; None where none explains them far better.

    One at most, because further ones may be consequences of the first.
    """
    best = min(judgement.misfit / FAR_BETTER, judgement.misfit - LEAST_CODES_BETTER, NO_CAMERA)
    if best <= 0.0:
        return None

    diagnosis = None
    uncorrected = _refitted_misfit(colours, fit_typical_response)
    for hypothesis in hypotheses(colours, judgement):
        # Fits of typical responses take a third of the time, and show that most causes are wrong.
        place, typical = _best_strength(hypothesis.corrections, uncorrected)
        if typical >= uncorrected:
            continue
        misfit = _refitted_misfit(hypothesis.corrections[place], fit_matrix_and_response)
        if misfit < best - (0.0 if diagnosis is None else CLEARER):
            best = misfit
            evidence = f"samples are {judgement.misfit:.0f} codes off what cameras make, without it {misfit:.1f}"
            diagnosis = Diagnosis(hypothesis.cause, evidence, hypothesis.advice)
    return diagnosis


def _best_strength(corrections: Sequence[StyleColours], uncorrected: float) -> tuple[int, float]:
    """The correction that fits a typical response best, and its misfit.

    Corrections are of rising strength: they are tried until the misfit rises, which starts at the uncorrected one.
    """
    best, least = 0, np.inf
    last = uncorrected
    for place, corrected in enumerate(corrections):
        misfit = _refitted_misfit(corrected, fit_typical_response)
        if misfit < least:
            best, least = place, misfit
        if misfit > last:
            break
        last = misfit
    return best, least


def _refitted_misfit(colours: StyleColours, fit: Callable[[Array, Array], MatrixAndResponse]) -> float:
    """The misfit of samples to the base that `fit` fits to them; infinite where no base can be fitted."""
    drawn = np.random.default_rng(0).permutation(len(colours.raw))[:MOST_COMPARED]
    balanced = colours.balanced[drawn]
    encoded = np.clip(colours.encoded[drawn], 0.0, 1.0)
    try:
        base = with_matrix_of_all(fit(balanced, encoded), balanced, encoded)
    except (CalibrationError, np.linalg.LinAlgError):
        return np.inf
    return judge_base(colours, base).misfit


def _no_camera(colour_misfit: float) -> Diagnosis:
    """The diagnosis of colours that lie as far off as no camera's, where no cause is known."""
    return Diagnosis(
        NOT_ONE_CAMERA,
        f"samples are {colour_misfit:.0f} codes off what cameras make; samples of real cameras are at most 8 off",
        "look at pictures and settings: one style, no automatic tone, RAW and JPEG of the same shots",
    )


def _toned(colours: StyleColours) -> Diagnosis | None:
    """Diagnose sepia and other toned pictures: one channel determines the others, though the RAW is colourful."""
    red, _, blue = 255 * colours.encoded.T
    powers = np.vander(colours.encoded[:, 1], 6)
    residuals = [channel - powers @ np.linalg.lstsq(powers, channel, rcond=None)[0] for channel in (red, blue)]
    tint = float(np.median(np.ptp(255 * colours.encoded, axis=1)))

    mean = np.maximum(colours.balanced.mean(axis=1, keepdims=True), LEAST_MEAN)
    colourful = float(np.percentile(np.ptp(colours.balanced / mean, axis=1), 90))
    if max(map(np.std, residuals)) > TONED_RESIDUAL or colourful < TONED_COLOURFUL or tint < LEAST_TINT:
        return None
    evidence = f"all their colours are one tint, {tint:.0f} codes from grey, though the RAW is colourful"
    return Diagnosis("the JPEGs are toned", evidence, "shoot with a colour style, or a plain black-and-white one")


def _shifted_rows(rendered: Array, samples: SampleSet) -> Diagnosis | None:
    """Diagnose shots whose JPEG values fit RAW values a few rows up or down far better than their own.

    rendered: (n, 3) the samples' RAW as their base renders it.
    """
    shots = np.unique(samples.shot)
    shifts = {str(name): _shift(rendered[samples.shot == name], samples.srgb[samples.shot == name]) for name in shots}
    shifted = [f"{name} (by {shift:+d})" for name, shift in shifts.items() if shift]
    if not shifted:
        return None
    return Diagnosis(
        f"the rows of {len(shifted)} of {len(shots)} shots are shifted",
        f"JPEG values fit the RAW of other rows: {', '.join(shifted[:4])}",
        "pair the columns anew",
    )


def _shift(rendered: Array, encoded: Array) -> int:
    """The number of rows by which JPEG values of a shot (n, 3) are after the RAW that they fit; 0 if it is unclear."""
    if len(encoded) < LEAST_ROWS:
        return 0
    errors = {}
    for shift in range(-FARTHEST_SHIFT, FARTHEST_SHIFT + 1):
        first, last = max(-shift, 0), len(encoded) - max(shift, 0)
        distance = np.linalg.norm(rendered[first:last] - encoded[first + shift : last + shift], axis=1)
        errors[shift] = 255 * float(np.minimum(distance, FAR_OFF / 2).mean())
    best = min(errors, key=lambda shift: errors[shift])
    is_clear = errors[0] > UNSHIFTED_ERROR and errors[best] < SHIFTED_ERROR * errors[0]
    return best if is_clear else 0
