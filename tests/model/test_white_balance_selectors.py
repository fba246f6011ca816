"""White balances by name, temperature and multipliers."""

import numpy as np
import pytest

from lutforge.errors import ProfileError, SettingsError
from lutforge.model.white_balance import WhiteBalance, resolve
from lutforge.settings import Kelvin, Multipliers

KNOWN = {
    "tungsten": WhiteBalance((1.2, 1.0, 2.8), 3200.0),
    "daylight": WhiteBalance((2.0, 1.0, 1.5), 5200.0),
    "shade": WhiteBalance((2.4, 1.0, 1.2), 7000.0),
    "auto": WhiteBalance((1.9, 1.0, 1.6)),
}


def test_names_and_multipliers_are_taken_as_they_are() -> None:
    np.testing.assert_array_equal(resolve("auto", KNOWN), [1.9, 1.0, 1.6])
    np.testing.assert_array_equal(resolve(Multipliers((2.5, 1.0, 1.1)), KNOWN), [2.5, 1.0, 1.1])


def test_temperatures_meet_the_known_settings() -> None:
    for name in ("tungsten", "daylight", "shade"):
        kelvin = KNOWN[name].kelvin
        assert kelvin is not None
        np.testing.assert_allclose(resolve(Kelvin(kelvin), KNOWN), KNOWN[name].multipliers)


def test_halfway_in_mired_is_the_geometric_mean() -> None:
    kelvin = 1e6 / ((1e6 / 3200 + 1e6 / 5200) / 2)
    expected = np.sqrt(np.array([1.2, 1.0, 2.8]) * [2.0, 1.0, 1.5])
    np.testing.assert_allclose(resolve(Kelvin(kelvin), KNOWN), expected)


def test_interpolation_is_monotone_between_settings() -> None:
    red = [resolve(Kelvin(kelvin), KNOWN)[0] for kelvin in np.linspace(3200, 7000, 40)]
    assert np.all(np.diff(red) > 0)


def test_far_temperatures_and_unknown_names_are_refused() -> None:
    with pytest.raises(SettingsError, match="outside the white balances"):
        resolve(Kelvin(2000.0), KNOWN)
    with pytest.raises(SettingsError, match="auto, daylight, shade, tungsten"):
        resolve("cloudy", KNOWN)
    with pytest.raises(SettingsError, match="two white balances of known temperature"):
        resolve(Kelvin(5000.0), {"auto": KNOWN["auto"], "daylight": KNOWN["daylight"]})


def test_two_settings_of_one_temperature_do_not_divide_by_zero() -> None:
    known = {**KNOWN, "incandescent": WhiteBalance((1.25, 1.0, 2.7), 3200.0)}
    assert np.all(np.isfinite(resolve(Kelvin(3200.0), known)))
    assert np.all(np.isfinite(resolve(Kelvin(4000.0), known)))


@pytest.mark.parametrize("bad", [(0.0, 1.0, 1.0), (1.0, 1.0, -2.0), (float("nan"), 1.0, 1.0), (1.0, 1.0, float("inf"))])
def test_multipliers_are_positive_numbers(bad: tuple[float, float, float]) -> None:
    with pytest.raises(ProfileError, match="positive"):
        WhiteBalance(bad)
