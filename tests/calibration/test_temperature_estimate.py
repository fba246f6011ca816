"""Colour temperatures of settings whose names tell none: the simulated cameras' known lights, and a real Nikon D40."""

from dataclasses import replace

import colour
import numpy as np
import pytest

from lutforge.calibration.options import CalibrationOptions
from lutforge.calibration.physical.white_balance import named_temperature, with_temperatures
from lutforge.colour.colour_temperature import camera_from_xyz, white_of
from lutforge.model.white_balance import WhiteBalance
from lutforge.pipeline.calibration import calibrate
from lutforge.simulate.camera import SimulatedCamera, nikon_d5100, sigma_sd_merrill
from tests.cases.real_data import PublishedPairs
from tests.cases.samples import chart_140, photograph_patches

NATURAL = ("tungsten", "flash", "cloudy", "shade")


def _anonymous(camera: SimulatedCamera) -> dict[str, WhiteBalance]:
    """All settings but daylight under names that tell nothing."""
    return {
        name if name == "daylight" else f"custom {name}": WhiteBalance(balance.multipliers)
        for name, balance in camera.white_balances.items()
    }


@pytest.mark.parametrize(("camera", "within"), [(nikon_d5100(), 0.01), (sigma_sd_merrill(), 0.035)])
def test_the_lights_of_the_simulated_cameras(camera: SimulatedCamera, within: float) -> None:
    found = with_temperatures(_anonymous(camera), camera.matrix)
    assert found["daylight"].kelvin == 5200
    for name in NATURAL:
        assert found[f"custom {name}"].kelvin == pytest.approx(camera.white_balances[name].kelvin, rel=within)


def test_they_are_the_temperatures_of_colour_science() -> None:
    camera = nikon_d5100()
    from_xyz = camera_from_xyz(camera.matrix, camera.multipliers("daylight"), 5200.0)
    for name, balance in with_temperatures(_anonymous(camera), camera.matrix).items():
        uv = white_of(np.array(balance.multipliers), from_xyz)
        kelvin, distance = colour.temperature.uv_to_CCT(uv, method="Ohno 2013")
        assert abs(distance) < 0.02
        assert balance.kelvin == pytest.approx(kelvin, rel=0.015), name


@pytest.mark.parametrize("model", ["lattice", "rbf"])
def test_calibration_fills_them_in(model: str) -> None:
    camera = nikon_d5100()
    samples = photograph_patches(camera, chart_140()[:60], balances=("daylight", "tungsten", "shade"), stops=(-1, 0))
    names = np.where(samples.white_balance == "daylight", "daylight", np.char.add("my ", samples.white_balance))
    renamed = replace(samples, white_balance=names)
    options = CalibrationOptions(model=model, size=5, nonuniform=False)  # type: ignore[arg-type]  # str of the parameters
    profile = calibrate(renamed, options)
    for name in ("tungsten", "shade"):
        assert profile.white_balances[f"my {name}"].kelvin == pytest.approx(
            camera.white_balances[name].kelvin, rel=0.04
        )


def test_a_nikon_d40(d40_pairs: PublishedPairs) -> None:
    """Nikon states 3000 K for incandescent, 5400 K flash, 6000 K cloudy, 8000 K shade (D40 manual, white balance)."""
    matrix = d40_pairs.matrix / d40_pairs.matrix.sum(axis=1, keepdims=True)
    settings = {
        name if name == "daylight" else f"no {name}": WhiteBalance(multipliers)
        for name, multipliers in d40_pairs.multipliers.items()
    }
    found = with_temperatures(settings, matrix)
    for name, kelvin in {"tungsten": 3000, "flash": 5400, "cloudy": 6000, "shade": 8000}.items():
        assert found[f"no {name}"].kelvin == pytest.approx(kelvin, rel=0.17), name


def test_what_is_no_light_gets_no_temperature() -> None:
    matrix, daylight = nikon_d5100().matrix, WhiteBalance(nikon_d5100().white_balances["daylight"].multipliers)
    auto = WhiteBalance((1.7, 1.0, 1.6), spread=0.2)
    green = WhiteBalance((3.2, 1.0, 3.0))
    found = with_temperatures({"daylight": daylight, "auto": auto, "under trees": green, "evening": auto}, matrix)
    assert [found[name].kelvin for name in ("auto", "under trees", "evening")] == [None, None, None]
    alone = with_temperatures({"custom": daylight, "auto": auto}, matrix)  # nothing says which light it is
    assert alone["custom"].kelvin is None


def test_names_that_tell() -> None:
    assert named_temperature("5600k") == named_temperature("5600 kelvin") == 5600.0
    assert named_temperature("tungsten") == 3200.0
    assert [named_temperature(name) for name in ("custom", "500k", "99999k", "auto")] == [None] * 4
