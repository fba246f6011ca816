"""Comparison of the shots of a style: which the camera rendered otherwise than the rest, and how.

What JPEG values differ by from those that the base renders of their RAW is a smooth function of colour, the same for
all shots, since the gamut map is fixed: a cubic polynomial. To it each shot, or each of two groups of shots, may add a
change: of tone (three numbers) and of what differs from grey (a matrix). Function and changes are fitted together, by
least squares with robust weights; the sum of squares that a change takes away states how much better shots fit apart.
Shots with few tones in common are compared as well as others, since the function joins them.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular

from lutforge.arrays import Array, Mask
from lutforge.calibration.lattice.monochrome import is_monochrome
from lutforge.calibration.matrix_and_response import MatrixAndResponse
from lutforge.model.profile import Diagnosis
from lutforge.samples.sample_set import SampleSet
from lutforge.solvers.robust_weights import RobustWeights, cauchy

MOST_OF_SHOT = 400
"""The largest number of a shot's samples that are compared; of more, as many are drawn at random."""
MOST_TOGETHER = 20_000
"""The largest number of samples of all shots together."""
MOST_FOR_SPREAD = 24
"""By how many of the other shots the spread of deviations is measured, at most."""
LEAST_OF_SHOT = 20
"""Shots with fewer samples are not compared."""
CODE = 1.0 / 255.0
CHANGE = 0.3
"""Standard deviation of the numbers of a change beforehand, in encoded values."""
ROBUST = RobustWeights(cauchy, multiple=3.0, least=CODE)
POWERS = [(i, j, k) for i in range(4) for j in range(4) for k in range(4) if i + j + k <= 3]
TONES = 3
"""How many numbers of a change are of tone."""
ALL_SPLITS = 12
"""The largest number of shots of which all divisions into two groups are tried.

Of more shots, single ones are moved from group to group as long as that helps.
"""
OFF, BEYOND = 0.8, 1.3
"""A shot deviates if its change takes away so many codes, and so many times those of the others' changes."""
APART, APART_CODES = 1.25, 0.2
"""Shots are of two groups if the error of all is so many times that of both, and so many codes more."""
HUE_GROUPS = 5
"""Errors of similar colours of a shot are alike: standard errors come from its residuals by groups of hue (Liang &
Zeger 1986, https://doi.org/10.1093/biomet/73.1.13)."""
CLEARLY = 4.0
"""A quantity deviates clearly by so many standard errors, and by one of these: EV, EV per EV, share of saturation."""
LEAST = (0.1, 0.06, 0.12)
OTHER_PRIMARIES = 0.12
"""Share of the colours' strength from which on primaries are named."""
WITHOUT_COLOUR = 2.0 * CODE
"""Channels of a black-and-white picture differ by at most this, but for a twentieth of it."""
DARKEST_LINEAR = 1e-6
"""Least linear value that has a logarithm."""
ADVICE = "shoot in manual mode with one picture style, scene-dependent features (D-Lighting, HDR, auto tone) off"


@dataclass(frozen=True)
class Deviation:
    """How a shot, or a group of them, deviates from the others.

    values, errors: exposure in EV, contrast in EV per EV, change of saturation, and their standard errors; clear: which
    of them are beyond chance. primaries: the share of their strength by which colours deviate besides. without_colour:
    the shot is black and white, and others are not.
    """

    shot: str
    values: tuple[float, ...]
    errors: tuple[float, ...]
    clear: tuple[bool, ...]
    primaries: float = 0.0
    without_colour: bool = False

    @property
    def cells(self) -> tuple[str, ...]:
        """Exposure, contrast and saturation as cells of a table."""
        return tuple(f"{value:+.2f} ± {error:.2f}" for value, error in zip(self.values, self.errors, strict=True))

    @property
    def words(self) -> str:
        """What deviates clearly, with standard errors."""
        if self.without_colour:
            return "black and white"
        parts = zip(("exposure", "contrast", "saturation"), self.values, self.errors, self.clear, strict=True)
        shown = [
            f"{name} {value:+.2f} ± {error:.2f} EV" if name == "exposure" else f"{name} {value:+.0%} ± {error:.0%}"
            for name, value, error, clear in parts
            if clear
        ]
        if self.primaries > OTHER_PRIMARIES:
            shown.append("primaries")
        return ", ".join(shown) or "tones and colours"


@dataclass(frozen=True)
class ShotGroups:
    """Two groups of shots that were rendered in two ways. deviation: of the second group from the first."""

    first: tuple[str, ...]
    second: tuple[str, ...]
    deviation: Deviation

    @property
    def diagnosis(self) -> Diagnosis:
        """The groups as a cause that spoils the whole set: it is not known which are right."""
        return Diagnosis(
            "the shots are of two groups that the camera rendered in two ways",
            f"{_listed(self.second)} differ from {_listed(self.first)}: {self.deviation.words}",
            "calibrate from one group alone, or give the groups two names of styles",
        )


def _listed(shots: Sequence[str], most: int = 12) -> str:
    """Names of shots in words."""
    more = f" and {len(shots) - most} more" if len(shots) > most else ""
    return ", ".join(shots[:most]) + more


@dataclass(frozen=True)
class ShotCheck:
    """The result of a comparison of shots. deviations: of single shots; groups: at most one entry for each style."""

    deviations: tuple[Deviation, ...] = ()
    groups: tuple[ShotGroups, ...] = ()

    @classmethod
    def of(cls, checks: Sequence["ShotCheck"]) -> "ShotCheck":
        """The checks of several styles in one."""
        return cls(
            tuple(deviation for check in checks for deviation in check.deviations),
            tuple(groups for check in checks for groups in check.groups),
        )

    @property
    def notes(self) -> tuple[str, ...]:
        """A sentence on the shots that deviate; none where there are none."""
        if not self.deviations:
            return ()
        listed = ", ".join(f"{deviation.shot} ({deviation.words})" for deviation in self.deviations[:4])
        more = f" and {len(self.deviations) - 4} more" if len(self.deviations) > 4 else ""
        return (f"shots deviate from what the others agree on and are left out, {listed}{more}: {ADVICE}",)


def check_shots(
    samples: SampleSet, multipliers: Array, usable: Mask, bases: Mapping[str, MatrixAndResponse]
) -> ShotCheck:
    """Compare the shots of each style that has a base.

    multipliers: (n, 3), what makes RAW white-balanced; usable: (n,) unclipped samples.
    """
    checks = list[ShotCheck]()
    for style, base in bases.items():
        rows = usable & (samples.style == style)
        balanced = samples.raw[rows] * multipliers[rows]
        encoded, shot = samples.srgb[rows], samples.shot[rows]

        colourless = _colourless(balanced, encoded, shot)
        checks.append(colourless)
        if not colourless.groups:
            rest = ~np.isin(shot, [deviation.shot for deviation in colourless.deviations])
            rendered = base.render(balanced[rest])
            checks.append(compare_shots(rendered, encoded[rest], shot[rest], base.response.linearize))
    return ShotCheck.of(checks)


def _colourless(balanced: Array, encoded: Array, shot: NDArray[np.str_]) -> ShotCheck:
    """Find black-and-white shots among shots with colour, or the reverse, of one style; arguments (n, …)."""
    names = np.unique(shot)
    if not any(is_monochrome(balanced[shot == name], encoded[shot == name]) for name in names):
        return ShotCheck()
    # Dark shots without colour then are, too, though their RAW has too little of it to show that.
    tints = np.ptp(encoded, axis=1)
    grey = np.array([bool(np.percentile(tints[shot == name], 95) <= WITHOUT_COLOUR) for name in names])
    if grey.all() or not grey.any():
        return ShotCheck()
    few = grey if 2 * np.count_nonzero(grey) <= len(grey) else ~grey
    if 3 * np.count_nonzero(few) > len(names):
        first, second = (tuple(str(name) for name in names[rows]) for rows in (~grey, grey))
        return ShotCheck(groups=(ShotGroups(first, second, _without_colour(_listed(second))),))
    return ShotCheck(tuple(_without_colour(str(name), bool(grey[few].all())) for name in names[few]))


def _without_colour(shot: str, without: bool = True) -> Deviation:
    """The deviation of a black-and-white shot from others, or of one with colour from black-and-white ones."""
    return Deviation(shot, (0.0, 0.0, -1.0 if without else 1.0), (0.0,) * 3, (False, False, True), 0.0, without)


def compare_shots(
    rendered: Array, encoded: Array, shot: NDArray[np.str_], linearize: Callable[[Array], Array]
) -> ShotCheck:
    """Find the shots of one style that deviate, the farthest first, or the two groups that they are of.

    rendered: (n, 3) the RAW as a fixed rendering has it; encoded: (n, 3) the JPEG values, neither clipped; shot: (n,)
    names; linearize: JPEG values (m, 3) → linear (m, 3). At most a third of the shots deviates: where more are
    otherwise, nothing says which are right. Groups are looked for among all shots only: what is left after a shot was
    left out may differ by what that shot had bent.
    """
    names, counts = np.unique(shot, return_counts=True)
    names = names[counts >= LEAST_OF_SHOT]
    most = len(names) // 3
    deviations = list[Deviation]()
    while len(names) > 1:
        comparison = _Comparison(rendered, encoded, shot, names)
        split = comparison.best_split()
        few = split if 2 * np.count_nonzero(split) <= len(split) else ~split
        is_half = 3 * np.count_nonzero(few) > len(names)
        if is_half and not deviations and comparison.is_apart(few):
            deviation = comparison.deviation(few, linearize)
            if any(deviation.clear):
                first, second = (tuple(str(name) for name in names[rows]) for rows in (~few, few))
                return ShotCheck(groups=(ShotGroups(first, second, deviation),))

        if len(deviations) == most:
            break
        places = np.arange(len(names))
        worst = max(places if is_half else places[few], key=lambda place: comparison.codes(places == place))
        outlier = places == worst
        single = _outlier(comparison, outlier, _Comparison(rendered, encoded, shot, names[~outlier]), linearize)
        if single is None:
            break
        deviations.append(single)
        names = names[~outlier]
    return ShotCheck(tuple(deviations))


def _outlier(
    comparison: "_Comparison", outlier: Mask, rest: "_Comparison", linearize: Callable[[Array], Array]
) -> Deviation | None:
    """The deviation of one shot, a mask (s,), from the rest of them; None where it is not clear."""
    count = len(rest.names)
    singles = [np.arange(count) == place for place in np.random.default_rng(0).permutation(count)[:MOST_FOR_SPREAD]]
    usual = float(np.median([rest.codes(single) for single in singles]))
    if comparison.codes(outlier) < max(OFF, BEYOND * usual):
        return None
    spread = 1.4826 * np.median([np.abs(rest.deviation(single, linearize).values) for single in singles], axis=0)
    deviation = comparison.deviation(outlier, linearize, spread)
    return deviation if any(deviation.clear) else None


class _Comparison:
    """The fit of a smooth function of colour that all shots share, and of changes of some shots to it.

    rendered, encoded: (n, 3); shot: (n,); names: (s,), the shots that are compared.
    """

    def __init__(self, rendered: Array, encoded: Array, shot: NDArray[np.str_], names: NDArray[np.str_]) -> None:
        self.names = names
        most = min(MOST_OF_SHOT, max(LEAST_OF_SHOT, MOST_TOGETHER // len(names)))
        rng = np.random.default_rng(0)
        rows = [np.sort(rng.permutation(np.flatnonzero(shot == name))[:most]) for name in names]
        chosen = np.concatenate(rows)
        self.parts = np.split(np.arange(len(chosen)), np.cumsum([len(part) for part in rows])[:-1])

        self.rendered = np.clip(rendered[chosen], 0.0, 1.0)
        self.changes = _changes(self.rendered)
        self.prior = (CODE / CHANGE) ** 2 * np.eye(self.changes.shape[2])
        functions = _polynomials(self.rendered)
        off = encoded[chosen] - self.rendered
        weight = np.ones(len(chosen))
        for _ in range(6):
            weighted = functions * weight[:, None]
            normal = weighted.T @ functions + 0.1 * (CODE / CHANGE) ** 2 * np.eye(len(POWERS))
            # Functions of which the weighted squares are 1 and the weighted products 0
            orthonormal = solve_triangular(np.linalg.cholesky(normal), functions.T, lower=True)
            self.residual = off - orthonormal.T @ (orthonormal * weight @ off)
            self._set_normal(orthonormal, weight)
            weight = ROBUST(np.linalg.norm(self.residual - self._by_shot(orthonormal), axis=1))
        self.orthonormal, self.weight = orthonormal, weight
        self.squares = float((weight[:, None] * self.residual**2).sum())

    def _set_normal(self, orthonormal: Array, weight: Array) -> None:
        """Set the normal equations of a change of each shot: (s, q, q), with the shared function, and right sides."""
        normal, cross, right = [], [], []
        for part in self.parts:
            weighted = self.changes[part] * weight[part, None, None]
            normal.append(np.einsum("ncq,ncr->qr", weighted, self.changes[part]))
            right.append(np.einsum("ncq,nc->q", weighted, self.residual[part]))
            cross.append(np.einsum("kn,ncq->ckq", orthonormal[:, part], weighted).reshape(-1, len(self.prior)))
        self.normal, self.cross, self.right = np.array(normal), np.array(cross), np.array(right)

    def _by_shot(self, orthonormal: Array) -> Array:
        """The part of the residuals (n, 3) that a change of each shot by itself explains."""
        inverse = np.linalg.inv(self.normal + self.prior)
        reduced = np.einsum("skq,sqr->skr", self.cross, inverse)
        core = (1.0 + 1e-9) * np.eye(self.cross.shape[1]) - np.einsum("skr,slr->kl", reduced, self.cross)
        joint = np.linalg.solve(core, np.einsum("skr,sr->k", reduced, self.right))
        change = np.einsum("sqr,sr->sq", inverse, self.right + np.einsum("skq,k->sq", self.cross, joint))
        shared = np.einsum("skq,sq->k", self.cross, change).reshape(3, -1)
        by_part = zip(self.parts, change, strict=True)
        explained = np.concatenate([self.changes[part] @ numbers for part, numbers in by_part])
        return np.asarray(explained - (shared @ orthonormal).T)

    def _change(self, sign: Array) -> tuple[Array, Array, float]:
        """The change d of shots by signs (s,), ±d, the inverse of its normal matrix, and the squares it takes away."""
        cross, right = np.tensordot(sign, self.cross, 1), sign @ self.right
        inverse = np.linalg.inv(np.tensordot(sign**2, self.normal, 1) + self.prior - cross.T @ cross)
        change = inverse @ right
        return change, inverse, float(right @ change)

    def gain(self, group: Mask) -> float:
        """The sum of squares that a change of a group (s,) against the others takes away."""
        return self._change(np.where(group, 1.0, -1.0))[2]

    def codes(self, group: Mask) -> float:
        """The gain of a group (s,) in codes: its root mean square over the samples of the group."""
        weight = float(self.weight[self._rows(group)].sum())
        return 255.0 * float(np.sqrt(max(self.gain(group), 0.0) / (3.0 * weight)))

    def _rows(self, group: Mask) -> NDArray[np.intp]:
        """The samples of a group (s,)."""
        return np.concatenate([self.parts[place] for place in np.flatnonzero(group)])

    def is_apart(self, group: Mask) -> bool:
        """True where a group (s,) and the others fit much better apart."""
        mean = 255.0**2 / (3.0 * float(self.weight.sum()))
        together = np.sqrt(mean * self.squares)
        apart = np.sqrt(mean * max(self.squares - self.gain(group), 0.0))
        return bool(together > APART * apart and together - apart > APART_CODES)

    def best_split(self) -> Mask:
        """The division of the shots into two groups (s,) that fit best apart."""
        count = len(self.names)
        if count <= ALL_SPLITS:
            splits = [
                np.array([False, *(bits >> place & 1 for place in range(count - 1))], dtype=np.bool_)
                for bits in range(1, 1 << (count - 1))
            ]
            return max(splits, key=self.gain)
        singles = sorted(range(count), key=lambda place: -self.gain(np.arange(count) == place))
        # From the shots that deviate most, and from random divisions
        rng = np.random.default_rng(0)
        starts = [np.arange(count) == place for place in singles[:3]] + [rng.random(count) < 0.5 for _ in range(4)]
        return max((self._improved(start) for start in starts), key=self.gain)

    def _improved(self, split: Mask) -> Mask:
        """Move single shots from group to group while that helps."""
        best, split = self.gain(split), split.copy()
        for _ in range(10):
            before = best
            for place in range(len(split)):
                split[place] = not split[place]
                gain = self.gain(split) if 0 < np.count_nonzero(split) < len(split) else 0.0
                if gain > best:
                    best = gain
                else:
                    split[place] = not split[place]
            if best <= before * (1 + 1e-9):
                break
        return split

    def deviation(self, group: Mask, linearize: Callable[[Array], Array], spread: Array | float = 0.0) -> Deviation:
        """Measure how the shots of a group (s,) deviate from the others. spread: (3,), of other shots' values."""
        sign = np.where(group, 1.0, -1.0)
        change, inverse, _ = self._change(sign)
        rows = self._rows(group)
        rendered, changes = self.rendered[rows], self.changes[rows]
        chroma = rendered - rendered.mean(axis=1, keepdims=True)
        strength = max(float(np.sum(chroma**2)), 1e-12)
        low, high = np.percentile(rendered.mean(axis=1), (10, 90))
        greys = np.repeat(np.linspace(max(low, 0.04), max(high, 0.08), 9)[:, None], 3, axis=1)
        changes_of_greys = _changes(greys)

        def stops(encoded: Array) -> Array:
            return np.asarray(np.log2(np.maximum(linearize(encoded).sum(axis=1), DARKEST_LINEAR)))

        tones = stops(greys)

        def measured(change: Array) -> Array:
            step = changes_of_greys @ change
            brighter = stops(np.clip(greys + step, 0.0, 1.0)) - stops(np.clip(greys - step, 0.0, 1.0))
            contrast, exposure = np.polyfit(tones - np.median(tones), brighter, 1)
            saturation = 2.0 * float(np.sum((changes[..., TONES:] @ change[TONES:]) * chroma)) / strength
            return np.array([exposure, contrast, saturation])

        values, small = measured(change), 1e-4
        slopes = np.stack([(measured(change + step) - values) / small for step in small * np.eye(len(change))], axis=1)

        within = np.square(slopes @ inverse @ self._scores(sign, change)).sum(axis=1) * HUE_GROUPS / (HUE_GROUPS - 1)
        errors = np.hypot(np.sqrt(within * len(rows) / (len(rows) - len(change))), spread)
        clear = (np.abs(values) > np.array(LEAST)) & (np.abs(values) > CLEARLY * errors)

        rest = 2.0 * changes[..., TONES:] @ change[TONES:] - values[2] * chroma
        primaries = float(np.sqrt(np.sum(rest**2) / strength))
        name = _listed([str(shot) for shot in self.names[group]])
        return Deviation(name, tuple(values.tolist()), tuple(errors.tolist()), tuple(clear.tolist()), primaries)

    def _scores(self, sign: Array, change: Array) -> Array:
        """The derivatives (q, g) of the squares by the change, summed over each group of hue of each shot."""
        signs = np.repeat(sign, [len(part) for part in self.parts])
        cross = np.tensordot(sign, self.cross, 1)
        shared = (cross @ change).reshape(3, -1)
        residual = self.residual - signs[:, None] * (self.changes @ change) + (shared @ self.orthonormal).T
        hue = np.arctan2(self.rendered[:, 2] - self.rendered[:, 1], self.rendered[:, 0] - self.rendered[:, 1])
        # Each change, less what the shared function explains of it
        explained = np.einsum("ckq,kn->ncq", cross.reshape(3, -1, len(change)), self.orthonormal)
        remaining = signs[:, None, None] * self.changes - explained
        scores = np.einsum("n,ncq,nc->nq", self.weight, remaining, residual)
        groups = [group for part in self.parts for group in np.array_split(part[np.argsort(hue[part])], HUE_GROUPS)]
        return np.stack([scores[group].sum(axis=0) for group in groups], axis=1)


def _polynomials(rendered: Array) -> Array:
    """Cubic polynomials of encoded colours (n, 3), (n, 20)."""
    red, green, blue = (2.0 * rendered - 1.0).T
    return np.stack([red**i * green**j * blue**k for i, j, k in POWERS], axis=1)


def _changes(rendered: Array) -> Array:
    """The values that each number of a change adds to encoded colours (n, 3), (n, 3, 9): tone, a matrix on chroma."""
    mean = rendered.mean(axis=1)
    middle = mean * (1.0 - mean)
    tones = np.stack([middle * (2.0 * mean - 1.0) ** power for power in range(TONES)], axis=1)
    chroma = rendered[:, [0, 2]] - mean[:, None]
    matrix = np.einsum("ni,co->ncio", chroma, np.eye(3)).reshape(len(rendered), 3, -1)
    return np.concatenate([np.repeat(tones[:, None], 3, axis=1), matrix], axis=2)
