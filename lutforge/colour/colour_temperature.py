"""White-balance multipliers along the locus of natural light, by colour temperature and tint.

A white balance makes the light of one chromaticity neutral. The camera's matrix converts multipliers (r, 1, b) to the
chromaticity of that light, and back. Tint is that of raw converters: 3000 times the distance from the locus in CIE 1960
(u, v). A positive tint presumes a greener light, and makes the picture more magenta (Adobe, DNG SDK 1.4,
dng_temperature.cpp, kTintScale).
"""

import numpy as np

from lutforge.arrays import Array
from lutforge.colour.rgb_spaces import BRADFORD
from lutforge.colour.srgb import D65, SRGB_TO_XYZ
from lutforge.settings import KELVIN_RANGE

TINT_PER_UV = 3000.0
"""Units of tint per unit of distance in CIE 1960 (u, v)."""
D65_KELVIN = 6504.0
"""The correlated colour temperature of CIE illuminant D65."""

COOLEST, HOTTEST = KELVIN_RANGE


def locus(kelvin: float) -> Array:
    """Return (u, v), CIE 1960, of natural light.

    It is Planck's up to 3500 K, daylight from 4000 K where its locus begins, mixed in between. Closed forms: M. Krystek
    (1985) and CIE 15:2018, equations 4.6 and 4.7.
    """
    t = kelvin
    share = float(np.clip((kelvin - 3500.0) / 500.0, 0.0, 1.0))  # of daylight
    planck = daylight = np.zeros(2)
    if share < 1:
        u = (0.860117757 + 1.54118254e-4 * t + 1.28641212e-7 * t**2) / (1 + 8.42420235e-4 * t + 7.08145163e-7 * t**2)
        v = (0.317398726 + 4.22806245e-5 * t + 4.20481691e-8 * t**2) / (1 - 2.89741816e-5 * t + 1.61456053e-7 * t**2)
        planck = np.array([u, v])
    if share > 0:
        if t <= 7000.0:
            x = -4.6070e9 / t**3 + 2.9678e6 / t**2 + 0.09911e3 / t + 0.244063
        else:
            x = -2.0064e9 / t**3 + 1.9018e6 / t**2 + 0.24748e3 / t + 0.237040
        y = -3.000 * x**2 + 2.870 * x - 0.275
        daylight = np.array([4 * x, 6 * y]) / (-2 * x + 12 * y + 3)
    return np.asarray((1 - share) * planck + share * daylight)


def white(kelvin: float, tint: float = 0.0) -> Array:
    """The chromaticity (u, v) at a tint from the locus, perpendicular to it; a positive tint is a greener light."""
    step = 1e-4 * kelvin
    along = locus(kelvin + step) - locus(kelvin - step)
    across = np.array([along[1], -along[0]]) / np.linalg.norm(along)
    if across[1] < 0:
        across = -across  # green lies at higher v
    return np.asarray(locus(kelvin) + across * tint / TINT_PER_UV)


def temperature_and_tint(uv: Array) -> tuple[float, float]:
    """The temperature and tint of a white: its nearest point of the locus, between 1500 K and 25000 K."""
    # In mireds, 1e6 / K, in which the locus is followed at an even pace; each turn searches 1/32 of the range before.
    low = 1e6 / HOTTEST
    high = 1e6 / COOLEST
    for _ in range(4):
        mireds = np.linspace(low, high, 65)
        distances = [float(np.sum((locus(1e6 / mired) - uv) ** 2)) for mired in mireds]
        best = mireds[int(np.argmin(distances))]
        step = mireds[1] - mireds[0]
        low = max(1e6 / HOTTEST, best - step)
        high = min(1e6 / COOLEST, best + step)

    kelvin = float(1e6 / best)
    across = white(kelvin, TINT_PER_UV) - locus(kelvin)
    return kelvin, TINT_PER_UV * float((uv - locus(kelvin)) @ across)


def camera_from_xyz(matrix: Array, multipliers: Array, kelvin: float) -> Array:
    """The matrix (3, 3) from XYZ of a light to camera RGB.

    matrix: Ts, white-balanced camera RGB → linear sRGB, calibrated under the light of `kelvin` whose multipliers these
    are.
    """
    cone = BRADFORD @ _xyz(locus(kelvin)) / (BRADFORD @ D65)
    to_light = np.linalg.inv(BRADFORD) @ np.diag(cone) @ BRADFORD
    return np.asarray(np.linalg.inv(to_light @ SRGB_TO_XYZ @ matrix @ np.diag(multipliers)))


def multipliers_of(uv: Array, from_xyz: Array) -> Array:
    """The multipliers (3,), green = 1, that make the light of chromaticity uv neutral. from_xyz: XYZ → camera RGB."""
    neutral = from_xyz @ _xyz(uv)
    return np.asarray(neutral[1] / neutral)


def white_of(multipliers: Array, from_xyz: Array) -> Array:
    """The chromaticity (u, v) of the light that these multipliers make neutral; the inverse of `multipliers_of`."""
    x, y, z = np.linalg.solve(from_xyz, 1 / multipliers)
    total = x + 15 * y + 3 * z
    return np.array([4 * x / total, 6 * y / total])


def _xyz(uv: Array) -> Array:
    """XYZ with Y = 1 of a CIE 1960 chromaticity."""
    u, v = uv
    x = 3 * u / (2 * u - 8 * v + 4)
    y = 2 * v / (2 * u - 8 * v + 4)
    return np.array([x / y, 1.0, (1 - x - y) / y])
