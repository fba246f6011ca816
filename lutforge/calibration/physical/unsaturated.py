"""Selects colours that the gamut map leaves alone, by their saturation (thesis 4.2.1: the threshold β)."""

import numpy as np

from lutforge.arrays import Array, Mask
from lutforge.calibration.options import PhysicalOptions, Preset
from lutforge.errors import CalibrationError

BETA = PhysicalOptions.beta
"""HSV saturation below which a colour is taken to be untouched by the gamut map."""
LEAST_UNSATURATED = 8
NEAR_WHITE = 0.97
"""Nearer to white even unsaturated colours are moved, some of their pixels clip, and f⁻¹ is steepest: a few of them
turn a plain least-squares fit of Ts by several per cent (0.1 % without them, on the simulated camera)."""
LEAST_SPAN = 0.25
"""The unsaturated colours must span this much of the encoded range, or the curve is a guess."""
ENOUGH, LEAST_SATURATED = 0.15, 0.35
"""If fewer than ENOUGH of the colours lie below β, the fit starts from the LEAST_SATURATED share of them."""


def saturation(encoded: Array) -> Array:
    """HSV saturation 1 − min/max of encoded colours (n, 3) → (n,); black is 0."""
    r, g, b = encoded.T
    high, low = np.maximum(np.maximum(r, g), b), np.minimum(np.minimum(r, g), b)
    return np.asarray(1.0 - low / np.maximum(high, 1e-6))


def untouched(encoded: Array, beta: float = BETA) -> Mask:
    """(n,) colours (n, 3) that a plain fit trusts: saturation below β, and not near white."""
    return np.asarray((saturation(encoded) < beta) & (encoded.max(axis=1) < NEAR_WHITE))


def untouched_odds(chroma: Array, beta: float) -> Array:
    """Return the weight (n,) of colours of saturation chroma (n,), ½ at β.

    There a shift that grows with the third power of the saturation is as large as the noise.
    """
    return np.asarray(1.0 / (1.0 + (chroma / beta) ** 6))


def starting_beta(chroma: Array, preset: Preset, beta: float = BETA) -> float:
    """β itself, or for the robust fit what takes in enough of the least saturated colours.

    Few colours lie below β under a light that the white balance does not meet; then the fit starts from those that are
    least saturated, if they lie below a saturation of one half.
    """
    if preset == "thesis" or (chroma < beta).sum() >= max(2 * LEAST_UNSATURATED, ENOUGH * len(chroma)):
        return beta
    return float(np.clip(np.quantile(chroma, LEAST_SATURATED), beta, 0.5))


def check_tones(encoded: Array, unsaturated: Mask) -> None:
    """Raise CalibrationError where unsaturated colours are too few, or of too few tones."""
    if unsaturated.sum() < LEAST_UNSATURATED:
        raise CalibrationError(
            f"{unsaturated.sum()} unsaturated colours; the response needs {LEAST_UNSATURATED}: "
            "shoot a grey card or a colour chart, at several exposures"
        )
    low, high = np.percentile(encoded[unsaturated, 1], [2, 98])
    if high - low < LEAST_SPAN:
        raise CalibrationError(
            f"the unsaturated colours span JPEG values {255 * low:.0f} to {255 * high:.0f} only: "
            "shoot a grey card or a colour chart at several exposures, from dark to nearly clipped"
        )
