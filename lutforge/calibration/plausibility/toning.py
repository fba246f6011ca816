"""Finds sepia and other toned pictures, whose colours lie on one tinted axis and depend on brightness alone."""

import numpy as np

from lutforge.arrays import Array
from lutforge.model.diagnosis import Diagnosis


def toned(balanced: Array, encoded: Array) -> Diagnosis | None:
    """Diagnose JPEG values (n, 3) that one channel determines although balanced RAW (n, 3) is colourful.

    Returns None for others, and for neutral values, as of a black-and-white style.
    """
    if len(encoded) < 24:
        return None
    red, green, blue = 255 * encoded.T
    design = np.vander(encoded[:, 1], 6)
    residual = [channel - design @ np.linalg.lstsq(design, channel, rcond=None)[0] for channel in (red, blue)]
    if max(np.std(residual[0]), np.std(residual[1])) > 2.0:
        return None
    light = balanced / np.maximum(balanced.mean(axis=1, keepdims=True), 1e-6)
    tint = np.median(np.ptp(np.stack([red, green, blue]), axis=0))
    if np.quantile(np.ptp(light, axis=1), 0.9) < 0.2 or tint < 3.0:
        return None
    evidence = f"all their colours are one tint, {tint:.0f} codes from grey, though the RAW is colourful"
    return Diagnosis("the JPEGs are toned", evidence, "shoot with a colour style, or a plain black-and-white one")
