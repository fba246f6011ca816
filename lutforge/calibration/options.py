"""How a camera is calibrated: one record of options, and the presets that name two sets of them."""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Literal, get_args

from lutforge.calibration.lattice_options import LatticeFitOptions
from lutforge.errors import CalibrationError
from lutforge.interpolation import INTERPOLATIONS, Interpolation
from lutforge.model.camera_profile import MODELS, ModelName

Preset = Literal["lutforge", "thesis"]
PRESETS: tuple[Preset, ...] = get_args(Preset)

SMALLEST, LARGEST = 3, 65
SHAPER_SIZE = 4096
"""Entries of the shaper whose grid the node levels are snapped to."""


@dataclass(frozen=True)
class CalibrationOptions:
    """Options of the fit.

    model: "lattice" fits the whole pipeline as lookup tables, "rbf" the thesis's physical stages (chapter 4) as well.
    preset: "thesis" is its chapters as written (uniform prior, fixed weights, α by fitting error, saturation threshold
    β); "lutforge" continues the matrix and response where there are no samples, smooths in all directions, chooses its
    weights by cross-validation over shots, and tells outliers by their residual. size: nodes per axis, 3 … 65.
    nonuniform: False stops at the uniform lattice. response: the lattice that renders has a curve behind it, which CLF
    and CTF files hold, and a plain form beside it for other files (lutforge preset only). lattice: the numbers of the
    lattice fit. Raises CalibrationError on values outside these.
    """

    model: ModelName = "lattice"
    preset: Preset = "lutforge"
    size: int = 33
    interpolation: Interpolation = "trilinear"
    nonuniform: bool = True
    shaper_size: int = SHAPER_SIZE
    response: bool = True
    lattice: LatticeFitOptions = field(default_factory=LatticeFitOptions)

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
        """The options as plain values, for the profile."""
        return {
            "model": self.model,
            "preset": self.preset,
            "size": self.size,
            "interpolation": self.interpolation,
            "nonuniform": self.nonuniform,
            "shaper_size": self.shaper_size,
            "response": self.response,
        }


def options_from_json(values: Mapping[str, object]) -> CalibrationOptions:
    """The options that a profile was calibrated with; what it does not say is the default."""
    names = {each.name for each in fields(CalibrationOptions)} - {"lattice"}
    known = {name: value for name, value in values.items() if name in names}
    try:
        return CalibrationOptions(**known)  # type: ignore[arg-type]  # checked by __post_init__, and TypeError here
    except TypeError as error:
        raise CalibrationError(f"the profile's options cannot be read ({error})") from error
