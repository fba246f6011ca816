"""Shots that the camera rendered otherwise than the rest: their exposure, contrast and saturation beside the others'.

The light that a JPEG value tells, by matrix and response, is compared with the light of its RAW value. What the two
differ by is a smooth function of colour for all shots, since the gamut map is fixed, plus an exposure, a contrast and a
saturation of each shot; all are fitted together, robustly, so that no shot bends what it is compared with. Errors of
similar colours of a shot are alike: its residuals by five groups of hue tell the standard errors (Liang & Zeger 1986,
https://doi.org/10.1093/biomet/73.1.13), to which the spread between the shots is added. The shot that departs most is
left out, and the others are compared again, until none departs clearly.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lutforge.arrays import Array, Mask
from lutforge.calibration.lattice.monochrome import is_monochrome
from lutforge.calibration.matrix_and_response import fit_matrix_and_response
from lutforge.samples.sample_set import SampleSet
from lutforge.solvers.robust_weights import RobustWeights, cauchy

GROUPS = 5
ROBUST = RobustWeights(cauchy, multiple=2.5, least=0.02)
DARK = 1e-3
"""Light is compared with this added, so that black has a logarithm."""
PRIOR = 0.1
"""Standard deviation of a shot's exposure, contrast and saturation beforehand: it tells them from the shared function
where only shots of other tones could tell."""
CLEARLY = 3.5
"""A shot departs if it is so many standard errors off: of 600 shots of fixed cameras, those beyond LEAST are off by up
to 2.2, each of 57 with a γ of 0.85 (S40, five shots; simulated camera, 15) or 0.93 (the latter) by 3.7 or more."""
LEAST = (0.1, 0.08, 0.12)
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
    order = np.argsort(shot, kind="stable")
    linear, balanced = linear[order], balanced[order]
    names, starts, member = np.unique(shot[order], return_index=True, return_inverse=True)
    light, lit = np.maximum(linear.sum(axis=1), 0.0) + DARK, np.maximum(balanced.sum(axis=1), 0.0) + DARK
    chroma = balanced / lit[:, None] - 1 / 3
    shown = linear / light[:, None] - 1 / 3
    tone = np.log2(lit)
    around = tone - np.array([np.median(part) for part in np.split(tone, starts[1:])])[member]
    coordinates = np.column_stack(
        [np.ones_like(tone), (tone - np.median(tone)) / 2, 3 * chroma[:, 0], 3 * chroma[:, 2]]
    )
    design = np.stack([coordinates[:, i] * coordinates[:, j] for i in range(4) for j in range(i, 4)], axis=1)
    strength = np.linalg.norm(chroma, axis=1)
    livelier = np.einsum("nc,nc->n", shown, chroma) / np.maximum(strength, 1e-6) - strength
    hue = np.arctan2(chroma[:, 2], chroma[:, 0])
    exposed = _by_shot(design, np.column_stack([np.ones_like(tone), around]), starts, member, np.log2(light / lit), hue)
    saturated = _by_shot(design, strength[:, None], starts, member, livelier, hue)
    value, error = (np.hstack(pair) for pair in zip(exposed, saturated, strict=True))
    enough = np.bincount(member) >= 4 * GROUPS
    if np.count_nonzero(enough) < 3:
        return []
    names, value, error = names[enough], value[enough] - np.median(value[enough], axis=0), error[enough]
    between = len(names) / (len(names) - 1) * 1.4826 * np.median(np.abs(value), axis=0)
    error = np.hypot(error, between)
    ratio = np.abs(value) / error
    clear = (ratio > CLEARLY) & (np.abs(value) > LEAST)
    departures = []
    for row, name in enumerate(names):
        (a, b, c), (d, e, f) = value[row].tolist(), error[row].tolist()
        exposure, contrast, saturation = clear[row].tolist()
        departure = Departure(str(name), (a, b, c), (d, e, f), (exposure, contrast, saturation))
        departures.append((departure, float(np.max(ratio[row] * clear[row]))))
    return departures


def _by_shot(
    design: Array, terms: Array, starts: NDArray[np.intp], member: NDArray[np.intp], values: Array, hue: Array
) -> tuple[Array, Array]:
    """Coefficients (s, k) that each shot has of terms (n, k), beside a shared function of colour, and their errors.

    design: (n, p) of that function; starts, member: where the rows of each of the s shots begin, and (n,) each row's
    shot; values: (n,), what is fitted; hue: (n,).
    """
    weight, left = np.ones(len(values)), values
    for _ in range(8):
        # The shots' coefficients are eliminated: what is left is a problem of the shared function alone.
        weighted, mine = design * weight[:, None], terms * weight[:, None]
        prior = np.average(left**2, weights=weight) / PRIOR**2 + 1e-9
        normal = np.add.reduceat(mine[:, :, None] * terms[:, None], starts) + prior * np.eye(terms.shape[1])
        inverse = np.linalg.inv(normal)
        cross = np.add.reduceat(weighted[:, :, None] * terms[:, None], starts)
        right = np.add.reduceat(mine * values[:, None], starts)
        eliminated = cross @ inverse
        shared = np.linalg.solve(
            weighted.T @ design
            - np.einsum("spk,sqk->pq", eliminated, cross)
            + 1e-6 * len(values) * np.eye(len(design.T)),
            weighted.T @ values - np.einsum("spk,sk->p", eliminated, right),
        )
        coefficients = np.einsum("skl,sl->sk", inverse, right - shared @ cross)
        left = values - design @ shared - np.einsum("nk,nk->n", terms, coefficients[member])
        weight = ROBUST(np.abs(left))
    errors = np.zeros_like(coefficients)
    for place, rows in enumerate(np.split(np.arange(len(values)), starts[1:])):
        groups = np.array_split(rows[np.argsort(hue[rows])], GROUPS)
        scores = np.array([terms[part].T @ (weight[part] * left[part]) for part in groups]) @ inverse[place]
        errors[place] = np.sqrt(np.square(scores).sum(axis=0) * GROUPS / (GROUPS - 1))
    return coefficients, errors
