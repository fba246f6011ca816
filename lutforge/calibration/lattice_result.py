"""What a lattice fit returns, and the last steps that every fit shares."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lutforge.calibration.options import CalibrationOptions
from lutforge.interpolation import Levels
from lutforge.model.lattice import Lattice
from lutforge.regression.node_levels import snap_levels
from lutforge.regression.normal_equations import normal_equations

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class LatticeResult:
    """A lattice; coverage: summed sample weight per node (N_r, N_g, N_b); rms: on the samples.

    smoothness: the λ_S that was chosen, of a lattice of SEARCH_SIZE nodes per axis; a lattice of N has N / SEARCH_SIZE
    times that, which weighs the same curvature alike.
    """

    lattice: Lattice
    coverage: Array
    smoothness: float
    rms: float


def snapped(levels: Levels, options: CalibrationOptions) -> Levels:
    """Node levels on the grid of the shaper that files will hold them in."""
    r, g, b = (snap_levels(axis, options.shaper_size) for axis in levels)
    return (r, g, b)


def result(lattice: Lattice, x: Array, y: Array, smoothness: float) -> LatticeResult:
    """The result of a fit of x → y (n, 3)."""
    coverage = normal_equations(x, np.ones_like(x), lattice.levels, lattice.interpolation).right[..., 0]
    rms = float(np.sqrt(np.mean(np.sum((lattice(x) - y) ** 2, axis=1))))
    return LatticeResult(lattice, np.ascontiguousarray(coverage), smoothness, rms)
