"""White balances by name, temperature, tint and multipliers."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from lutforge.calibration.physical.white_balance import named_white_balances
from lutforge.colour.spectra import WAVELENGTHS, light, surface_reflectances
from lutforge.colour.srgb import delta_e_2000
from lutforge.errors import ProfileError, SettingsError
from lutforge.model.camera_profile import CameraProfile
from lutforge.model.profile_data import PictureStyle
from lutforge.model.white_balance import WhiteBalance, resolve, temperature_range
from lutforge.samples.sample_set import SampleSet
from lutforge.settings import Kelvin, Multipliers
from lutforge.simulate.camera import SimulatedCamera, nikon_d5100, sigma_sd_merrill
from tests.cases.samples import samples_of_settings

CAMERA = nikon_d5100()
MATRIX = CAMERA.matrix
KNOWN = {name: WhiteBalance(balance.multipliers, balance.kelvin) for name, balance in CAMERA.white_balances.items()} | {
    "auto": WhiteBalance((1.9, 1.0, 1.6))
}


PROFILE = CameraProfile("Test", MATRIX, KNOWN, {"standard": PictureStyle()})


def test_names_and_multipliers_are_taken_as_they_are_and_temperatures_meet_the_known_settings() -> None:
    np.testing.assert_array_equal(resolve("auto", KNOWN, MATRIX), [1.9, 1.0, 1.6])
    np.testing.assert_array_equal(resolve(Multipliers((2.5, 1.0, 1.1)), KNOWN, MATRIX), [2.5, 1.0, 1.1])
    for name in ("tungsten", "daylight", "flash", "cloudy", "shade"):
        same = resolve(Kelvin(KNOWN[name].kelvin or 0.0), KNOWN, MATRIX)
        np.testing.assert_allclose(same, KNOWN[name].multipliers, rtol=1e-12)


@pytest.mark.parametrize("camera", [nikon_d5100(), sigma_sd_merrill()], ids=["D5100", "Merrill"])
@pytest.mark.parametrize("kelvin", [3200, 3500, 4000, 4300, 4700, 5000, 5350, 5750, 6500, 7000, 8500, 9500])
def test_a_temperature_in_between_renders_as_its_own_multipliers_would(camera: SimulatedCamera, kelvin: int) -> None:
    known = {name: WhiteBalance(wb.multipliers, wb.kelvin) for name, wb in camera.white_balances.items()}
    if kelvin < 4000:  # Planck's law
        metres = WAVELENGTHS * 1e-9
        spectrum = metres**-5 / np.expm1(1.4388e-2 / (metres * kelvin))
    else:
        spectrum = light(float(kelvin))
    response = spectrum[:, None] * camera.sensitivity
    surfaces = 0.6 * surface_reflectances() @ response / response.sum(axis=0).max()
    truth = response.sum(axis=0)[1] / response.sum(axis=0)
    found = resolve(Kelvin(float(kelvin)), known, camera.matrix)
    difference = delta_e_2000(camera.render(surfaces, "standard", found), camera.render(surfaces, "standard", truth))
    assert difference.mean() <= 1.0


def test_multipliers_move_steadily_with_the_temperature() -> None:
    found = np.array([resolve(Kelvin(kelvin), KNOWN, MATRIX) for kelvin in np.linspace(2800, 9000, 90)])
    assert np.all(np.diff(found[:, 0]) > 0)
    assert np.all(np.diff(found[:, 2]) < 0)


def test_a_tint_is_a_greener_light_and_a_more_magenta_picture() -> None:
    plain, green, magenta = (resolve(Kelvin(4700.0, tint), KNOWN, MATRIX) for tint in (0.0, 20.0, -20.0))
    assert np.all(green[[0, 2]] > plain[[0, 2]])
    assert np.all(magenta[[0, 2]] < plain[[0, 2]])
    np.testing.assert_allclose(green * magenta, plain**2, rtol=0.01)  # nearly the same step both ways


def test_a_named_setting_takes_a_tint() -> None:
    tinted = PROFILE.multipliers("standard/daylight+20")
    np.testing.assert_allclose(tinted, PROFILE.multipliers("standard/5200K+20"), rtol=1e-3)
    np.testing.assert_allclose(PROFILE.multipliers("standard/daylight+0"), KNOWN["daylight"].multipliers)


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ("standard/daylite", r"did you mean daylight\? known: .*daylight.*, a temperature from \d+K to"),
        ("standart/daylight", r'unknown style "standart"; did you mean standard\?'),
        ("standard/moonlight+20", "unknown white balance"),
        ("standard/daylight+400", "tint"),
        ("standard/daylight-5000K", "no natural light"),
        ("standard/2000K", "outside the white balances"),
        ("standard/underwater", "auto, cloudy, daylight, flash, fluorescent, shade, tungsten"),
    ],
)
def test_settings_that_no_profile_has_are_refused(words: str, says: str) -> None:
    with pytest.raises(SettingsError, match=says):
        PROFILE.selector(words)


def test_a_setting_is_shifted_along_the_locus() -> None:
    profile = PROFILE
    wanted = profile.multipliers("standard/5700K") / profile.multipliers("standard/5200K")
    shifted = profile.multipliers("standard/daylight+500K") / profile.multipliers("standard/daylight")
    np.testing.assert_allclose(shifted, wanted, rtol=0.02)
    mired = profile.multipliers(f"standard/daylight{1e6 / 5700 - 1e6 / 5200:+.4f}mired")
    np.testing.assert_allclose(mired, profile.multipliers("standard/daylight+500K"), rtol=1e-4)
    automatic = CameraProfile("Test", MATRIX, {"auto": KNOWN["auto"]}, {"standard": PictureStyle()})
    step = automatic.multipliers("standard/auto-20mired") / automatic.multipliers("standard/auto")
    wanted = profile.multipliers("standard/daylight-20mired") / profile.multipliers("standard/daylight")
    np.testing.assert_allclose(step, wanted, rtol=0.02)


def test_the_gain_of_a_setting_stays_with_a_tint() -> None:
    """A setting whose JPEGs the camera makes brighter by a tenth."""
    known = {**KNOWN, "daylight": replace(KNOWN["daylight"], gain=1.1)}
    profile = CameraProfile("Test", MATRIX, known, {"standard": PictureStyle()})
    np.testing.assert_allclose(
        profile.multipliers("standard/daylight+0.01"), profile.multipliers("standard/daylight"), rtol=1e-3
    )


def automatic_samples() -> SampleSet:
    """Colours of a camera on automatic white balance, under four lights, with what LibRaw knows of it."""
    samples = samples_of_settings(CAMERA, 3, ("standard",))
    seen = (light(6504.0)[:, None] * CAMERA.sensitivity).sum(axis=0)
    d65 = seen[1] / seen
    count = len(samples.camera)
    return replace(
        samples,
        shot=samples.white_balance,
        white_balance=np.full(count, "auto"),
        d65_r=np.full(count, d65[0]),
        d65_b=np.full(count, d65[2]),
    )


def test_a_profile_of_automatic_shots_knows_presets_and_temperatures() -> None:
    samples = automatic_samples()
    balances = named_white_balances(samples, samples.wb, MATRIX)
    assert set(balances) == {"auto", "tungsten", "daylight", "cloudy", "shade"}
    profile = CameraProfile("Test", MATRIX, balances, {"standard": PictureStyle()})
    for name in ("tungsten", "daylight", "cloudy", "shade"):
        kelvin = CAMERA.white_balances[name].kelvin
        found = profile.multipliers(f"standard/{kelvin:g}K")
        assert np.abs(found / CAMERA.white_balances[name].multipliers - 1).max() < 0.06, name
    for asked in ("3200K", "5200K+10", "auto+500K", "auto-20mired"):
        profile.selector(f"standard/{asked}")
    unknown = np.full(len(samples.camera), np.nan)
    assert set(named_white_balances(replace(samples, d65_r=unknown), samples.wb, MATRIX)) == {"auto"}


def test_one_setting_of_a_known_temperature_tells_others() -> None:
    with pytest.raises(SettingsError, match=r"no known colour temperature.*name multipliers instead"):
        resolve(Kelvin(5000.0), {"auto": KNOWN["auto"]}, MATRIX)
    alone = {"auto": KNOWN["auto"], "daylight": KNOWN["daylight"]}
    assert np.all(np.abs(resolve(Kelvin(3200.0), alone, MATRIX) / resolve(Kelvin(3200.0), KNOWN, MATRIX) - 1) < 0.1)
    low, high = temperature_range(KNOWN)
    for kelvin in (low, high):
        assert np.all(resolve(Kelvin(kelvin), KNOWN, MATRIX) > 0)


def test_fluorescent_lamps_lie_beside_the_locus_and_do_not_bend_it() -> None:
    lamp = KNOWN["fluorescent"]
    natural = {name: balance for name, balance in KNOWN.items() if name != "fluorescent"}
    assert lamp.kelvin is not None
    with_lamp = resolve(Kelvin(lamp.kelvin), KNOWN, MATRIX)
    np.testing.assert_array_equal(with_lamp, resolve(Kelvin(lamp.kelvin), natural, MATRIX))
    only = {"fluorescent": lamp, "daylight": KNOWN["daylight"]}
    np.testing.assert_allclose(resolve(Kelvin(lamp.kelvin), only, MATRIX), lamp.multipliers, rtol=1e-12)


def test_two_settings_of_one_temperature_are_averaged() -> None:
    r, g, b = KNOWN["tungsten"].multipliers
    known = {**KNOWN, "incandescent": WhiteBalance((1.21 * r, g, b / 1.21), KNOWN["tungsten"].kelvin)}
    kelvin = KNOWN["tungsten"].kelvin
    assert kelvin is not None
    np.testing.assert_allclose(resolve(Kelvin(kelvin), known, MATRIX), [1.1 * r, g, b / 1.1], rtol=1e-12)


@pytest.mark.parametrize(
    ("values", "says"),
    [
        *(((bad, 1.0), "positive") for bad in (0.0, -2.0, float("nan"), float("inf"))),
        *(((2.0, 1.5, bad), "not a temperature") for bad in (-5.0, 0.0, 1e9, float("nan"), "hot")),
        *(((2.0, 1.5, None, bad), "spread") for bad in (-0.1, float("nan"), float("inf"))),
    ],
)
def test_numbers_that_no_light_has_are_refused(values: tuple[Any, ...], says: str) -> None:
    red, blue, *others = values
    with pytest.raises(ProfileError, match=says):
        WhiteBalance((red, 1.0, blue), *others)
