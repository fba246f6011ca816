"""The error figures of the thesis (chapter 5): pixel error and its quartiles, RMSE, and ΔE00 beside them."""

from dataclasses import dataclass

import numpy as np

from lutforge.arrays import Array
from lutforge.colour.srgb import delta_e_2000

JUST_VISIBLE = 1.0
"""The ΔE00 that is just noticed side by side, about (CIE 142-2001)."""


FIGURES = ("n", "mean", "max", "Q1", "median", "Q3", "RMSE", "ΔE00", "max ΔE00")


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

    @property
    def cells(self) -> tuple[str, ...]:
        """The figures as cells of a table, whose columns FIGURES names."""
        numbers = (self.mean, self.maximum, self.q1, self.median, self.q3, self.rmse)
        differences = ("–" if value is None else f"{value:.2f}" for value in (self.de00_mean, self.de00_max))
        return (str(self.count), *(f"{value:.4f}" for value in numbers), *differences)


@dataclass(frozen=True)
class MethodError:
    """An error of one method in a style. count: of samples, or of pairs; values: by the titles of their columns."""

    style: str
    method: str
    held_out: bool
    count: int
    values: dict[str, float]


def error_figures(predicted: Array, measured: Array, *, display: bool) -> ErrorFigures:
    """Figures of predicted (n, 3) against measured (n, 3); display: both are encoded sRGB."""
    distance = np.linalg.norm(predicted - measured, axis=1)
    q1, median, q3 = np.percentile(distance, [25, 50, 75])
    difference = delta_e_2000(predicted, measured) if display else None
    return ErrorFigures(
        count=len(distance),
        mean=float(distance.mean()),
        maximum=float(distance.max()),
        q1=float(q1),
        median=float(median),
        q3=float(q3),
        rmse=float(np.sqrt(np.mean((predicted - measured) ** 2))),
        de00_mean=None if difference is None else float(difference.mean()),
        de00_max=None if difference is None else float(difference.max()),
    )


def visibility(de00: float) -> str:
    """Say in words what a mean ΔE00 between two pictures looks like."""
    if de00 < JUST_VISIBLE:
        return "less than an eye sees side by side"
    if de00 < 2 * JUST_VISIBLE:
        return "what an eye just sees side by side"
    return "visible" if de00 < 5 * JUST_VISIBLE else "far off"
