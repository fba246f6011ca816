"""The options of a calibration."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from typing import Any, ClassVar, Self

from lutforge.errors import CalibrationError
from lutforge.interpolation import INTERPOLATIONS, Interpolation
from lutforge.model.lattice import SHORT_SHAPER_SIZE

BETA = 0.3
"""HSV saturation β below which a colour is taken to be left alone by the gamut map."""
CURVES = 15
"""Curves of EMoR of which f⁻¹ is made."""
MOST_CENTRES = 4_000
"""Centres of a gamut map, to which samples are merged; the thesis has 3,000 to 5,000."""
SMALLEST_LATTICE = 3
LARGEST_LATTICE = 65
"""Nodes per axis."""


@dataclass(frozen=True)
class LatticeOptions:
    """The lattices of a profile.

    size: nodes per axis, 3 … 65; interpolation: between them; nonuniform: False keeps the node levels evenly spaced;
    shaper_size: entries of the shaper that will hold the levels. Raises CalibrationError on values outside these.

    preset: the word of the command line for the method of calibration; method: its name in a sentence.
    """

    preset: ClassVar[str]
    method: ClassVar[str]

    size: int = 33
    interpolation: Interpolation = "trilinear"
    nonuniform: bool = True
    shaper_size: int = SHORT_SHAPER_SIZE

    def __post_init__(self) -> None:
        if not SMALLEST_LATTICE <= self.size <= LARGEST_LATTICE:
            raise CalibrationError(f"lattice size {self.size} is not within {SMALLEST_LATTICE} … {LARGEST_LATTICE}")
        if self.interpolation not in INTERPOLATIONS:
            raise CalibrationError(
                f'unknown interpolation "{self.interpolation}"; choose one of {", ".join(INTERPOLATIONS)}'
            )
        if self.shaper_size < self.size:
            raise CalibrationError(f"a shaper of {self.shaper_size} entries cannot hold {self.size} node levels")

    def without_exposure_pairs(self, pairs: tuple[tuple[str, str], ...]) -> Self:
        """The options of a fit that leaves out the exposure pairs of these shots; the same where it uses no pairs."""
        return self

    def as_json(self) -> dict[str, object]:
        """The options as plain values, for the profile."""
        return asdict(self)


@dataclass(frozen=True)
class CalibrationOptions(LatticeOptions):
    """Options of the calibration.

    beta: HSV saturation below which a colour is surely used to fit response and matrix; curves: number of EMoR curves
    of the response; centres: the most of a gamut map. The others are those of `LatticeOptions`. Raises CalibrationError
    on values outside their ranges.
    """

    preset: ClassVar[str] = "lutforge"
    method: ClassVar[str] = "LutForge's own method"

    beta: float = BETA
    curves: int = CURVES
    centres: int = MOST_CENTRES

    def __post_init__(self) -> None:
        super().__post_init__()
        check_model_options(self.beta, self.curves, self.centres)


def check_model_options(beta: float, curves: int, centres: int) -> None:
    """Raise CalibrationError where a camera model cannot be fitted with these numbers."""
    if not 0 < beta <= 1:
        raise CalibrationError("β lies above 0, up to 1")
    if not 1 <= curves <= CURVES:
        raise CalibrationError(f"{curves} curves; EMoR has 1 to {CURVES}")
    if centres < 8:
        raise CalibrationError("a gamut map needs 8 centres or more")


def options_from_json(values: Mapping[str, object]) -> CalibrationOptions:
    """The options that a profile was calibrated with; what it does not state is the default."""
    names = {field.name for field in fields(CalibrationOptions)}
    known: dict[str, Any] = {name: value for name, value in values.items() if name in names}
    try:
        return CalibrationOptions(**known)  # checked by __post_init__, and TypeError here
    except (TypeError, ValueError) as error:
        raise CalibrationError(f"the profile's options cannot be read ({error})") from error
