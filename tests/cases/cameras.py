"""Simulated cameras that nothing was made on: each with its own sensor, tone curve, gamut map and chart."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from lutforge.arrays import Array
from lutforge.colour.spectra import chart_reflectances
from lutforge.samples.sample_set import SampleSet
from lutforge.simulate.camera import _build, _fit_matrix
from lutforge.simulate.gamut_map import SimulatedGamutMap
from lutforge.simulate.tone_response import ToneResponse, invert_increasing
from tests.cases.samples import chart_140, photograph_patches, surfaces


@dataclass(frozen=True)
class Power:
    """f: a power with a straight toe, and a shoulder that rolls off; knee: where it begins, in encoded values."""

    exponent: float
    toe: float
    knee: float

    def __call__(self, linear: ArrayLike) -> Array:
        x = np.clip(linear, 0.0, 1.0)
        return np.where(x < 1, invert_increasing(self.inverse, x, 0.0, 1.0), 1.0)

    def inverse(self, encoded: ArrayLike) -> Array:
        v = np.clip(encoded, 0.0, 1.0)
        rolled = np.where(v > self.knee, v + 2.0 * (v - self.knee) ** 2 * (1 + self.knee), v)
        bent = (rolled + self.toe) ** self.exponent - self.toe**self.exponent
        top = 1.0 + 2.0 * (1 - self.knee) ** 2 * (1 + self.knee)
        return np.asarray(bent / ((top + self.toe) ** self.exponent - self.toe**self.exponent))


@dataclass(frozen=True)
class Logarithm:
    """f = log(1 + a x) / log(1 + a): flat contrast over many stops."""

    strength: float

    def __call__(self, linear: ArrayLike) -> Array:
        return np.asarray(np.log1p(self.strength * np.clip(linear, 0.0, 1.0)) / np.log1p(self.strength))

    def inverse(self, encoded: ArrayLike) -> Array:
        return np.asarray(np.expm1(np.clip(encoded, 0.0, 1.0) * np.log1p(self.strength)) / self.strength)


@dataclass(frozen=True)
class DistanceMap:
    """h: distances from the largest channel, (max − c) / max, boosted and rolled off towards 1 beyond a threshold, as
    the ACES gamut compression does; below it nothing moves."""

    threshold: float
    boost: float

    def __call__(self, linear: ArrayLike) -> Array:
        p = np.asarray(linear, dtype=np.float64)
        top = np.maximum(p.max(axis=-1, keepdims=True), 1e-9)
        distance = (top - p) / top
        over = np.maximum(distance - self.threshold, 0.0)
        over = over * (1 + self.boost * over / (over + 0.1))
        room = 1 - self.threshold
        rest = 1 - np.minimum(distance, self.threshold) - over / (1 + (over / room) ** 1.5) ** (1 / 1.5)
        return np.asarray(top * rest)


def random_response(rng: np.random.Generator) -> ToneResponse | Power | Logarithm:
    """A tone curve, a power or a logarithm."""
    kind = rng.integers(3)
    if kind == 0:
        toe, shoulder = rng.uniform(0.15, 0.3), rng.uniform(0.85, 0.97)
        return ToneResponse(tuple(toe + rng.normal(0, 0.004, 3)), tuple(shoulder + rng.normal(0, 0.004, 3)))
    if kind == 1:
        return Power(rng.uniform(1.8, 2.4), rng.uniform(0.02, 0.06), rng.uniform(0.6, 0.9))
    return Logarithm(rng.uniform(15, 80))


def random_gamut_map(rng: np.random.Generator, sensitivity: Array) -> SimulatedGamutMap | DistanceMap:
    """A gamut map of one of two kinds."""
    if rng.integers(3) == 0:
        return DistanceMap(rng.uniform(0.4, 0.6), rng.uniform(0.0, 0.7))
    signal = np.array([0.25, 0.5, 0.25]) @ np.linalg.inv(_fit_matrix(sensitivity))
    knee, onset, boost = rng.uniform(0.55, 0.75), rng.uniform(0.4, 0.5), rng.uniform(0, 0.9)
    return SimulatedGamutMap(tuple(signal), knee, onset, boost, rng.normal(0, 0.07), rng.uniform(-0.15, 0.15))


def photographed_at_random(name: str, sensitivity: Array, seed: int) -> SampleSet:
    """Shots of a camera with measured sensitivities and a rendering drawn at random."""
    rng = np.random.default_rng([seed, 77])
    sensitivity = sensitivity / sensitivity.max(axis=0) * (rng.uniform(0.5, 1), 1.0, rng.uniform(0.5, 1))
    chosen = rng.permutation(["tungsten", "fluorescent", "daylight", "cloudy", "shade"])[: rng.integers(1, 6)].tolist()
    style = (random_gamut_map(rng, sensitivity), random_response(rng))
    camera = replace(
        _build(name, sensitivity),
        styles={"standard": style},  # type: ignore[dict-item]  # any h and f that can be called
        full_well=rng.uniform(15e3, 60e3),
    )
    chart = (chart_reflectances(), chart_140(seed), surfaces(200, seed))[rng.integers(3)]
    stops = tuple(np.sort(rng.uniform(-5, 1, rng.integers(3, 7))).tolist())
    return photograph_patches(camera, chart, balances=chosen, stops=stops, seed=seed)
