"""The colours to photograph next: colours of real surfaces with the largest expected error in a style.

Expected errors are measured on held-out samples, and the samples of one chart do not show the errors of other colours.
So colours without a sample nearby are named instead where no error is known, and named in addition where fewer than
half of the colours of real surfaces have a sample nearby.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from lutforge.arrays import Array, Mask
from lutforge.colour.srgb import SRGB_TO_XYZ, srgb_decode, srgb_to_lab

TONE_NAMES = ((35.0, "dark"), (65.0, "medium"), (101.0, "light"))
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

NEAR = 0.1
"""Largest distance, in encoded RGB, at which a sample is near a colour."""
VISIBLE = 6.0 / 255.0
"""Least error of encoded RGB that is visible when two colours are seen side by side."""
LEAST_SEEN = 0.5
"""Least share of real colours with a sample nearby, for the expected errors of the others to be valid."""
MOSTLY_UNSEEN = 0.5
"""Least share of colours without a sample nearby in a region that is a gap."""
LEAST_UNSEEN = 4
"""Least number of such colours in a gap: a few at the border of a region are none."""
MOST_GAPS = 6
"""Most gaps that are reported."""


@dataclass(frozen=True)
class Gap:
    """A region of real colours to photograph. unseen: the share of its colours without a sample nearby.

    error: the mean expected error there, of encoded RGB; NaN where it is not known.
    """

    colour: str
    unseen: float
    error: float = np.nan

    def __str__(self) -> str:
        expected = "" if np.isnan(self.error) else f", likely {255 * self.error:.0f} of 255 codes off"
        return f"{self.colour} ({self.unseen:.0%} of them unseen{expected})"


def colour_gaps(encoded: Array, expected: Callable[[Array], Array] | None = None) -> tuple[Gap, ...]:
    """The largest gaps between samples' JPEG colours (n, 3), the largest first; empty where there are none.

    expected: encoded colours (m, 3) → the expected error (m,). First come regions with a visible error, in the order of
    the sum of their errors. Then come regions without samples, in the order of the number of their colours. The colours
    are those of sRGB within Pointer's gamut, which real surfaces have (M. R. Pointer, "The gamut of real surface
    colors", Color Research & Application 5(3), 1980).
    """
    cells, lab = _real_colours()
    distance, _ = cKDTree(encoded.reshape(-1, 3)).query(cells, distance_upper_bound=NEAR)
    is_unseen = ~np.isfinite(distance)
    few_seen = expected is None or 1.0 - is_unseen.mean() < LEAST_SEEN
    error = np.full(len(cells), np.nan) if expected is None else expected(cells)

    names = np.array([_name(colour) for colour in lab])
    visible: list[tuple[float, Gap]] = []
    unseen: list[tuple[float, Gap]] = []
    for name in dict.fromkeys(names.tolist()):
        inside = names == name
        share = float(is_unseen[inside].mean())
        count = int(is_unseen[inside].sum())
        size = float(error[inside].mean())
        if size > VISIBLE:
            visible.append((float(error[inside].sum()), Gap(name, share, size)))
        elif few_seen and share >= MOSTLY_UNSEEN and count >= LEAST_UNSEEN:
            unseen.append((float(count), Gap(name, share)))

    def largest_first(gaps: list[tuple[float, Gap]]) -> list[Gap]:
        return [gap for _, gap in sorted(gaps, key=lambda entry: -entry[0])]

    return tuple((largest_first(visible) + largest_first(unseen))[:MOST_GAPS])


@dataclass(frozen=True)
class Nearness:
    """How near samples come to the colours that real surfaces have.

    share: of these colours with a sample nearby; unseen: the regions most of whose colours have none, the largest
    first, at most three.
    """

    share: float
    unseen: tuple[str, ...]

    def __str__(self) -> str:
        words = f"the samples come near {self.share:.0%} of the colours that real surfaces have"
        if not self.unseen:
            return words
        *first, last = self.unseen
        listed = f"{', '.join(first)} and {last}" if first else last
        return f"{words}; most {listed} are not among these"


def nearness(encoded: Array) -> Nearness:
    """How near samples' JPEG colours (n, 3) come to the colours that real surfaces have."""
    cells, lab = _real_colours()
    distance, _ = cKDTree(encoded.reshape(-1, 3)).query(cells, distance_upper_bound=NEAR)
    is_unseen = ~np.isfinite(distance)
    names = np.array([_name(colour) for colour in lab])
    counts = {}
    for name in dict.fromkeys(names.tolist()):
        inside = names == name
        count = int(is_unseen[inside].sum())
        if is_unseen[inside].mean() >= MOSTLY_UNSEEN and count >= LEAST_UNSEEN:
            counts[name] = count
    return Nearness(float(1.0 - is_unseen.mean()), tuple(sorted(counts, key=lambda name: -counts[name])[:3]))


def _real_colours() -> tuple[Array, Array]:
    """The centres of cells of sRGB's cube within Pointer's gamut (m, 3), encoded, and their CIELAB."""
    import colour  # imported here: it takes a second, and most commands never need it

    axis = (np.arange(16) + 0.5) / 16
    cells = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1).reshape(-1, 3)
    lab = srgb_to_lab(cells)
    inside = np.asarray(colour.is_within_pointer_gamut(srgb_decode(cells) @ SRGB_TO_XYZ.T), dtype=np.bool_)
    inside |= _is_grey(lab)
    return cells[inside], lab[inside]


def _is_grey(lab: Array) -> Mask:
    """True of colours (…, 3) in CIELAB that are near grey."""
    return np.asarray(np.hypot(lab[..., 1], lab[..., 2]) < 12.0)


def _name(lab: Array) -> str:
    """The name of the region of a colour (3,) in CIELAB."""
    tone = next(name for bound, name in TONE_NAMES if lab[0] < bound)
    if _is_grey(lab):
        return f"{tone} greys"
    angle = float(np.degrees(np.arctan2(lab[2], lab[1]))) % 360.0
    return f"{tone} {next(name for bound, name in HUES if angle < bound)}s"
