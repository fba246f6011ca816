"""White balances Tw = diag(m_r, m_g, m_b) of a camera, by name, temperature or multipliers (thesis 4.2.2, 6)."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from lutforge.arrays import Array
from lutforge.colour.colour_temperature import (
    COOLEST,
    HOTTEST,
    camera_from_xyz,
    locus,
    multipliers_of,
    temperature_and_tint,
    white,
    white_of,
)
from lutforge.errors import ProfileError, SettingsError, alternatives
from lutforge.settings import LARGEST_MULTIPLIER, Kelvin, Multipliers, Shift

NAMED_KELVIN = {
    "tungsten": 3200.0,
    "incandescent": 3200.0,
    "fluorescent": 4000.0,
    "daylight": 5200.0,
    "cloudy": 6000.0,
    "shade": 7000.0,
}
"""Correlated colour temperatures that cameras mean by their settings, in kelvin."""

BY_MATRIX = (2500.0, 10000.0)
"""Temperatures between which the matrix serves wherever it is anchored, in kelvin."""

LIGHT_SOURCES = {
    "daylight": 1,
    "fluorescent": 2,
    "incandescent": 3,
    "tungsten": 3,
    "flash": 4,
    "cloudy": 10,
    "shade": 11,
}
"""Codes of the tag LightSource (Exif 2.32, 4.6.5) that name a camera's white balance; 0 is unknown, 255 another."""


@dataclass(frozen=True)
class WhiteBalance:
    """The multipliers of one white balance, and what is known of it.

    multipliers: r, g, b with g = 1; kelvin: correlated colour temperature where known; spread: for a setting that the
    camera changes from shot to shot (auto), the largest relative deviation of a shot from these multipliers; gain: a
    common factor of all channels of this setting, relative to the camera's other settings (the third number of Tw).

    Raises ProfileError on multipliers that are not positive numbers with green = 1 or that no camera sets, and on a
    temperature or spread that is none.
    """

    multipliers: tuple[float, float, float]
    kelvin: float | None = None
    spread: float = 0.0
    gain: float = 1.0

    @property
    def factors(self) -> Array:
        """Tw as the camera applies it, (3,): the multipliers times the gain."""
        return self.gain * np.array(self.multipliers)

    def __post_init__(self) -> None:
        if not all(math.isfinite(value) and value > 0 for value in self.multipliers):
            raise ProfileError(f"white balance: multipliers {self.multipliers} are not positive numbers")
        if max(self.multipliers) > LARGEST_MULTIPLIER * min(self.multipliers):
            raise ProfileError(f"white balance: no camera sets multipliers as unequal as {self.multipliers}")
        if not abs(self.multipliers[1] - 1) < 1e-6:
            raise ProfileError(f"white balance: multipliers {self.multipliers} are not divided by green")
        kelvin = self.kelvin
        if kelvin is not None and not (isinstance(kelvin, int | float) and COOLEST <= kelvin <= HOTTEST):
            raise ProfileError(f"white balance: {kelvin!r} is not a temperature from {COOLEST:g} to {HOTTEST:g} kelvin")
        if not 0 <= self.spread <= LARGEST_MULTIPLIER:
            raise ProfileError(f"white balance: a spread of {self.spread} is not possible")
        if not 1.0 / LARGEST_MULTIPLIER <= self.gain <= LARGEST_MULTIPLIER:
            raise ProfileError(f"white balance: no camera multiplies all channels by {self.gain}")


@dataclass(frozen=True, eq=False)
class WhiteBalanceModel:
    """The white balances that a profile knows, and its matrices, from which those of other lights follow.

    known: by name; matrix: Ts (3, 3), white-balanced camera RGB → linear sRGB; colorimetric: (3, 3) XYZ → RAW, None
    where it is not known.
    """

    known: Mapping[str, WhiteBalance]
    matrix: Array
    colorimetric: Array | None = None

    def multipliers(self, white_balance: str | Kelvin | Multipliers) -> Array:
        """Tw (3,) that a selector asks for: multipliers times the gain of the setting.

        Raises SettingsError, listing the known settings, where the profile cannot answer.
        """
        match white_balance:
            case Multipliers(rgb, gain):
                return gain * np.array(rgb)
            case Kelvin(kelvin, 0.0) if f"{kelvin:g}k" in self.known:
                return self.known[f"{kelvin:g}k"].factors
            case Kelvin(kelvin, tint):
                return self._at_temperature(kelvin, tint)
            case name:
                if name not in self.known:
                    hint = f" (a temperature is written {name}K)" if name.isdigit() else ""
                    raise SettingsError(
                        f'unknown white balance "{name}"{hint}; {alternatives(name, sorted(self.known))}'
                        f"{self.temperatures_in_words}, or any multipliers of red, green and blue, such as 2.1,1,1.4"
                    )
                return self.known[name].factors

    def shifted(self, multipliers: Array, shift: Shift) -> Array:
        """The multipliers of a light that is a step from the one that `multipliers` make neutral.

        Where the profile knows no temperature at all, that light is taken for daylight of 5200 K: a step in mired
        changes multipliers nearly alike from everywhere. Raises SettingsError where no natural light is so far off.
        """
        if self.colorimetric is not None or self._settings_of_natural_light:
            from_xyz = self._camera_from_xyz()
        else:
            from_xyz = camera_from_xyz(self.matrix, multipliers / multipliers[1], NAMED_KELVIN["daylight"])
        kelvin, tint = temperature_and_tint(white_of(multipliers, from_xyz))
        mired = 1e6 / (kelvin + shift.kelvin) + shift.mired if kelvin + shift.kelvin > 0 else 0.0
        if not 1e6 / HOTTEST <= mired <= 1e6 / COOLEST:
            raise SettingsError(f"no natural light lies so far from the picture's {kelvin:.0f}K, {tint:+.0f}")
        change = multipliers_of(white(1e6 / mired, tint + shift.tint), from_xyz)
        return np.asarray(multipliers * change / multipliers_of(white(kelvin, tint), from_xyz))

    def temperature_of(self, multipliers: Array) -> Kelvin:
        """Temperature and tint of the light that multipliers make neutral, through the camera's matrix.

        Raises SettingsError where the profile knows no temperature at all.
        """
        kelvin, tint = temperature_and_tint(white_of(multipliers, self._camera_from_xyz()))
        return Kelvin(kelvin, tint)

    @property
    def temperature_range(self) -> tuple[float, float]:
        """The lowest and highest temperature in kelvin that a selector may ask for.

        Raises SettingsError where no setting's temperature is known.
        """
        mireds = [1e6 / kelvin for kelvin, _ in self._settings_of_natural_light]
        if not mireds:
            raise SettingsError(
                f"this profile knows {', '.join(sorted(self.known))}, of no known colour temperature: name multipliers "
                "instead, such as standard/2.1,1,1.4, shift a picture's own, such as as-shot+500K, or calibrate from "
                "RAW files of a camera that LibRaw knows, or with a shot on a named setting, such as daylight"
            )
        margin = 30.0  # mired beyond the outermost known white balance
        low, high = 1e6 / (max(mireds) + margin), 1e6 / max(min(mireds) - margin, 1e6 / HOTTEST)
        return min(low, BY_MATRIX[0]), max(high, BY_MATRIX[1])

    @property
    def temperatures_in_words(self) -> str:
        """The temperatures that a selector may ask for, as the end of a list; "" where there are none."""
        if not self._settings_of_natural_light:
            return ""
        low, high = self.temperature_range
        return f", a temperature from {low:.0f}K to {high:.0f}K"

    def _at_temperature(self, kelvin: float, tint: float) -> Array:
        """Return the multipliers for a light by the matrix, corrected by the deviations of the camera's own settings.

        The logarithms of the deviations are interpolated in reciprocal temperature (mired), and constant beyond the
        outermost settings.
        """
        low, high = self.temperature_range
        if not low - 1e-6 <= kelvin <= high + 1e-6:
            raise SettingsError(
                f"{kelvin:g}K lies outside the white balances of this profile, {low:.0f}K to {high:.0f}K; "
                "calibrate shots on a setting nearer to it"
            )
        from_xyz = self._camera_from_xyz()
        settings = self._settings_of_natural_light
        mireds = np.array(sorted({1e6 / temperature for temperature, _ in settings}))
        deviations = np.zeros((len(mireds), 3))
        for index, mired in enumerate(mireds):  # settings of one temperature: their mean
            logs = [np.log(factors) for temperature, factors in settings if 1e6 / temperature == mired]
            deviations[index] = np.mean(logs, axis=0) - np.log(multipliers_of(locus(1e6 / mired), from_xyz))
        deviation = [np.interp(1e6 / kelvin, mireds, deviations[:, c]) for c in range(3)]
        return np.asarray(np.exp(deviation) * multipliers_of(white(kelvin, tint), from_xyz))

    @property
    def _settings_of_natural_light(self) -> list[tuple[float, Array]]:
        """Temperature and Tw of the settings for natural light.

        Fluorescent lamps lie beside its locus, and count only where there is nothing else.
        """
        settings = {name: (balance.kelvin, balance.factors) for name, balance in self.known.items() if balance.kelvin}
        natural = [setting for name, setting in settings.items() if "fluorescent" not in name]
        return natural if len({kelvin for kelvin, _ in natural}) >= 2 else list(settings.values())

    def _camera_from_xyz(self) -> Array:
        """(3, 3) XYZ → camera RGB: the colorimetric one, else the fitted one, anchored at the setting nearest daylight.

        The fitted matrix contains the camera's look: it takes warm light for less warm than it is.
        """
        if self.colorimetric is not None:
            return self.colorimetric
        settings = self._settings_of_natural_light
        if not settings:
            raise SettingsError("this profile knows no colour temperature; name multipliers r,g,b instead")
        daylight = 1e6 / NAMED_KELVIN["daylight"]
        kelvin, factors = min(settings, key=lambda setting: abs(1e6 / setting[0] - daylight))
        return camera_from_xyz(self.matrix, factors / factors[1], kelvin)
