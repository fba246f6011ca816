"""Shots that the camera rendered otherwise than the rest: their exposure, contrast and saturation beside the others'.

The light that a JPEG value tells, by matrix and response, is compared with the light of its RAW value. What the two
differ by is a smooth function of colour for all shots, since the gamut map is fixed, and this function is fitted and
taken out. What is left of a shot is measured in five groups of its colours, by hue; their mean and spread are the
departure and its standard error, which errors that are alike among similar colours do not make too small (Ibragimov &
Müller 2010, https://doi.org/10.1198/jbes.2009.08046). The shot that departs most is left out, and the others are
compared again, until none departs clearly.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lutforge.arrays import Array, Mask
from lutforge.calibration.lattice.monochrome import is_monochrome
from lutforge.calibration.physical.matrix_and_response import fit_matrix_and_response
from lutforge.samples.sample_set import SampleSet
from lutforge.solvers.robust_weights import RobustWeights, cauchy

GROUPS = 5
CLEARLY = 5.0
"""A shot departs if it is so many standard errors off: with four degrees of freedom, one in 130 shots by chance alone.
The spread between the shots is added to the error, which makes it far fewer."""
LEAST = (0.1, 0.08, 0.1)
"""Departures of less stay: exposure in EV, contrast in EV per EV, and the change of saturation."""
ADVICE = "shoot in manual mode with one picture style, scene-dependent features (D-Lighting, HDR, auto tone) off"


@dataclass(frozen=True)
class Departure:
    """How one shot departs from the others. values, errors: exposure, contrast, saturation, and standard errors."""

    shot: str
    values: tuple[float, float, float]
    errors: tuple[float, float, float]
    clear: tuple[bool, bool, bool]

    @property
    def cells(self) -> tuple[str, ...]:
        """Exposure, contrast and saturation as cells of a table."""
        return tuple(f"{value:+.2f} ± {error:.2f}" for value, error in zip(self.values, self.errors, strict=True))

    @property
    def words(self) -> str:
        """What departs clearly, with standard errors."""
        parts = zip(("exposure", "contrast", "saturation"), self.values, self.errors, self.clear, strict=True)
        shown = (
            f"{name} {value:+.2f} ± {error:.2f} EV" if name == "exposure" else f"{name} {value:+.0%} ± {error:.0%}"
            for name, value, error, clear in parts
            if clear
        )
        return ", ".join(shown)


def departure_notes(departures: tuple[Departure, ...]) -> tuple[str, ...]:
    """A sentence on the shots that depart; none where there are none."""
    if not departures:
        return ()
    listed = ", ".join(f"{departure.shot} ({departure.words})" for departure in departures[:4])
    more = f" and {len(departures) - 4} more" if len(departures) > 4 else ""
    return (f"shots depart from what the others agree on and are left out, {listed}{more}: {ADVICE}",)


def departing_shots(samples: SampleSet, multipliers: Array, usable: Mask) -> tuple[Departure, ...]:
    """Return the shots of all styles that depart clearly from the others of their style.

    multipliers: (n, 3), what makes RAW white-balanced; usable: (n,) unclipped samples.
    """
    found: list[Departure] = []
    for style in np.unique(samples.style[usable]):
        rows = usable & (samples.style == style)
        balanced, encoded = samples.raw[rows] * multipliers[rows], samples.srgb[rows]
        if len(np.unique(samples.shot[rows])) < 3 or is_monochrome(balanced, encoded):
            continue
        fit = fit_matrix_and_response(balanced, encoded)
        found.extend(find_departures(fit.linearize(encoded), balanced, samples.shot[rows]))
    return tuple(found)


def find_departures(linear: Array, balanced: Array, shot: NDArray[np.str_]) -> tuple[Departure, ...]:
    """Return the shots that depart clearly, the farthest first; at most half of them, none of fewer than three.

    linear: (n, 3) the white-balanced RAW that matrix and response, or a profile, make of the JPEG values; balanced:
    (n, 3) the RAW itself, neither clipped; shot: (n,) names.
    """
    found: list[Departure] = []
    names = np.unique(shot)
    while len(names) - len(found) >= 3 and len(found) < (len(names) - 1) // 2:
        rows = ~np.isin(shot, [departure.shot for departure in found])
        worst, strength = None, 0.0
        for departure, ratio in _departures(linear[rows], balanced[rows], shot[rows]):
            if any(departure.clear) and ratio > strength:
                worst, strength = departure, ratio
        if worst is None:
            break
        found.append(worst)
    return tuple(found)


def _departures(linear: Array, balanced: Array, shot: NDArray[np.str_]) -> list[tuple[Departure, float]]:
    """All shots with enough colours, and by how many standard errors each departs."""
    light, lit = np.maximum(linear.sum(axis=1), 0.0) + 1e-3, np.maximum(balanced.sum(axis=1), 0.0) + 1e-3
    chroma = balanced / lit[:, None] - 1 / 3
    shown = linear / light[:, None] - 1 / 3
    tone = np.log2(lit)
    tone = tone - np.median(tone)
    coordinates = np.column_stack([np.ones_like(tone), tone / 2, 3 * chroma[:, 0], 3 * chroma[:, 2]])
    design = np.stack([coordinates[:, i] * coordinates[:, j] for i in range(4) for j in range(i, 4)], axis=1)
    strength = np.linalg.norm(chroma, axis=1)
    livelier = np.einsum("nc,nc->n", shown, chroma) / np.maximum(strength, 1e-6) - strength
    residual = np.column_stack([_without_common(design, np.log2(light / lit)), _without_common(design, livelier)])
    hue = np.arctan2(chroma[:, 2], chroma[:, 0])
    names, values, errors = [], [], []
    for name in np.unique(shot):
        rows = np.flatnonzero(shot == name)
        if len(rows) < 4 * GROUPS:
            continue
        groups = np.array_split(rows[np.argsort(hue[rows])], GROUPS)
        told = np.array([_of_group(residual[part], tone[part], strength[part]) for part in groups])
        names.append(str(name))
        values.append(np.median(told, axis=0))
        errors.append(told.std(axis=0, ddof=1) / np.sqrt(GROUPS))
    if len(names) < 3:
        return []
    value, error = np.array(values), np.array(errors)
    value = value - np.median(value, axis=0)
    between = 1.4826 * np.median(np.abs(value), axis=0)
    ratio = np.abs(value) / np.hypot(error, between)
    clear = (ratio > CLEARLY) & (np.abs(value) > LEAST)
    departures = []
    for row, name in enumerate(names):
        (a, b, c), (d, e, f) = value[row].tolist(), np.hypot(error, between)[row].tolist()
        exposure, contrast, saturation = clear[row].tolist()
        told_of = Departure(name, (a, b, c), (d, e, f), (exposure, contrast, saturation))
        departures.append((told_of, float(np.max(ratio[row] * clear[row]))))
    return departures


def _without_common(design: Array, values: Array) -> Array:
    """What a robust fit of a function of colour leaves of values (n,)."""
    weight, robust, left = np.ones(len(values)), RobustWeights(cauchy, multiple=2.5, least=0.02), values
    for _ in range(8):
        weighted = design * weight[:, None]
        normal = weighted.T @ design + 1e-6 * len(values) * np.eye(design.shape[1])
        left = values - design @ np.linalg.solve(normal, weighted.T @ values)
        weight = robust(np.abs(left))
    return left


def _of_group(residual: Array, tone: Array, strength: Array) -> tuple[float, float, float]:
    """Exposure, contrast and saturation of a group of colours."""
    around = tone - np.median(tone)
    middle = float(np.median(residual[:, 0]))
    contrast = float(around @ (residual[:, 0] - middle) / (around @ around + 1.0))
    saturation = float(strength @ residual[:, 1] / (strength @ strength + 1e-3))
    return middle, contrast, saturation
