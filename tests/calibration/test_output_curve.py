"""The curve after a cube: a bijection of [0, 1] that continues as a straight line outside."""

import numpy as np
import pytest

from lutforge.calibration.lattice.output_curve import OutputCurve, output_curve
from lutforge.interpolation import apply_curve
from lutforge.model.response import Response

CODES = np.linspace(0.0, 1.0, 33)
SRGB = np.where(CODES <= 0.04045, CODES / 12.92, ((CODES + 0.055) / 1.055) ** 2.4)
STEEP = CODES**8


@pytest.fixture(params=[SRGB, CODES, STEEP, 0.01 + 0.7 * SRGB], ids=["sRGB", "line", "steep foot", "offset and gain"])
def curve(request: pytest.FixtureRequest) -> OutputCurve:
    return output_curve(Response(np.repeat(request.param[:, None], 3, axis=1)))


def test_a_curve_there_and_back(curve: OutputCurve) -> None:
    encoded = np.random.default_rng(0).random((1000, 3))
    np.testing.assert_allclose(apply_curve(curve.table, curve.to_values(encoded)), encoded, atol=1e-12)
    ends = np.array([[0.0] * 3, [1.0] * 3])
    np.testing.assert_array_equal(curve.to_values(ends), ends)
    np.testing.assert_array_equal(apply_curve(curve.table, np.array([[-0.5] * 3, [1.7] * 3])), ends)


def test_slope_is_the_derivative_and_bounded(curve: OutputCurve) -> None:
    encoded = np.random.default_rng(1).random((200, 3))
    low, high = np.clip(encoded - 1 / 255, 0, 1), np.clip(encoded + 1 / 255, 0, 1)
    slope = curve.slope(encoded)
    np.testing.assert_allclose(slope * (curve.to_values(high) - curve.to_values(low)), high - low, atol=1e-12)
    assert np.all(slope <= 9)  # 1 + the bound of 8 on f'


def test_linear_light_runs_on_across_the_clipping(curve: OutputCurve) -> None:
    linear = np.linspace(-0.5, 1.5, 2001)[:, None].repeat(3, axis=1)
    values = curve.continued(linear)
    assert np.all(np.diff(values, axis=0) > 0)
    below, above = linear[:, 0] < curve.linear[0, 0], linear[:, 0] > curve.linear[-1, 0]
    assert np.all(values[below] < 0) and np.all(values[above] > 1)
    for part in (values[below], values[above]):
        np.testing.assert_allclose(np.diff(part, 2, axis=0), 0, atol=1e-9)


def test_it_is_the_response_between_the_ends() -> None:
    curve = output_curve(Response(np.repeat(SRGB[:, None], 3, axis=1)))
    linear = np.random.default_rng(2).random((500, 3))
    expected = np.interp(linear, SRGB, CODES)
    found = apply_curve(curve.table, curve.continued(linear))
    np.testing.assert_allclose(found, expected, atol=4e-3)  # PCHIP between 33 knots
