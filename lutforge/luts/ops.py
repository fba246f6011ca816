"""The four operations of which every LUT is a sequence, evaluated as the readers of LUT files evaluate them.

The models are OpenColorIO's `ops/` (https://github.com/AcademySoftwareFoundation/OpenColorIO) and the process nodes of
the Common LUT Format (SMPTE ST 2136-1). A curve or cube clamps its inputs to its domain, and takes NaN for the lowest.
"""

from dataclasses import dataclass, field

import numpy as np

from lutforge.arrays import Array
from lutforge.errors import LutError
from lutforge.interpolation import INTERPOLATIONS, Interpolation, Levels, apply_curve, interpolate
from lutforge.model.lattice import Lattice, grid, uniform_levels


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
        if self.is_diagonal:  # by channel: what is not finite stays in its own
            return np.asarray(x * np.diag(self.matrix) + self.offset)
        return np.asarray(x @ self.matrix.T + self.offset)

    def __repr__(self) -> str:
        rows = [np.diag(self.matrix)] if self.is_diagonal else self.matrix
        text = "; ".join(" ".join(f"{value:.5g}" for value in row) for row in rows)
        offset = "" if np.all(self.offset == 0) else " + " + " ".join(f"{value:.5g}" for value in self.offset)
        return f"Matrix {'diagonal ' if self.is_diagonal else ''}{text}{offset}"


@dataclass(frozen=True, eq=False, repr=False)
class Range:
    """Clamps every channel to [low, high]; None leaves that end open. Raises LutError on an empty range."""

    low: float | None = 0.0
    high: float | None = 1.0

    def __post_init__(self) -> None:
        if self.low is not None and self.high is not None and not self.low < self.high:
            raise LutError(f"LUT: the range {self.low:g} to {self.high:g} is empty")

    def __call__(self, x: Array) -> Array:
        """Evaluate at x (…, 3); NaN becomes the low end."""
        known = np.where(np.isnan(x), 0.0 if self.low is None else self.low, x)
        return np.asarray(np.clip(known, self.low, self.high)) if (self.low, self.high) != (None, None) else known

    def __repr__(self) -> str:
        ends = ("open" if end is None else f"{end:g}" for end in (self.low, self.high))
        return f"Range {' to '.join(ends)}"


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
        known = np.where(np.isnan(x), self.inputs[0], x)
        knots, values = self.inputs.T, self.outputs.T
        return np.stack([np.interp(known[..., c], knots[c], values[c]) for c in range(3)], axis=-1)

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


# --- The curve in front of a cube: it spreads node levels that lie where a function bends (thesis, chapter 5) ---------
# s_c(L_c(i)) = i / (N − 1), linear in between. Sampled at M even points it stays exact where the node levels are among
# the points: readers interpolate linearly between samples.


SHAPER_SIZE = 65536
"""Entries of a shaper: the most that DaVinci Resolve and OpenColorIO read in a .cube file."""

FEW = 4096
"""Entries that hold the node levels of profiles, which are snapped to so many points."""


def shaper(levels: Levels, size: int = SHAPER_SIZE, axis_curve: Array | None = None, high: float = 1.0) -> Curve:
    """The curve that takes node levels, multiples of 1 / (size − 1), to even steps.

    levels: (N,) per channel, as shares of the domain from 0 to `high`; they may end before or beyond it.
    axis_curve: (m, 3), rising, at even steps of the domain: the cube is linear in its values between two nodes, and not
    in the inputs. Raises LutError where a level is not on the grid, or the curve does not rise from node to node.
    """
    if not 2 <= size <= SHAPER_SIZE:
        raise LutError(f"LUT: a shaper of {size} entries; readers take 2 to {SHAPER_SIZE}")
    for name, axis in zip("RGB", levels, strict=True):
        if not np.all(np.isfinite(axis)) or axis[0] != 0 or not np.all(np.diff(axis) > 0):
            raise LutError(f"LUT: the {name} node levels do not increase strictly from 0")
        if not on_grid(axis, size):
            raise LutError(
                f"LUT: node levels are not multiples of 1/{size - 1}, so a shaper of {size} entries cannot hold them; "
                "snap them before the fit"
            )
    at = np.linspace(0.0, 1.0, size)
    columns = []
    for c, axis in enumerate(levels):
        x, knots = at, axis
        if axis_curve is not None:
            even = np.linspace(0.0, 1.0, len(axis_curve))
            x, knots = np.interp(at, even, axis_curve[:, c]), np.interp(axis, even, axis_curve[:, c])
            # Beyond the domain the curve runs straight on, so that a last level out there is told from those before.
            knots = knots + np.maximum(axis - 1.0, 0.0)
            if not np.all(np.diff(knots) > 0):
                raise LutError("LUT: the axis curve does not rise from one node level to the next")
        columns.append(np.interp(x, knots, np.linspace(0.0, 1.0, len(axis))))
    return Curve(np.stack(columns, axis=1), 0.0, high)


def node_levels(curve: Curve | None, cube: Cube) -> Levels:
    """The inputs (N,) of a shaper, or of none, at which its cube's nodes lie, per channel; at its ends those beyond."""
    r, g, b = (np.linspace(0.0, 1.0, count) for count in cube.values.shape[:3])
    if curve is None:
        return r, g, b
    at = np.linspace(curve.low, curve.high, len(curve.outputs))
    levels = []
    for c, even in enumerate((r, g, b)):
        rising = np.maximum.accumulate(curve.outputs[:, c])
        first = np.concatenate([[True], np.diff(rising) > 0])  # a flat end is reached where it begins
        inputs = at if curve.inputs is None else curve.inputs[:, c]
        levels.append(np.interp(even, rising[first], inputs[first]))
    return levels[0], levels[1], levels[2]


def on_grid(axis: Array, size: int) -> bool:
    """True where every node level is one of the points of a sampled shaper of `size` entries."""
    points = axis * (size - 1)
    return bool(np.all(np.abs(points - np.rint(points)) < 1e-6))


def is_even(levels: Levels) -> bool:
    """True where node levels are evenly spaced on [0, 1], so that no shaper is needed."""
    return all(np.allclose(axis, np.linspace(0.0, 1.0, len(axis)), rtol=0, atol=1e-12) for axis in levels)


def levels_behind_gain(levels: Levels, gain: Array) -> Levels:
    """Node levels (N,) behind a gain (3,) as levels in front of it: L / gain, moved to the points of a shaper.

    Each gets its own. The last may lie before or beyond 1; it is rounded up, so that what the camera clips stays so.
    """
    moved = []
    for axis, factor in zip(levels, gain, strict=True):
        scaled = axis / factor * (SHAPER_SIZE - 1)
        points = np.rint(scaled).astype(np.int64)
        points[-1] = int(np.ceil(scaled[-1] - 1e-6))
        order = np.arange(len(axis))
        moved.append((np.maximum.accumulate(points - order) + order) / (SHAPER_SIZE - 1))
    return moved[0], moved[1], moved[2]


def lattice_ops(lattice: Lattice) -> tuple[Op, ...]:
    """A lattice as shaper, cube and output curve; exact where its levels are on a shaper's grid and equal in number."""
    # Else levels are moved to the grid, or added in the widest cells, and the cube is evaluated there.
    size = max(lattice.size)
    padded = []
    for axis in lattice.levels:
        while len(axis) < size:
            widest = int(np.argmax(np.diff(axis)))
            axis = np.insert(axis, widest + 1, 0.5 * (axis[widest] + axis[widest + 1]))
        padded.append(axis)
    r, g, b = padded
    entries = next((few for few in (FEW, SHAPER_SIZE) if all(on_grid(axis, few) for axis in (r, g, b))), None)
    if entries is None and not is_even((r, g, b)):
        r, g, b = levels_behind_gain((r, g, b), np.ones(3))
    same = all(np.array_equal(new, old) for new, old in zip((r, g, b), lattice.levels, strict=True))
    values = lattice.values if same else lattice.cube_values(grid((r, g, b)))
    curve = () if is_even((r, g, b)) else (shaper((r, g, b), entries or SHAPER_SIZE),)
    behind = () if lattice.output_curve is None else (Curve(lattice.output_curve),)
    return *curve, Cube(values, lattice.interpolation), *behind
