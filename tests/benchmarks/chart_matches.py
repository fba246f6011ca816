"""Ten real cameras matched by a common reference's RAW, and what any fixed map from picture to picture could reach.

    python -m tests.benchmarks.chart_matches

The cameras photographed a chart at four exposures under two lights (tests/data/middlebury_charts.npz); the Nikon
D200's RAW stands in for all others'. Prints, for the 90 ordered pairs under each light, how many lie within 0.03 (mean
distance of RGB on unclipped patches), and the median:

- with exposures as they were: the same shutter dial, whatever light it let through;
- with exposures as calibration found them, from each camera's own pictures and the reference's RAW (it knows none of a
  light that it was not trained on);
- with the gain that brings a shot to the mean level of the other camera's shot; with the best gain a shot (an oracle);
- by polynomials of degree 2 or 3 fitted to the pictures of that very pair, the better of both, on left-out patches:
  what a fixed map reaches that knows the answer;
- the same across lights: trained under the other light.
"""

from dataclasses import dataclass, replace
from itertools import combinations_with_replacement

import numpy as np
from numpy.typing import NDArray

from lutforge.arrays import Array
from lutforge.calibration.calibrate import calibrate
from lutforge.calibration.options import CalibrationOptions
from lutforge.calibration.physical.reference_camera import own_raw
from lutforge.model.camera_profile import CameraProfile, match
from lutforge.samples.clipping import unclipped_colours
from lutforge.samples.sample_set import SampleSet
from lutforge.samples.table import read_samples
from tests.benchmarks.common import heading, row
from tests.cases.real_data import CHARTS

REFERENCE = "NikonD200"
STOPS = np.arange(-1.2, 1.21, 0.08)


@dataclass(frozen=True, eq=False)
class Pair:
    """Unclipped patches of both cameras: JPEG values (n, 3), and the shot of each (n,)."""

    source: str
    target: str
    here: Array
    there: Array
    shot: NDArray[np.str_]


def pairs(samples: SampleSet) -> list[Pair]:
    """All ordered pairs of cameras under one light."""
    found = []
    cameras = {str(name): samples.select(samples.camera == name) for name in np.unique(samples.camera)}
    for source, one in cameras.items():
        for target, other in cameras.items():
            here, there = _same_patches(one, other)
            x, y = one.srgb[here], other.srgb[there]
            inside = np.all((np.minimum(x, y) > 0.02) & (np.maximum(x, y) < 0.98), axis=1)
            if source != target:
                found.append(Pair(source, target, x[inside], y[inside], one.shot[here][inside]))
    return found


def _same_patches(one: SampleSet, other: SampleSet) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    here, there = (np.char.add(np.char.add(side.shot, "/"), side.patch) for side in (one, other))
    _, first, second = np.intersect1d(here, there, return_indices=True)
    return first, second


def profiles_and_gains(samples: SampleSet) -> dict[str, tuple[CameraProfile, dict[str, float]]]:
    """Of each camera its profile by the reference's RAW, and the stops by which its shots depart from that."""
    raw, found = samples.select(samples.camera == REFERENCE), {}
    for name in map(str, np.unique(samples.camera)):
        own, gains = samples.select(samples.camera == name), {str(shot): 0.0 for shot in np.unique(samples.shot)}
        if name != REFERENCE:
            here, there = _same_patches(own, raw)
            named = np.full(len(here), REFERENCE)
            own = replace(own.select(here), raw=raw.raw[there], raw_camera=named, wb=np.full((len(here), 3), np.nan))
            carried, transfer = own_raw(own)
            plain = own.select(unclipped_colours(own.srgb, own.raw))
            stops = np.log2(carried.raw.sum(axis=1) / (plain.raw @ transfer.T).sum(axis=1))
            gains |= {str(shot): float(np.median(stops[plain.shot == shot])) for shot in np.unique(plain.shot)}
        found[name] = (calibrate(own, CalibrationOptions())[0], gains)
    return found


def errors(pair: Pair, cameras: dict[str, tuple[CameraProfile, dict[str, float]]]) -> tuple[float, ...]:
    """The mean distance of a pair: as exposed, by calibration's exposures, by mean level, by the best gain."""
    (source, lags), (target, leads) = cameras[pair.source], cameras[pair.target]

    def matched(stops: float) -> Array:
        return match(source, "standard/wb1", target, "standard/wb1", stops)(pair.here)

    tried = np.stack([matched(float(stops)) for stops in STOPS])
    far = np.linalg.norm(tried - pair.there, axis=2)
    sums = np.linalg.norm(matched(0.0) - pair.there, axis=1).sum() * np.eye(4)[0]
    for shot in np.unique(pair.shot):
        rows = pair.shot == shot
        level = np.abs(tried[:, rows].mean(axis=(1, 2)) - pair.there[rows].mean())
        found = matched(leads.get(str(shot), 0.0) - lags.get(str(shot), 0.0))[rows]
        sums[1] += np.linalg.norm(found - pair.there[rows], axis=1).sum()
        sums[2] += far[np.argmin(level)][rows].sum()
        sums[3] += far[:, rows].sum(axis=1).min()
    return tuple(sums / len(pair.here))


def _terms(colours: Array, degree: int) -> Array:
    products = [combinations_with_replacement(range(3), power) for power in range(1, degree + 1)]
    columns = [np.prod(colours[:, list(chosen)], axis=1) for power in products for chosen in power]
    return np.column_stack([np.ones(len(colours)), *columns])


def fixed_map(pair: Pair, other_light: Pair | None = None) -> float:
    """The mean distance by the better of two polynomials, on left-out patches, or trained under another light."""
    found = []
    for degree in (2, 3):
        train = pair if other_light is None else other_light
        terms = _terms(train.here, degree)
        solve = np.linalg.solve(terms.T @ terms + 1e-3 * np.eye(terms.shape[1]), terms.T)
        if other_light is None:
            residual = pair.there - terms @ (solve @ pair.there)
            residual = residual / (1.0 - np.einsum("ij,ji->i", terms, solve))[:, None]  # as if left out
        else:
            residual = pair.there - _terms(pair.here, degree) @ (solve @ train.there)
        found.append(float(np.linalg.norm(residual, axis=1).mean()))
    return min(found)


def main() -> None:
    """Print both tables."""
    samples = read_samples(CHARTS)
    parts = {name: samples.select(np.char.startswith(samples.shot, name)) for name in ("light1", "light2")}
    cameras = {name: profiles_and_gains(part) for name, part in parts.items()}
    ways = ("as exposed", "calibration's exposures", "mean level", "best gain", "fixed map of the pair itself")
    heading("trained, tested", *ways)
    for trained, known in cameras.items():
        for tested, part in parts.items():
            own = {(pair.source, pair.target): pair for pair in pairs(parts[trained])}
            rows = []
            for pair in pairs(part):
                other = None if trained == tested else own[pair.source, pair.target]
                rows.append((*errors(pair, known), fixed_map(pair, other)))
            cells = [f"{(way <= 0.03).sum()} ({np.median(way):.3f})" for way in np.array(rows).T]
            row(f"{trained}, {tested}", *cells)


if __name__ == "__main__":
    main()
