"""The saturation of encoded colours, and the spread of the chromaticities of linear ones."""

import numpy as np

from lutforge.arrays import Array

DARKEST = 1e-6
"""The brightest channel of a colour counts as at least this, so that black has a saturation."""
LEAST_SUM = 1e-9
"""The sum of a colour's channels counts as at least this, so that black has a chromaticity."""


def saturation(encoded: Array) -> Array:
    """The HSV saturation 1 − min/max of encoded colours (n, 3) → (n,); black is 0."""
    r, g, b = encoded.T
    high, low = np.maximum(np.maximum(r, g), b), np.minimum(np.minimum(r, g), b)
    return np.asarray(1.0 - low / np.maximum(high, DARKEST))


def hue_spread(linear: Array) -> float:
    """The spread of chromaticities of linear colours (n, 3) in their second principal direction, root mean square."""
    if len(linear) < 2:
        return 0.0
    shares = linear / np.maximum(linear.sum(axis=1, keepdims=True), LEAST_SUM)
    return float(np.linalg.svd(shares - shares.mean(axis=0), compute_uv=False)[1] / np.sqrt(len(linear)))
