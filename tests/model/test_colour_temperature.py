"""Temperature and tint of lights, against colour-science's spectra."""

import colour
import numpy as np
import pytest
from numpy.typing import NDArray

from lutforge.colour.colour_temperature import (
    camera_from_xyz,
    locus,
    multipliers_of,
    temperature_and_tint,
    white,
    white_of,
)
from lutforge.colour.spectra import light
from lutforge.simulate.camera import nikon_d5100


def uv_of_spectrum(name: float | str) -> NDArray[np.float64]:
    observer = colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"].copy().align(colour.SpectralShape(380, 780, 5))
    x, y, z = light(name) @ observer.values
    total = x + 15 * y + 3 * z
    return np.array([4 * x / total, 6 * y / total])


@pytest.mark.parametrize("kelvin", [4000.0, 4700.0, 5200.0, 6504.0, 7500.0, 10000.0])
def test_the_locus_is_daylight_from_4000_kelvin(kelvin: float) -> None:
    np.testing.assert_allclose(locus(kelvin), uv_of_spectrum(kelvin), atol=3e-4)


def test_the_locus_is_planck_s_below() -> None:
    np.testing.assert_allclose(locus(2856.0), uv_of_spectrum("A"), atol=3e-4)


@pytest.mark.parametrize("kelvin", [2000.0, 2856.0, 3700.0, 4500.0, 6500.0, 12000.0])
@pytest.mark.parametrize("tint", [-30.0, 0.0, 12.0])
def test_temperature_and_tint_read_back(kelvin: float, tint: float) -> None:
    found, off = temperature_and_tint(white(kelvin, tint))
    assert found == pytest.approx(kelvin, rel=0.01)
    assert off == pytest.approx(tint, abs=0.5)


def test_green_lies_above_the_locus() -> None:
    for kelvin in (2500.0, 5000.0, 9000.0):
        assert white(kelvin, 10.0)[1] > white(kelvin)[1]
        assert np.linalg.norm(white(kelvin, 10.0) - white(kelvin)) == pytest.approx(10 / 3000)


def test_multipliers_and_whites_are_each_other_s_inverse() -> None:
    camera = nikon_d5100()
    from_xyz = camera_from_xyz(camera.matrix, camera.multipliers("daylight"), 5200.0)
    for name, balance in camera.white_balances.items():
        uv = white_of(np.array(balance.multipliers), from_xyz)
        np.testing.assert_allclose(multipliers_of(uv, from_xyz), balance.multipliers, rtol=1e-12)
        if name != "fluorescent":
            kelvin, tint = temperature_and_tint(uv)
            assert kelvin == pytest.approx(balance.kelvin, rel=0.03)
            assert abs(tint) < 8
