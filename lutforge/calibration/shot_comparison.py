"""Comparison of the shots of a style: which the camera rendered otherwise than the rest, and how.

What JPEG values differ by from those that the base renders of their RAW is a smooth function of colour, the same for
all shots, since the gamut map is fixed (`shared_function`). To it each shot, or each of two groups of shots, may add a
change: of tone (three numbers) and of what differs from grey (a matrix). The sum of squares that a change saves states
how much better shots fit apart. Shots with few tones in common are compared as well as others, since the function joins
them.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lutforge.arrays import Array, Mask
from lutforge.calibration.lattice.monochrome import is_monochrome
from lutforge.calibration.matrix_and_response import MatrixAndResponse
from lutforge.calibration.shared_function import (
    CODE,
    TONES,
    ComparedColours,
    SharedFunctionFit,
    change_basis,
    fit_shared_function,
)
from lutforge.calibration.split_search import best_split
from lutforge.model.profile import Diagnosis
from lutforge.samples.sample_set import SampleSet

MOST_OF_SHOT = 400
"""The largest number of a shot's samples that are compared; of more, as many are drawn at random."""
MOST_TOGETHER = 20_000
"""The largest number of samples of all shots together."""
LEAST_OF_SHOT = 20
"""Shots with fewer samples are not compared."""
MOST_FOR_SPREAD = 24
"""The largest number of other shots by which the spread of deviations is measured."""

LEAST_DEVIATION = 0.8
"""A shot deviates only if its change saves at least this error, in codes."""
TIMES_USUAL_DEVIATION = 1.3
"""A shot deviates only if its change saves so many times the error, in codes, that those of the other shots save."""
GROUPS_ERROR_RATIO = 1.25
"""Shots are of two groups only if the error of all together is so many times that of the two apart."""
GROUPS_ERROR_SAVED = 0.2
"""Shots are of two groups only if the error of all together is so many codes larger than that of the two apart."""

CLEAR_STANDARD_ERRORS = 4.0
"""A quantity deviates clearly only by so many standard errors."""
LEAST_EXPOSURE, LEAST_CONTRAST, LEAST_SATURATION = 0.1, 0.06, 0.12
"""A quantity deviates clearly only by this: EV, EV per EV, share of the saturation."""
HUE_GROUPS = 5
"""Errors of similar colours of a shot are alike: standard errors come from its residuals by groups of hue (Liang &
Zeger 1986, https://doi.org/10.1093/biomet/73.1.13)."""
OTHER_PRIMARIES = 0.12
"""Share of the colours' strength from which on primaries are named."""
WITHOUT_COLOUR = 2.0 * CODE
"""Channels of a black-and-white picture differ by at most this, but for a twentieth of it."""

DARKEST_LINEAR = 1e-6
"""Least linear value that has a logarithm."""
DARKEST_GREYS = (0.04, 0.08)
"""The darkest grey that a change is measured at is no darker than the first, and the brightest than the second."""
GREYS = 9
"""The number of greys that a change is measured at."""
DERIVATIVE_STEP = 1e-4
"""Step of a numerical derivative by a number of a change."""
LEAST_STRENGTH = 1e-12
"""Least sum of squares of what differs from grey, so that colours without any divide."""
ADVICE = "shoot in manual mode with one picture style, scene-dependent features (D-Lighting, HDR, auto tone) off"


@dataclass(frozen=True)
class Deviation:
    """The deviation of a shot, or of a group of shots, from the others.

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
        """The quantities that deviate clearly, in words, with standard errors."""
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
            in_agreement = ~np.isin(shot, [deviation.shot for deviation in colourless.deviations])
            rendered = base.render(balanced[in_agreement])
            checks.append(compare_shots(rendered, encoded[in_agreement], shot[in_agreement], base.response.linearize))
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

    if _is_large(_minority(grey)):
        first, second = (tuple(str(name) for name in names[rows]) for rows in (~grey, grey))
        return ShotCheck(groups=(ShotGroups(first, second, _black_and_white(_listed(second))),))
    if 2 * np.count_nonzero(grey) <= len(grey):
        return ShotCheck(tuple(_black_and_white(str(name)) for name in names[grey]))
    return ShotCheck(tuple(_in_colour(str(name)) for name in names[~grey]))


def _black_and_white(shot: str) -> Deviation:
    """The deviation of a black-and-white shot from shots with colour."""
    return Deviation(shot, (0.0, 0.0, -1.0), (0.0,) * 3, (False, False, True), 0.0, without_colour=True)


def _in_colour(shot: str) -> Deviation:
    """The deviation of a shot with colour from black-and-white shots."""
    return Deviation(shot, (0.0, 0.0, 1.0), (0.0,) * 3, (False, False, True), 0.0, without_colour=False)


def _minority(group: Mask) -> Mask:
    """The smaller of two groups of shots, of which one is a mask (s,)."""
    return group if 2 * np.count_nonzero(group) <= len(group) else ~group


def _is_large(minority: Mask) -> bool:
    """True where a minority is more than a third of the shots (s,): then it is not known which of them are right."""
    return bool(3 * np.count_nonzero(minority) > len(minority))


def compare_shots(
    rendered: Array, encoded: Array, shot: NDArray[np.str_], linearize: Callable[[Array], Array]
) -> ShotCheck:
    """Find the shots of one style that deviate, the farthest first, or the two groups that they are of.

    rendered: (n, 3) the RAW as a fixed rendering has it; encoded: (n, 3) the JPEG values, neither clipped; shot: (n,)
    names; linearize: JPEG values (m, 3) → linear (m, 3). At most a third of the shots deviates. Groups are looked for
    among all shots only: the shots that remain after one was left out may differ by what that shot had bent.
    """
    names, counts = np.unique(shot, return_counts=True)
    names = names[counts >= LEAST_OF_SHOT]
    most_deviations = len(names) // 3

    def fit_of(names: NDArray[np.str_]) -> SharedFunctionFit:
        return fit_shared_function(_drawn_colours(rendered, encoded, shot, names))

    deviations = list[Deviation]()
    while len(names) > 1:
        fit = fit_of(names)
        minority = _minority(best_split(len(names), fit.error_saved))
        if not deviations and _is_large(minority) and _are_apart(fit, minority):
            deviation = _deviation(_listed(names[minority].tolist()), fit, minority, linearize)
            if any(deviation.clear):
                first, second = (tuple(str(name) for name in names[rows]) for rows in (~minority, minority))
                return ShotCheck(groups=(ShotGroups(first, second, deviation),))

        if len(deviations) == most_deviations:
            break
        places = np.arange(len(names))
        candidates = places if _is_large(minority) else places[minority]
        outlier = places == max(candidates, key=lambda place: fit.deviation_in_codes(places == place))
        outlier_name = str(names[outlier][0])
        single = _outlier_deviation(outlier_name, fit, outlier, fit_of(names[~outlier]), linearize)
        if single is None:
            break
        deviations.append(single)
        names = names[~outlier]
    return ShotCheck(tuple(deviations))


def _drawn_colours(rendered: Array, encoded: Array, shot: NDArray[np.str_], names: NDArray[np.str_]) -> ComparedColours:
    """The colours of the shots of these names (s,), of each shot as many as are compared."""
    most = min(MOST_OF_SHOT, max(LEAST_OF_SHOT, MOST_TOGETHER // len(names)))
    rng = np.random.default_rng(0)
    drawn = [np.sort(rng.permutation(np.flatnonzero(shot == name))[:most]) for name in names]
    rows = np.concatenate(drawn)
    ends_of_shots = np.cumsum([len(of_shot) for of_shot in drawn])
    return ComparedColours.of(rendered[rows], encoded[rows], np.split(np.arange(len(rows)), ends_of_shots[:-1]))


def _are_apart(fit: SharedFunctionFit, group: Mask) -> bool:
    """True where a group of shots (s,) and the others fit much better apart."""
    together, apart = fit.errors_together_and_apart(group)
    return together > GROUPS_ERROR_RATIO * apart and together - apart > GROUPS_ERROR_SAVED


def _outlier_deviation(
    name: str,
    fit: SharedFunctionFit,
    outlier: Mask,
    fit_without_outlier: SharedFunctionFit,
    linearize: Callable[[Array], Array],
) -> Deviation | None:
    """The deviation of one shot, a mask (s,), from the others; None where it is not clear.

    The others' deviations from each other, in a fit without the shot, are what is usual.
    """
    places = np.arange(len(outlier) - 1)
    singles = [places == place for place in np.random.default_rng(0).permutation(len(places))[:MOST_FOR_SPREAD]]
    usual = float(np.median([fit_without_outlier.deviation_in_codes(single) for single in singles]))
    if fit.deviation_in_codes(outlier) < max(LEAST_DEVIATION, TIMES_USUAL_DEVIATION * usual):
        return None

    of_others = [_deviation("", fit_without_outlier, single, linearize).values for single in singles]
    spread = 1.4826 * np.median(np.abs(of_others), axis=0)  # the standard deviation, by the median
    deviation = _deviation(name, fit, outlier, linearize, spread)
    return deviation if any(deviation.clear) else None


@dataclass(frozen=True, eq=False)
class _ChangeMeter:
    """Measures a change by its effect on the greys and colours of some shots.

    chroma: (n, 3) by how much the shots' colours differ from grey; basis: (n, 3, q) what the numbers of a change add to
    the colours. greys: (g, 3) encoded, over the shots' tones; tones: (g,) their brightness in stops; basis_of_greys:
    (g, 3, q).
    """

    chroma: Array
    basis: Array
    greys: Array
    tones: Array
    basis_of_greys: Array
    linearize: Callable[[Array], Array]

    @classmethod
    def of(cls, rendered: Array, basis: Array, linearize: Callable[[Array], Array]) -> "_ChangeMeter":
        """The meter for rendered colours (n, 3) with the basis of their changes (n, 3, q)."""
        chroma = rendered - rendered.mean(axis=1, keepdims=True)
        darkest, brightest = np.maximum(np.percentile(rendered.mean(axis=1), (10, 90)), DARKEST_GREYS)
        greys = np.repeat(np.linspace(darkest, brightest, GREYS)[:, None], 3, axis=1)
        return cls(chroma, basis, greys, _stops(linearize(greys)), change_basis(greys), linearize)

    @property
    def strength(self) -> float:
        """The sum of squares of what the colours differ from grey by."""
        return max(float(np.sum(self.chroma**2)), LEAST_STRENGTH)

    def values(self, change: Array) -> Array:
        """The difference (3,) of shots with + change (q,) from shots with − change.

        It is of exposure in EV, contrast in EV per EV, and a share of the saturation.
        """
        step = self.basis_of_greys @ change
        brighter, darker = (
            _stops(self.linearize(np.clip(greys, 0.0, 1.0))) for greys in (self.greys + step, self.greys - step)
        )
        contrast, exposure = np.polyfit(self.tones - np.median(self.tones), brighter - darker, 1)
        saturation = float(np.sum(self._moved_colours(change) * self.chroma)) / self.strength
        return np.array([exposure, contrast, saturation])

    def slopes(self, change: Array) -> Array:
        """The derivatives (3, q) of the values by the numbers of a change (q,)."""
        values = self.values(change)
        steps = DERIVATIVE_STEP * np.eye(len(change))
        return np.stack([(self.values(change + step) - values) / DERIVATIVE_STEP for step in steps], axis=1)

    def primaries(self, change: Array, saturation: float) -> float:
        """The share of their strength by which a change (q,) moves colours other than by its change of saturation."""
        remaining = self._moved_colours(change) - saturation * self.chroma
        return float(np.sqrt(np.sum(remaining**2) / self.strength))

    def _moved_colours(self, change: Array) -> Array:
        """The difference (n, 3) of colours with + change (q,) from those with − change, apart from tone."""
        return np.asarray(2.0 * (self.basis[..., TONES:] @ change[TONES:]))


def _stops(linear: Array) -> Array:
    """The brightness of linear colours (m, 3) → (m,), in stops."""
    return np.asarray(np.log2(np.maximum(linear.sum(axis=1), DARKEST_LINEAR)))


def _deviation(
    name: str,
    fit: SharedFunctionFit,
    group: Mask,
    linearize: Callable[[Array], Array],
    spread: Array | float = 0.0,
) -> Deviation:
    """Measure how the shots of a group (s,) deviate from the others. spread: (3,), of other shots' values."""
    change = fit.fitted_change(group)
    rows = fit.colours.rows(group)
    meter = _ChangeMeter.of(fit.colours.rendered[rows], fit.colours.basis[rows], linearize)
    values = meter.values(change.numbers)

    # Variances by the scores of groups of hue, corrected for the number of groups and of samples
    by_hue_group = meter.slopes(change.numbers) @ change.inverse @ fit.scores(change, HUE_GROUPS)
    within = np.square(by_hue_group).sum(axis=1) * HUE_GROUPS / (HUE_GROUPS - 1)
    errors = np.hypot(np.sqrt(within * len(rows) / (len(rows) - len(change.numbers))), spread)

    least = np.array([LEAST_EXPOSURE, LEAST_CONTRAST, LEAST_SATURATION])
    clear = (np.abs(values) > least) & (np.abs(values) > CLEAR_STANDARD_ERRORS * errors)
    primaries = meter.primaries(change.numbers, float(values[2]))
    return Deviation(name, tuple(values.tolist()), tuple(errors.tolist()), tuple(clear.tolist()), primaries)
