"""Error figures of predicted colours: those of the thesis (chapter 5), and ΔE00."""

from dataclasses import dataclass

import numpy as np

from lutforge.arrays import Array
from lutforge.colour.srgb import delta_e_2000

FIGURES = ("n", "mean", "max", "Q1", "median", "Q3", "RMSE", "ΔE00", "max ΔE00")
"""The columns of `ErrorFigures.cells`."""


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
        """The figures as cells of a table with the columns FIGURES."""
        numbers = (self.mean, self.maximum, self.q1, self.median, self.q3, self.rmse)
        differences = ("–" if value is None else f"{value:.2f}" for value in (self.de00_mean, self.de00_max))
        return (str(self.count), *(f"{value:.4f}" for value in numbers), *differences)


def error_figures(predicted: Array, measured: Array, *, display: bool) -> ErrorFigures:
    """The figures of predicted (n, 3) against measured (n, 3). display: both are encoded sRGB."""
    distance = np.linalg.norm(predicted - measured, axis=1)
    rmse = np.sqrt(np.mean((predicted - measured) ** 2))
    figures = [distance.mean(), distance.max(), *np.percentile(distance, [25, 50, 75]), rmse]
    if display:
        difference = delta_e_2000(predicted, measured)
        figures += [difference.mean(), difference.max()]
    return ErrorFigures(len(distance), *map(float, figures))
