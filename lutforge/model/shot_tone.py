"""The departure of one shot's tone from the camera's fixed rendering, as measured on the shot's samples."""

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from lutforge.arrays import Array
from lutforge.colour.srgb import srgb_decode
from lutforge.errors import ProfileError
from lutforge.samples.sample_set import SampleSet


def tone_of(encoded: Array) -> Array:
    """The tone of JPEG colours (n, 3): log₂ of their linear mean in units of 2.5 stops, 0 at 18 % grey, (n,)."""
    return np.asarray(np.log2(np.maximum(srgb_decode(encoded).mean(axis=1), 1e-4) / 0.18) / 2.5)


def tone_basis(tone: Array) -> Array:
    """The columns 1, x, x² of tones (n,), (n, 3): exposure, contrast, and how shadows and highlights differ."""
    return np.stack([np.ones_like(tone), tone, tone**2], axis=-1)


def place_basis(tone: Array, place: Array) -> Array:
    """Nine bilinear functions over the picture at places (n, 2), for dark and for bright tones (n,) each: (n, 18).

    They are 0 where a place is NaN.
    """
    at = np.clip(np.nan_to_num(place / (0.8, 0.55)), -1.0, 1.0)  # pictures are about 3 : 2
    linear = np.maximum(1.0 - np.abs(at[:, :, None] - (-1.0, 0.0, 1.0)), 0.0)
    known = np.all(np.isfinite(place), axis=1, keepdims=True)
    grid = known * (linear[:, 1, :, None] * linear[:, 0, None, :]).reshape(-1, 9)
    bright = 1.0 / (1.0 + np.exp(-3.0 * tone[:, None]))
    return np.hstack([grid * (1.0 - bright), grid * bright])


@dataclass(frozen=True)
class ShotTone:
    """The departure of one shot. All sizes are in stops, by which its JPEG is brighter than the fixed rendering.

    coefficients: of `tone_basis`, the part that every place of the picture shares; zeros where it is not significant.
    exposure: its mean over the shot's samples; shadows, highlights: at the twentieth darkest and brightest of them.
    local: what differs from place to place, its root mean square; 0 where it is not significant; maps: by place,
    three rows of three, of dark and of bright tones. significance: the p-values of the two parts.
    Raises ProfileError on numbers that no camera makes.
    """

    shot: str
    style: str
    coefficients: tuple[float, float, float]
    exposure: float
    shadows: float
    highlights: float
    local: float = 0.0
    maps: tuple[tuple[float, ...], tuple[float, ...]] = ((0.0,) * 9, (0.0,) * 9)
    significance: tuple[float, float] = (1.0, 1.0)

    def __post_init__(self) -> None:
        """Raise ProfileError on a number that no camera can have."""
        sizes = (*self.coefficients, self.exposure, self.shadows, self.highlights, self.local, *sum(self.maps, ()))
        if not all(abs(value) < 100.0 for value in sizes) or any(len(part) != 9 for part in self.maps):
            raise ProfileError("a departure of a shot in the profile has numbers that no camera makes")

    @property
    def stops(self) -> float:
        """The size of the global part: the largest of exposure, shadows and highlights."""
        return max((self.exposure, self.shadows, self.highlights), key=abs)

    @property
    def words(self) -> str:
        """The departure in words."""
        parts = []
        if abs(self.shadows - self.highlights) > max(0.05, 0.3 * abs(self.exposure)):
            parts.append(f"tone: shadows {self.shadows:+.2f} EV, highlights {self.highlights:+.2f} EV")
        elif self.stops:
            parts.append(f"exposure {self.exposure:+.2f} EV")
        if self.local:
            parts.append(f"local: ±{self.local:.2f} EV from place to place")
        return ", ".join(parts)


def tone_stops(samples: SampleSet, tones: Iterable[ShotTone], *, local: bool = False) -> Array:
    """Return, for each sample (n,), by how many stops its shot's JPEG is brighter than the fixed rendering.

    local: with the part that depends on the place in the picture.
    """
    stops = np.zeros(len(samples))
    for tone in tones:
        mine = samples.shot == tone.shot
        tones_of_mine = tone_of(samples.srgb[mine])
        stops[mine] = tone_basis(tones_of_mine) @ np.array(tone.coefficients)
        if local:
            stops[mine] += place_basis(tones_of_mine, samples.position[mine]) @ np.concatenate(tone.maps)
    return stops


def without_tones(samples: SampleSet, tones: Iterable[ShotTone]) -> SampleSet:
    """The samples with RAW as bright as the shots' JPEGs show it in all places, so that one rendering serves them."""
    return replace(samples, raw=samples.raw * 2.0 ** tone_stops(samples, tones)[:, None])
