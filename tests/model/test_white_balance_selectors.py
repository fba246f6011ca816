"""White balances by name, temperature, tint and multipliers."""

import re
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import colour
import numpy as np
import pytest
from numpy.typing import NDArray

from lutforge.arrays import Array
from lutforge.calibration.named_white_balances import named_white_balances
from lutforge.calibration.options import CalibrationOptions
from lutforge.colour.colour_temperature import (
    camera_from_xyz,
    locus,
    multipliers_of,
    temperature_and_tint,
    white,
    white_of,
)
from lutforge.colour.spectra import WAVELENGTHS, light, surface_reflectances
from lutforge.colour.srgb import delta_e_2000
from lutforge.errors import ProfileError, SettingsError
from lutforge.images.raw import read_raw
from lutforge.model.camera_profile import CameraProfile, load_profile
from lutforge.model.profile import PictureStyle
from lutforge.model.white_balance import WhiteBalance, WhiteBalanceModel
from lutforge.pipeline.calibration import calibrate
from lutforge.samples.sample_set import SampleSet, concatenate
from lutforge.settings import Kelvin, Multipliers, parse_selector
from lutforge.simulate.camera import SimulatedCamera, nikon_d5100, sigma_sd_merrill
from lutforge.simulate.scene import palette
from tests.cases.samples import samples_of_settings

CAMERA = nikon_d5100()
MATRIX = CAMERA.matrix
KNOWN = {name: WhiteBalance(balance.multipliers, balance.kelvin) for name, balance in CAMERA.white_balances.items()} | {
    "auto": WhiteBalance((1.9, 1.0, 1.6))
}


PROFILE = CameraProfile("Test", MATRIX, KNOWN, {"standard": PictureStyle()})


def resolve(balance: str | Kelvin | Multipliers, known: Mapping[str, WhiteBalance], matrix: Array) -> Array:
    return WhiteBalanceModel(known, matrix).multipliers(balance)


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
        ("standard/moonlight+20", f"{PROFILE.camera}: unknown white balance"),  # several cameras may take part
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
    expected = profile.multipliers("standard/5700K") / profile.multipliers("standard/5200K")
    shifted = profile.multipliers("standard/daylight+500K") / profile.multipliers("standard/daylight")
    np.testing.assert_allclose(shifted, expected, rtol=0.02)
    mired = profile.multipliers(f"standard/daylight{1e6 / 5700 - 1e6 / 5200:+.4f}mired")
    np.testing.assert_allclose(mired, profile.multipliers("standard/daylight+500K"), rtol=1e-4)
    automatic = CameraProfile("Test", MATRIX, {"auto": KNOWN["auto"]}, {"standard": PictureStyle()})
    step = automatic.multipliers("standard/auto-20mired") / automatic.multipliers("standard/auto")
    expected = profile.multipliers("standard/daylight-20mired") / profile.multipliers("standard/daylight")
    np.testing.assert_allclose(step, expected, rtol=0.02)


def test_the_gain_of_a_setting_stays_with_a_tint() -> None:
    """A setting whose JPEGs the camera makes brighter by a tenth."""
    known = {**KNOWN, "daylight": replace(KNOWN["daylight"], gain=1.1)}
    profile = CameraProfile("Test", MATRIX, known, {"standard": PictureStyle()})
    tinted, plain = (profile.multipliers(f"standard/daylight{tint}") for tint in ("+0.01", ""))
    np.testing.assert_allclose(tinted, plain, rtol=1e-3)


def with_d65(samples: SampleSet) -> SampleSet:
    """The samples with the multipliers of D65 that LibRaw knows of the camera."""
    seen = (light(6504.0)[:, None] * CAMERA.sensitivity).sum(axis=0)
    count = len(samples.camera)
    return replace(samples, d65_r=np.full(count, seen[1] / seen[0]), d65_b=np.full(count, seen[1] / seen[2]))


def test_temperatures_come_from_the_colorimetric_matrix_where_it_is_known() -> None:
    """The look in a fitted matrix moves no light: presets and temperatures are those of the known matrix."""
    samples = automatic_samples()
    matrix = CAMERA.color_matrix()
    samples = replace(samples, from_xyz=np.tile(matrix.ravel(), (len(samples), 1)))
    look = MATRIX @ np.array([[1.2, -0.1, -0.1], [-0.1, 1.2, -0.1], [-0.1, -0.1, 1.2]])
    balances = named_white_balances(samples, samples.wb, look)
    profile = CameraProfile("Test", look, balances, {"standard": PictureStyle()}, from_xyz=matrix)
    for kelvin in (2500.0, 2856.0, 3200.0, 4000.0, 5200.0, 6504.0, 8000.0):
        expected = multipliers_of(locus(kelvin), matrix)
        np.testing.assert_allclose(profile.multipliers(f"standard/{kelvin:g}K"), expected, rtol=0.01)
    np.testing.assert_allclose(balances["tungsten"].multipliers, multipliers_of(locus(3200.0), matrix), rtol=1e-9)
    measured = {**balances, "daylight": WhiteBalance((2.0, 1.0, 1.4), 5200.0)}  # a measured setting wins
    corrected = CameraProfile("Test", look, measured, {"standard": PictureStyle()}, from_xyz=matrix)
    np.testing.assert_allclose(corrected.multipliers("standard/5200K"), (2.0, 1.0, 1.4), rtol=1e-9)


def test_the_colorimetric_matrix_is_kept_in_a_profile_file(tmp_path: Path) -> None:
    matrix = CAMERA.color_matrix()
    balances = {"daylight": WhiteBalance((2.0, 1.0, 1.4), 5200.0)}
    CameraProfile("Test", MATRIX, balances, {"standard": PictureStyle()}, from_xyz=matrix).save(tmp_path / "camera.npz")
    loaded = load_profile(tmp_path / "camera.npz")
    assert loaded.from_xyz is not None
    np.testing.assert_allclose(loaded.from_xyz, matrix)


@pytest.mark.parametrize(
    ("kelvin", "expected"),
    [(2856.0, (1.147, 1.0, 2.210)), (3200.0, (1.318, 1.0, 1.870)), (4000.0, (1.677, 1.0, 1.520))],
)
def test_libraw_s_matrix_of_a_real_camera_is_read(
    shared_data: Path, kelvin: float, expected: tuple[float, float, float]
) -> None:
    raw = read_raw(shared_data / "canon_powershot_s40" / "CRW_0101.CRW", half_size=True)
    assert raw.from_xyz is not None
    np.testing.assert_allclose(multipliers_of(locus(kelvin), raw.from_xyz), expected, rtol=0.03)


def automatic_samples() -> SampleSet:
    """Colours of a camera on automatic white balance, under four lights."""
    samples = samples_of_settings(CAMERA, 3, ("standard",))
    auto = np.full(len(samples.camera), "auto")
    return with_d65(replace(samples, shot=samples.white_balance, white_balance=auto))


def test_a_profile_of_automatic_shots_knows_presets_and_temperatures() -> None:
    samples = automatic_samples()
    balances = named_white_balances(samples, samples.wb, MATRIX)
    assert set(balances) == {"auto", "tungsten", "daylight", "cloudy", "shade"}
    profile = CameraProfile("Test", MATRIX, balances, {"standard": PictureStyle()})
    for name in ("tungsten", "daylight", "cloudy", "shade"):
        kelvin = CAMERA.white_balances[name].kelvin
        found = profile.multipliers(f"standard/{kelvin:g}K")
        assert np.abs(found / CAMERA.white_balances[name].multipliers - 1).max() < 0.045, name
    for asked in ("3200K", "5200K+10", "auto+500K", "auto-20mired"):
        profile.selector(f"standard/{asked}")
    unknown = np.full(len(samples.camera), np.nan)
    assert set(named_white_balances(replace(samples, d65_r=unknown), samples.wb, MATRIX)) == {"auto"}


@pytest.mark.slow
def test_automatic_shots_refinish_to_presets_nearly_as_shots_on_these_presets_do() -> None:
    """Within 1.5 times the error, on the mean. The camera leaves some warmth of the light in its pictures."""
    names = ("tungsten", "daylight", "flash", "cloudy", "shade")
    rng = np.random.default_rng(3)

    def automatic(light: str) -> Array:
        ideal = CAMERA.multipliers(light)
        return np.asarray(ideal * (CAMERA.multipliers("daylight") / ideal) ** 0.15)

    def photographed(balance_of: Callable[[str], Array], name: str = "") -> CameraProfile:
        parts = []
        for number, light_name in enumerate(names * 2):
            drawn, wb = palette(40, rng), balance_of(light_name)
            raw = np.vstack([CAMERA.expose(level * drawn, light_name) for level in (0.06, 0.12, 0.45, 1.0)]).clip(0, 1)
            jpeg = CAMERA.render(raw[:, None] + rng.normal(0, 0.002, (len(raw), 16, 3)), "standard", wb)
            parts.append(
                SampleSet.from_arrays(
                    raw, np.rint(255 * jpeg).mean(axis=1) / 255, camera=CAMERA.name, style="standard",
                    white_balance=name or light_name, shot=f"{number}", exposure_s=1 / 60, wb=wb,
                )
            )  # fmt: skip
        return calibrate(with_d65(concatenate(parts)), CalibrationOptions(size=17))

    profiles = photographed(CAMERA.multipliers), photographed(automatic, "auto")
    assert set(profiles[1].white_balances) == {"auto", "tungsten", "daylight", "cloudy", "shade"}
    errors = np.zeros(2)
    for lit in ("daylight", "tungsten", "shade"):
        raw = np.vstack([CAMERA.expose(level * palette(150, rng), lit) for level in (0.12, 0.4, 0.9)]).clip(0, 1)
        before = CAMERA.render(raw, "standard", automatic(lit))
        given = "standard/" + ",".join(f"{value:.6f}" for value in automatic(lit))
        for name in names:
            expected = CAMERA.render(raw, "standard", name)
            both = np.concatenate([before, expected], axis=1)
            whole = np.all((both > 0.01) & (both < 0.99), axis=1)
            for number, asked in enumerate((name, f"{CAMERA.white_balances[name].kelvin:g}K")):
                made = profiles[number].refinish(given, f"standard/{asked}")(before[whole])
                errors[number] += np.sqrt(np.mean((made - expected[whole]) ** 2))
    assert errors[1] <= 1.5 * errors[0], errors / 15


def test_one_setting_of_a_known_temperature_tells_others() -> None:
    with pytest.raises(SettingsError, match=r"no known colour temperature.*name multipliers instead"):
        resolve(Kelvin(5000.0), {"auto": KNOWN["auto"]}, MATRIX)
    alone = {"auto": KNOWN["auto"], "daylight": KNOWN["daylight"]}
    assert np.all(np.abs(resolve(Kelvin(3200.0), alone, MATRIX) / resolve(Kelvin(3200.0), KNOWN, MATRIX) - 1) < 0.1)
    low, high = WhiteBalanceModel(KNOWN, MATRIX).temperature_range
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


def uv_of_spectrum(name: float | str) -> NDArray[np.float64]:
    observer = colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"].copy().align(colour.SpectralShape(380, 780, 5))
    x, y, z = light(name) @ observer.values
    total = x + 15 * y + 3 * z
    return np.array([4 * x / total, 6 * y / total])


def test_the_locus_is_daylight_from_4000_kelvin_and_planck_s_below() -> None:
    for kelvin in (4000.0, 4700.0, 5200.0, 6504.0, 7500.0, 10000.0):
        np.testing.assert_allclose(locus(kelvin), uv_of_spectrum(kelvin), atol=3e-4)
    np.testing.assert_allclose(locus(2856.0), uv_of_spectrum("A"), atol=3e-4)


@pytest.mark.parametrize("kelvin", [2000.0, 2856.0, 3700.0, 4500.0, 6500.0, 12000.0])
@pytest.mark.parametrize("tint", [-30.0, 0.0, 12.0])
def test_temperature_and_tint_read_back(kelvin: float, tint: float) -> None:
    found, off = temperature_and_tint(white(kelvin, tint))
    assert found == pytest.approx(kelvin, rel=0.01)
    assert off == pytest.approx(tint, abs=0.5)
    assert white(kelvin, 10.0)[1] > white(kelvin)[1]  # green lies above the locus
    assert np.linalg.norm(white(kelvin, tint) - white(kelvin)) == pytest.approx(abs(tint) / 3000)


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


@pytest.mark.parametrize(
    ("text", "balance", "printed"),
    [
        (" Standard / Daylight ", "daylight", "standard/daylight"),
        ("standard/5200k", Kelvin(5200.0), "standard/5200K"),
        ("standard/5200K+10", Kelvin(5200.0, 10.0), "standard/5200K+10"),
        ("standard/5200 K -7.5", Kelvin(5200.0, -7.5), "standard/5200K-7.5"),
        ("standard/4.2,2,3", Multipliers((2.1, 1.0, 1.5)), "standard/2.1,1,1.5"),
    ],
)
def test_a_selector_is_read_and_reads_back_what_it_prints(text: str, balance: object, printed: str) -> None:
    selector = parse_selector(text)
    assert (selector.style, selector.white_balance, str(selector)) == ("standard", balance, printed)
    assert parse_selector(printed) == selector


@pytest.mark.parametrize(
    ("text", "message"),
    [
        *((text, "STYLE/WB") for text in ("", "standard", "/daylight", "standard/")),
        *((f"standard/{text}", "1500K") for text in ("900K", "99999K")),
        *((f"standard/{text}", "multipliers") for text in ("1,2", "1,2,3,4", "1,x,2", "1,0,2", "1,-1,2", "1,nan,2")),
        *((f"standard/{text}", "multipliers") for text in ("inf,1,2", "1e300,1,1", "1e5,1,1", "1,1,1e-4")),
        ("vivid/1e9K", "between 1500K and 25000K"),
        ("vivid/5200K+", "5200K+10"),
        ("vivid/5200K+x", "5200K+10"),
        ("vivid/5200K+nan", "tint"),
        ("vivid/5200K+900", "tint"),
        ("vivid/5.2.0K", "5200K"),
    ],
)
def test_anything_else_is_refused_in_one_line_that_says_what_is_right(text: str, message: str) -> None:
    with pytest.raises(SettingsError, match=re.escape(message)) as caught:
        parse_selector(text)
    assert "\n" not in str(caught.value)
    for rgb in ((2.0, 0.0, 1.0), (4.2, 2.0, 3.0), (-1.0, 1.0, 1.0), (float("nan"), 1.0, 1.0)):
        with pytest.raises(SettingsError, match="multipliers"):
            Multipliers(rgb)
