"""What comes back of a JPEG that goes to the reference of a config and back, and what may be lost there.

In the gamut are the colours that a render makes of RAW, and the 8-bit codes nearest to them, which a file holds.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lutforge.ocio.lattice_lut import LatticeLut as Lut
from lutforge.ocio.made_colours import as_8_bit, climbed, spread

Array = NDArray[np.float64]

MEAN_GOAL, MAX_GOAL = 0.002, 0.02
"""What a colour space of a config may lose to the reference and back, RGB norm of encoded values."""
MEASURED = 1 << 15


@dataclass(frozen=True)
class RoundTrip:
    """JPEG → RAW → JPEG on colours that the render makes: RGB norm of the encoded difference. departure: mean norm of
    the change of the linearization from the profile's own, linear, 1 = saturation; 0 where it is the profile's own;
    moved: of the render, encoded, where samples are."""

    mean: float
    maximum: float
    departure: float = 0.0
    moved: float = 0.0

    @property
    def worth(self) -> float:
        """The larger share of its goal."""
        return max(self.mean / MEAN_GOAL, self.maximum / MAX_GOAL)

    @property
    def met(self) -> bool:
        """Within the goals."""
        return self.worth <= 1

    def or_worse(self, other: "RoundTrip") -> "RoundTrip":
        """The larger of both errors."""
        return replace(self, mean=max(self.mean, other.mean), maximum=max(self.maximum, other.maximum))

    def __str__(self) -> str:
        text = f"round trip mean {rounded_up(self.mean)}, max {rounded_up(self.maximum)}"
        if self.departure:
            text += f", by LUTs fitted to each other (mean change of linearize {self.departure:.2g} of saturation"
            text += f", of render where samples are {self.moved:.2g})" if self.moved else ")"
        if not self.met:
            text += f": beyond {MEAN_GOAL:g} and {MAX_GOAL:g}, where the render folds or its gamut ends"
        return text


def rounded_up(value: float) -> str:
    """A measured error to two digits, never said smaller than it is."""
    if value <= 0:
        return "0"
    unit = 10.0 ** (np.floor(np.log10(value)) - 1)
    return f"{np.ceil(value / unit - 1e-9) * unit:.2g}"


def measure(render: Lut, linearize: Lut, count: int = MEASURED, seed: int = 11) -> RoundTrip:
    """The round trip over RAW colours spread over the whole range and over its darks, as files hold what they make, in
    floats and in 8 bits, and what is worse near the worst of these."""

    def lost(jpeg: Array) -> Array:
        return np.asarray(np.linalg.norm(np.clip(render(linearize(jpeg)), 0.0, 1.0) - jpeg, axis=1))

    def left(raw: Array) -> Array:
        return lost(np.clip(render(raw), 0.0, 1.0))

    raw = spread(count, seed)
    errors, of_codes = left(raw), lost(as_8_bit(np.clip(render(raw), 0.0, 1.0)))
    trip = summary(errors, of_codes)
    return replace(trip, maximum=max(trip.maximum, float(left(climbed(left, raw, errors, seed)).max())))


def summary(*errors: Array) -> RoundTrip:
    """The largest mean and the largest error of several sets."""
    return RoundTrip(max(float(e.mean()) for e in errors), max(float(e.max()) for e in errors))
