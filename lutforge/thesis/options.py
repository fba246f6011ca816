"""The options of the thesis's calibration: the numbers that it leaves open."""

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields, replace
from typing import Any, ClassVar, Self

from lutforge.calibration.options import (
    BETA,
    CURVES,
    MOST_CENTRES,
    CalibrationOptions,
    LatticeOptions,
    check_model_options,
    options_from_json,
)
from lutforge.errors import CalibrationError


@dataclass(frozen=True)
class ThesisOptions(LatticeOptions):
    """Options of the thesis's calibration.

    beta: HSV saturation β below which a colour is used to fit f and Ts; curves: number of EMoR curves of f⁻¹; centres:
    the most of a gamut map; rho: ρ of (4.8), its smoothness; None chooses it on held-out shots. without_pairs: pairs of
    names of shots whose exposure pairs are not used to fit f. The others are those of `LatticeOptions`. Raises
    CalibrationError on values outside their ranges.
    """

    preset: ClassVar[str] = "thesis"
    method: ClassVar[str] = "the thesis's method"

    beta: float = BETA
    curves: int = CURVES
    centres: int = MOST_CENTRES
    rho: float | None = None
    without_pairs: tuple[tuple[str, str], ...] = ()

    def __post_init__(self) -> None:
        super().__post_init__()
        check_model_options(self.beta, self.curves, self.centres)
        if self.rho is not None and not 0 <= self.rho < math.inf:
            raise CalibrationError("ρ is a finite number that is not negative")

    def without_exposure_pairs(self, pairs: tuple[tuple[str, str], ...]) -> Self:
        """The options of a fit of f that leaves out the exposure pairs of these shots."""
        return replace(self, without_pairs=pairs)

    def as_json(self) -> dict[str, object]:
        """The options as plain values, for the profile."""
        return {"preset": self.preset, **asdict(self)}


Options = CalibrationOptions | ThesisOptions
"""The options of either calibration."""
OPTIONS_OF_PRESET: dict[str, type[Options]] = {
    options.preset: options for options in (CalibrationOptions, ThesisOptions)
}
"""Both kinds of options, by the word that the command line has for them."""


def stated_options(values: Mapping[str, object]) -> Options:
    """The options that a profile states: those of the thesis, or of LutForge's own calibration.

    Raises CalibrationError where they cannot be read.
    """
    if values.get("preset") != ThesisOptions.preset:
        return options_from_json(values)
    names = {field.name for field in fields(ThesisOptions)}
    known: dict[str, Any] = {name: value for name, value in values.items() if name in names}
    try:
        pairs = tuple((str(first), str(second)) for first, second in known.pop("without_pairs", ()))
        return ThesisOptions(**known, without_pairs=pairs)
    except (TypeError, ValueError) as error:
        raise CalibrationError(f"the profile's options cannot be read ({error})") from error


def options_of_preset(preset: str, **lattice: Any) -> Options:
    """The default options of a preset by its name, "lutforge" or "thesis". Raises CalibrationError on another name."""
    if preset not in OPTIONS_OF_PRESET:
        raise CalibrationError(f'unknown preset "{preset}"; choose one of {", ".join(OPTIONS_OF_PRESET)}')
    return OPTIONS_OF_PRESET[preset](**lattice)
