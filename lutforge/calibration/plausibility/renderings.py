"""Tests whether all shots have one rendering, against two renderings and against a brightness for each shot.

The residuals of the chain of all shots are regressed on a cubic polynomial of the colours. The regression needs only
sums of products over each shot's samples, so that any grouping of shots costs one small solve. Every second sample of a
shot is used to fit, the others to measure the error. Two renderings are found by alternation, as in k-means clustering:
each shot is assigned to the rendering that fits it better, until nothing changes, starting from each shot alone.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lutforge.arrays import Array, Mask
from lutforge.calibration.physical.unsaturated import saturation
from lutforge.calibration.plausibility.colour_chain import CODE, ColourChain, cubic_terms, curve_terms, fit_chain
from lutforge.calibration.plausibility.shot_saturation import odd_group
from lutforge.calibration.plausibility.whole_set import LEAST_GAIN
from lutforge.model.diagnosis import Diagnosis
from lutforge.solvers.blas import one_blas_thread
from lutforge.solvers.robust_weights import cauchy


@dataclass(frozen=True, eq=False)
class _Sums:
    """Weighted sums over half of the samples of each of m shots, for a least-squares fit of residuals on k terms.

    products: of terms with terms (m, k, k); cross: of terms with residuals (m, k, 3); squares: of residuals (m,);
    count: of samples (m,).
    """

    products: Array
    cross: Array
    squares: Array
    count: Array

    def errors(self, coefficients: Array) -> Array:
        """Mean squared error of each shot (m,) under coefficients (k, 3)."""
        fitted = np.einsum("kc,mkl,lc->m", coefficients, self.products, coefficients)
        crossed = np.einsum("kc,mkc->m", coefficients, self.cross)
        return np.asarray(np.maximum(self.squares - 2 * crossed + fitted, 0.0) / self.count)


@one_blas_thread
def mixed_shots(
    chain: ColourChain, x: Array, encoded: Array, multipliers: Array, shot: NDArray[np.str_], setting: NDArray[np.str_]
) -> Diagnosis | None:
    """Diagnose shots of one style of which some are of another style or sensor, or each has a brightness of its own.

    x: balanced RAW (n, 3); encoded: JPEG values (n, 3), both unclipped; setting: names of white balances (n,). Returns
    None where one rendering explains all shots.
    """
    names, index = np.unique(shot, return_inverse=True)
    enough = np.bincount(index) >= 16
    rows = enough[index]
    if enough.sum() < 3:
        return None
    x, encoded, multipliers, setting = x[rows], encoded[rows], multipliers[rows], setting[rows]
    names, index = np.unique(shot[rows], return_inverse=True)
    linear = chain.predicted(x, multipliers)
    rendered = chain.encoded(linear)
    fitting, judging = _halves(cubic_terms(rendered), encoded - rendered, index, len(names))
    whole = np.ones(len(names), dtype=np.bool_)
    odd = odd_group(chain, x - chain.offset * multipliers, encoded, index)
    told = odd.log_odds > LEAST_GAIN
    group = odd.shots if told else _two_groups(fitting, judging, whole)
    one = _left_out(fitting, judging, whole)
    two = np.where(group, _left_out(fitting, judging, group), _left_out(fitting, judging, ~group))
    if group.sum() == 1:
        two[group] = judging.errors(_coefficients(fitting, group))[group]
    gains, rendered = _brightened(chain, x, encoded, multipliers, index)
    each = _left_out(*_halves(cubic_terms(rendered), encoded - rendered, index, len(names)), whole)
    found = _explanation(one, two, each, group, gains)
    if found == "each":
        return Diagnosis(
            "each JPEG was brightened by itself",
            f"brightness varies by {np.std(gains):.2f} EV (1 σ) over {len(names)} shots, and nothing else does",
            "switch automatic tone, D-Lighting and exposure compensation in development off",
        )
    if not found and not told:
        return None
    codes = [255 * float(np.sqrt(np.mean(errors[group]))) for errors in (one, two)]
    sensor = _multipliers_differ(group[index], multipliers, setting) or odd.sensor_is_likelier(group)
    return _of_group(group, names, sensor, codes)


def _explanation(one: Array, two: Array, each: Array, group: Mask, gains: Array) -> str:
    """Return "two" or "each" where two renderings, or a brightness for each shot, explain the shots much better; or "".

    one, two, each: the squared errors (m,) of left-out shots under each explanation. The sum of the logarithms of the
    errors must fall by more than chance allows, as there are 2^(m − 1) ways to divide m shots into two groups, and must
    fall in both groups. Two renderings are also reported where the smaller group is far from the others.
    """
    one, two, each = (np.log(np.sqrt(errors) + 0.4 * CODE) for errors in (one, two, each))
    lowered, brightened = float(np.sum(one - two)), float(np.sum(one - each))
    chance = 2.5 + 0.25 * len(one) * np.log(2.0)
    apart = np.abs(gains - np.median(gains)) > 0.035
    if brightened > max(0.6 * chance, lowered) and 2 * apart.sum() >= len(gains):
        return "each"
    parts = [float(np.mean((one - two)[part])) for part in (group, ~group)]
    usual, stray = float(np.median(one[~group])), float(np.mean(one[group]))
    if 3 * group.sum() <= len(group) and stray - usual > np.log(2.5) and parts[0] > 0.25 and len(group) > 5:
        return "two"
    return "two" if lowered > chance and min(parts) > 0.16 else ""


def _halves(terms: Array, residual: Array, index: NDArray[np.intp], count: int) -> tuple[_Sums, _Sums]:
    """Sums over every second sample of each shot, and over the others."""
    order = np.argsort(index, kind="stable")
    place = np.empty(len(index), dtype=np.intp)
    place[order] = np.arange(len(index)) - np.searchsorted(index[order], index[order])
    halves = (_sums(terms, residual, index, place % 2 == parity, count) for parity in (0, 1))
    return next(halves), next(halves)


def _sums(terms: Array, residual: Array, index: NDArray[np.intp], half: Mask, count: int) -> _Sums:
    """Sums over half of the samples, with robust weights."""
    size = np.linalg.norm(residual, axis=1)
    weight = half * cauchy(size / (6.0 * np.median(size) + CODE))
    rows = [index == shot for shot in range(count)]
    weighted = terms * weight[:, None]
    return _Sums(
        np.array([terms[mine].T @ weighted[mine] for mine in rows]),
        np.array([weighted[mine].T @ residual[mine] for mine in rows]),
        np.array([float((weight * size**2)[mine].sum()) for mine in rows]),
        np.array([float(weight[mine].sum()) for mine in rows]),
    )


def _coefficients(fitting: _Sums, group: Mask) -> Array:
    """The coefficients (k, 3) of a group of shots, by ridge regression towards those of all shots."""
    everything, ridge = fitting.products.sum(axis=0), 1e-3 * np.eye(fitting.products.shape[1])
    common = np.linalg.solve(everything + ridge, fitting.cross.sum(axis=0))
    if group.all() or not group.any():
        return np.asarray(common)
    prior = everything * (4.0 / fitting.count.sum()) + ridge
    return np.asarray(
        np.linalg.solve(fitting.products[group].sum(axis=0) + prior, fitting.cross[group].sum(axis=0) + prior @ common)
    )


def _left_out(fitting: _Sums, judging: _Sums, group: Mask) -> Array:
    """Mean squared error of each shot (m,) under the polynomial of the group's other shots."""
    errors = np.empty(len(group))
    for shot in range(len(group)):
        others = group & (np.arange(len(group)) != shot)
        errors[shot] = judging.errors(_coefficients(fitting, others))[shot]
    return errors


def _two_groups(fitting: _Sums, judging: _Sums, whole: Mask) -> Mask:
    """The smaller (m,) of the two groups of shots whose two polynomials have the least error."""
    best, found = np.inf, ~whole
    for start in range(len(whole)):
        group = np.arange(len(whole)) == start
        for _ in range(8):
            inside, outside = (fitting.errors(_coefficients(fitting, mask)) for mask in (group, ~group))
            moved = inside < outside
            if np.array_equal(moved, group) or not moved.any() or moved.all():
                break
            group = moved
        errors = [judging.errors(_coefficients(fitting, mask)) for mask in (group, ~group)]
        total = float(np.where(group, *errors).sum())
        if total < best:
            best, found = total, group
    return found if 2 * found.sum() <= len(whole) else ~found


def _brightened(
    chain: ColourChain, x: Array, encoded: Array, multipliers: Array, index: NDArray[np.intp]
) -> tuple[Array, Array]:
    """Return by how many EV each shot's JPEG is brighter than the median one (m,), and all colours rendered so (n, 3).

    chain: of all shots as they are. A chain fitted to shots of different brightness explains a part of the brightness
    by colour, so that chain and brightness are fitted in turn.
    """
    gains = _gains(chain, x, encoded, multipliers, index)
    for _ in range(2):
        brighter = x * 2.0 ** gains[index, None]
        chain = fit_chain(brighter, encoded, multipliers)
        gains = gains + _gains(chain, brighter, encoded, multipliers, index)
        gains -= np.median(gains)
    return gains, chain.encoded(chain.predicted(x * 2.0 ** gains[index, None], multipliers))


def _gains(chain: ColourChain, x: Array, encoded: Array, multipliers: Array, index: NDArray[np.intp]) -> Array:
    """Return by how many EV each shot's JPEG is brighter than the chain renders it, (m,)."""
    light, linear = curve_terms(encoded) @ chain.curve, chain.predicted(x, multipliers)
    plain = (saturation(encoded) < 0.4) & (encoded.max(axis=1) > 0.2) & (linear.min(axis=1) > 1e-4)
    ratio = np.log2(np.maximum(light.sum(axis=1), 1e-6) / np.maximum(linear.sum(axis=1), 1e-6))
    shots = [plain & (index == shot) for shot in range(index.max() + 1)]
    return np.array([float(np.median(ratio[rows])) if rows.sum() >= 4 else 0.0 for rows in shots])


def _of_group(group: Mask, names: NDArray[np.str_], sensor: bool, codes: list[float]) -> Diagnosis:
    """The diagnosis of a group of shots; codes: its errors under the common rendering and under its own."""
    listed = ", ".join(str(name) for name in names[group][:4]) + (", …" if group.sum() > 4 else "")
    what = "sensor under the same camera name" if sensor else "picture style under the same name"
    return Diagnosis(
        f"{group.sum()} of {len(names)} shots seem to be of another {what}",
        f"{listed} lie {codes[0]:.1f} codes off the common rendering, {codes[1]:.1f} off one of their own",
        "name them apart, or leave them out",
        whole_set=False,
    )


def _multipliers_differ(inside: Mask, multipliers: Array, setting: NDArray[np.str_]) -> bool:
    """Whether one white balance has other multipliers inside a group of samples (n,) than outside."""
    for name in np.unique(setting[inside]):
        both = [
            np.median(multipliers[(setting == name) & part], axis=0)
            for part in (inside, ~inside)
            if ((setting == name) & part).any()
        ]
        if name != "auto" and len(both) == 2 and np.abs(np.log(both[0] / both[1])).max() > 0.03:
            return True
    return False
