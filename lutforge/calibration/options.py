"""How a camera is calibrated: one record of options, and the presets that name two sets of them."""

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields
from typing import Any, Literal, get_args

from lutforge.errors import CalibrationError
from lutforge.interpolation import INTERPOLATIONS, Interpolation
from lutforge.model.camera_profile import MODELS, ModelName


@dataclass(frozen=True)
class PhysicalOptions:
    """How response, matrix and gamut map are fitted (thesis, chapter 4).

    beta: HSV saturation β below which a colour is used to fit f and Ts. curves: number of EMoR curves of f⁻¹.
    weighting: a sample has the number of samples of its tone to the power of −weighting as its weight, so that with 0
    all samples count alike, and with 1 all tones. centres: the most of a gamut map. rho: ρ of (4.8), its smoothness;
    None chooses it on held-out shots. without_pairs: pairs of names of shots whose exposure pairs are not used to fit f
    (preset "thesis").
    Raises CalibrationError on values outside these.
    """

    beta: float = 0.3
    curves: int = 15
    weighting: float = 0.5
    centres: int = 4000
    rho: float | None = None
    without_pairs: tuple[tuple[str, str], ...] = ()

    def __post_init__(self) -> None:
        if not 0 < self.beta <= 1 or not 0 <= self.weighting <= 1:
            raise CalibrationError("β lies above 0, up to 1, and the data weighting between 0 and 1")
        if not 1 <= self.curves <= 15:
            raise CalibrationError(f"{self.curves} curves; EMoR has 1 to 15")
        if self.centres < 8 or (self.rho is not None and not 0 <= self.rho < math.inf):
            raise CalibrationError("a gamut map needs 8 centres or more, and a finite ρ that is not negative")


Preset = Literal["lutforge", "thesis"]
PRESETS: tuple[Preset, ...] = get_args(Preset)

SMALLEST, LARGEST = 3, 65
SHAPER_SIZE = 4096
"""Entries of the shaper whose grid the node levels are snapped to."""


@dataclass(frozen=True)
class CalibrationOptions:
    """Options of the fit.

    model: "lattice" renders by lookup tables that the fitted model is baked to, "rbf" by the model itself.
    preset: "thesis" is its chapters as written (regression of lattices from a uniform prior, fixed weights, α by
    fitting error, saturation threshold β); "lutforge" fits matrix and response to all pairs and the gamut map by
    kriging, and bakes the lattices from these. size: nodes per axis, 3 … 65. nonuniform: False keeps the node levels
    evenly spaced. physical: the numbers of response, matrix and gamut map that the thesis leaves open. Raises
    CalibrationError on values outside these.
    """

    model: ModelName = "lattice"
    preset: Preset = "lutforge"
    size: int = 33
    interpolation: Interpolation = "trilinear"
    nonuniform: bool = True
    shaper_size: int = SHAPER_SIZE
    physical: PhysicalOptions = field(default_factory=PhysicalOptions)

    def __post_init__(self) -> None:
        if self.model not in MODELS:
            raise CalibrationError(f'unknown model "{self.model}"; choose one of {", ".join(MODELS)}')
        if self.preset not in PRESETS:
            raise CalibrationError(f'unknown preset "{self.preset}"; choose one of {", ".join(PRESETS)}')
        if not SMALLEST <= self.size <= LARGEST:
            raise CalibrationError(f"lattice size {self.size} is not within {SMALLEST} … {LARGEST}")
        if self.interpolation not in INTERPOLATIONS:
            raise CalibrationError(
                f'unknown interpolation "{self.interpolation}"; choose one of {", ".join(INTERPOLATIONS)}'
            )
        if self.shaper_size < self.size:
            raise CalibrationError(f"a shaper of {self.shaper_size} entries cannot hold {self.size} node levels")

    def as_json(self) -> dict[str, object]:
        """The options as plain values, for the profile; of the physical ones, those that are not the default."""
        values, usual = asdict(self), asdict(PhysicalOptions())
        physical = {name: value for name, value in values.pop("physical").items() if value != usual[name]}
        return values | ({"physical": physical} if physical else {})


def options_from_json(values: Mapping[str, object]) -> CalibrationOptions:
    """The options that a profile was calibrated with; what it does not say is the default."""
    names = {each.name for each in fields(CalibrationOptions)}
    known: dict[str, Any] = {name: value for name, value in values.items() if name in names}
    try:
        if "physical" in known:
            physical = dict(known["physical"])
            pairs = tuple((str(one), str(other)) for one, other in physical.pop("without_pairs", ()))
            known["physical"] = PhysicalOptions(**physical, without_pairs=pairs)
        return CalibrationOptions(**known)  # checked by __post_init__, and TypeError here
    except (TypeError, ValueError) as error:
        raise CalibrationError(f"the profile's options cannot be read ({error})") from error
