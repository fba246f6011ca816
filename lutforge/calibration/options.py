"""How a camera is calibrated: one record of options, and the presets that name two sets of them.

Figures of the lattice fit are of 17 nodes per axis on the 30 % of the Nikon D40's published pairs that are held out:
the mean and the largest error norm, encoded 0 … 1, medians over five splits. With the numbers here they are 0.0027 and
0.015, of the plain form 0.0040 and 0.039.
"""

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields
from typing import Any, Literal, get_args

from lutforge.errors import CalibrationError
from lutforge.interpolation import INTERPOLATIONS, Interpolation
from lutforge.model.camera_profile import MODELS, ModelName

SEARCH_SIZE = 13
"""Nodes per axis of the lattice on which node levels and λ_S are searched: the best levels hardly depend on their
number. λ_S is stated for this size wherever it is kept."""

MEASURING_TOLERANCE = 1e-4
"""The tolerance of fits whose only use is to measure an error: within 1e-4 of the exact ones on every sample."""


@dataclass(frozen=True)
class LatticeFitOptions:
    """How a lattice is fitted to samples.

    smoothness: λ_S where there is one shot only, and nothing to cross-validate on; where there are more the search
    begins there. It ends at √10 times that in all five splits.

    prior_weight: the weight that holds each node to the prior: negligible where there are samples, it determines the
    nodes that no sample reaches. The mean hardly depends on it: 0.0027 at 1e-7, 0.0028 at 1e-3, where the largest error
    grows to 0.017.

    grey_weight: the weight of each of 257 points of the grey axis, where a sample has 1: little beside samples, enough
    elsewhere to keep the axis neutral. It costs nothing on samples (0: 0.0027; 0.2: 0.0028).

    outlier_scale, least_outlier: a sample whose error is this many times the median, and at least this large, counts
    half. Twelve codes are beyond any noise of a mean over a patch. Clean data lose nothing (0.0027 without, too).

    eye_share: share of the node levels of a render that stays at perceptually even steps. Without it, a set of bright
    samples makes the first cell so wide that it holds all the dark codes of usual pictures. It costs clean data 1 % of
    the mean (0: 0.0027; 0.3: 0.0028).

    search_tolerance, tolerance: relative residual of fits that are searched with, and of the last one. A hundredth and
    a thousandth of them change no figure in its fourth digit.

    point_weight: the weight, where a sample has 1, of a point of the lattice with a curve in the fit of its plain form,
    and of a likely scene in the fit of the lattice that linearizes. With 0.01 the largest error is 0.044 instead of
    0.039; 1 has the same figures.

    bound_cost: nodes of the plain form are bounded to [0, 1] where that raises the mean error by no more than this, a
    quarter of a code, which no eye sees. If they always are bounded, the mean is 0.0056 and the largest error 0.051.

    follow_power: the plain form minimizes an Lp norm of its errors with p = 2 + this power. With 0 the figures are
    0.0042 and 0.044, with 2 they are 0.0041 and 0.052.
    """

    smoothness: float = 3e-3
    prior_weight: float = 1e-5
    grey_weight: float = 0.02
    outlier_scale: float = 10.0
    least_outlier: float = 12.0 / 255.0
    eye_share: float = 0.1
    search_tolerance: float = 1e-2
    tolerance: float = 1e-5
    point_weight: float = 0.2
    bound_cost: float = 0.25 / 255.0
    follow_power: float = 1.25


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

    @property
    def nugget(self) -> float | None:
        """8Nπρ of (4.8)."""
        return None if self.rho is None else 8.0 * self.centres * math.pi * self.rho


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
    nonuniform: False keeps the node levels evenly spaced. output_curve: the lattice that renders has one behind
    it, which CLF and CTF files hold, and a plain form for other files (lutforge preset only). lattice: the numbers of
    the lattice fit; physical: those of response, matrix and gamut map. Raises CalibrationError on values outside these.
    """

    model: ModelName = "lattice"
    preset: Preset = "lutforge"
    size: int = 33
    interpolation: Interpolation = "trilinear"
    nonuniform: bool = True
    shaper_size: int = SHAPER_SIZE
    output_curve: bool = True
    lattice: LatticeFitOptions = field(default_factory=LatticeFitOptions)
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
        usual = asdict(PhysicalOptions())
        physical = {name: value for name, value in asdict(self.physical).items() if value != usual[name]}
        return {
            "model": self.model,
            "preset": self.preset,
            "size": self.size,
            "interpolation": self.interpolation,
            "nonuniform": self.nonuniform,
            "shaper_size": self.shaper_size,
            "output_curve": self.output_curve,
            **({"physical": physical} if physical else {}),
        }


def options_from_json(values: Mapping[str, object]) -> CalibrationOptions:
    """The options that a profile was calibrated with; what it does not say is the default."""
    names = {each.name for each in fields(CalibrationOptions)} - {"lattice"}
    known: dict[str, Any] = {name: value for name, value in values.items() if name in names}
    try:
        if "physical" in known:
            physical = dict(known["physical"])
            pairs = tuple((str(one), str(other)) for one, other in physical.pop("without_pairs", ()))
            known["physical"] = PhysicalOptions(**physical, without_pairs=pairs)
        return CalibrationOptions(**known)  # checked by __post_init__, and TypeError here
    except (TypeError, ValueError) as error:
        raise CalibrationError(f"the profile's options cannot be read ({error})") from error
