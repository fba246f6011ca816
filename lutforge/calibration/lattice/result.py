"""What a lattice fit returns, and the last steps that every fit shares."""

from dataclasses import dataclass

import numpy as np

from lutforge.arrays import Array
from lutforge.calibration.options import CalibrationOptions
from lutforge.interpolation import Levels
from lutforge.model.lattice import Lattice, snap_levels
from lutforge.solvers.normal_equations import InterpolationMatrix


@dataclass(frozen=True, eq=False)
class LatticeResult:
    """A fitted lattice. coverage: summed weight of the samples at each node, (N_r, N_g, N_b).

    smoothness: the λ_S that was chosen, of a lattice of SEARCH_SIZE nodes per axis; a lattice of N has N / SEARCH_SIZE
    times that, which weighs the same curvature alike.
    """

    lattice: Lattice
    coverage: Array
    smoothness: float


def snapped(levels: Levels, options: CalibrationOptions) -> Levels:
    """Node levels on the grid of the shaper that files will hold them in."""
    r, g, b = (snap_levels(axis, options.shaper_size) for axis in levels)
    return (r, g, b)


def result(lattice: Lattice, x: Array, smoothness: float) -> LatticeResult:
    """The result of a fit to samples at x (n, 3)."""
    matrix = InterpolationMatrix(x, lattice.levels, lattice.interpolation)
    coverage = matrix.normal_equations(np.ones_like(x)).right[..., 0]
    return LatticeResult(lattice, np.ascontiguousarray(coverage), smoothness)
