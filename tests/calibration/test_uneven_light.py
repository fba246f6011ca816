"""Uneven light over a chart: named, and removed where it is smooth; never invented."""

from collections.abc import Callable

import numpy as np
import pytest

from lutforge.arrays import Array
from lutforge.calibration.uneven_light import UnevenLight, fit_uneven_light
from lutforge.colour.spectra import chart_reflectances
from lutforge.samples.chart import chart_kind
from lutforge.simulate.camera import SimulatedCamera, nikon_d5100, sigma_sd_merrill

CHART = chart_kind("classic")
CAMERAS = [(camera, style) for camera in (nikon_d5100(), sigma_sd_merrill()) for style in camera.styles]
Field = Callable[[Array, Array], Array]
FIELDS: dict[str, tuple[Field, float, str]] = {
    "side": (lambda x, y: 1.0 - 0.3 * (x + 1) / 2, 0.3, "from left to right"),
    "strong": (lambda x, y: 1.0 - 0.6 * (1 - x) / 2, 0.6, "from right to left"),
    "above": (lambda x, y: 1.0 - 0.3 * (1 - y) / 2, 0.3, "from bottom to top"),
    "corner": (lambda x, y: 1.0 - 0.15 * ((x + 1) / 2 + (y + 1) / 2), 0.3, "from top left to bottom right"),
    "lamp": (lambda x, y: 1.0 - 0.25 * (x**2 + y**2) / 2, 0.25, "from the middle"),
}
"""Light by place, by how much it falls, and the words for that."""


def _fitted(camera: SimulatedCamera, style: str, field: Field) -> UnevenLight | None:
    """Of a chart's 8-bit JPEG values, by the style's true response, under a field of light."""
    shade = field(*CHART.places.T) * np.ones(len(CHART.places))
    raw = 0.8 * camera.expose(chart_reflectances(), "daylight") * shade[:, None]
    codes = np.rint(255 * camera.render(raw, style, "daylight"))
    linear = np.where((codes > 2) & (codes < 253), camera.styles[style][1].inverse(codes / 255), np.nan)
    return fit_uneven_light(linear, CHART.linear_srgb("5200K"), CHART.places)


@pytest.mark.parametrize(("camera", "style"), CAMERAS)
@pytest.mark.parametrize("name", FIELDS)
def test_a_field_is_named_and_found(name: str, camera: SimulatedCamera, style: str) -> None:
    field, fall, words = FIELDS[name]
    found = _fitted(camera, style, field)
    assert found is not None and words in found.note
    assert found.fall == pytest.approx(fall, abs=0.08)
    ratio = found.gain(CHART.places) / field(*CHART.places.T)
    assert np.std(np.log(ratio)) < 0.15 * np.std(np.log(field(*CHART.places.T))) + 0.02


@pytest.mark.parametrize(("camera", "style"), CAMERAS)
def test_even_light_is_left_alone(camera: SimulatedCamera, style: str) -> None:
    assert _fitted(camera, style, lambda x, y: np.ones_like(x)) is None


@pytest.mark.parametrize(("camera", "style"), CAMERAS)
def test_the_edge_of_a_shadow_is_named_and_not_smoothed_away(camera: SimulatedCamera, style: str) -> None:
    found = _fitted(camera, style, lambda x, y: np.where(x > 0.3, 0.5, 1.0))
    assert found is not None and "abruptly" in found.note
    assert np.array_equal(found.gain(CHART.places), np.ones(len(CHART.places)))


def test_few_patches_say_nothing() -> None:
    few = np.arange(len(CHART.places)) < 12
    linear = np.where(few[:, None], CHART.linear_srgb("5200K"), np.nan)
    assert fit_uneven_light(linear, CHART.linear_srgb("5200K"), CHART.places) is None
