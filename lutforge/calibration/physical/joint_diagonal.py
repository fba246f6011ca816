"""Split the matrices of several white balances, Tz_i = Ts Tw_i Tc with diagonal Tw_i, into one Ts and one Tc.

The way is that of a joint diagonalization: B. N. Flury & W. Gautschi (1986), https://doi.org/10.1137/0907013.
"""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from lutforge.arrays import Array
from lutforge.solvers.gauss_newton import gauss_newton


def jointly_diagonal(fits: Mapping[str, tuple[Array, Array]]) -> tuple[Array, Array, dict[str, Array]]:
    """Tc with ones on its diagonal, Ts, and Tw (3,) by white balance, of Tz⁻¹ = Tc⁻¹ Tw⁻¹ Ts⁻¹ and its precision.

    The other six entries of Tc are expected to be 0 within a half, which settles what the white balances leave open.
    """
    inverses = np.stack([inverse for inverse, _ in fits.values()])
    roots = np.stack([np.linalg.cholesky(precision) for _, precision in fits.values()])
    off = ~np.eye(3, dtype=np.bool_)

    def parts(unknown: Array) -> tuple[Array, Array, Array]:
        transfer, from_linear = np.eye(3), np.eye(3)
        transfer[off] = unknown[:6]
        from_linear[off] = unknown[6:12]
        from_linear[np.diag_indices(3)] -= from_linear.sum(axis=1) - 1.0
        return transfer, from_linear, np.exp(unknown[12:].reshape(-1, 3))

    def residuals(unknown: Array) -> Array:
        transfer, from_linear, balances = parts(unknown)
        modelled = np.linalg.inv(transfer) @ (from_linear / balances[..., None])
        return np.concatenate([((modelled - inverses) @ roots).ravel(), unknown[:6] / 0.5])

    def linearize(unknown: Array, _: NDArray[np.intp]) -> tuple[Array, Array]:
        values = residuals(unknown[0])
        steps = 1e-6 * np.eye(unknown.shape[1])
        slopes = [(residuals(unknown[0] + step) - residuals(unknown[0] - step)) / 2e-6 for step in steps]
        return values[None], np.stack(slopes, axis=1)[None]

    sums = inverses.sum(axis=2)
    first = inverses[0] / sums[0][:, None]
    start = np.concatenate([np.zeros(6), first[off], -np.log(sums).ravel()])
    transfer, from_linear, balances = parts(gauss_newton(linearize, start[None], most=200).value[0])
    return transfer, np.asarray(np.linalg.inv(from_linear), dtype=np.float64), dict(zip(fits, balances, strict=True))
