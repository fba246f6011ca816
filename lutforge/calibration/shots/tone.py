"""Finds shots whose tone the camera changed: their exposure, a global curve, and a part that varies over the picture.

Where the rendering is fixed, the light of the scene is a smooth function of the JPEG's colour, a Gaussian process (see
`departures`). Each shot is predicted by the others. The prediction without a group has a closed form, which also gives
the covariance of its errors (Rasmussen & Williams 2006, section 5.4.2, https://doi.org/10.7551/mitpress/3206.001.0001).
Colours that no other shot shows are uncertain, and errors of similar colours are correlated. Every shot of a fixed
camera may depart by a few per cent at some colours.

The departure of a shot is fitted by generalized least squares, first with columns of tone, then with columns of place
and tone. Each fit is tested by χ², with one false-alarm rate for all shots of a style together (Bonferroni).
Covariances are scaled by the median misfit of the shots.

A shot that departs spoils the prediction of the others. So the most significant departure is modelled first, and all
shots are tested again, until no further one is significant (forward search; Hadi & Simonoff 1993,
https://doi.org/10.1080/01621459.1993.10476407).
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import solve_triangular
from scipy.special import chdtrc

from lutforge.arrays import Array, Mask
from lutforge.calibration.shots.departures import (
    Cells,
    Departure,
    cells_of,
    covariance_of,
    departures_of,
    light_of,
    own_covariance,
)
from lutforge.errors import CalibrationError
from lutforge.model.shot_tone import ShotTone, place_basis, tone_basis
from lutforge.samples.sample_set import SampleSet
from lutforge.solvers.blas import one_blas_thread

LEAST_EV = 0.08
"""Departures of less stay, a quarter of the steps in which cameras expose."""
MANUAL_MODE = "shoot in manual mode with one picture style, scene-dependent features (D-Lighting, HDR, auto tone) off"


def shot_tones(samples: SampleSet, multipliers: Array, usable: Mask) -> tuple[ShotTone, ...]:
    """Return the significant departures of shots, of all styles.

    multipliers: (n, 3), what makes RAW white-balanced; usable: (n,) unclipped samples.
    Raises CalibrationError where a style has two shots only and they contradict each other.
    """
    found: list[ShotTone] = []
    for name in np.unique(samples.style[usable]):
        mine = usable & (samples.style == name)
        cells = cells_of(samples.select(mine), multipliers[mine])
        if len(cells.names) < 2:
            continue
        tones = _search(cells, str(name))
        if len(cells.names) == 2 and tones:
            if max(abs(tone.stops) for tone in tones) > 0.3:
                raise CalibrationError(
                    f'style "{name}": its two shots contradict each other ({tones[0].shot}: {tones[0].words}): '
                    f"{MANUAL_MODE}, or add shots"
                )
            continue  # either may be the one that departs
        found.extend(tones)
    return tuple(found)


def tones_beside(
    linearize: Mapping[str, Callable[[Array], Array]], samples: SampleSet, multipliers: Array, usable: Mask
) -> tuple[ShotTone, ...]:
    """Return the significant departures of shots from a calibrated rendering that was not fitted to them.

    linearize: by style, the function I → Tw E. The uncertainty of the calibration is taken for twice the variance by
    which any shot departs.
    """
    found: list[ShotTone] = []
    for name in np.unique(samples.style[usable & np.isin(samples.style, list(linearize))]):
        mine = usable & (samples.style == name)
        cells = cells_of(samples.select(mine), multipliers[mine])
        light = np.maximum(linearize[str(name)](cells.encoded).sum(axis=1), 1e-5)
        error = np.log2(light) - np.log2(1e-4 + light_of(cells.encoded)) - cells.y
        covariance = 3.0 * own_covariance(cells) + np.diag(cells.scatter)
        fits = []
        for place in range(len(cells.names)):
            member = cells.shot == place
            fits.append(_fit(cells, Departure(error[member], covariance[np.ix_(member, member)], member)))
        found.extend(_significant(cells, str(name), fits).values())
    return tuple(found)


def tone_notes(tones: Sequence[ShotTone]) -> tuple[str, ...]:
    """Notes on shots that depart: a sentence per style for those that are corrected, and one for those left out."""
    notes = []
    for style in dict.fromkeys(tone.style for tone in tones):
        for fate, local in (("taken out of them", False), ("left out", True)):
            mine = [tone for tone in tones if tone.style == style and bool(tone.local) is local]
            if mine:
                listed = ", ".join(f"{tone.shot} ({tone.words})" for tone in mine[:4])
                more = f" and {len(mine) - 4} more" if len(mine) > 4 else ""
                notes.append(
                    f"{style}: shots depart from what the others agree on, {listed}{more}: {fate}; {MANUAL_MODE}"
                )
    return tuple(notes)


@dataclass(frozen=True, eq=False)
class _Fit:
    """The departure of one shot, split into a tone curve and a map over the picture.

    tone: (3,), coefficients of the tone curve, and stops: (m,), its values in the shot's cells; maps: (18,),
    coefficients of the map, and local: (m,), its values; gains: by how much each lowers the misfit, χ² with 3 and 18
    degrees of freedom; misfit: the remaining misfit per cell.
    """

    tone: Array
    stops: Array
    maps: Array
    local: Array
    gains: tuple[float, float]
    misfit: float

    def p_values(self, scale: float) -> tuple[float, float]:
        """Return the p-values of the two gains, divided by the usual misfit `scale`."""
        tone, local = (max(gain, 0.0) / scale for gain in self.gains)
        return float(chdtrc(3, tone)), float(chdtrc(18, local))


def _fit(cells: Cells, departure: Departure) -> _Fit:
    """Fit a departure by generalized least squares; each coefficient has a normal prior of one stop."""
    root = np.linalg.cholesky(departure.covariance)

    def whitened(values: Array) -> Array:
        return np.asarray(solve_triangular(root, values, lower=True))

    def fitted(columns: Array, wanted: Array) -> Array:
        design = whitened(columns)
        return np.asarray(np.linalg.solve(design.T @ design + np.eye(columns.shape[1]), design.T @ whitened(wanted)))

    def misfit(error: Array) -> float:
        return float(np.sum(whitened(error) ** 2))

    error = departure.error
    level, place = cells.tone[departure.member], cells.place[departure.member]
    tones, places = tone_basis(level), place_basis(level, place)
    tone = fitted(tones, error)
    stops = tones @ tone
    maps = fitted(places, error - stops)
    local = places @ maps
    before, between, after = misfit(error), misfit(error - stops), misfit(error - stops - local)
    return _Fit(tone, stops, maps, local, (before - between, between - after), after / len(error))


@one_blas_thread
def _search(cells: Cells, style: str) -> list[ShotTone]:
    """The significant departures of one style's shots, by forward search."""
    covariance, freed = covariance_of(cells), dict[int, Array]()
    while True:
        departures = departures_of(cells, covariance, freed)
        fits = [_fit(cells, departure) for departure in departures]
        tones = _significant(cells, style, fits)
        strange = sorted((k for k in tones if k not in freed), key=lambda k: -sum(fits[k].gains))
        room = (len(fits) - 1) // 2 - len(freed)  # most shots must agree
        if not strange or room <= 0:
            return list(tones.values())
        for k in strange[:room]:
            if sum(fits[k].gains) >= 0.8 * sum(fits[strange[0]].gains):
                member = departures[k].member
                basis, places = tone_basis(cells.tone[member]), place_basis(cells.tone[member], cells.place[member])
                freed[k] = np.hstack([basis, places]) if tones[k].local else basis


def _significant(cells: Cells, style: str, fits: Sequence[_Fit]) -> dict[int, ShotTone]:
    """The departures that are significant, by the place of their shot."""
    limit = 0.01 / (2 * len(fits))  # a false alarm in one set of a hundred, over two tests a shot
    scale = max(1.0, float(np.median([fit.misfit for fit in fits])))
    tones = {k: _tone(cells, style, k, fit, fit.p_values(scale), limit) for k, fit in enumerate(fits)}
    return {k: tone for k, tone in tones.items() if tone is not None}


def _tone(cells: Cells, style: str, shot: int, fit: _Fit, p: tuple[float, float], limit: float) -> ShotTone | None:
    """The significant parts of a shot's departure; None where there are none."""
    dark, middle, bright = (float(value) for value in _at_tones(cells.tone[cells.shot == shot], fit.stops))
    size = float(np.sqrt(np.mean(fit.local**2)))
    common = p[0] < limit and max(abs(dark), abs(middle), abs(bright)) > LEAST_EV
    differs = p[1] < limit and size > LEAST_EV
    if not (common or differs):
        return None
    a, b, c = (float(value) for value in fit.tone * common)
    tone = ShotTone(cells.names[shot], style, (a, b, c), middle * common, dark * common, bright * common)
    first, second = (tuple(float(value) for value in part) for part in (fit.maps[:9], fit.maps[9:]))
    tone = replace(tone, significance=p)
    return replace(tone, local=size, maps=(first, second)) if differs else tone


def _at_tones(tone: Array, stops: Array) -> tuple[float, float, float]:
    """Stops at the 5th percentile of tone, in the mean, and at the 95th percentile."""
    order = np.argsort(tone)
    dark, bright = (order[round(share * (len(order) - 1))] for share in (0.05, 0.95))
    return float(stops[dark]), float(stops.mean()), float(stops[bright])
