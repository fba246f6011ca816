"""Removes from single shots the tone curve that the camera applied to them.

Some cameras change the light of a scene by its tone before they render it (Active D-Lighting, Auto Lighting Optimizer).
Others apply a curve to each channel of the rendered JPEG. Either is modelled as a smooth curve in stops: of the tone of
the scene, or of each channel. The curve is fitted to the shot's departure from the prediction by the other shots, by
generalized least squares. Of the two forms the one with the higher marginal likelihood is removed from all shots of a
style (Rasmussen & Williams 2006, equation 2.30, https://doi.org/10.7551/mitpress/3206.001.0001).

The form is chosen with variances that are broad enough for any camera. The curve is then fitted with the variances that
maximize the likelihood of the agreeing shots. These often agree better than broad variances assume, and the curve
should be right to a hundredth of a stop. How a camera computes the tone of a scene from its channels is not known, so
the weights of the channels are fitted as well.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.optimize import minimize

from lutforge.arrays import Array, Mask
from lutforge.calibration.physical.matrix_and_response import fit_matrix_and_response
from lutforge.calibration.shots.departures import (
    Cells,
    Departure,
    cells_of,
    covariance_of,
    departures_of,
    likeliest_sizes,
)
from lutforge.model.response import Response
from lutforge.model.shot_tone import ShotTone, tone_basis
from lutforge.samples.sample_set import SampleSet
from lutforge.solvers.blas import one_blas_thread

KNOTS = np.linspace(-2.5, 1.0, 15)
"""Knots of the piecewise linear curves, in units of 2.5 stops from 18 % grey."""


def without_departures(
    samples: SampleSet, multipliers: Array, usable: Mask, tones: Sequence[ShotTone]
) -> tuple[SampleSet, Array]:
    """Return samples and multipliers (n, 3) with global departures removed, and without shots that depart locally.

    usable: (n,) unclipped samples. A style keeps its shots where none would remain.
    """
    kept = ~np.isin(samples.shot, [tone.shot for tone in tones if tone.local])
    for name in np.unique(samples.style):
        kept |= (samples.style == name) & ~np.any(kept & (samples.style == name))
    samples, multipliers, usable = samples.select(kept), multipliers[kept], usable[kept]
    for name in dict.fromkeys(tone.style for tone in tones):
        shots = [tone.shot for tone in tones if tone.style == name and any(tone.coefficients)]
        mine = samples.style == name
        agreeing = mine & usable & ~np.isin(samples.shot, shots)
        if np.isin(shots, samples.shot[mine & usable]).any() and np.count_nonzero(agreeing) >= 10:
            samples = _corrected(samples, multipliers, usable & mine, agreeing, shots)
    return samples, multipliers


@one_blas_thread
def _corrected(samples: SampleSet, multipliers: Array, usable: Mask, agreeing: Mask, shots: Sequence[str]) -> SampleSet:
    """Remove the departures of a style's shots; agreeing: (n,) the usable samples of its other shots."""
    response = fit_matrix_and_response(samples.raw[agreeing] * multipliers[agreeing], samples.srgb[agreeing]).response
    cells = cells_of(samples.select(usable), multipliers[usable])
    by_code = _curves_of_channels(cells.encoded, response)
    members = {place: cells.shot == place for place, name in enumerate(cells.names) if name in shots}
    fits = _fits(cells, by_code, members)
    raw, srgb = samples.raw.copy(), samples.srgb.copy()
    for place, (mixture, coefficients) in fits.items():
        mine = (samples.shot == cells.names[place]) & np.isin(samples.style, samples.style[usable])
        if mixture is not None:
            raw[mine] *= 2.0 ** (_curves(_tones(raw[mine] * multipliers[mine] @ mixture)) @ coefficients)[:, None]
        else:
            linear = response.linearize(srgb[mine])
            srgb[mine] = np.clip(response.encode(linear * 2.0 ** -(_curves(_tones(linear)) @ coefficients)), 0.0, 1.0)
    return replace(samples, raw=raw, srgb=srgb)


def _fits(cells: Cells, by_code: Array, members: Mapping[int, Mask]) -> dict[int, tuple[Array | None, Array]]:
    """Return, by shot, the channel weights (3,) of a curve of light, None for a curve of codes, and coefficients (k,).

    by_code: (n, k), the columns of curves of codes at the cells; members: by shot that departs, the mask (n,) of its
    cells.
    """
    light = {place: cells.balanced[mask] for place, mask in members.items()}
    columns = {place: _curves(_tones(each.mean(axis=1))) for place, each in light.items()}
    freed = {place: np.hstack([columns[place], by_code[mask]]) for place, mask in members.items()}
    departures = departures_of(cells, covariance_of(cells), freed)
    advantage = [
        _fitted(columns[place], departures[place])[1] - _fitted(by_code[mask], departures[place])[1]
        for place, mask in members.items()
    ]
    agreeing = ~np.any(list(members.values()), axis=0)
    covariance = covariance_of(cells, likeliest_sizes(cells, agreeing))
    if sum(advantage) < 0.0:
        freed = {place: by_code[mask] for place, mask in members.items()}
        departures = departures_of(cells, covariance, freed)
        return {place: (None, _fitted(freed[place], departures[place])[0]) for place in members}
    departures = departures_of(cells, covariance, freed)
    for _ in range(2):  # each shot's weights slightly change the prediction of the others
        mixtures = {place: _mixture(light[place], departures[place]) for place in members}
        freed = {place: _curves(_tones(light[place] @ mixtures[place])) for place in members}
        departures = departures_of(cells, covariance, freed)
    return {place: (mixtures[place], _fitted(freed[place], departures[place])[0]) for place in members}


def _mixture(light: Array, departure: Departure) -> Array:
    """Return the weights (3,), which sum to 1, of the channels of light (m, 3) whose tone best explains a departure.

    The logarithms of red and blue relative to green have a standard normal prior, wide enough for a luminance.
    """

    def shares(logarithms: Array) -> Array:
        parts = np.exp([logarithms[0], 0.0, logarithms[1]])
        return np.asarray(parts / parts.sum())

    def negative_log_posterior(logarithms: Array) -> float:
        likelihood = _fitted(_curves(_tones(light @ shares(logarithms))), departure)[1]
        return float(0.5 * logarithms @ logarithms - likelihood)

    start = np.array([[0.0, 0.0], [0.4, 0.0], [0.0, 0.4]])
    options = {"initial_simplex": start, "xatol": 0.02, "fatol": 0.02}
    return shares(minimize(negative_log_posterior, start[0], method="Nelder-Mead", options=options).x)


def _tones(linear: Array) -> Array:
    """Tones of linear light of any shape, in units of 2.5 stops from 18 % grey."""
    return np.asarray(np.log2(np.maximum(linear, 2e-4) / 0.18) / 2.5)


def _curves(tone: Array) -> Array:
    """The columns (…, 18) of a curve at tones (…,): a parabola of about a stop and a smooth rest of about 0.3 stops."""
    inside = np.clip(tone, KNOTS[0], KNOTS[-1])
    linear = np.maximum(1.0 - np.abs(inside[..., None] - KNOTS) / (KNOTS[1] - KNOTS[0]), 0.0)
    scaled = np.sqrt(5.0) * np.abs(KNOTS[:, None] - KNOTS) / 0.5  # Matérn's covariance over 1.25 stops
    smooth = 0.3**2 * (1.0 + scaled + scaled**2 / 3.0) * np.exp(-scaled)
    return np.concatenate(
        [tone_basis(inside), linear @ np.linalg.cholesky(smooth + 1e-8 * np.eye(len(KNOTS)))], axis=-1
    )


def _curves_of_channels(encoded: Array, response: Response) -> Array:
    """The columns (n, 18) of one curve applied to each channel, as they change the light of JPEG colours (n, 3)."""
    linear = np.maximum(response.linearize(encoded), 2e-4)
    share = linear / linear.sum(axis=1, keepdims=True)
    return np.asarray(np.einsum("nc,nck->nk", share, _curves(_tones(linear))))


def _fitted(columns: Array, departure: Departure) -> tuple[Array, float]:
    """Coefficients (k,), standard normal a priori, of columns (m, k), and a departure's log marginal likelihood."""
    weighted = cho_solve(cho_factor(departure.covariance), columns)
    normal = columns.T @ weighted + np.eye(columns.shape[1])
    coefficients = np.linalg.solve(normal, weighted.T @ departure.error)
    total = cho_factor(departure.covariance + columns @ columns.T)
    misfit = float(departure.error @ cho_solve(total, departure.error))
    return coefficients, -0.5 * misfit - float(np.log(np.diag(total[0])).sum())
