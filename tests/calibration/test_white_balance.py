"""What files do not tell of a white balance: multipliers, temperatures and gains, found from the samples."""

import numpy as np
import pytest
from numpy.typing import NDArray

from lutforge.calibration.named_white_balances import named_temperature, named_white_balances
from lutforge.calibration.white_balance import complete_multipliers, multipliers_from_colours
from lutforge.errors import CalibrationError
from lutforge.samples.sample_set import SampleSet
from lutforge.simulate.camera import SimulatedCamera, nikon_d5100

CAMERA = nikon_d5100()


def photographed(camera: SimulatedCamera, balance: str, count: int, grey: bool) -> tuple[NDArray[np.float64], ...]:
    """RAW and JPEG values of random colours; grey: a quarter of them neutral."""
    rng = np.random.default_rng(11)
    balanced = rng.uniform(0.03, 0.35, (count, 1)) * rng.uniform(0.5, 1.5, (count, 3))
    if grey:
        balanced[::4] = balanced[::4, :1]
    raw = balanced / np.asarray(camera.white_balances[balance].multipliers)
    return raw, np.round(camera.render(raw, "standard", balance) * 255) / 255


def sample_set(raw: NDArray[np.float64], srgb: NDArray[np.float64], balance: str) -> SampleSet:
    return SampleSet.from_arrays(raw, srgb, camera="Camera", white_balance=balance, shot="a", exposure_s=0.01)


@pytest.mark.parametrize("balance", ["daylight", "tungsten", "shade"])
@pytest.mark.parametrize(("grey", "within"), [(True, 0.02), (False, 0.06)])
def test_multipliers_are_found_with_greys_and_without(balance: str, grey: bool, within: float) -> None:
    """Without greys the colours alone decide, and the gamut map moves those that are saturated."""
    raw, srgb = photographed(CAMERA, balance, 300, grey)
    samples = sample_set(raw, srgb, balance)
    found, notes = complete_multipliers(samples)
    np.testing.assert_allclose(found[0], CAMERA.white_balances[balance].multipliers, rtol=within)
    assert len(notes) == 1
    assert balance in notes[0]
    assert named_white_balances(samples, found, CAMERA.matrix)[balance].spread == 0.0


def test_one_colour_tells_no_white_balance() -> None:
    raw = np.tile([[0.2, 0.1, 0.05]], (100, 1))
    with pytest.raises(CalibrationError, match="too alike"):
        multipliers_from_colours(raw, np.tile([[0.8, 0.3, 0.1]], (100, 1)))
    samples = sample_set(raw, np.tile([[0.8, 0.3, 0.1]], (100, 1)), "daylight")
    with pytest.raises(CalibrationError, match="wb_r"):
        complete_multipliers(samples)


def test_real_multipliers_are_found_from_colours(s40_samples: SampleSet) -> None:
    """A Canon S40 shot of a chart, whose file says 1.620, 1, 1.555: within 6 %, knowing nothing."""
    samples = s40_samples.select(s40_samples.shot == "CRW_0101")
    np.testing.assert_allclose(multipliers_from_colours(samples.raw, samples.srgb), samples.wb[0], rtol=0.06)


def test_names_that_tell() -> None:
    assert named_temperature("5600k") == named_temperature("5600 kelvin") == 5600.0
    assert named_temperature("tungsten") == 3200.0
    assert [named_temperature(name) for name in ("custom", "500k", "99999k", "auto")] == [None] * 4
