"""The four operations of which every LUT is a sequence, evaluated as the readers of LUT files evaluate them.

The models are OpenColorIO's `ops/` (https://github.com/AcademySoftwareFoundation/OpenColorIO) and the process nodes of
the Common LUT Format (SMPTE ST 2136-1). A curve or cube clamps its inputs to its domain, and takes NaN for the lowest.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from lutforge.arrays import Array
from lutforge.errors import LutError
from lutforge.interpolation import INTERPOLATIONS, Interpolation, apply_curve, interpolate
from lutforge.model.lattice import uniform_levels


@dataclass(frozen=True, eq=False, repr=False)
class Matrix:
    """y = matrix · x + offset, of shapes (3, 3) and (3,). Raises LutError where a number is not finite."""

    matrix: Array
    offset: Array = field(default_factory=lambda: np.zeros(3))

    def __post_init__(self) -> None:
        if self.matrix.shape != (3, 3) or self.offset.shape != (3,):
            raise LutError("LUT: a matrix is 3 × 3 numbers and an offset of three")
        if not np.all(np.isfinite(self.matrix)) or not np.all(np.isfinite(self.offset)):
            raise LutError("LUT: a matrix holds a number that is not finite")

    @property
    def is_diagonal(self) -> bool:
        """True where no channel depends on another."""
        return bool(np.all(self.matrix == np.diag(np.diag(self.matrix))))

    @property
    def is_identity(self) -> bool:
        """True where it changes nothing."""
        return bool(np.all(self.matrix == np.eye(3)) and np.all(self.offset == 0))

    def __call__(self, x: Array) -> Array:
        """Evaluate at x (…, 3)."""
        if self.is_diagonal:  # channel by channel: NaN and infinity then stay in their channel
            return np.asarray(x * np.diag(self.matrix) + self.offset)
        return np.asarray(x @ self.matrix.T + self.offset)

    def __repr__(self) -> str:
        rows = [np.diag(self.matrix)] if self.is_diagonal else self.matrix
        text = "; ".join(" ".join(f"{value:.5g}" for value in row) for row in rows)
        offset = "" if np.all(self.offset == 0) else " + " + " ".join(f"{value:.5g}" for value in self.offset)
        return f"Matrix {'diagonal ' if self.is_diagonal else ''}{text}{offset}"


@dataclass(frozen=True, eq=False, repr=False)
class Range:
    """A clamp of every channel to [low, high]; None leaves that end open. Raises LutError on an empty range."""

    low: float | None = 0.0
    high: float | None = 1.0

    def __post_init__(self) -> None:
        if self.low is not None and self.high is not None and not self.low < self.high:
            raise LutError(f"LUT: the range {self.low:g} to {self.high:g} is empty")

    def __call__(self, x: Array) -> Array:
        """Evaluate at x (…, 3); NaN becomes the low end."""
        numbers = np.where(np.isnan(x), 0.0 if self.low is None else self.low, x)
        return np.asarray(np.clip(numbers, self.low, self.high)) if (self.low, self.high) != (None, None) else numbers

    def __repr__(self) -> str:
        limits = ("open" if end is None else f"{end:g}" for end in (self.low, self.high))
        return f"Range {' to '.join(limits)}"


@dataclass(frozen=True, eq=False, repr=False)
class Curve:
    """A table per channel, with straight lines between its entries.

    outputs: (m, 3), at m even steps from `low` to `high`, or at the free knots `inputs` (m, 3), which increase.
    Raises LutError where a number is not finite or the inputs do not increase.
    """

    outputs: Array
    low: float = 0.0
    high: float = 1.0
    inputs: Array | None = None

    def __post_init__(self) -> None:
        table = self.outputs
        if table.ndim != 2 or table.shape[1] != 3 or len(table) < 2 or not np.all(np.isfinite(table)):
            raise LutError("LUT: a curve is a table of rows of three finite numbers")
        if not -np.inf < self.low < self.high < np.inf:
            raise LutError(f"LUT: a curve from {self.low:g} to {self.high:g} has no domain")
        knots = self.inputs
        if knots is not None and (knots.shape != table.shape or not np.all(np.diff(knots, axis=0) > 0)):
            raise LutError("LUT: the knots of a curve do not increase, or are not as many as its entries")

    def __call__(self, x: Array) -> Array:
        """Evaluate at x (…, 3)."""
        if self.inputs is None:
            on_unit = x if (self.low, self.high) == (0.0, 1.0) else np.asarray((x - self.low) / (self.high - self.low))
            return apply_curve(self.outputs, on_unit)
        numbers = np.where(np.isnan(x), self.inputs[0], x)
        knots, values = self.inputs.T, self.outputs.T
        return np.stack([np.interp(numbers[..., c], knots[c], values[c]) for c in range(3)], axis=-1)

    def __repr__(self) -> str:
        low, high = (self.low, self.high) if self.inputs is None else (self.inputs.min(), self.inputs.max())
        kind = "" if self.inputs is None else " at free knots"
        lowest, highest = self.outputs.min(), self.outputs.max()
        return f"Curve {len(self.outputs)} entries{kind}, {low:g} to {high:g} → {lowest:.5g} to {highest:.5g}"


@dataclass(frozen=True, eq=False, repr=False)
class Cube:
    """A table (N_r, N_g, N_b, 3) of even nodes over [0, 1]³. Raises LutError where a number is not finite."""

    values: Array
    interpolation: Interpolation = "tetrahedral"

    def __post_init__(self) -> None:
        if self.values.ndim != 4 or self.values.shape[3] != 3 or min(self.values.shape[:3]) < 2:
            raise LutError(f"LUT: a cube of shape {self.values.shape}; N × N × N × 3 is wanted, N from 2")
        if not np.all(np.isfinite(self.values)):
            raise LutError("LUT: a cube value is not a finite number")
        if self.interpolation not in INTERPOLATIONS:
            raise LutError(f'LUT: interpolation "{self.interpolation}" is none of {", ".join(INTERPOLATIONS)}')

    @property
    def size(self) -> int:
        """Nodes of the longest axis."""
        return int(max(self.values.shape[:3]))

    @property
    def has_equal_axes(self) -> bool:
        """True where the three axes have equally many nodes."""
        return len(set(self.values.shape[:3])) == 1

    def __call__(self, x: Array) -> Array:
        """Evaluate at x (…, 3)."""
        r, g, b = (uniform_levels(count)[0] for count in self.values.shape[:3])
        return interpolate(x, (r, g, b), self.values, self.interpolation)

    def __repr__(self) -> str:
        nodes = f"{self.size}³" if self.has_equal_axes else " × ".join(map(str, self.values.shape[:3]))
        return f"Cube {nodes} nodes, {self.interpolation}, {self.values.min():.5g} to {self.values.max():.5g}"


Op = Matrix | Range | Curve | Cube
"""Any operation: (…, 3) → (…, 3), float64."""


def joined(ops: Sequence[Op]) -> tuple[Op, ...]:
    """Return operations with neighbouring matrices made one, and without those that change nothing."""
    result: list[Op] = []
    for op in ops:
        before = result[-1] if result else None
        if isinstance(op, Matrix) and isinstance(before, Matrix):
            result[-1] = Matrix(op.matrix @ before.matrix, op.matrix @ before.offset + op.offset)
        else:
            result.append(op)
    return tuple(op for op in result if not (isinstance(op, Matrix) and op.is_identity))
