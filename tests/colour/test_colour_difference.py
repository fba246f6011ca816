"""ΔE00 against published values and colour-science."""

import colour
import numpy as np
import pytest

from lutforge.arrays import Array
from lutforge.colour.srgb import SRGB_TO_XYZ, lab_delta_e_2000, srgb_to_lab


@pytest.mark.parametrize(
    ("first", "second", "difference"),
    [
        ((50.0, 2.6772, -79.7751), (50.0, 0.0, -82.7485), 2.0425),
        ((50.0, 0.0, 0.0), (50.0, -1.0, 2.0), 2.3669),
        ((50.0, 2.49, -0.001), (50.0, -2.49, 0.0009), 7.1792),
        ((50.0, 2.49, -0.001), (50.0, -2.49, 0.0011), 7.2195),
        ((50.0, -0.001, 2.49), (50.0, 0.0011, -2.49), 4.7461),
        ((22.7233, 20.0904, -46.694), (23.0331, 14.973, -42.5619), 2.0373),
        ((2.0776, 0.0795, -1.135), (0.9033, -0.0636, -0.5514), 0.9082),
    ],
)
def test_published_pairs(first: tuple[float, ...], second: tuple[float, ...], difference: float) -> None:
    """Sharma, Wu and Dalal 2005, table 1."""
    assert lab_delta_e_2000(np.array(first), np.array(second)) == pytest.approx(difference, abs=5e-5)


def test_it_is_that_of_colour_science() -> None:
    rng = np.random.default_rng(0)
    first: Array = rng.uniform([0, -128, -128], [100, 128, 128], (50_000, 3))
    second: Array = rng.uniform([0, -128, -128], [100, 128, 128], (50_000, 3))
    first[:100, 1:] = 0.0
    second[50:150, 1:] = 0.0
    wanted = colour.delta_E(first, second, method="CIE 2000")
    np.testing.assert_allclose(lab_delta_e_2000(first, second), wanted, atol=1e-10)
    encoded = rng.random((10_000, 3))
    space = colour.RGB_COLOURSPACES["sRGB"]
    linear = colour.models.eotf_sRGB(encoded)
    lab = colour.XYZ_to_Lab(linear @ SRGB_TO_XYZ.T, space.whitepoint)
    np.testing.assert_allclose(srgb_to_lab(encoded), lab, atol=1e-10)
