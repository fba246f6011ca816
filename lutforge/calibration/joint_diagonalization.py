"""Matrices of several white balances as products of one matrix each side and a diagonal one between them."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from lutforge.arrays import Array
from lutforge.solvers.gauss_newton import gauss_newton

TRANSFER_SPREAD = 0.5
"""Standard deviation of the prior of the entries of Tc that are not on its diagonal, around 0."""
DERIVATIVE_STEP = 1e-6
"""Step of a numerical derivative."""
MOST_DIAGONALIZATION_STEPS = 200
"""Gauss–Newton steps, at most."""
OFF_DIAGONAL = ~np.eye(3, dtype=np.bool_)
COUNT_OFF_DIAGONAL = 6


def jointly_diagonal(fits: Mapping[str, tuple[Array, Array]]) -> tuple[Array, Array, dict[str, Array]]:
    """Split the matrices of several white balances, Tz_i = Ts Tw_i Tc with diagonal Tw_i, into one Ts and one Tc.

    The way is that of a joint diagonalization: B. N. Flury & W. Gautschi (1986), https://doi.org/10.1137/0907013.
    fits: Tz⁻¹ = Tc⁻¹ Tw⁻¹ Ts⁻¹ by white balance, with the precision (3, 3) of each of its rows. Returns Tc with ones on
    its diagonal, Ts, and Tw (3,) by white balance.

    The other six entries of Tc are expected to be 0 within a half, which settles what the white balances leave open.
    """
    inverses = np.stack([inverse for inverse, _ in fits.values()])
    roots = np.stack([np.linalg.cholesky(precision) for _, precision in fits.values()])

    def residuals(unknowns: Array) -> Array:
        transfer, from_linear, balances = _factors(unknowns)
        modelled = np.linalg.inv(transfer) @ (from_linear / balances[..., None])
        prior = unknowns[:COUNT_OFF_DIAGONAL] / TRANSFER_SPREAD
        return np.concatenate([((modelled - inverses) @ roots).ravel(), prior])

    def linearize(unknowns: Array, _: NDArray[np.intp]) -> tuple[Array, Array]:
        values = residuals(unknowns[0])
        steps = DERIVATIVE_STEP * np.eye(unknowns.shape[1])
        slopes = [
            (residuals(unknowns[0] + step) - residuals(unknowns[0] - step)) / (2 * DERIVATIVE_STEP) for step in steps
        ]
        return values[None], np.stack(slopes, axis=1)[None]

    # The search starts from Tc = identity: then Tz⁻¹ is Ts⁻¹, each row divided by a multiplier of the white balance.
    sums = inverses.sum(axis=2)
    first = inverses[0] / sums[0][:, None]
    start = np.concatenate([np.zeros(COUNT_OFF_DIAGONAL), first[OFF_DIAGONAL], -np.log(sums).ravel()])
    unknowns = gauss_newton(linearize, start[None], most=MOST_DIAGONALIZATION_STEPS).value[0]

    transfer, from_linear, balances = _factors(unknowns)
    return transfer, np.asarray(np.linalg.inv(from_linear), dtype=np.float64), dict(zip(fits, balances, strict=True))


def _factors(unknowns: Array) -> tuple[Array, Array, Array]:
    """Tc (3, 3) with ones on its diagonal, Ts⁻¹ (3, 3) with rows that sum to 1, and Tw (b, 3) of each white balance.

    unknowns: the six other entries of Tc, those of Ts⁻¹, and the logarithms of Tw.
    """
    transfer, from_linear = np.eye(3), np.eye(3)
    of_transfer, of_linear, logs = np.split(unknowns, [COUNT_OFF_DIAGONAL, 2 * COUNT_OFF_DIAGONAL])
    transfer[OFF_DIAGONAL] = of_transfer
    from_linear[OFF_DIAGONAL] = of_linear
    from_linear[np.diag_indices(3)] -= from_linear.sum(axis=1) - 1.0
    return transfer, from_linear, np.exp(logs.reshape(-1, 3))
