"""Input transforms of cameras without RAW from exposures of a chart, beside those of the published calculator's method.

Both get photographs of a chart with noise, as JPEG, and shutters that are off. The peer is the method of the ACES input
transform calculator for prosumer cameras (https://github.com/ampas/idt-calculator): P. E. Debevec & J. Malik (1997),
https://doi.org/10.1145/258734.258884, gives a curve for each channel, and a 3 × 3 matrix takes the linear colours to
those of the chart by least ΔE in CIE Lab.
"""

from collections.abc import Callable
from pathlib import Path

import colour
import numpy as np
from scipy.optimize import least_squares

from lutforge.arrays import Array
from lutforge.colour.rgb_spaces import matrix_between
from lutforge.colour.spectra import light, linear_srgb_under, reflectances, surface_reflectances
from lutforge.pipeline.chart_patches import SPACE
from lutforge.pipeline.input_transform import write_input_transform
from lutforge.samples.chart import chart_kind
from lutforge.samples.sample_set import Text
from lutforge.simulate.camera import LIGHT_OF_WHITE_BALANCE, SimulatedCamera
from tests.cases.charts import STOPS, photograph_chart

OTHER_STOPS = np.array(STOPS[:-1]) + 0.4
LIGHTS = {"daylight": "5200K", "cloudy": "6000K", "tungsten": "A"}

Method = Callable[[Array], Array]
"""JPEG values (…, 3) → linear colours (…, 3) in SPACE, on any scale."""


def errors(camera: SimulatedCamera, setting: str, white_balance: str, folder: Path) -> dict[str, tuple[float, float]]:
    """Mean ΔE00 by method: of the chart at other exposures, of other surfaces."""
    kind = chart_kind("classic")
    chart = reflectances("ISO 17321-1")
    files = photograph_chart(camera, kind, chart, folder, light=setting, white_balance=white_balance)
    fitted = write_input_transform(files, folder / "camera.npz", kind, LIGHTS[setting], camera="made up")
    assert fitted.samples is not None
    (selector,) = (f"standard/{name}" for name in fitted.profile.white_balances)
    samples = fitted.samples
    seconds = np.array([fitted.exposure_s[name] for name in samples.shot])
    peer = debevec_and_matrix(samples.srgb, seconds, samples.raw / seconds[:, None], samples.patch)
    methods: dict[str, Method] = {"LutForge": fitted.profile.linearize(selector), "Debevec and 3 × 3": peer}
    return {
        name: (
            error_of(method, camera, chart, setting, white_balance),
            error_of(method, camera, surface_reflectances(), setting, white_balance),
        )
        for name, method in methods.items()
    }


def error_of(method: Method, camera: SimulatedCamera, surfaces: Array, setting: str, white_balance: str) -> float:
    """Mean ΔE00 of a method on surfaces at exposures of the camera, on the scale that suits it best."""
    true = linear_srgb_under(surfaces, light(LIGHT_OF_WHITE_BALANCE[setting])) @ matrix_between("linear-srgb", SPACE).T
    exposures = camera.nominal_exposure_s * 2.0**OTHER_STOPS
    raw = [camera.expose(surfaces, setting, time) for time in exposures]
    encoded = np.stack([camera.render(each, "standard", white_balance) for each in raw])
    inside = np.all((encoded > 2 / 255) & (encoded < 253 / 255), axis=-1)
    found = method(np.rint(255 * encoded) / 255) / exposures[:, None, None]
    ratio = np.where(inside, found[..., 1] / true[:, 1], np.nan)
    found = found / np.nanmedian(ratio)
    return float(np.mean(colour.delta_E(_lab(found), _lab(true)[None], method="CIE 2000")[inside]))


def _lab(linear: Array) -> Array:
    xyz = linear @ matrix_between(SPACE, "linear-srgb").T @ colour.RGB_COLOURSPACES["sRGB"].matrix_RGB_to_XYZ.T
    white = colour.CCS_ILLUMINANTS["CIE 1931 2 Degree Standard Observer"]["D65"]
    return np.asarray(colour.XYZ_to_Lab(xyz, white))


def debevec_and_matrix(encoded: Array, seconds: Array, target: Array, patch: Text) -> Method:
    """The peer, of JPEG values (n, 3), exposures (n,), the chart's colours (n, 3) and the names of patches (n,)."""
    curves = np.stack([_debevec(encoded[:, channel], seconds, patch) for channel in range(3)], axis=1)

    def linear(values: Array) -> Array:
        codes = np.arange(256) / 255
        return np.stack([np.interp(values[..., c], codes, curves[:, c]) for c in range(3)], axis=-1)

    seen = linear(encoded) / seconds[:, None]
    expected = _lab(target / target.max())
    start = np.linalg.lstsq(seen, target / target.max())[0]

    def residual(entries: Array) -> Array:
        return np.asarray((_lab(seen @ entries.reshape(3, 3)) - expected).ravel())

    matrix = least_squares(residual, start.ravel()).x.reshape(3, 3)
    return lambda values: linear(values) @ matrix


def _debevec(encoded: Array, seconds: Array, patch: Text, smoothness: float = 30.0) -> Array:
    """f⁻¹ at 256 codes: equation (3), with the hat function (4), g(128) = 0; smoothness as in colour-hdri."""
    codes, place = np.rint(255 * encoded).astype(int), np.unique(patch, return_inverse=True)[1]
    hat = np.minimum(np.arange(256), 255 - np.arange(256)) + 1.0
    count, patches = len(codes), int(place.max()) + 1
    left, right = np.zeros((count + 255, 256 + patches)), np.zeros(count + 255)
    rows = np.arange(count)
    left[rows, codes], left[rows, 256 + place] = hat[codes], -hat[codes]
    right[:count] = hat[codes] * np.log(seconds)
    middle = np.arange(1, 255)
    for offset, factor in ((-1, 1.0), (0, -2.0), (1, 1.0)):
        left[count + middle - 1, middle + offset] = smoothness * hat[middle] * factor
    left[-1, 128] = 1.0
    return np.asarray(np.exp(np.linalg.lstsq(left, right)[0][:256]))
