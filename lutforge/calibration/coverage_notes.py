"""Notes on what the samples of a calibration lack: shots, exposures, tones and colours."""

import numpy as np

from lutforge.arrays import Array
from lutforge.calibration.lattice.monochrome import monochrome_note
from lutforge.calibration.matrix_and_response import LEAST_UNSATURATED
from lutforge.calibration.options import BETA
from lutforge.colour.saturation import saturation
from lutforge.samples.sample_set import SampleSet

LEAST_BRIGHTEST = 0.85
"""Encoded value that the brightest unclipped sample of a style should reach."""
ONE_HUE = 0.02
"""Shares of red, green and blue that spread less than this in their second direction are of one hue, or grey."""


def thin_settings(samples: SampleSet) -> list[str]:
    """Return notes on white balances with a single shot, and on styles with a single exposure."""
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
    return notes


def thin_colours(encoded: Array, style: str, *, monochrome: bool) -> list[str]:
    """Notes on the colours that a style's unclipped samples (n, 3) lack; monochrome: the style is black and white."""
    notes = []
    if (saturation(encoded) < BETA).sum() < LEAST_UNSATURATED:
        notes.append(
            f'style "{style}": hardly any unsaturated colours, so its greys are guessed: '
            "shoot a grey card or a colour chart at several exposures"
        )
    brightest = float(np.max(encoded, initial=0.0))
    if brightest < LEAST_BRIGHTEST:
        notes.append(
            f'style "{style}": no sample is brighter than {brightest:.0%} of white, so brighter tones are guessed, '
            "and the errors do not show it: expose more"
        )
    if monochrome:
        return [*notes, monochrome_note(style)]
    shares = encoded / encoded.sum(axis=1, keepdims=True)
    spread = np.linalg.svd(shares - shares.mean(axis=0), compute_uv=False)
    if spread[1] < ONE_HUE * np.sqrt(len(encoded)):
        notes.append(
            f'style "{style}": all colours are grey or of one hue, so all others are guessed: '
            "shoot a colour chart or a scene of many colours"
        )
    return notes
