"""The camera response f: linear [0, 1] → encoded [0, 1], one monotone curve per channel (thesis 4.2.1)."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from lutforge.arrays import Array
from lutforge.errors import ProfileError


@dataclass(frozen=True, eq=False)
class Response:
    """f⁻¹ as a table: `inverse` (n, 3), the linear value at n evenly spaced encoded values 0 … 1, non-decreasing.

    Between the entries both directions are linear; outside they are clamped.
    Raises ProfileError where a column falls, is constant, or holds a number that is not finite.
    """

    inverse: Array

    def __post_init__(self) -> None:
        table = self.inverse
        if table.ndim != 2 or table.shape[1] != 3 or len(table) < 2 or not np.all(np.isfinite(table)):
            raise ProfileError("response: expected a table of n rows and 3 columns of finite numbers")
        if np.any(np.diff(table, axis=0) < 0) or np.any(table[-1] <= table[0]):
            raise ProfileError("response: the inverse response must not fall, and must reach beyond its start")

    def linearize(self, encoded: ArrayLike) -> Array:
        """f⁻¹: encoded (…, 3) → linear (…, 3)."""
        values = np.asarray(encoded, dtype=np.float64)
        codes = np.linspace(0.0, 1.0, len(self.inverse))
        return np.stack([np.interp(values[..., c], codes, self.inverse[:, c]) for c in range(3)], axis=-1)

    def encode(self, linear: ArrayLike) -> Array:
        """f: linear (…, 3) → encoded (…, 3) in [0, 1]. A flat stretch of f⁻¹ answers with its upper end."""
        values = np.asarray(linear, dtype=np.float64)
        codes = np.linspace(0.0, 1.0, len(self.inverse))
        return np.stack([np.interp(values[..., c], self.inverse[:, c], codes) for c in range(3)], axis=-1)


def smooth_response(response: Response) -> Response:
    """The response with a monotone cubic between its entries (Fritsch & Carlson 1980), tabulated at 1,021 codes."""
    from scipy.interpolate import PchipInterpolator  # imported here: what only applies a profile never needs it

    entries = np.linspace(0.0, 1.0, len(response.inverse))
    table = PchipInterpolator(entries, response.inverse, axis=0)(np.linspace(0.0, 1.0, 1021))
    return Response(np.maximum.accumulate(table, axis=0))
