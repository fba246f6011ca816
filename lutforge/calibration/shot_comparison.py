"""Comparison of the shots of a style: which the camera rendered otherwise than the rest, and how.

What JPEG values differ by from those that the base renders of their RAW is a smooth function of colour, the same for
all shots, since the gamut map is fixed: a cubic polynomial. To it each shot, or each of two groups of shots, may add a
change: of the tone of each channel (three numbers) and of what differs from grey (a matrix). Function and changes are
fitted together, by least squares with robust weights; the sum of squares that a change takes away states how much
better shots fit apart. Shots with few tones in common are compared as well as others, since the function joins them.

Of all divisions of the shots into two groups, the one that fits best is judged by a single measure: how far the groups
are apart, compared with how far single shots are from others of their own group; where they are not, so is the single
shot that fits best apart. A third of the shots or fewer deviate from the others; of larger groups nothing says which is
right.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

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
LEAST_OF_SHOT = 20
"""Shots with fewer samples are not compared."""
CODE = 1.0 / 255.0
CHANGE = 0.3
"""Standard deviation of the numbers of a change beforehand, in encoded values."""
ROBUST = RobustWeights(cauchy, multiple=3.0, least=CODE)
POWERS = [(i, j, k) for i in range(4) for j in range(4) for k in range(4) if i + j + k <= 3]
TONES = 3
"""How many numbers of a change are of the tone of each channel."""
MATRIX = 6
"""How many are of the matrix."""
ALL_SPLITS = 12
"""The largest number of shots of which all divisions into two groups are tried.

Of more shots, single ones are moved from group to group as long as that helps.
"""
USUAL = 1.9
"""Codes that sound shots are apart from each other beforehand, between the 0.5 of most cameras and the 2.2 of the
roughest one measured. It counts as much as one difference that was measured."""
FAR, LEAST_CODES = 1.9, 1.6
"""Groups are apart by so many times what is usual, and by so many codes."""
SURE = 1.0
"""A shot is surely of its group if the other group fits it worse by so many times what is usual."""
HUE_GROUPS = 5
"""Errors of similar colours of a shot are alike: standard errors come from its residuals by groups of hue (Liang &
Zeger 1986, https://doi.org/10.1093/biomet/73.1.13)."""
QUANTITIES = ("exposure", "contrast", "saturation", "red", "blue")
COLUMNS = ("exposure, EV", "contrast", "saturation", "red, EV", "blue, EV")
"""What is measured of a deviation; red and blue are those of the white balance, compared with green."""
LEAST = np.array([0.1, 0.06, 0.12, 0.08, 0.08])
CLEARLY = 4.0
"""A quantity deviates clearly by so many standard errors, and by the least value above: EV, EV per EV, a share."""
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

    values, errors: exposure in EV, contrast in EV per EV, change of saturation, red and blue of greys compared with
    green in EV, and their standard errors; clear: which of them are beyond chance. primaries: the share of their
    strength by which colours deviate besides. without_colour: the shot is black and white, and others are not.
    """

    shot: str
    values: tuple[float, ...]
    errors: tuple[float, ...]
    clear: tuple[bool, ...]
    primaries: float = 0.0
    without_colour: bool = False

    @property
    def is_told(self) -> bool:
        """True where it is known what deviates."""
        return any(self.clear) or self.primaries > OTHER_PRIMARIES or self.without_colour

    @property
    def cells(self) -> tuple[str, ...]:
        """The values as cells of a table, under `COLUMNS`."""
        return tuple(f"{value:+.2f} ± {error:.2f}" for value, error in zip(self.values, self.errors, strict=True))

    @property
    def words(self) -> str:
        """What deviates clearly, with standard errors."""
        if self.without_colour:
            return "black and white"
        exposure, contrast, saturation, red, blue = (
            f"{value:+.0%} ± {error:.0%}" if name in ("contrast", "saturation") else f"{value:+.2f} ± {error:.2f} EV"
            for name, value, error in zip(QUANTITIES, self.values, self.errors, strict=True)
        )
        named = [
            f"exposure {exposure}", f"contrast {contrast}", f"saturation {saturation}",
            f"white balance: red {red}", f"white balance: blue {blue}",
        ]  # fmt: skip
        shown = [words for words, clear in zip(named, self.clear, strict=True) if clear]
        if self.primaries > OTHER_PRIMARIES:
            shown.append("primaries")
        return ", ".join(shown) or "tones and colours"


@dataclass(frozen=True)
class ShotGroups:
    """Two groups of shots that were rendered in two ways.

    deviation: of the second group from the first; either: shots that fit both groups.
    """

    first: tuple[str, ...]
    second: tuple[str, ...]
    deviation: Deviation
    either: tuple[str, ...] = ()

    @property
    def diagnosis(self) -> Diagnosis:
        """The groups as a cause that spoils the whole set: it is not known which are right."""
        either = f"; {_listed(self.either)} may be of either" if self.either else ""
        return Diagnosis(
            "the shots are of two groups that the camera rendered in two ways",
            f"{_listed(self.second)} differ from {_listed(self.first)}: {self.deviation.words}{either}",
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
        known = bool(np.isfinite(samples.wb[rows]).all())

        colourless = _colourless(balanced, encoded, shot)
        checks.append(colourless)
        if not colourless.groups:
            rest = ~np.isin(shot, [deviation.shot for deviation in colourless.deviations])
            rendered = base.render(balanced[rest])
            compared = compare_shots(rendered, encoded[rest], shot[rest], base.response.linearize, balances_known=known)
            checks.append(replace(compared, groups=()) if colourless.deviations else compared)
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
    is_saturation = np.array(QUANTITIES) == "saturation"
    values = (-1.0 if without else 1.0) * is_saturation
    return Deviation(shot, tuple(values.tolist()), (0.0,) * len(values), tuple(is_saturation.tolist()), 0.0, without)


def compare_shots(
    rendered: Array,
    encoded: Array,
    shot: NDArray[np.str_],
    linearize: Callable[[Array], Array],
    *,
    balances_known: bool = True,
) -> ShotCheck:
    """Find the shots of one style that deviate, or the two groups that they are of.

    rendered: (n, 3) the RAW as a fixed rendering has it; encoded: (n, 3) the JPEG values, neither clipped; shot: (n,)
    names; linearize: JPEG values (m, 3) → linear (m, 3); balances_known: the files state the multipliers, so that a
    tint is the rendering's. At most a third of the shots deviates: where more are otherwise, nothing says which are
    right. Groups are looked for among all shots only: what is left after a shot was left out may differ by what that
    shot had bent.
    """
    names, counts = np.unique(shot, return_counts=True)
    names = names[counts >= LEAST_OF_SHOT]
    most = len(names) // 3
    deviations = list[Deviation]()
    while len(names) > 1:
        comparison = _Comparison(rendered, encoded, shot, names, tinted=balances_known)
        split = next(filter(comparison.is_apart, (comparison.best_split(), comparison.best_single())), None)
        if split is None:
            break
        unsure = comparison.unsure(split)
        few, others = split & ~unsure, ~split & ~unsure
        if not (few.any() and others.any()):
            break
        is_half = 3 * np.count_nonzero(few) > np.count_nonzero(~unsure)
        if not is_half and np.count_nonzero(few) <= most - len(deviations):
            # Only what has a standard error leaves a shot out; primaries have none.
            measured = comparison.deviations(comparison.singles(few), linearize)
            found = [deviation for deviation in measured if any(deviation.clear)]
            if not found:
                break
            deviations += found
            names = np.setdiff1d(names, [deviation.shot for deviation in found])
        else:
            (deviation,) = comparison.deviations([split], linearize)
            if deviations or not deviation.is_told:
                break
            first, second, either = (tuple(str(name) for name in names[rows]) for rows in (others, few, unsure))
            return ShotCheck(groups=(ShotGroups(first, second, deviation, either),))
    return ShotCheck(tuple(deviations))


class _Comparison:
    """The fit of a smooth function of colour that all shots share, and of changes of some shots to it.

    rendered, encoded: (n, 3); shot: (n,); names: (s,), the shots that are compared.
    """

    def __init__(
        self, rendered: Array, encoded: Array, shot: NDArray[np.str_], names: NDArray[np.str_], *, tinted: bool
    ) -> None:
        self.names = names
        most = min(MOST_OF_SHOT, max(LEAST_OF_SHOT, MOST_TOGETHER // len(names)))
        rng = np.random.default_rng(0)
        rows = [np.sort(rng.permutation(np.flatnonzero(shot == name))[:most]) for name in names]
        chosen = np.concatenate(rows)
        self.parts = np.split(np.arange(len(chosen)), np.cumsum([len(part) for part in rows])[:-1])

        self.rendered = np.clip(rendered[chosen], 0.0, 1.0)
        self.tinted = tinted
        self.changes = _changes(self.rendered, tinted=tinted)
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
        remaining = self.residual - self._by_shot(orthonormal)
        freedom = 3.0 * (weight.sum() - len(POWERS)) - self.right.size
        self.noise = float((weight[:, None] * remaining**2).sum() / max(freedom, 1.0))

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

    def _change(self, signs: Array) -> tuple[Array, Array, float]:
        """Changes (m q,) of shots by signs (m, s), the inverse of their normal matrix, and the squares they take."""
        cross = self._cross(signs)
        right = (signs @ self.right).ravel()
        normal = np.einsum("is,js,sqr->iqjr", signs, signs, self.normal).reshape(cross.shape[1], -1)
        inverse = np.linalg.inv(normal + np.kron(np.eye(len(signs)), self.prior) - cross.T @ cross)
        change = inverse @ right
        return change, inverse, float(right @ change)

    def _cross(self, signs: Array) -> Array:
        """The products of the shared functions with changes of shots by signs (m, s): (k, m q)."""
        return np.concatenate([np.tensordot(sign, self.cross, 1) for sign in signs], axis=1)

    def gain(self, *groups: Mask) -> float:
        """The sum of squares that changes of some groups (s,) against the others take away, by Akaike's criterion."""
        change, _, gain = self._change(np.where(groups, 1.0, -1.0))
        return gain - 2.0 * len(change) * self.noise

    def codes(self, group: Mask) -> float:
        """How far a group (s,) is from the others, in codes: root mean square."""
        return self._as_codes(self.gain(group), group, ~group)

    def usual_codes(self, group: Mask) -> float:
        """How far single shots are from the others of their own group, (s,) or not, in codes.

        The median of the shots, and what is usual beforehand as one more difference to those within groups.
        """
        gain, found = self.gain(group), []
        for single in self.singles(group | ~group):
            others = (group == group[single]) & ~single
            if others.any():
                found.append(self._as_codes(self.gain(group, single) - gain, single, others))
        within = len(group) - 2
        squared = within * float(np.median(found)) ** 2 if found else 0.0
        return float(np.sqrt((USUAL**2 + squared) / (1 + within)))

    def _as_codes(self, gain: float, group: Mask, others: Mask) -> float:
        """The squares that a change of a group (s,) against others takes away as a difference of the two, in codes."""
        weights = [float(self.weight[self._rows(mask)].sum()) for mask in (group, others)]
        return 255.0 * float(np.sqrt(max(gain, 0.0) / 3.0 * (1.0 / weights[0] + 1.0 / weights[1])))

    def _rows(self, group: Mask) -> NDArray[np.intp]:
        """The samples of a group (s,)."""
        return np.concatenate([self.parts[place] for place in np.flatnonzero(group)])

    def is_apart(self, group: Mask) -> bool:
        """True where a group (s,) is far from the others, compared with how far single shots usually are."""
        return self.codes(group) > max(LEAST_CODES, FAR * self.usual_codes(group))

    def unsure(self, group: Mask) -> Mask:
        """The shots (s,) that fit a group (s,) about as well as the others."""
        gain, least = self.gain(group), SURE * self.usual_codes(group)
        singles = self.singles(group | ~group)
        return np.array([self._as_codes(gain - self.gain(group ^ one), one, ~one) < least for one in singles])

    def singles(self, shots: Mask) -> list[Mask]:
        """A group (s,) of its own for each of some shots (s,)."""
        return [np.arange(len(shots)) == place for place in np.flatnonzero(shots)]

    def best_split(self) -> Mask:
        """The smaller (s,) of the two groups of shots that fit best apart."""
        count = len(self.names)
        if count <= ALL_SPLITS:
            places = np.arange(count - 1)
            splits = [np.append(bits >> places & 1, 0).astype(np.bool_) for bits in range(1, 1 << (count - 1))]
        else:
            # From the shots that deviate most, and from random divisions
            singles = sorted(self.singles(np.ones(count, dtype=np.bool_)), key=self.gain, reverse=True)
            rng = np.random.default_rng(0)
            starts = [*singles[:3], *(rng.random(count) < 0.5 for _ in range(4))]
            splits = [self._improved(start) for start in starts]
        best = max(splits, key=self.gain)
        return best if 2 * np.count_nonzero(best) <= count else ~best

    def best_single(self) -> Mask:
        """The shot, as a mask (s,), that fits best apart from all others."""
        return max(self.singles(np.ones(len(self.names), dtype=np.bool_)), key=self.gain)

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

    def deviations(self, groups: Sequence[Mask], linearize: Callable[[Array], Array]) -> list[Deviation]:
        """Measure how the shots of each of some groups (s,) deviate from those of none."""
        signs = np.where(groups, 1.0, -1.0)
        change, inverse, _ = self._change(signs)
        scores = self._scores(signs, change)
        found = []
        for group, own in zip(groups, np.split(np.arange(len(change)), len(groups)), strict=True):
            measure = _Measure(self.rendered[self._rows(group)], linearize, tinted=self.tinted)
            values, slopes = measure(change[own]), measure.slopes(change[own])
            within = np.square(slopes @ inverse[own] @ scores).sum(axis=1) * HUE_GROUPS / (HUE_GROUPS - 1)
            errors = np.sqrt(within)
            clear = (np.abs(values) > LEAST) & (np.abs(values) > CLEARLY * errors)
            name = _listed([str(shot) for shot in self.names[group]])
            primaries = measure.primaries(change[own])
            found.append(
                Deviation(name, tuple(values.tolist()), tuple(errors.tolist()), tuple(clear.tolist()), primaries)
            )
        return found

    def _scores(self, signs: Array, change: Array) -> Array:
        """The derivatives (m q, g) of the squares by changes of signs (m, s), summed over hues of each shot."""
        cross = self._cross(signs)
        of_samples = np.repeat(signs, [len(part) for part in self.parts], axis=1)
        changes = np.concatenate([sign[:, None, None] * self.changes for sign in of_samples], axis=2)
        shared = (cross @ change).reshape(3, -1)
        residual = self.residual - changes @ change + (shared @ self.orthonormal).T
        hue = np.arctan2(self.rendered[:, 2] - self.rendered[:, 1], self.rendered[:, 0] - self.rendered[:, 1])
        # Each change, less what the shared function explains of it
        explained = np.einsum("ckq,kn->ncq", cross.reshape(3, -1, len(change)), self.orthonormal)
        scores = np.einsum("n,ncq,nc->nq", self.weight, changes - explained, residual)
        groups = [group for part in self.parts for group in np.array_split(part[np.argsort(hue[part])], HUE_GROUPS)]
        return np.stack([scores[group].sum(axis=0) for group in groups], axis=1)


class _Measure:
    """What photographers call a change of colours that are rendered so, (n, 3): exposure, contrast and more."""

    def __init__(self, rendered: Array, linearize: Callable[[Array], Array], *, tinted: bool) -> None:
        self.linearize = linearize
        self.changes = _changes(rendered, tinted=tinted)[..., -MATRIX:]
        self.chroma = rendered - rendered.mean(axis=1, keepdims=True)
        self.strength = max(float(np.sum(self.chroma**2)), 1e-12)
        low, high = np.percentile(rendered.mean(axis=1), (10, 90))
        self.greys = np.repeat(np.linspace(max(low, 0.04), max(high, 0.08), 9)[:, None], 3, axis=1)
        self.of_greys = _changes(self.greys, tinted=tinted)

    def __call__(self, change: Array) -> Array:
        """The values of a `Deviation` by a change ±d (q,)."""
        step = self.of_greys @ change
        linear = [self.linearize(np.clip(self.greys + off, 0.0, 1.0)) for off in (0.0, step, -step)]
        tones, brighter, darker = (_stops(values.sum(axis=1)) for values in linear)
        contrast, exposure = np.polyfit(tones - np.median(tones), brighter - darker, 1)
        saturation = 2.0 * float(np.sum((self.changes @ change[-MATRIX:]) * self.chroma)) / self.strength
        red, green, blue = (_stops(linear[1]) - _stops(linear[2])).mean(axis=0)
        return np.array([exposure, contrast, saturation, red - green, blue - green])

    def slopes(self, change: Array, small: float = 1e-4) -> Array:
        """The derivatives (5, q) of these values by the numbers of a change (q,)."""
        steps = small * np.eye(len(change))
        return np.stack([(self(change + step) - self(change)) / small for step in steps], axis=1)

    def primaries(self, change: Array) -> float:
        """The share of their strength by which a change (q,) moves colours otherwise than by saturation."""
        moved = 2.0 * self.changes @ change[-MATRIX:]
        rest = moved - np.sum(moved * self.chroma) / self.strength * self.chroma
        return float(np.sqrt(np.sum(rest**2) / self.strength))


def _stops(linear: Array) -> Array:
    return np.asarray(np.log2(np.maximum(linear, DARKEST_LINEAR)))


def _polynomials(rendered: Array) -> Array:
    """Cubic polynomials of encoded colours (n, 3), (n, 20)."""
    red, green, blue = (2.0 * rendered - 1.0).T
    return np.stack([red**i * green**j * blue**k for i, j, k in POWERS], axis=1)


def _changes(rendered: Array, *, tinted: bool) -> Array:
    """The values that each number of a change adds to encoded colours (n, 3), (n, 3, q): tones, a matrix on chroma.

    tinted: tones of each channel, else of all alike.
    """
    mean = rendered.mean(axis=1)
    middle = mean * (1.0 - mean)
    tones = np.stack([middle * (2.0 * mean - 1.0) ** power for power in range(TONES)], axis=1)
    chroma = rendered[:, [0, 2]] - mean[:, None]
    channels = np.eye(3) if tinted else np.ones((3, 1))
    parts = np.einsum("ni,co->ncio", tones, channels), np.einsum("ni,co->ncio", chroma, np.eye(3))
    return np.concatenate([part.reshape(len(rendered), 3, -1) for part in parts], axis=2)
