"""Measures the round trip of a JPEG that is linearized and rendered again.

It is measured on colours that a render makes of RAW, and on the 8-bit codes nearest to them, as files hold them.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from lutforge.arrays import Array, Mask
from lutforge.inverse.colours import as_8_bit, climbed, raw_colours

ColourFunction = Callable[[Array], Array]

MEAN_GOAL, MAX_GOAL = 0.001, 0.02
"""The most that a round trip should lose, RGB norm of encoded values: a quarter of a code, and five."""

MEAN_KEY, MAX_KEY = "round trip mean", "round trip max"
"""The names of both in a description."""


@dataclass(frozen=True)
class RoundTrip:
    """JPEG → RAW → JPEG: mean, 99.9th percentile and maximum of the RGB norm of the encoded difference.

    worst: the 8-bit code nearest to the colour of the maximum; shown: the maximum of the colours that samples showed,
    0 where it is within the goal, None where the samples are not known.
    """

    mean: float
    p999: float
    maximum: float
    worst: tuple[int, ...] = ()
    shown: float | None = None

    @property
    def met(self) -> bool:
        """True where mean and maximum are within the goals."""
        return self.mean <= MEAN_GOAL and self.maximum <= MAX_GOAL

    def __str__(self) -> str:
        """Lines of a key and a value each, which `stated_errors` reads."""
        text = f"{MEAN_KEY}: {rounded_up(self.mean)}\n{MAX_KEY}: {rounded_up(self.maximum)}"
        text += f"\nround trip quantile: 99.9 % within {rounded_up(self.p999)}"
        if self.maximum <= MAX_GOAL:
            return text
        text += f"\nround trip worst: at JPEG code {' '.join(map(str, self.worst))}"
        if self.shown is None:
            return text
        if self.shown == 0:
            return f"{text}; more than {MAX_GOAL:g} only for colours that no sample showed"
        return f"{text}; {rounded_up(self.shown)} for colours that samples showed"


def stated_errors(description: str) -> tuple[float, float]:
    """Read mean and maximum from a description that holds the lines of a `RoundTrip`; both 0 where it does not."""
    fields = dict(line.split(": ", 1) for line in description.splitlines() if ": " in line)
    try:
        return float(fields[MEAN_KEY]), float(fields[MAX_KEY])
    except (KeyError, ValueError):
        return 0.0, 0.0


def rounded_up(value: float) -> str:
    """A measured error rounded up to two digits."""
    if value <= 0:
        return "0"
    unit = 10.0 ** (np.floor(np.log10(value)) - 1)
    return f"{np.ceil(value / unit - 1e-9) * unit:.2g}"


def measure(
    render: ColourFunction,
    linearize: ColourFunction,
    count: int = 1 << 15,
    seed: int = 11,
    shown: Callable[[Array], Mask] | None = None,
) -> RoundTrip:
    """Measure the round trip of the JPEG of 5 · `count` RAW colours, in floats and in 8 bits, and near the worst ones.

    render, linearize: as their files evaluate them; shown: tells of JPEG colours (n, 3) whether samples showed them.
    """

    def lost(jpeg: Array) -> Array:
        return np.asarray(np.linalg.norm(np.clip(render(linearize(jpeg)), 0.0, 1.0) - jpeg, axis=1))

    def made(raw: Array) -> Array:
        return np.clip(render(raw), 0.0, 1.0)

    raw = raw_colours(count, seed)
    jpeg = made(raw)
    errors, of_codes = lost(jpeg), lost(as_8_bit(jpeg))
    climb = made(climbed(lambda near: lost(made(near)), raw, errors, seed))
    every = np.concatenate([errors, of_codes, lost(climb)])
    colours = np.concatenate([jpeg, as_8_bit(jpeg), climb])
    largest, beyond = int(every.argmax()), every > MAX_GOAL
    return RoundTrip(
        max(float(part.mean()) for part in (errors, of_codes)),
        max(float(np.quantile(part, 0.999)) for part in (errors, of_codes)),
        float(every[largest]),
        tuple(int(code) for code in np.rint(255 * colours[largest])),
        None if shown is None else float(np.max(every[beyond], where=shown(colours[beyond]), initial=0.0)),
    )
