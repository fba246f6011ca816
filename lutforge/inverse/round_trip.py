"""What comes back of a JPEG that is linearized and rendered again.

Measured are the colours that a render makes of RAW, and the 8-bit codes nearest to them, which a file holds.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from lutforge.arrays import Array
from lutforge.inverse.colours import as_8_bit, climbed, raw_colours

ColourFunction = Callable[[Array], Array]

MEAN_GOAL, MAX_GOAL = 0.001, 0.02
"""The most that a round trip should lose, RGB norm of encoded values: a quarter of a code, and five."""


@dataclass(frozen=True)
class RoundTrip:
    """JPEG → RAW → JPEG: mean, 99.9th percentile and maximum of the RGB norm of the encoded difference."""

    mean: float
    p999: float
    maximum: float

    @property
    def met(self) -> bool:
        """True where mean and maximum are within the goals."""
        return self.mean <= MEAN_GOAL and self.maximum <= MAX_GOAL

    def __str__(self) -> str:
        mean, p999, maximum = (rounded_up(value) for value in (self.mean, self.p999, self.maximum))
        text = f"round trip mean {mean}, max {maximum}, 99.9 % within {p999}"
        return text if self.met else f"{text}; more than {MAX_GOAL:g} for codes at the edge of what the camera makes"


def rounded_up(value: float) -> str:
    """A measured error to two digits, never said smaller than it is."""
    if value <= 0:
        return "0"
    unit = 10.0 ** (np.floor(np.log10(value)) - 1)
    return f"{np.ceil(value / unit - 1e-9) * unit:.2g}"


def measure(render: ColourFunction, linearize: ColourFunction, count: int = 1 << 15, seed: int = 11) -> RoundTrip:
    """Measure the round trip of the JPEG of 5 · `count` RAW colours, in floats and in 8 bits, and near the worst ones.

    render, linearize: as their files evaluate them.
    """

    def lost(jpeg: Array) -> Array:
        return np.asarray(np.linalg.norm(np.clip(render(linearize(jpeg)), 0.0, 1.0) - jpeg, axis=1))

    def lost_of(raw: Array) -> Array:
        return lost(np.clip(render(raw), 0.0, 1.0))

    raw = raw_colours(count, seed)
    jpeg = np.clip(render(raw), 0.0, 1.0)
    errors, of_codes = lost(jpeg), lost(as_8_bit(jpeg))
    worst = float(lost_of(climbed(lost_of, raw, errors, seed)).max())
    return RoundTrip(
        max(float(part.mean()) for part in (errors, of_codes)),
        max(float(np.quantile(part, 0.999)) for part in (errors, of_codes)),
        max(worst, float(errors.max()), float(of_codes.max())),
    )
