"""Samples of the simulated camera: patches of known surfaces, sensor noise, 8-bit JPEG values, exposure errors."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from lutforge.colour.spectra import chart_reflectances, surface_reflectances
from lutforge.samples.sample_set import SampleSet, concatenate
from lutforge.simulate.camera import SimulatedCamera

Array = NDArray[np.float64]

BALANCES = ("tungsten", "fluorescent", "daylight", "cloudy", "shade")
PIXELS = 64
"""Pixels of a patch: JPEG values are means of so many rounded ones."""


def surfaces(count: int, seed: int) -> Array:
    """Mixtures of two measured surfaces, darker or lighter, (count, L)."""
    rng = np.random.default_rng([seed, 7])
    base = np.vstack([chart_reflectances(), surface_reflectances()])
    first, second = rng.integers(0, len(base), (2, count))
    share, level = rng.uniform(0, 1, (count, 1)), rng.uniform(0.15, 1.05, (count, 1))
    mixed: Array = np.clip(level * (share * base[first] + (1 - share) * base[second]), 0.0, 1.0)
    return mixed


def chart_140(seed: int = 0) -> Array:
    """24 chart patches and 116 more, as on a large chart."""
    return np.vstack([chart_reflectances(), surfaces(116, seed)])


def photograph_patches(
    camera: SimulatedCamera,
    reflectances: Array,
    *,
    styles: Sequence[str] = ("standard",),
    balances: Sequence[str] = BALANCES,
    stops: Sequence[float] = (-3, -2, -1, 0, 1),
    exposure_error: float = 0.03,
    known: bool = True,
    seed: int = 0,
) -> SampleSet:
    """One shot of all surfaces per style, white balance and exposure; the true exposure is off by up to the error."""
    rng = np.random.default_rng(seed)
    parts: list[SampleSet] = []
    count = len(reflectances)
    for style in styles:
        for balance in balances:
            for stop in stops:
                time = camera.nominal_exposure_s * 2.0**stop
                raw = camera.expose(reflectances, balance, time * (1 + rng.uniform(-exposure_error, exposure_error)))
                raw = np.clip(raw, 0.0, 1.0)
                noise = np.sqrt(raw / camera.full_well + (camera.read_noise / camera.full_well) ** 2)
                pixels = raw[:, None] + noise[:, None] * rng.standard_normal((count, PIXELS, 3))
                jpeg = np.rint(255 * camera.render(pixels, style, balance)).mean(axis=1) / 255
                multipliers = np.tile(camera.multipliers(balance) if known else np.full(3, np.nan), (count, 1))
                parts.append(
                    SampleSet(
                        camera=np.full(count, camera.name),
                        style=np.full(count, style),
                        white_balance=np.full(count, balance),
                        shot=np.full(count, f"{style} {balance} {stop:+g}"),
                        patch=np.array([f"{place:04d}" for place in range(count)]),
                        exposure_s=np.full(count, time),
                        raw=np.clip(pixels, 0.0, 1.0).mean(axis=1),
                        srgb=jpeg,
                        wb=multipliers,
                        raw_camera=np.full(count, camera.name),
                    )
                )
    return concatenate(parts)
