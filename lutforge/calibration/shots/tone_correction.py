"""Take out of single shots what a camera did to their tone: as light before the rendering, or as codes after it.

Some cameras change the light of a scene before they render it, by its tone (active D-lighting, auto lighting); a curve
may as well lie behind the rendering, on each channel's codes. Either is a curve of stops that is smooth, of the tone
of the scene or of each channel of the JPEG. It is fitted to the shot's departure from what the other shots predict by
generalized least squares, and where both are possible, that form is taken out of a style's shots under which their
departures are likelier (Rasmussen & Williams 2006, equation 2.30, https://doi.org/10.7551/mitpress/3206.001.0001).
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from lutforge.arrays import Array, Mask
from lutforge.calibration.physical.matrix_and_response import fit_matrix_and_response
from lutforge.calibration.shots.departures import Departure, cells_of, covariance_of, departures_of, light_of
from lutforge.model.response import Response
from lutforge.model.shot_tone import ShotTone, tone_basis
from lutforge.samples.sample_set import SampleSet
from lutforge.solvers.blas import one_blas_thread

KNOTS = np.linspace(-2.5, 1.0, 15)
"""Tones between which curves are straight, in units of 2.5 stops from 18 % grey."""


def without_departures(
    samples: SampleSet, multipliers: Array, usable: Mask, tones: Sequence[ShotTone]
) -> tuple[SampleSet, Array]:
    """The samples and multipliers (n, 3) without the shots that depart locally, and the global part out of the others.

    usable: (n,) unclipped samples. A style of which nothing would be left keeps its shots.
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
    """Take the departures of a style's shots out of them; agreeing: (n,) the usable samples of its other shots."""
    response = fit_matrix_and_response(samples.raw[agreeing] * multipliers[agreeing], samples.srgb[agreeing]).response
    cells = cells_of(samples.select(usable), multipliers[usable])
    light = np.exp2(cells.y) * (1e-4 + light_of(cells.encoded)) / 3.0
    by_light, by_code = _curves(_tones(light)), _curves_of_channels(cells.encoded, response)
    members = {place: cells.shot == place for place, name in enumerate(cells.names) if name in shots}
    freed = {place: np.hstack([by_light[mask], by_code[mask]]) for place, mask in members.items()}
    departures = departures_of(cells, covariance_of(cells), freed)
    fits = {
        place: [_fitted(columns[mask], departures[place]) for columns in (by_light, by_code)]
        for place, mask in members.items()
    }
    light_is_likelier = sum(light[1] - code[1] for light, code in fits.values()) >= 0.0
    raw, srgb = samples.raw.copy(), samples.srgb.copy()
    for place, (of_light, of_code) in fits.items():
        mine = (samples.shot == cells.names[place]) & np.isin(samples.style, samples.style[usable])
        if light_is_likelier:
            scene = (raw[mine] * multipliers[mine]).mean(axis=1)
            raw[mine] *= 2.0 ** (_curves(_tones(scene)) @ of_light[0])[:, None]
        else:
            linear = response.linearize(srgb[mine])
            srgb[mine] = np.clip(response.encode(linear * 2.0 ** -(_curves(_tones(linear)) @ of_code[0])), 0.0, 1.0)
    return replace(samples, raw=raw, srgb=srgb)


def _tones(linear: Array) -> Array:
    """Tones of linear light of any shape, in units of 2.5 stops from 18 % grey."""
    return np.asarray(np.log2(np.maximum(linear, 2e-4) / 0.18) / 2.5)


def _curves(tone: Array) -> Array:
    """Smooth curves at tones (…,), (…, 18): a parabola of about a stop, and what is left, of about 0.3 stops."""
    inside = np.clip(tone, KNOTS[0], KNOTS[-1])
    hats = np.maximum(1.0 - np.abs(inside[..., None] - KNOTS) / (KNOTS[1] - KNOTS[0]), 0.0)
    scaled = np.sqrt(5.0) * np.abs(KNOTS[:, None] - KNOTS) / 0.5  # Matérn's covariance over 1.25 stops
    smooth = 0.3**2 * (1.0 + scaled + scaled**2 / 3.0) * np.exp(-scaled)
    return np.concatenate([tone_basis(inside), hats @ np.linalg.cholesky(smooth + 1e-8 * np.eye(len(KNOTS)))], axis=-1)


def _curves_of_channels(encoded: Array, response: Response) -> Array:
    """Curves of each channel by itself, as they change the light of JPEG colours (n, 3), (n, 18)."""
    linear = np.maximum(response.linearize(encoded), 2e-4)
    share = linear / linear.sum(axis=1, keepdims=True)
    return np.asarray(np.einsum("nc,nck->nk", share, _curves(_tones(linear))))


def _fitted(columns: Array, departure: Departure) -> tuple[Array, float]:
    """Coefficients (k,) of columns (m, k) with a prior of 1, and the log of the departure's likelihood, unscaled."""
    weighted = cho_solve(cho_factor(departure.covariance), columns)
    normal = columns.T @ weighted + np.eye(columns.shape[1])
    coefficients = np.linalg.solve(normal, weighted.T @ departure.error)
    total = cho_factor(departure.covariance + columns @ columns.T)
    misfit = float(departure.error @ cho_solve(total, departure.error))
    return coefficients, -0.5 * misfit - float(np.log(np.diag(total[0])).sum())
