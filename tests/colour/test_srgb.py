"""ΔE00 and CIE L*a*b* against colour-science."""

import colour
import numpy as np

from lutforge.arrays import Array
from lutforge.colour.srgb import SRGB_TO_XYZ, lab_delta_e_2000, srgb_to_lab


def test_it_is_that_of_colour_science() -> None:
    rng = np.random.default_rng(0)
    first: Array = rng.uniform([0, -128, -128], [100, 128, 128], (50_000, 3))
    second: Array = rng.uniform([0, -128, -128], [100, 128, 128], (50_000, 3))
    first[:100, 1:] = 0.0
    second[50:150, 1:] = 0.0
    expected = colour.delta_E(first, second, method="CIE 2000")
    np.testing.assert_allclose(lab_delta_e_2000(first, second), expected, atol=1e-10)
    encoded = rng.random((10_000, 3))
    space = colour.RGB_COLOURSPACES["sRGB"]
    linear = colour.models.eotf_sRGB(encoded)
    lab = colour.XYZ_to_Lab(linear @ SRGB_TO_XYZ.T, space.whitepoint)
    np.testing.assert_allclose(srgb_to_lab(encoded), lab, atol=1e-10)
