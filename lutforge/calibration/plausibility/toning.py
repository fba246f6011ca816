"""Sepia and other toned pictures: their colours tell brightness only, on a tinted axis."""

import numpy as np

from lutforge.arrays import Array
from lutforge.model.diagnosis import Diagnosis


def toned(balanced: Array, encoded: Array) -> Diagnosis | None:
    """Tell whether JPEG values (n, 3) follow from one of their channels, though RAW balanced (n, 3) is colourful.

    Neutral ones, of a black-and-white style, are no fault.
    """
    if len(encoded) < 24:
        return None
    red, green, blue = 255 * encoded.T
    design = np.vander(encoded[:, 1], 6)
    left = [channel - design @ np.linalg.lstsq(design, channel, rcond=None)[0] for channel in (red, blue)]
    if max(np.std(left[0]), np.std(left[1])) > 2.0:
        return None
    light = balanced / np.maximum(balanced.mean(axis=1, keepdims=True), 1e-6)
    tint = np.median(np.ptp(np.stack([red, green, blue]), axis=0))
    if np.quantile(np.ptp(light, axis=1), 0.9) < 0.2 or tint < 3.0:
        return None
    evidence = f"all their colours are one tint, {tint:.0f} codes from grey, though the RAW is colourful"
    return Diagnosis("the JPEGs are toned", evidence, "shoot with a colour style, or a plain black-and-white one")
