"""Do the shots of a style agree on one rendering? What is thin in them, and what to shoot instead."""

import numpy as np
from numpy.typing import NDArray

from lutforge.arrays import Array
from lutforge.calibration.lattice.monochrome import monochrome_note
from lutforge.calibration.physical.matrix_and_response import fit_matrix_and_response
from lutforge.calibration.physical.unsaturated import BETA, LEAST_UNSATURATED, saturation
from lutforge.errors import CalibrationError
from lutforge.samples.sample_set import SampleSet

DISAGREEMENT = 8.0 / 255.0
"""A shot whose unsaturated colours lie so far from the common response, in the median, contradicts the others …"""
RELATIVE = 4.0
"""… if it is also so many times as far as the better half of the shots …"""
LARGEST = 16.0 / 255.0
"""… or so far in any case: then no two agree."""
LEAST_OF_SHOT = 4
MOST_SAMPLES = 6000
LEAST_BRIGHT = 0.85
"""Encoded value that the brightest unclipped sample of a style should reach."""
LEAST_SPREAD = 0.02
"""Shares of red, green and blue that spread less than this in their second direction are of one hue, or grey."""


def check_agreement(balanced: Array, encoded: Array, shot: NDArray[np.str_], style: str) -> tuple[str, ...]:
    """Notes that name the shots which contradict the others.

    Raises CalibrationError where as many shots contradict as agree, so that none can be called right.
    """
    names = np.unique(shot)
    if len(names) < 2:
        return ()
    rows = np.random.default_rng(0).permutation(len(shot))[:MOST_SAMPLES]
    try:
        fit = fit_matrix_and_response(balanced[rows], encoded[rows])
    except CalibrationError:
        return ()  # too few unsaturated colours to compare shots by; the fit that needs them says so
    distance = np.max(np.abs(fit.response.encode(balanced @ fit.matrix.T) - encoded), axis=1)
    plain = saturation(encoded) < BETA
    medians = {
        str(name): float(np.median(distance[plain & (shot == name)]))
        for name in names
        if (plain & (shot == name)).sum() >= LEAST_OF_SHOT
    }
    if len(medians) < 2:
        return ()
    ordered = np.sort(list(medians.values()))
    usual = float(np.median(ordered[: (len(ordered) + 1) // 2]))
    stray = {
        name: value for name, value in medians.items() if value > max(DISAGREEMENT, min(RELATIVE * usual, LARGEST))
    }
    if not stray:
        return ()
    listed = ", ".join(f"{name} ({255 * value:.0f} codes)" for name, value in list(stray.items())[:4])
    advice = "shoot in manual mode with one picture style, scene-dependent features (D-Lighting, HDR, auto tone) off"
    if 2 * len(stray) >= len(medians):
        raise CalibrationError(f'style "{style}": the shots contradict each other, {listed} off the rest: {advice}')
    return (f"{style}: {listed} off what the other shots agree on: leave out, or {advice}",)


def thin_settings(samples: SampleSet) -> tuple[str, ...]:
    """Notes on what rests on a single shot or exposure."""
    notes = []
    for name in np.unique(samples.white_balance):
        shots = np.unique(samples.shot[samples.white_balance == name])
        if len(shots) == 1 and len(np.unique(samples.shot)) > 1:
            notes.append(
                f'white balance "{name}": one shot only ({shots[0]}); nothing can be checked against it: add a second'
            )
    for name in np.unique(samples.style):
        rows = samples.style == name
        times = samples.exposure_s[rows & np.isfinite(samples.exposure_s)]
        if len(times) and np.ptp(np.log2(times)) < 0.1:
            notes.append(
                f'style "{name}": one exposure only: shoot the same at −2 and +1 EV, too, for dark and light tones'
            )
    return tuple(notes)


def thin_colours(encoded: Array, style: str, *, monochrome: bool = False) -> tuple[str, ...]:
    """Notes on the colours that a style's unclipped samples (n, 3) lack; monochrome: the style is black and white."""
    notes = []
    if (saturation(encoded) < BETA).sum() < LEAST_UNSATURATED:
        notes.append(
            f'style "{style}": hardly any unsaturated colours, so its greys are guessed: '
            "shoot a grey card or a colour chart at several exposures"
        )
    brightest = float(np.max(encoded, initial=0.0))
    if brightest < LEAST_BRIGHT:
        notes.append(
            f'style "{style}": no sample is brighter than {brightest:.0%} of white, so brighter tones are guessed, '
            "and the errors do not show it: expose more"
        )
    if monochrome:
        return (*notes, monochrome_note(style))
    shares = encoded / encoded.sum(axis=1, keepdims=True)
    spread = np.linalg.svd(shares - shares.mean(axis=0), compute_uv=False)
    if spread[1] < LEAST_SPREAD * np.sqrt(len(encoded)):
        notes.append(
            f'style "{style}": all colours are grey or of one hue, so all others are guessed: '
            "shoot a colour chart or a scene of many colours"
        )
    return tuple(notes)
