"""The columns of the table that samples are filtered by, and the rows outside their limits."""

from dataclasses import dataclass

import numpy as np

from lutforge.arrays import Array, Mask
from lutforge.colour.saturation import saturation
from lutforge.samples.sample_set import SampleSet


@dataclass(frozen=True)
class Column:
    """A column of the table that samples are filtered by. usual: limits before a user moves them, within `reach`.

    of_stages: whether its limits leave samples out of the stages alone, since gamut map and lattice need them.
    """

    title: str
    reach: tuple[float, float]
    usual: tuple[float, float]
    step: float
    of_stages: bool = False

    def outside(self, values: Array, limits: tuple[float, float]) -> Mask:
        """(n,): the values outside these limits, to a millionth; what is unknown is inside."""
        low, high = limits
        first, last = self.reach
        return np.asarray(((values < low - 1e-6) & (low > first)) | ((values > high + 1e-6) & (high < last)))


FILTER_COLUMNS = {
    "saturation": Column("Saturation", (0.0, 1.0), (0.0, 1.0), 0.01, of_stages=True),
    "darkest": Column("Smallest JPEG code", (0, 255), (1, 255), 1),
    "brightest": Column("Largest JPEG code", (0, 255), (0, 254), 1),
    "raw": Column("Largest RAW value", (0.0, 1.0), (0.0, 0.98), 0.01),
    "residual": Column("Distance from the model, codes", (0.0, 64.0), (0.0, 64.0), 0.5),
}
"""By their names; a limit at the end of the reach leaves nothing out."""


def column_values(samples: SampleSet, residual: Array) -> dict[str, Array]:
    """(n,) by the name of a column: its values. residual: RGB distance between JPEG and model, encoded, 0 … 1."""
    codes = 255 * samples.srgb
    return {
        "saturation": saturation(samples.srgb),
        "darkest": codes.min(axis=1),
        "brightest": codes.max(axis=1),
        "raw": samples.raw.max(axis=1),
        "residual": 255 * residual,
    }
