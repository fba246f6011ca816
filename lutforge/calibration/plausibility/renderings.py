"""Do all shots have one rendering? Two of them, or a brightness of its own for each, are tried against it.

What the chain of all leaves over is regressed on a cubic polynomial of the colours, by shots: sums of products of a
shot's samples are all that is needed, so any grouping of shots costs one small solve. Every second sample of a shot
fits, the others judge. Two renderings are found as two means are: shots are dealt to whichever fits them better, until
nothing changes, starting from each shot alone.
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


@dataclass(frozen=True, eq=False)
class _Sums:
    """Sums over half of the samples of each of m shots, for a least-squares fit of their residuals on k terms.

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
    """Tell of one style's shots whether some are of another style or sensor, or each has a brightness of its own.

    x: balanced RAW (n, 3), encoded (n, 3), both unclipped; setting: white balances (n,). None where one rendering does.
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
    """Whether "two" renderings or a brightness for "each" shot explain the squared errors (m,) much better than one.

    They must lower the logarithms of the errors on left-out shots, summed, by more than dealing m shots to two groups
    can, which there are 2^(m − 1) ways to do, and in both groups; or the smaller group is far off the rest.
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


def _halves(terms: Array, left: Array, index: NDArray[np.intp], count: int) -> tuple[_Sums, _Sums]:
    """Sums over every second sample of each shot, and over the others."""
    order = np.argsort(index, kind="stable")
    place = np.empty(len(index), dtype=np.intp)
    place[order] = np.arange(len(index)) - np.searchsorted(index[order], index[order])
    return _sums(terms, left, index, place % 2 == 0, count), _sums(terms, left, index, place % 2 == 1, count)


def _sums(terms: Array, left: Array, index: NDArray[np.intp], half: Mask, count: int) -> _Sums:
    size = np.linalg.norm(left, axis=1)
    counts = half / (1.0 + (size / (6.0 * np.median(size) + CODE)) ** 2)  # strays count little
    rows = [index == shot for shot in range(count)]
    weighted = terms * counts[:, None]
    return _Sums(
        np.array([terms[mine].T @ weighted[mine] for mine in rows]),
        np.array([weighted[mine].T @ left[mine] for mine in rows]),
        np.array([float((counts * size**2)[mine].sum()) for mine in rows]),
        np.array([float(counts[mine].sum()) for mine in rows]),
    )


def _coefficients(fitting: _Sums, group: Mask) -> Array:
    """The polynomial (k, 3) of a group of shots, drawn to that of all where the group tells nothing."""
    everything, ridge = fitting.products.sum(axis=0), 1e-3 * np.eye(fitting.products.shape[1])
    common = np.linalg.solve(everything + ridge, fitting.cross.sum(axis=0))
    if group.all() or not group.any():
        return np.asarray(common)
    drawn = everything * (4.0 / fitting.count.sum()) + ridge
    return np.asarray(
        np.linalg.solve(fitting.products[group].sum(axis=0) + drawn, fitting.cross[group].sum(axis=0) + drawn @ common)
    )


def _left_out(fitting: _Sums, judging: _Sums, group: Mask) -> Array:
    """Mean squared error of each shot (m,) under the polynomial of the group's other shots."""
    errors = np.empty(len(group))
    for shot in range(len(group)):
        others = group & (np.arange(len(group)) != shot)
        errors[shot] = judging.errors(_coefficients(fitting, others))[shot]
    return errors


def _two_groups(fitting: _Sums, judging: _Sums, whole: Mask) -> Mask:
    """(m,): the smaller of the two groups of shots that leave the least error together."""
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
    """What each shot's JPEG is brighter than the median one's, in EV (m,), and all colours rendered so, (n, 3).

    chain: of all shots as they are. One that is fitted to shots of different brightness takes a part of it for colour,
    so the chain and the brightness are fitted in turn.
    """
    gains = _gains(chain, x, encoded, multipliers, index)
    for _ in range(2):
        brighter = x * 2.0 ** gains[index, None]
        chain = fit_chain(brighter, encoded, multipliers)
        gains = gains + _gains(chain, brighter, encoded, multipliers, index)
        gains -= np.median(gains)
    return gains, chain.encoded(chain.predicted(x * 2.0 ** gains[index, None], multipliers))


def _gains(chain: ColourChain, x: Array, encoded: Array, multipliers: Array, index: NDArray[np.intp]) -> Array:
    """What each shot's JPEG is brighter than the chain renders it, in EV (m,)."""
    light, linear = curve_terms(encoded) @ chain.curve, chain.predicted(x, multipliers)
    plain = (saturation(encoded) < 0.4) & (encoded.max(axis=1) > 0.2) & (linear.min(axis=1) > 1e-4)
    ratio = np.log2(np.maximum(light.sum(axis=1), 1e-6) / np.maximum(linear.sum(axis=1), 1e-6))
    shots = [plain & (index == shot) for shot in range(index.max() + 1)]
    return np.array([float(np.median(ratio[rows])) if rows.sum() >= 4 else 0.0 for rows in shots])


def _of_group(group: Mask, names: NDArray[np.str_], sensor: bool, codes: list[float]) -> Diagnosis:
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
