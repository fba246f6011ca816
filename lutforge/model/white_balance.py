"""White balances Tw = diag(m_r, m_g, m_b) of a camera, by name, temperature or multipliers (thesis 4.2.2, 6)."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lutforge.errors import ProfileError, SettingsError
from lutforge.settings import Kelvin, Multipliers

NAMED_KELVIN = {
    "tungsten": 3200.0,
    "incandescent": 3200.0,
    "fluorescent": 4000.0,
    "daylight": 5200.0,
    "cloudy": 6000.0,
    "shade": 7000.0,
}
"""Correlated colour temperatures that cameras mean by their settings, in kelvin."""

MIRED_MARGIN = 30.0
"""How far beyond the outermost known white balance a temperature may lie, in mired."""


@dataclass(frozen=True)
class WhiteBalance:
    """multipliers: r, g, b with g = 1; kelvin: correlated colour temperature where known; spread: for a setting that
    the camera changes from shot to shot (auto), the largest relative departure of a shot from these multipliers.

    Raises ProfileError on multipliers that are not positive numbers.
    """

    multipliers: tuple[float, float, float]
    kelvin: float | None = None
    spread: float = 0.0

    def __post_init__(self) -> None:
        if not all(math.isfinite(value) and value > 0 for value in self.multipliers):
            raise ProfileError(f"white balance: multipliers {self.multipliers} are not positive numbers")


def resolve(white_balance: str | Kelvin | Multipliers, known: Mapping[str, WhiteBalance]) -> NDArray[np.float64]:
    """The multipliers (3,) that a selector asks for, green = 1.

    Raises SettingsError, listing the known settings, where the profile cannot answer.
    """
    match white_balance:
        case Multipliers(rgb):
            return np.array(rgb)
        case Kelvin(kelvin) if f"{kelvin:g}k" in known:
            return np.array(known[f"{kelvin:g}k"].multipliers)
        case Kelvin(kelvin):
            return _interpolate(kelvin, known)
        case name:
            if name not in known:
                raise SettingsError(f'unknown white balance "{name}"; this profile knows {", ".join(sorted(known))}')
            return np.array(known[name].multipliers)


def _interpolate(kelvin: float, known: Mapping[str, WhiteBalance]) -> NDArray[np.float64]:
    """Multipliers at a temperature: log multipliers, linear in reciprocal temperature (mired)."""
    points = sorted(
        (1e6 / balance.kelvin, balance.multipliers) for balance in known.values() if balance.kelvin is not None
    )
    if len({mired for mired, _ in points}) < 2:
        raise SettingsError(
            f"{kelvin:g}K needs two white balances of known temperature to interpolate between; "
            f"this profile knows {', '.join(sorted(known))}"
        )
    mireds = np.array([mired for mired, _ in points])
    wanted = 1e6 / kelvin
    if not mireds[0] - MIRED_MARGIN <= wanted <= mireds[-1] + MIRED_MARGIN:
        raise SettingsError(
            f"{kelvin:g}K lies outside the white balances of this profile, "
            f"{1e6 / mireds[-1]:.0f}K to {1e6 / mireds[0]:.0f}K"
        )
    logs = np.log([multipliers for _, multipliers in points])
    cell = int(np.clip(np.searchsorted(mireds, wanted, side="right") - 1, 0, len(mireds) - 2))
    while mireds[cell + 1] == mireds[cell]:  # two settings of one temperature
        cell += 1 if cell + 2 < len(mireds) else -1
    fraction = (wanted - mireds[cell]) / (mireds[cell + 1] - mireds[cell])
    multipliers: NDArray[np.float64] = np.exp((1 - fraction) * logs[cell] + fraction * logs[cell + 1])
    return multipliers
