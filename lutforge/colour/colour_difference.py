"""ΔE00 between encoded sRGB colours, through colour-science."""

import numpy as np

from lutforge.arrays import Array


def srgb_to_lab(encoded: Array) -> Array:
    """Encoded sRGB (…, 3), clamped to [0, 1] → CIE L*a*b* under D65 (…, 3)."""
    import colour  # imported here: it takes a second, and most commands never need it

    space = colour.RGB_COLOURSPACES["sRGB"]
    linear = colour.models.eotf_sRGB(np.clip(encoded, 0.0, 1.0))
    return np.asarray(colour.XYZ_to_Lab(linear @ space.matrix_RGB_to_XYZ.T, space.whitepoint), dtype=np.float64)


def delta_e_2000(first: Array, second: Array) -> Array:
    """CIE ΔE00 of two arrays of encoded sRGB colours (…, 3) → (…). CIE 142-2001."""
    import colour

    difference = colour.delta_E(srgb_to_lab(first), srgb_to_lab(second), method="CIE 2000")
    return np.asarray(difference, dtype=np.float64)
