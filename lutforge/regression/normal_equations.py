"""The data term of lattice regression, W'W and W'y, assembled as a stencil (thesis 5.2; Garcia & Gupta 2009).

A sample touches the eight corners of one cell, so W'W couples a node with its 26 neighbours at most: it is stored as
(nodes, 27) coefficients, without ever forming W. Time O(64 n), memory O(27 N³).
"""

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from lutforge.interpolation import Interpolation, Levels, corner_weights, locate

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class NormalEquations:
    """W'ΩW as a 27-point stencil and W'Ωy, for sample weights Ω.

    stencil: (N_r, N_g, N_b, 27), offset index 9·(dr + 1) + 3·(dg + 1) + (db + 1); right: (N_r, N_g, N_b, 3).
    """

    stencil: Array
    right: Array


@njit(cache=True, nogil=True)
def _assemble(
    x: Array,
    y: Array,
    weight: Array,
    r_levels: Array,
    g_levels: Array,
    b_levels: Array,
    tetrahedral: bool,
    stencil: Array,
    right: Array,
) -> None:
    weights = np.empty(8)
    for n in range(x.shape[0]):
        ir, fr = locate(r_levels, x[n, 0])
        ig, fg = locate(g_levels, x[n, 1])
        ib, fb = locate(b_levels, x[n, 2])
        corner_weights(tetrahedral, fr, fg, fb, weights)
        omega = weight[n]
        y0, y1, y2 = omega * y[n, 0], omega * y[n, 1], omega * y[n, 2]
        for p in range(8):
            wp = weights[p]
            if wp == 0.0:
                continue
            pr, pg, pb = p >> 2, (p >> 1) & 1, p & 1
            i, j, k = ir + pr, ig + pg, ib + pb
            right[i, j, k, 0] += wp * y0
            right[i, j, k, 1] += wp * y1
            right[i, j, k, 2] += wp * y2
            wp *= omega
            centre = 13 - 9 * pr - 3 * pg - pb
            for q in range(8):
                stencil[i, j, k, centre + 9 * (q >> 2) + 3 * ((q >> 1) & 1) + (q & 1)] += wp * weights[q]


def normal_equations(
    x: Array, y: Array, levels: Levels, method: Interpolation, weight: Array | None = None
) -> NormalEquations:
    """Assemble W'ΩW and W'Ωy for samples `x` (n, 3) → `y` (n, 3) with weights (n,), all 1 unless given."""
    size = tuple(len(axis) for axis in levels)
    stencil, right = np.zeros((*size, 27)), np.zeros((*size, 3))
    omega = np.ones(len(x)) if weight is None else weight
    _assemble(x, y, omega, *levels, method == "tetrahedral", stencil, right)
    return NormalEquations(stencil, right)
