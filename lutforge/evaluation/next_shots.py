"""The colours to photograph next: those of real surfaces of which a style knows least.

The colours are those of measured reflectances in even steps of lightness, as the style renders them. How far its model
is expected to be off there follows from where its samples lie (`evaluation.expected_difference`). A colour is asked for
where that is more than twice as far as usual: so colours that count as known have at most half the error of those.

Held-out errors confirm these expectations only near colours that the shots show. So nothing counts as enough where no
shot could be held out, or where most colours have no sample nearby, as after one chart.
"""

from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from lutforge.arrays import Array, Mask
from lutforge.colour.srgb import srgb_decode, srgb_encode, srgb_to_lab
from lutforge.evaluation.expected_difference import expected_difference
from lutforge.model.camera_profile import CameraProfile

TONE_NAMES = ((15.0, "very dark"), (35.0, "dark"), (65.0, "medium"), (85.0, "light"), (101.0, "very light"))
"""Names by upper bound of L*."""
HUES = (
    (20.0, "pink"),
    (50.0, "red"),
    (75.0, "orange"),
    (105.0, "yellow"),
    (165.0, "green"),
    (230.0, "cyan"),
    (300.0, "blue"),
    (335.0, "purple"),
    (361.0, "pink"),
)
"""Names by upper bound of the CIELAB hue angle in degrees."""
GREY_CHROMA = 12.0
"""The CIELAB chroma below which a colour is near grey."""

LIGHTNESSES = np.linspace(8.0, 108.0, 14)
"""L* of a white surface in the light and shade that surfaces are taken to be seen in: of 108 highlights are left."""
NEAR = 0.07
"""Largest distance, in encoded RGB, at which a sample is near a colour.

With it one chart is near less than half of the colours of real surfaces, at one exposure (11 %) or three (49 %), and
five photographs of the Canon S40 near 64 %.
"""
NEAR_SHARES = 0.04
"""Largest distance at which shares of red and green in linear values are near each other.

With it one chart in one light, at any exposures, is near less than half of the colours of real surfaces (30 to 42 %),
and five photographs of the Canon S40 near 64 %.
"""
LEAST_CODE, LEAST_LINEAR = 0.2, 1e-4
"""Brightness of colours whose shares are compared: those of darker ones are noise. Least linear value of a channel."""
TIMES_USUAL = 2.0
"""A colour is asked for where its expected error is more than so many times the usual one, the median."""
VISIBLE = 2.0
"""ΔE00 from which a difference is seen without looking for it."""
LEAST_SEEN = 0.5
"""Least share of real colours with a sample nearby for held-out errors to speak for the others."""
LEAST_SHARE = 0.25
"""Least share of the colours of a region that is asked for in a gap."""
LEAST_COLOURS = 4
"""Least number of such colours in a gap: a few at the border of a region are none."""
LEAST_UNPROVEN_GAPS = 3
"""Least number of gaps that are reported where held-out errors do not speak for them."""
MOST_GAPS = 6
"""Most gaps that are reported."""


@dataclass(frozen=True)
class Gap:
    """A region of real colours to photograph. share: of its colours that are asked for.

    difference: the mean expected ΔE00 of the region; NaN where it is not known.
    """

    colour: str
    share: float
    difference: float = np.nan

    def __str__(self) -> str:
        if np.isnan(self.difference):
            return f"{self.colour} ({self.share:.0%} of them have no sample nearby)"
        return f"{self.colour} (likely ΔE00 {self.difference:.1f} off)"


@dataclass(frozen=True, eq=False)
class KnownColours:
    """How well a style knows the colours that real surfaces have.

    encoded: these colours in its JPEGs (m, 3). expected: the expected ΔE00 of its rendering (m,), NaN where it is not
    known. near: the mask (m,) of those with a sample nearby. seen: the share of them that samples show, at their tone
    or, where that is less, at any. is_measured: the style has held-out errors.
    """

    encoded: Array
    expected: Array
    near: Mask
    seen: float
    is_measured: bool

    @property
    def usual(self) -> float:
        """The usual expected ΔE00; NaN where it is not known."""
        return float(np.median(self.expected)) if len(self.expected) else np.nan

    def asks_for(self, expected: Array) -> Mask:
        """A mask (n,) of the colours that are asked for, by the ΔE00 (n,) that is expected of them."""
        return np.asarray(expected > TIMES_USUAL * self.usual)

    @cached_property
    def least_known(self) -> tuple[Gap, ...]:
        """The regions of which a good part is asked for, those with most such colours first.

        Where no error can be expected, they are those of which a good part has no sample nearby. Where the regions are
        few, those with the largest expected error follow.
        """
        is_known = np.isfinite(self.usual)
        asked = self.asks_for(self.expected) if is_known else ~self.near
        regions, place, sizes = np.unique(region_names(self.encoded), return_inverse=True, return_counts=True)
        counts = np.bincount(place, asked, minlength=len(regions))
        shares, means = counts / sizes, np.bincount(place, self.expected, minlength=len(regions)) / sizes

        is_gap = (counts >= LEAST_COLOURS) & (shares >= LEAST_SHARE)
        order = np.argsort(-counts, kind="stable")
        chosen = order[is_gap[order]][:MOST_GAPS].tolist()
        if is_known:
            order = np.argsort(-means, kind="stable")
            others = order[(sizes[order] >= LEAST_COLOURS) & ~is_gap[order]].tolist()
            least = 1 if self.are_vouched_for else LEAST_UNPROVEN_GAPS
            chosen += others[: max(least - len(chosen), 0)]
        return tuple(Gap(str(regions[index]), float(shares[index]), float(means[index])) for index in chosen)

    @property
    def are_vouched_for(self) -> bool:
        """True where held-out errors speak for the colours that have no sample nearby."""
        return self.is_measured and self.seen >= LEAST_SEEN

    @property
    def gaps(self) -> tuple[Gap, ...]:
        """The regions that must be photographed: the least known ones, if likely visibly off, or if none is proven."""
        if not self.are_vouched_for:
            return self.least_known
        return tuple(gap for gap in self.least_known if not gap.difference < VISIBLE)

    @property
    def advice(self) -> str:
        """What to photograph, before a list of `gaps`. Where there are none, that is said, and what is known least."""
        if not self.is_measured:
            reason = "no shot could be held out, so no error is proven: shoot another scene, lighter and darker as well"
        elif not self.are_vouched_for:
            reason = f"only {self.seen:.0%} of the colours that real surfaces have are near a sample: shoot others"
        elif self.gaps:
            reason = "some colours that real surfaces have are likely to be visibly off"
        else:
            least = ", ".join(gap.colour for gap in self.least_known[:3])
            known_least = f"; known least are {least}" if least else ""
            usually = f"likely ΔE00 {self.usual:.1f} off" if np.isfinite(self.usual) else "near a sample, most of them"
            return f"nothing that must be shot: the colours that real surfaces have are {usually}{known_least}."
        return f"{reason}. Known least are:" if self.gaps else f"{reason}."


def known_colours(profile: CameraProfile, style: str, encoded: Array) -> KnownColours:
    """How well a style of a profile knows the colours of real surfaces; encoded: JPEG colours of its samples (n, 3)."""
    of_style = profile.styles[style]
    linear = real_surfaces()
    model = of_style.models[0] if of_style.models else None
    expects = expected_difference(model) if model is not None else None
    if model is None or expects is None:
        colours = srgb_encode(linear[np.all((linear >= 0.0) & (linear <= 1.0), axis=1)])
        expected = np.full(len(colours), np.nan)
    else:
        balanced = np.linalg.solve(profile.matrix, linear.T).T
        after_matrix = balanced[np.all((balanced >= 0.0) & (balanced <= 1.0), axis=1)] @ model.matrix.T
        expected = expects(after_matrix)
        colours = np.clip(model.response.encode(model.gamut_map(after_matrix)), 0.0, 1.0)
    near = _near(encoded.reshape(-1, 3), colours, NEAR)
    shown = encoded.reshape(-1, 3)[encoded.reshape(-1, 3).max(axis=1) > LEAST_CODE]
    near_at_any_tone = _near(_shares(shown), _shares(colours[colours.max(axis=1) > LEAST_CODE]), NEAR_SHARES)
    seen = min(float(np.mean(near)), float(np.mean(near_at_any_tone)))
    return KnownColours(colours, expected, near, seen, "render_mean" in of_style.errors)


def _near(points: Array, others: Array, distance: float) -> Mask:
    """A mask (m,) of the others (m, k) that have one of the points (n, k) within a distance."""
    return np.asarray(np.isfinite(cKDTree(points).query(others, distance_upper_bound=distance)[0]))


def _shares(encoded: Array) -> Array:
    """The shares of red and green (n, 2) in the linear values of encoded colours (n, 3), which no exposure changes."""
    linear = np.maximum(srgb_decode(encoded), LEAST_LINEAR)
    return np.asarray((linear / linear.sum(axis=1, keepdims=True))[:, :2])


@cache
def real_surfaces() -> Array:
    """Linear sRGB (m, 3) of the 99 reflectances of CIE 224:2017, and of each half mixed with grey, by lightness."""
    # Imported here, since it takes a second.
    from lutforge.colour.spectra import light, linear_srgb_under, surface_reflectances

    surfaces = linear_srgb_under(surface_reflectances(), light("D65"))
    paler = 0.5 * surfaces + 0.5 * surfaces.mean(axis=1, keepdims=True)
    exposures = np.where(LIGHTNESSES > 8.0, ((LIGHTNESSES + 16.0) / 116.0) ** 3, LIGHTNESSES / 903.3)
    return np.asarray((exposures[:, None, None] * np.concatenate([surfaces, paler])).reshape(-1, 3))


def region_names(encoded: Array) -> NDArray[np.str_]:
    """The name (n,) of the region of each encoded colour (n, 3): its tone, and its hue or that it is grey."""
    lab = srgb_to_lab(encoded)
    angle = np.degrees(np.arctan2(lab[:, 2], lab[:, 1])) % 360.0
    tones = _named(lab[:, 0], TONE_NAMES)
    hues = np.where(np.hypot(lab[:, 1], lab[:, 2]) < GREY_CHROMA, "grey", _named(angle, HUES))
    return np.array([f"{tone} {hue}s" for tone, hue in zip(tones, hues, strict=True)], dtype=np.str_)


def _named(values: Array, names: tuple[tuple[float, str], ...]) -> NDArray[np.str_]:
    """The names of values (n,) by upper bounds."""
    bounds, words = zip(*names, strict=True)
    places = np.searchsorted(bounds, values, side="right").clip(max=len(words) - 1)
    return np.asarray(np.array(words)[places], dtype=np.str_)
