"""Comparison of the shots of a style: which the camera rendered otherwise than the rest, and how.

What JPEG values differ by from those that the base renders of their RAW is a smooth function of colour, the same for
all shots, since the gamut map is fixed (`shared_function`). To it each shot, or each of two groups of shots, may add a
change: of the tone of each channel (three numbers) and of what differs from grey (a matrix). The sum of squares that a
change saves states how much better shots fit apart. Shots with few tones in common are compared as well as others,
since the function joins them.

Of all divisions of the shots into two groups, the one that fits best is judged by a single measure: how far the groups
are apart, compared with how far single shots are from others of their own group. Where they are not apart, the single
shot that fits best apart is judged in the same way. What is found has to hold on the colours that both sides show:
nothing tells a change of other colours from what the function does there. A third of the shots or fewer deviate from
the others; of larger groups nothing says which is right.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from lutforge.arrays import Array, Mask
from lutforge.calibration.deviations import QUANTITIES, Deviation, listed, measured_deviations
from lutforge.calibration.lattice.monochrome import is_monochrome
from lutforge.calibration.matrix_and_response import MatrixAndResponse
from lutforge.calibration.shared_function import (
    CODE,
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
LEAST_SAMPLES_OF_SHOT = 20
"""Shots with fewer samples are not compared."""
COMMON_DISTANCE = 0.1
"""Colours of two groups are common if they are so near, in rendered values."""

USUAL_DIFFERENCE = 1.9
"""Codes that sound shots differ by from each other beforehand, between the 0.5 of most cameras and the 2.2 of the
roughest one measured. It counts as much as one difference that was measured."""
USUAL_DIFFERENCE_OF_HUE = 0.5
"""Codes that sound shots differ by beforehand, where a turn of hue is the only change: 1.9 / √15, since a change of all
kinds has 15 numbers, which differ independently."""
LEAST_DIFFERENCE = 1.6
"""Groups are apart only if they differ by so many codes."""
TIMES_USUAL_DIFFERENCE = 1.9
"""Groups are apart only if they differ by so many times what is usual."""
SURE_OF_GROUP = 1.0
"""A shot is surely of its group if the other group fits it worse by so many times what is usual."""

WITHOUT_COLOUR = 2.0 * CODE
"""Channels of a black-and-white picture differ by at most this, but for a twentieth of it."""

ADVICE = "shoot in manual mode with one picture style, scene-dependent features (D-Lighting, HDR, auto tone) off"


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
        either = f"; {listed(self.either)} may be of either" if self.either else ""
        return Diagnosis(
            "the shots are of two groups that the camera rendered in two ways",
            f"{listed(self.second)} differ from {listed(self.first)}: {self.deviation.words}{either}",
            "calibrate from one group alone, or give the groups two names of styles",
        )


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
            in_agreement = ~np.isin(shot, [deviation.shot for deviation in colourless.deviations])
            rendered = base.render(balanced[in_agreement])
            linearize = base.response.linearize
            compared = compare_shots(
                rendered, encoded[in_agreement], shot[in_agreement], linearize, balances_known=known
            )
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

    if _is_large(_minority(grey)):
        first, second = (tuple(str(name) for name in names[rows]) for rows in (~grey, grey))
        return ShotCheck(groups=(ShotGroups(first, second, _black_and_white(listed(second))),))
    if 2 * np.count_nonzero(grey) <= len(grey):
        return ShotCheck(tuple(_black_and_white(str(name)) for name in names[grey]))
    return ShotCheck(tuple(_in_colour(str(name)) for name in names[~grey]))


def _black_and_white(shot: str) -> Deviation:
    """The deviation of a black-and-white shot from shots with colour."""
    return _of_saturation(shot, -1.0, without_colour=True)


def _in_colour(shot: str) -> Deviation:
    """The deviation of a shot with colour from black-and-white shots."""
    return _of_saturation(shot, 1.0, without_colour=False)


def _of_saturation(shot: str, change: float, *, without_colour: bool) -> Deviation:
    """A deviation of nothing but the saturation."""
    values = tuple(change if name == "saturation" else 0.0 for name in QUANTITIES)
    clear = tuple(name == "saturation" for name in QUANTITIES)
    return Deviation(shot, values, (0.0,) * len(QUANTITIES), clear, 0.0, without_colour)


def _minority(group: Mask) -> Mask:
    """The smaller of two groups of shots, of which one is a mask (s,)."""
    return group if 2 * np.count_nonzero(group) <= len(group) else ~group


def _is_large(minority: Mask) -> bool:
    """True where a minority is more than a third of the shots (s,): then it is not known which of them are right."""
    return bool(3 * np.count_nonzero(minority) > len(minority))


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
    tint is the rendering's. At most a third of the shots deviates. Groups are looked for among all shots only: the
    shots that remain after one was left out may differ by what that shot had bent.
    """
    by_all_changes = _compare_shots_by(_ALL_CHANGES, rendered, encoded, shot, linearize, balances_known)
    if by_all_changes.deviations or by_all_changes.groups:
        return by_all_changes
    return _compare_shots_by(_HUE_ALONE, rendered, encoded, shot, linearize, balances_known)


@dataclass(frozen=True)
class _Changes:
    """The changes by which shots are compared.

    of: the colours, with the basis of these changes. usual_difference: codes that sound shots differ by beforehand.
    least_of_sure: codes that a shot is surely of its group by, at least. unsure_are_either: whether shots that fit both
    groups may be of the smaller one.
    """

    of: Callable[[ComparedColours], ComparedColours]
    usual_difference: float
    least_of_sure: float
    unsure_are_either: bool


_ALL_CHANGES = _Changes(lambda colours: colours, USUAL_DIFFERENCE, 0.0, unsure_are_either=False)
_HUE_ALONE = _Changes(ComparedColours.by_hue, USUAL_DIFFERENCE_OF_HUE, LEAST_DIFFERENCE, unsure_are_either=True)
"""Shots that show few strong colours fit any turn of hues."""


def _compare_shots_by(
    changes: _Changes,
    rendered: Array,
    encoded: Array,
    shot: NDArray[np.str_],
    linearize: Callable[[Array], Array],
    balances_known: bool,
) -> ShotCheck:
    """Compare shots by some changes, as `compare_shots` does by all."""
    names, counts = np.unique(shot, return_counts=True)
    names = names[counts >= LEAST_SAMPLES_OF_SHOT]
    most_deviations = len(names) // 3
    deviations = list[Deviation]()
    while len(names) > 1:
        colours = _drawn_colours(rendered, encoded, shot, names, tinted=balances_known)
        comparison = _Comparison(fit_shared_function(changes.of(colours)), changes)
        split = comparison.groups_apart()
        if split is None:
            break
        unsure = comparison.unsure(split)
        few, others = split & ~unsure, ~split & ~unsure
        if not (few.any() and others.any()):
            break

        smaller = few | unsure if changes.unsure_are_either else few[~unsure]
        if not _is_large(smaller) and np.count_nonzero(few) <= most_deviations - len(deviations):
            # Only what has a standard error leaves a shot out; primaries have none.
            measured = measured_deviations(names.tolist(), comparison.fit, _singles(few), linearize)
            clear = [deviation for deviation in measured if any(deviation.clear)]
            if not clear:
                break
            deviations += clear
            names = np.setdiff1d(names, [deviation.shot for deviation in clear])
        else:
            (deviation,) = measured_deviations(names.tolist(), comparison.fit, [split], linearize)
            if deviations or not deviation.is_known:
                break
            first, second, either = (tuple(str(name) for name in names[rows]) for rows in (others, few, unsure))
            return ShotCheck(groups=(ShotGroups(first, second, deviation, either),))
    return ShotCheck(tuple(deviations))


@dataclass(frozen=True, eq=False)
class _Comparison:
    """A comparison of shots by some changes, and the fit of these."""

    fit: SharedFunctionFit
    changes: _Changes

    def groups_apart(self) -> Mask | None:
        """The smaller (s,) of two groups of shots that are apart, or a single shot that is; None where none is."""
        count = len(self.fit.colours.rows_of_shots)
        smaller = _minority(best_split(count, self.fit.error_saved))
        single = max(_singles(np.ones(count, dtype=np.bool_)), key=self.fit.error_saved)
        return next((group for group in (smaller, single) if self._are_apart(group)), None)

    def unsure(self, group: Mask) -> Mask:
        """The shots (s,) that fit a group (s,) about as well as the others."""
        saved = self.fit.error_saved(group)
        least = max(self.changes.least_of_sure, SURE_OF_GROUP * self._usual_difference(group))
        return np.array(
            [
                self.fit.difference_in_codes(saved - self.fit.error_saved(group ^ single), single, ~single) < least
                for single in _singles(np.ones(len(group), dtype=np.bool_))
            ]
        )

    def _are_apart(self, group: Mask) -> bool:
        """True where a group of shots (s,) is far from the others, compared with how far single shots usually are.

        By the colours that both show it has to be farther than usual, too: strong colours may be missing among these.
        """
        usual = self._usual_difference(group)
        if _difference(self.fit, group) <= max(LEAST_DIFFERENCE, TIMES_USUAL_DIFFERENCE * usual):
            return False
        common, enough = self.fit.colours.common(group, COMMON_DISTANCE, LEAST_SAMPLES_OF_SHOT)
        remaining = group[enough]
        if remaining.all() or not remaining.any():
            return False
        return _difference(fit_shared_function(common), remaining) > max(LEAST_DIFFERENCE, usual)

    def _usual_difference(self, group: Mask) -> float:
        """How far single shots are from the others of their own side, a group of shots (s,) or not, in codes.

        The median of the shots, and what is usual beforehand as one more difference to those within groups.
        """
        saved = self.fit.error_saved(group)
        differences = []
        for single in _singles(np.ones(len(group), dtype=np.bool_)):
            others = (group == group[single]) & ~single
            if others.any():
                further = self.fit.error_saved(group, single) - saved
                differences.append(self.fit.difference_in_codes(further, single, others))
        within = len(group) - 2
        squared = within * float(np.median(differences)) ** 2 if differences else 0.0
        return float(np.sqrt((self.changes.usual_difference**2 + squared) / (1 + within)))


def _difference(fit: SharedFunctionFit, group: Mask) -> float:
    """How far a group of shots (s,) is from the others, in codes."""
    return fit.difference_in_codes(fit.error_saved(group), group, ~group)


def _singles(shots: Mask) -> list[Mask]:
    """A group (s,) of its own for each of some shots (s,)."""
    return [np.arange(len(shots)) == place for place in np.flatnonzero(shots)]


def _drawn_colours(
    rendered: Array, encoded: Array, shot: NDArray[np.str_], names: NDArray[np.str_], *, tinted: bool
) -> ComparedColours:
    """The colours of the shots of these names (s,), of each shot as many as are compared."""
    most = min(MOST_OF_SHOT, max(LEAST_SAMPLES_OF_SHOT, MOST_TOGETHER // len(names)))
    rng = np.random.default_rng(0)
    drawn = [np.sort(rng.permutation(np.flatnonzero(shot == name))[:most]) for name in names]
    rows = np.concatenate(drawn)
    ends_of_shots = np.cumsum([len(of_shot) for of_shot in drawn])
    rows_of_shots = np.split(np.arange(len(rows)), ends_of_shots[:-1])
    return ComparedColours.of(rendered[rows], encoded[rows], rows_of_shots, partial(change_basis, tinted=tinted))
