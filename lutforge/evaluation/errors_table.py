"""The error figures of the thesis (chapter 5): pixel error and its quartiles, RMSE, and ΔE00 beside them."""

from dataclasses import asdict, dataclass

import numpy as np

from lutforge.arrays import Array
from lutforge.colour.colour_difference import delta_e_2000

JUST_VISIBLE = 1.0
"""The ΔE00 that is just noticed side by side, about (CIE 142-2001)."""


@dataclass(frozen=True)
class ErrorFigures:
    """Pixel error: the Euclidean norm of the RGB difference, 1 = full scale. rmse: per channel, root mean square.

    de00_mean, de00_max: ΔE00 between encoded sRGB colours; None where the values are not display colours.
    """

    count: int
    mean: float
    maximum: float
    q1: float
    median: float
    q3: float
    rmse: float
    de00_mean: float | None = None
    de00_max: float | None = None

    def as_json(self) -> dict[str, float | int | None]:
        """Plain values by name."""
        return asdict(self)


def error_figures(predicted: Array, measured: Array, *, display: bool) -> ErrorFigures:
    """Figures of predicted (n, 3) against measured (n, 3); display: both are encoded sRGB."""
    distance = np.linalg.norm(predicted - measured, axis=1)
    q1, median, q3 = np.percentile(distance, [25, 50, 75])
    de00_mean = de00_max = None
    if display:
        difference = delta_e_2000(predicted, measured)
        de00_mean, de00_max = float(difference.mean()), float(difference.max())
    return ErrorFigures(
        count=len(distance),
        mean=float(distance.mean()),
        maximum=float(distance.max()),
        q1=float(q1),
        median=float(median),
        q3=float(q3),
        rmse=float(np.sqrt(np.mean((predicted - measured) ** 2))),
        de00_mean=de00_mean,
        de00_max=de00_max,
    )


def visibility(de00: float) -> str:
    """Say in words what a mean ΔE00 between two pictures looks like."""
    if de00 < JUST_VISIBLE:
        return "less than an eye sees side by side"
    if de00 < 2 * JUST_VISIBLE:
        return "what an eye just sees side by side"
    return "visible" if de00 < 5 * JUST_VISIBLE else "far off"
