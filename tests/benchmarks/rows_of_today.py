"""The rows of the table of `cameras_of_today`, and the figures of the code before that stand beside them."""

from collections.abc import Iterator
from dataclasses import dataclass

BEFORE = {
    "S40 as it is: falloffs found": 0.0,
    "S40, 0.85 EV, dark RAW: falloff off by at most, EV": 0.804,
    "S40, 0.85 EV, dark RAW: error ratio": 4.342,
    "S40, 0.85 EV, bright JPEG: falloff off by at most, EV": 0.804,
    "S40, 0.85 EV, bright JPEG: error ratio": 5.673,
    "S40, 0.3 EV, dark RAW: falloff off by at most, EV": 0.284,
    "S40, 0.3 EV, dark RAW: error ratio": 1.91,
    "S40, 0.3 EV, bright JPEG: falloff off by at most, EV": 0.284,
    "S40, 0.3 EV, bright JPEG: error ratio": 1.933,
    "S40, 1.5 EV, dark RAW: falloff off by at most, EV": 1.418,
    "S40, 1.5 EV, dark RAW: error ratio": 6.695,
    "S40, 1.5 EV, bright JPEG: falloff off by at most, EV": 1.418,
    "S40, 1.5 EV, bright JPEG: error ratio": 10.001,
    "S40, two lenses, 1.2 and 0.5 EV: off by at most, EV": 1.134,
    "S40, two lenses, 1.2 and 0.5 EV: error ratio": 5.307,
    "S40, power 0.85 of CRW_0101: error ratio": 1.41,
    "S40, power 0.85 of CRW_0104: error ratio": 1.50,
    "simulated, power 0.93 of one: error ratio": 1.17,
    "simulated, shadows +0.5 EV of a third: error ratio": 1.87,
    "demo, blue ball: mean ΔE00": 3.0,
    "demo, graded picture: RMSE": 0.0163,
    "refinish, 144 shots: worst of 132 pairs": 0.0162,
}
"""Figures of the code before, by row, where they were measured; it refused some of these shots as contradicting."""


@dataclass(frozen=True)
class Row:
    """A line of the table; target: what the value may be at most."""

    name: str
    value: float
    target: float


Rows = Iterator[Row]
