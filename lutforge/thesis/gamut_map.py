"""The gamut map h, or h⁻¹, fitted to measured pairs by radial basis functions (thesis 4.2.3, equations 4.7, 4.8).

Centres are chosen greedily (Carr et al., "Reconstruction and representation of 3D objects with radial basis functions",
SIGGRAPH 2001): a map is fitted to few pairs; those of the largest residuals are added, until all residuals are below
the tolerance or the number of centres is at its limit.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import lapack

from lutforge.arrays import Array, Mask
from lutforge.calibration.options import MOST_CENTRES
from lutforge.errors import CalibrationError
from lutforge.model.gamut_map import GamutMap
from lutforge.solvers.farthest_points import farthest_points

LARGEST_RESIDUAL = 0.1 / 255
"""Residual, in linear values, below which a pair needs no centre."""
NUGGETS = (1e-5, 1e-4, 1e-3, 1e-2, 1e-1, 1.0)
"""Candidates of 8Nπρ of (4.8), the weight of smoothness against fidelity."""
SHOT_FOLDS = 5
"""Parts in which shots are left out to choose 8Nπρ."""
AS_GOOD = 1.005
"""Maps whose errors are within this ratio count as equally good; the smoothest of them is taken."""
COINCIDENT = 0.5 / 255
"""Pairs whose colours lie in one cell of this size are one pair, their median."""
GROWTH = 0.6
"""Centres that a round adds, as a share of those before it."""


def fit_gamut_map(
    source: Array,
    target: Array,
    *,
    groups: NDArray[np.str_] | None = None,
    most: int = MOST_CENTRES,
    rho: float | None = None,
    tolerance: float = LARGEST_RESIDUAL,
) -> GamutMap:
    """Fit target = h(source), both (n, 3) linear.

    groups: (n,) shot names, whole shots are left out to choose ρ; most: of centres, 8 or more; rho: ρ of (4.8),
    None chooses 8Nπρ; tolerance: residual, in linear values, below which a pair needs no centre. Time O(centres³ + n ·
    centres); memory 8 · centres² bytes and twice that while solving. Raises CalibrationError below 8 distinct colours,
    or where they all lie in one plane.
    """
    names = np.arange(len(source)).astype(str) if groups is None else groups
    source, target, names = merge_coincident(source, target, names, COINCIDENT)
    if len(source) < 8 or np.linalg.matrix_rank(source - source.mean(axis=0), tol=1e-4 * np.sqrt(len(source))) < 3:
        raise CalibrationError(
            f"{len(source)} distinct colours do not determine a gamut map: shoot a chart or a scene of many colours"
        )
    nugget = _choose_nugget(source, target, names) if rho is None else 0.0
    chosen = farthest_points(source, min(64, most, len(source)))
    while True:
        count = len(chosen)
        gamut_map = solve(source[chosen], target[chosen], nugget if rho is None else 8 * count * np.pi * rho)
        residual = np.linalg.norm(gamut_map(source) - target, axis=1)
        open_pairs = residual > tolerance
        open_pairs[chosen] = False
        room = min(most, len(source)) - count
        if room <= 0 or not open_pairs.any():
            return gamut_map
        added = min(room, max(int(count * GROWTH), 8))
        chosen = np.concatenate([chosen, _worst_apart(source, residual, open_pairs, added)])


def solve(centres: Array, values: Array, nugget: float) -> GamutMap:
    """Solve (4.8) for all three channels: [D − nugget I, P; Pᵀ, 0] [λ; a] = [values; 0].

    centres, values: (n, 3); nugget: 8Nπρ. The matrix is symmetric and indefinite; LAPACK's dgesv overwrites it.
    Raises CalibrationError where the centres coincide or lie in a plane.
    """
    count = len(centres)
    system = np.zeros((count + 4, count + 4), order="F")

    # D in place: |a − b|² = |a|² − 2 a·b + |b|².
    squares = np.sum(centres**2, axis=1)
    distances = system[:count, :count]
    np.matmul(centres, centres.T, out=distances)
    distances *= -2.0
    distances += squares[:, None]
    distances += squares[None, :]
    np.sqrt(np.maximum(distances, 0.0, out=distances), out=distances)
    np.fill_diagonal(distances, -nugget)

    polynomial = np.column_stack([np.ones(count), centres])
    system[:count, count:] = polynomial
    system[count:, :count] = polynomial.T
    right = np.zeros((count + 4, 3), order="F")
    right[:count] = values
    _, _, solution, status = lapack.dgesv(system, right, overwrite_a=True, overwrite_b=True)
    if status != 0 or not np.all(np.isfinite(solution)):
        raise CalibrationError("gamut map: the colours coincide or lie in one plane; shoot a scene of more colours")
    return GamutMap(centres.copy(), solution[:count].copy(), solution[count:].copy())


def merge_coincident(
    source: Array, target: Array, names: NDArray[np.str_], size: float
) -> tuple[Array, Array, NDArray[np.str_]]:
    """Merge the pairs of each cell of this size to one, their median; about 0.2 % of the thesis's points coincide.

    The name is that of the first.
    """
    keys = np.floor(source / size).astype(np.int64)
    _, first, place, counts = np.unique(keys, axis=0, return_index=True, return_inverse=True, return_counts=True)
    place = place.reshape(-1)
    order = np.argsort(place, kind="stable")
    starts = np.concatenate([[0], np.cumsum(counts)[:-1]])
    merged_source = source[first].copy()
    merged_target = target[first].copy()
    for cell in np.flatnonzero(counts > 1):
        rows = order[starts[cell] : starts[cell] + counts[cell]]
        merged_source[cell] = np.median(source[rows], axis=0)
        merged_target[cell] = np.median(target[rows], axis=0)
    return merged_source, merged_target, names[first]


def _worst_apart(source: Array, residual: Array, candidates: Mask, most: int) -> NDArray[np.intp]:
    """Up to `most` pairs of the largest residuals, one per cell; the cells are as large as that number allows."""
    rows = np.flatnonzero(candidates)
    rows = rows[np.argsort(-residual[rows], kind="stable")]
    best = rows[:0]
    for power in range(2, 12):
        cells = np.floor(source[rows] * 2**power).astype(np.int64)
        _, first = np.unique(cells, axis=0, return_index=True)
        best = rows[np.sort(first)[:most]]
        if len(best) >= most:
            break
    return best


def _choose_nugget(source: Array, target: Array, names: NDArray[np.str_]) -> float:
    """The smoothest candidate of least error on shots left out, a fold at a time, on a subset of the pairs."""
    rng = np.random.default_rng(0)
    rows = rng.permutation(len(source))[:800]
    source = source[rows]
    target = target[rows]
    shots, shot = np.unique(names[rows], return_inverse=True)
    # Of fewer shots one may be the only one of its exposure: then single pairs are left out, not whole shots.
    fold = (
        rng.permutation(len(shots))[shot] % SHOT_FOLDS
        if len(shots) >= SHOT_FOLDS
        else np.arange(len(rows)) % SHOT_FOLDS
    )
    scores = []
    for nugget in NUGGETS:
        score = 0.0
        for left_out in range(SHOT_FOLDS):
            train = fold != left_out
            test = fold == left_out
            if train.sum() < 8:
                continue
            gamut_map = solve(source[train], target[train], nugget)
            score += float(np.sum(np.linalg.norm(gamut_map(source[test]) - target[test], axis=1)))
        scores.append(score)
    as_good = [nugget for nugget, score in zip(NUGGETS, scores, strict=True) if score <= AS_GOOD * min(scores)]
    return max(as_good)
