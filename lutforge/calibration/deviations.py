"""Deviations: how a shot, or a group of shots, was rendered otherwise than the others, in the words of photographers.

A fitted change (`shared_function`) is measured by its effect on greys and colours of the shots: exposure, contrast,
saturation, the tint of greys, hue, and what it moves besides. Standard errors come from the residuals of the fit.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from lutforge.arrays import Array, Mask
from lutforge.calibration.shared_function import MATRIX_TERMS, ComparedColours, SharedFunctionFit, turn_basis

QUANTITIES = ("exposure", "contrast", "saturation", "red", "blue", "hue")
COLUMNS = ("exposure, EV", "contrast", "saturation", "red, EV", "blue, EV", "hue, °")
"""What is measured of a deviation; red and blue are those of the white balance, compared with green; hue is the angle
from red to green by which all hues are turned."""
LEAST_DEVIATION = np.array([0.1, 0.06, 0.12, 0.08, 0.08, 4.0])
"""A quantity deviates clearly only by this: EV, EV per EV, share of the saturation, EV, EV, degrees."""
CLEAR_STANDARD_ERRORS = 4.0
"""A quantity deviates clearly only by so many standard errors."""
HUE_GROUPS = 5
"""Errors of similar colours of a shot are alike: standard errors come from its residuals by groups of hue (Liang &
Zeger 1986, https://doi.org/10.1093/biomet/73.1.13)."""
OTHER_PRIMARIES = 0.12
"""Share of the colours' strength from which on primaries are named."""

DARKEST_LINEAR = 1e-6
"""Smaller linear values are raised to this before a logarithm."""
DARKEST_GREYS = (0.04, 0.08)
"""The darkest grey that a change is measured at is no darker than the first, and the brightest than the second."""
MEASURED_GREYS = 9
"""The number of greys that a change is measured at."""
CHANGE_STEP = 1e-4
"""Step of a numerical derivative by a number of a change."""
LEAST_STRENGTH = 1e-12
"""Least sum of squares of what differs from grey, so that nothing is divided by 0 where all colours are grey."""


@dataclass(frozen=True)
class Deviation:
    """The deviation of a shot, or of a group of shots, from the others.

    values, errors: exposure in EV, contrast in EV per EV, change of saturation, red and blue of greys compared with
    green in EV, turn of hues in degrees, and their standard errors; clear: which of them are beyond chance. primaries:
    the share of their strength by which colours deviate besides. without_colour: the shot is black and white, and
    others are not.
    """

    shot: str
    values: tuple[float, ...]
    errors: tuple[float, ...]
    clear: tuple[bool, ...]
    primaries: float = 0.0
    without_colour: bool = False

    @property
    def is_known(self) -> bool:
        """True where it is known what deviates."""
        return any(self.clear) or self.primaries > OTHER_PRIMARIES or self.without_colour

    @property
    def cells(self) -> tuple[str, ...]:
        """The values as cells of a table, under `COLUMNS`."""
        return tuple(f"{value:+.2f} ± {error:.2f}" for value, error in zip(self.values, self.errors, strict=True))

    @property
    def words(self) -> str:
        """The quantities that deviate clearly, in words, with standard errors."""
        if self.without_colour:
            return "black and white"
        shown = []
        for name, value, error, clear in zip(QUANTITIES, self.values, self.errors, self.clear, strict=True):
            if not clear:
                continue
            match name:
                case "contrast" | "saturation":
                    number = f"{value:+.0%} ± {error:.0%}"
                case "hue":
                    number = f"{value:+.0f}° ± {error:.0f}°"
                case _:
                    number = f"{value:+.2f} ± {error:.2f} EV"
            shown.append(f"white balance: {name} {number}" if name in ("red", "blue") else f"{name} {number}")
        if self.primaries > OTHER_PRIMARIES and not self.clear[-1]:  # which a turn of hues moves as far
            shown.append("primaries")
        return ", ".join(shown) or "tones and colours"


def listed(shots: Sequence[str], most: int = 12) -> str:
    """Names of shots in words."""
    more = f" and {len(shots) - most} more" if len(shots) > most else ""
    return ", ".join(shots[:most]) + more


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
    def of(cls, colours: ComparedColours, group: Mask, linearize: Callable[[Array], Array]) -> "_ChangeMeter":
        """The meter for the colours of a group of shots (s,)."""
        rows = colours.rows(group)
        rendered, basis = colours.rendered[rows], colours.basis[rows]
        chroma = rendered - rendered.mean(axis=1, keepdims=True)
        darkest, brightest = np.maximum(np.percentile(rendered.mean(axis=1), (10, 90)), DARKEST_GREYS)
        greys = np.repeat(np.linspace(darkest, brightest, MEASURED_GREYS)[:, None], 3, axis=1)
        tones = _stops(linearize(greys).sum(axis=1))
        return cls(chroma, basis, greys, tones, colours.change(greys), linearize)

    @property
    def strength(self) -> float:
        """The sum of squares of what the colours differ from grey by."""
        return max(float(np.sum(self.chroma**2)), LEAST_STRENGTH)

    def values(self, change: Array) -> Array:
        """How shots with + change (q,) differ from shots with − change (6,): the values of a `Deviation`."""
        step = self.basis_of_greys @ change
        more, less = (self.linearize(np.clip(greys, 0.0, 1.0)) for greys in (self.greys + step, self.greys - step))
        brighter = _stops(more.sum(axis=1)) - _stops(less.sum(axis=1))
        contrast, exposure = np.polyfit(self.tones - np.median(self.tones), brighter, 1)
        saturation, turn = (float(share) for share in self._saturation_and_turn(self._moved_colours(change)))
        red, green, blue = (_stops(more) - _stops(less)).mean(axis=0)
        return np.array([exposure, contrast, saturation, red - green, blue - green, np.degrees(turn)])

    def slopes(self, change: Array) -> Array:
        """The derivatives (6, q) of the values by the numbers of a change (q,)."""
        values = self.values(change)
        steps = CHANGE_STEP * np.eye(len(change))
        return np.stack([(self.values(change + step) - values) / CHANGE_STEP for step in steps], axis=1)

    def primaries(self, change: Array, saturation: float) -> float:
        """The share of their strength by which a change (q,) moves colours other than by its change of saturation."""
        remaining = self._moved_colours(change) - saturation * self.chroma
        return float(np.sqrt(np.sum(remaining**2) / self.strength))

    def _saturation_and_turn(self, moved: Array) -> Array:
        """The share of saturation and the angle in radians (2,) that explain most of how colours (n, 3) are moved."""
        turned = turn_basis(self.chroma)[..., 0]  # as long as the chroma and at right angles to it
        return np.array([np.sum(moved * self.chroma), np.sum(moved * turned)]) / self.strength

    def _moved_colours(self, change: Array) -> Array:
        """How far (n, 3) colours with + change (q,) are from those with − change, apart from tone.

        A change of hue alone has no numbers of tone.
        """
        return np.asarray(2.0 * (self.basis[..., -MATRIX_TERMS:] @ change[-MATRIX_TERMS:]))


def _stops(linear: Array) -> Array:
    """Linear values of any shape in stops."""
    return np.asarray(np.log2(np.maximum(linear, DARKEST_LINEAR)))


def measured_deviations(
    names: Sequence[str], fit: SharedFunctionFit, groups: Sequence[Mask], linearize: Callable[[Array], Array]
) -> list[Deviation]:
    """Measure how the shots of each of some groups (s,) deviate from the shots of none. names: of all shots."""
    changes = fit.fitted_changes(*groups)
    scores = fit.scores(changes, HUE_GROUPS)
    rows_of_inverse = np.split(changes.inverse, len(groups))
    deviations = []
    for group, change, inverse in zip(groups, changes.numbers, rows_of_inverse, strict=True):
        meter = _ChangeMeter.of(fit.colours, group, linearize)
        values = meter.values(change)

        # Variances by the scores of groups of hue, corrected for their number
        by_hue_group = meter.slopes(change) @ inverse @ scores
        errors = np.sqrt(np.square(by_hue_group).sum(axis=1) * HUE_GROUPS / (HUE_GROUPS - 1))

        # A turn of hues is sure only by itself: among other numbers it may be a part of other primaries.
        sure = [True] * (len(values) - 1) + [fit.colours.change is turn_basis]
        clear = (np.abs(values) > LEAST_DEVIATION) & (np.abs(values) > CLEAR_STANDARD_ERRORS * errors) & sure
        deviations.append(
            Deviation(
                listed([names[place] for place in np.flatnonzero(group).tolist()]),
                tuple(values.tolist()),
                tuple(errors.tolist()),
                tuple(clear.tolist()),
                meter.primaries(change, float(values[2])),
            )
        )
    return deviations
