"""The colours to photograph next: real ones that a style knows least, by the error to expect of them.

Where no error is known, or where samples come near less than half of the colours that real surfaces have, they are
those that no sample comes near: errors to expect are measured on samples that were left out, and those of one chart
say nothing of other colours.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from lutforge.arrays import Array, Mask
from lutforge.colour.srgb import SRGB_TO_XYZ, srgb_decode, srgb_to_lab

TONES = ((35.0, "dark"), (65.0, "medium"), (101.0, "light"))
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
"""A colour is known within this distance of a sample, in encoded RGB."""
VISIBLE = 6.0 / 255.0
"""Error of encoded RGB that is seen side by side."""
FEW_SEEN = 0.5
"""Share of real colours below which samples are too few to tell an error of the others from."""
MOSTLY_UNSEEN, MORE_THAN_A_CORNER = 0.5, 4
"""A region is a gap from this share and this number of unseen cells on."""
MOST_GAPS = 6


@dataclass(frozen=True)
class Gap:
    """A region of real colours that is not known: its name, and the share of it that is unknown.

    error: the mean error to expect there, of encoded RGB; NaN where that is not known.
    """

    colour: str
    unknown: float
    error: float = np.nan

    def __str__(self) -> str:
        expected = "" if np.isnan(self.error) else f", {255 * self.error:.0f} codes of error to expect"
        return f"{self.colour} ({self.unknown:.0%} of them unseen{expected})"


def colour_gaps(encoded: Array, expected: Callable[[Array], Array] | None = None) -> tuple[Gap, ...]:
    """The largest gaps among samples' JPEG colours (n, 3), the largest first; none where all regions are known.

    expected: encoded colours (m, 3) → the error to expect (m,). A region is a gap where that is visible, and the gap
    with the largest sum of errors comes first; then, or without it, where no sample is near, the most colours first.
    Counted are the colours of sRGB within Pointer's gamut, the colours that real surfaces have (M. R. Pointer, "The
    gamut of real surface colors", Color Research & Application 5(3), 1980).
    """
    cells, lab = _real_colours()
    distance, _ = cKDTree(encoded.reshape(-1, 3)).query(cells, distance_upper_bound=NEAR)
    unknown = ~np.isfinite(distance)
    few_seen = expected is None or 1.0 - unknown.mean() < FEW_SEEN
    error = np.full(len(cells), np.nan) if expected is None else expected(cells)

    names = np.array([_name(colour) for colour in lab])
    visible: list[tuple[float, Gap]] = []
    unseen: list[tuple[float, Gap]] = []
    for name in dict.fromkeys(names.tolist()):
        inside = names == name
        share = float(unknown[inside].mean())
        count = int(unknown[inside].sum())
        size = float(error[inside].mean())
        if size > VISIBLE:
            visible.append((float(error[inside].sum()), Gap(name, share, size)))
        elif few_seen and share >= MOSTLY_UNSEEN and count >= MORE_THAN_A_CORNER:
            unseen.append((float(count), Gap(name, share)))

    def largest_first(gaps: list[tuple[float, Gap]]) -> list[Gap]:
        return [gap for _, gap in sorted(gaps, key=lambda entry: -entry[0])]

    return tuple((largest_first(visible) + largest_first(unseen))[:MOST_GAPS])


def _real_colours() -> tuple[Array, Array]:
    """Cell middles of sRGB's cube within Pointer's gamut (m, 3), and their CIELAB."""
    import colour  # imported here: it takes a second, and most commands never need it

    axis = (np.arange(16) + 0.5) / 16
    cells = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1).reshape(-1, 3)
    lab = srgb_to_lab(cells)
    inside = np.asarray(colour.is_within_pointer_gamut(srgb_decode(cells) @ SRGB_TO_XYZ.T), dtype=np.bool_)
    inside |= _is_grey(lab)
    return cells[inside], lab[inside]


def _is_grey(lab: Array) -> Mask:
    """Whether colours (…, 3) pass for greys."""
    return np.asarray(np.hypot(lab[..., 1], lab[..., 2]) < 12.0)


def _name(lab: Array) -> str:
    """The region of a colour."""
    tone = next(name for bound, name in TONES if lab[0] < bound)
    if _is_grey(lab):
        return f"{tone} greys"
    angle = float(np.degrees(np.arctan2(lab[2], lab[1]))) % 360.0
    return f"{tone} {next(name for bound, name in HUES if angle < bound)}s"
