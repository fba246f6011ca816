"""What a LUT file holds: a gain per channel, curve and node levels (the shaper), a cube, a response, a matrix."""

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lutforge.errors import LutError
from lutforge.interpolation import INTERPOLATIONS, Interpolation, Levels, interpolate, through
from lutforge.luts.shaper import SHAPER_SIZE, SHAPER_SIZES, on_grid, sampled_shaper, scaled_levels
from lutforge.model.lattice import Lattice, grid, uniform_levels
from lutforge.model.transform import Transform, checked_colours

if TYPE_CHECKING:
    from lutforge.luts.write import Written

Array = NDArray[np.float64]

MAX_SIZE = 129
"""Most nodes per axis that OpenColorIO reads."""


@dataclass(frozen=True, eq=False)
class Lut:
    """y = matrix · response(cube(s(curve(clamp(i))))), i = (gain · before · x − lowest) / (highest − lowest), s
    spreading the node levels evenly.

    gain: (3,) positive. levels: three axes of N node levels from 0, strictly increasing, each a multiple of
    1 / (shaper_size − 1), or evenly spaced on [0, 1] (then the file needs no shaper). The last is 1, save in
    a LUT with a gain folded in, where it is the 1 / gain at which the camera clips. cube: (N, N, N, 3),
    indexed r, g, b. matrix: (3, 3). title and comments: for the reader of the file, cut to single lines of
    text. Raises LutError where something does not fit.

    curve: (m, 3), increasing from 0 to 1 at m even steps of [0, 1], or none: axes on which the cube is linear between
    its nodes, such as linear light for an encoded input. Files hold it in the shaper. response: (m, 3), the output at m
    even steps of [0, 1] of what the cube gives, clamped; none for none. Process lists (CLF, CTF) hold it.
    highest: inputs span 0 to this, scene-linear light often more than 1; files hold it as the range of the shaper.
    lowest: 0, or below, from where on inputs span; process lists hold it.
    before: (3, 3), from a scene-linear space to the axes of the LUT, or none; process lists hold it.
    source: the function that the LUT was fitted to: formats that cannot hold this form of it are fitted anew.
    """

    gain: Array
    levels: Levels
    cube: Array
    matrix: Array
    shaper_size: int = SHAPER_SIZE
    interpolation: Interpolation = "tetrahedral"
    title: str = ""
    comments: tuple[str, ...] = ()
    curve: Array | None = None
    response: Array | None = None
    highest: float = 1.0
    lowest: float = 0.0
    before: Array | None = None
    source: Transform | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        size = len(self.levels[0])
        if self.cube.shape != (size, size, size, 3) or any(axis.shape != (size,) for axis in self.levels):
            counts = "/".join(str(len(axis)) for axis in self.levels)
            raise LutError(
                f"LUT: a cube of shape {self.cube.shape} on {counts} node levels; "
                "files hold N × N × N × 3 on N levels per axis"
            )
        if not 2 <= size <= MAX_SIZE:
            raise LutError(f"LUT: {size} nodes per axis; OpenColorIO reads 2 to {MAX_SIZE}")
        if not 2 <= self.shaper_size <= SHAPER_SIZE:
            raise LutError(f"LUT: a shaper of {self.shaper_size} entries; readers take 2 to {SHAPER_SIZE}")
        if self.gain.shape != (3,) or not np.all(np.isfinite(self.gain)) or not np.all(self.gain > 0):
            raise LutError("LUT: the gain is three positive numbers")
        if self.matrix.shape != (3, 3) or not np.all(np.isfinite(self.matrix)):
            raise LutError("LUT: the matrix is 3 × 3 finite numbers")
        if not 0 < self.highest < 65504:
            raise LutError(f"LUT: inputs up to {self.highest:g}; half floats end at 65504")
        if not -65504 < self.lowest <= 0:
            raise LutError(f"LUT: inputs from {self.lowest:g}; they begin at 0, or below, as far as half floats reach")
        if self.before is not None and (self.before.shape != (3, 3) or not np.all(np.isfinite(self.before))):
            raise LutError("LUT: the matrix in front is 3 × 3 finite numbers")
        if not np.all(np.isfinite(self.cube)):
            raise LutError("LUT: a cube value is not a finite number")
        if self.interpolation not in INTERPOLATIONS:
            raise LutError(f'LUT: interpolation "{self.interpolation}" is none of {", ".join(INTERPOLATIONS)}')
        for name, axis in zip("RGB", self.levels, strict=True):
            if not np.all(np.isfinite(axis)) or axis[0] != 0 or not np.all(np.diff(axis) > 0):
                raise LutError(f"LUT: the {name} node levels do not increase strictly from 0")
        for name, table in (("curve", self.curve), ("response", self.response)):
            if table is None:
                continue
            if table.ndim != 2 or table.shape[1] != 3 or len(table) < 2 or not np.all(np.isfinite(table)):
                raise LutError(f"LUT: the {name} is not a table of rows of three finite numbers")
        if self.curve is not None and not all(np.all(np.diff(axis) > 0) for axis in self.knots):
            raise LutError("LUT: the curve does not increase from one node level to the next")
        if not self.is_uniform and not all(on_grid(axis, self.shaper_size) for axis in self.levels):
            raise LutError(
                f"LUT: node levels are not multiples of 1/{self.shaper_size - 1}, so a shaper of "
                f"{self.shaper_size} entries cannot hold them; snap them before the last fit"
            )

    def __call__(self, x: ArrayLike) -> Array:
        """What a reader of the file computes, in float64: (…, 3) → (…, 3). NaN counts as 0.

        Raises ImageError on another shape, and on integers.
        """
        scene = checked_colours(x)
        if self.before is not None:
            scene = scene @ self.before.T
        span = self.highest - self.lowest
        inside = np.clip(np.nan_to_num(scene * (self.gain / span)) - self.lowest / span, 0.0, 1.0)
        y = interpolate(self.stretched(inside), self.knots, self.cube, self.interpolation)
        if self.response is not None:
            y = through(self.response, y)
        return y @ self.matrix.T

    def inner(self, x: ArrayLike) -> Array:
        """The same in front of response and matrix."""
        return replace(self, response=None, matrix=np.eye(3))(x)

    def stretched(self, x: Array) -> Array:
        """Inputs (…, 3) in [0, 1], behind the gain, on the axes of the cube."""
        return x if self.curve is None else through(self.curve, x)

    @property
    def knots(self) -> Levels:
        """The node levels behind the curve: where the cube is interpolated."""
        if self.curve is None:
            return self.levels
        r, g, b = self.stretched(np.stack(self.levels, axis=1)).T
        return (np.ascontiguousarray(r), np.ascontiguousarray(g), np.ascontiguousarray(b))

    @property
    def size(self) -> int:
        """Nodes per axis, N."""
        return len(self.levels[0])

    @property
    def is_uniform(self) -> bool:
        """True where the node levels are evenly spaced on [0, 1]: no shaper is needed."""
        even = np.linspace(0.0, 1.0, self.size)
        return (
            self.curve is None
            and self.highest == 1
            and self.lowest == 0
            and all(np.allclose(axis, even, rtol=0, atol=1e-12) for axis in self.levels)
        )

    @property
    def has_gain(self) -> bool:
        """True where a gain other than 1 comes first."""
        return bool(np.any(self.gain != 1))

    @property
    def is_for_scenes(self) -> bool:
        """True where inputs are scene-linear light, beyond [0, 1] or through a matrix in front."""
        return self.before is not None or self.highest != 1 or self.lowest != 0

    @property
    def has_matrix(self) -> bool:
        """True where a matrix other than the identity comes last."""
        return bool(np.any(self.matrix != np.eye(3)))

    @property
    def shaper(self) -> Array:
        """The sampled shaper, (shaper_size, 3)."""
        if self.curve is None:
            return sampled_shaper(self.levels, self.shaper_size)
        x = np.repeat(np.linspace(0.0, 1.0, self.shaper_size)[:, None], 3, axis=1)
        bent = through(self.curve, x)
        even = np.linspace(0.0, 1.0, self.size)
        return np.stack([np.interp(bent[:, c], self.knots[c], even) for c in range(3)], axis=1)

    def folded(self, shaper_size: int = SHAPER_SIZE) -> "Lut":
        """The same function without gain and matrix, for formats of one shaper and one cube.

        The gain goes into the node levels, L / gain moved to the shaper's grid, and the cube is evaluated
        again at the moved nodes, so that each output changes by less than its kinks do over one step of the
        shaper.
        """
        if self.response is not None:
            raise LutError("a LUT with a response has no form without; fit it again, bake(…, response=False)")
        if not self.has_gain:
            return replace(self, cube=self.cube @ self.matrix.T, matrix=np.eye(3)) if self.has_matrix else self
        r, g, b = (
            scaled_levels(axis, float(gain), shaper_size) for axis, gain in zip(self.levels, self.gain, strict=True)
        )
        cube, curve = self(grid((r, g, b))), None
        if self.curve is not None:
            x = np.linspace(0.0, 1.0, shaper_size)[:, None] * self.gain
            # Straight on where the camera clips, so that the last level is still told from the ones before it.
            curve = through(self.curve, x) + np.maximum(x - 1.0, 0.0)
        return replace(
            self,
            gain=np.ones(3),
            levels=(r, g, b),
            cube=cube,
            matrix=np.eye(3),
            shaper_size=shaper_size,
            curve=curve,
        )

    def without_shaper(self, size: int) -> "Lut":
        """The function sampled on a uniform cube: the fallback for readers of 3D tables only. Not a fit."""
        if self.is_uniform and not self.has_gain and self.response is None and size == self.size:
            return self.folded()
        levels = uniform_levels(size)
        return replace(
            self,
            gain=np.ones(3),
            levels=levels,
            cube=self(grid(levels)),
            matrix=np.eye(3),
            curve=None,
            response=None,
        )

    def write(self, path: str | Path, dialect: str | None = None) -> "Written":
        """Write to a file; suffix and dialect pick the format, see `lutforge.luts.write`."""
        from lutforge.luts.write import write_lut  # the formats import this module

        return write_lut(self, path, dialect)


def lut_from_lattice(lattice: Lattice, gain: Array | None = None, matrix: Array | None = None, title: str = "") -> Lut:
    """A lattice of a profile as a LUT; exact where its levels are on a shaper's grid and equal in number.

    Else levels are moved to the grid, or added in the widest cells, and the cube is evaluated there.
    gain: (3,) in front; matrix: (3, 3) behind.
    """
    size = max(lattice.size)
    r, g, b = (padded_levels(axis, size) for axis in lattice.levels)
    fitting = (entries for entries in SHAPER_SIZES if all(on_grid(axis, entries) for axis in (r, g, b)))
    shaper_size = next(fitting, SHAPER_SIZE)
    even = all(np.allclose(axis, np.linspace(0, 1, size), rtol=0, atol=1e-12) for axis in (r, g, b))
    if not even and not all(on_grid(axis, shaper_size) for axis in (r, g, b)):
        r, g, b = (scaled_levels(axis, 1.0, shaper_size) for axis in (r, g, b))
    exact = all(np.array_equal(new, old) for new, old in zip((r, g, b), lattice.levels, strict=True))
    return Lut(
        gain=np.ones(3) if gain is None else gain,
        levels=(r, g, b),
        cube=lattice.values if exact else lattice.inner(grid((r, g, b))),
        matrix=np.eye(3) if matrix is None else matrix,
        shaper_size=shaper_size,
        interpolation=lattice.interpolation,
        title=title,
        response=lattice.response,
    )


def padded_levels(axis: Array, size: int) -> Array:
    """Levels with midpoints of the widest cells added until there are `size` of them."""
    while len(axis) < size:
        widest = int(np.argmax(np.diff(axis)))
        axis = np.insert(axis, widest + 1, 0.5 * (axis[widest] + axis[widest + 1]))
    return axis
