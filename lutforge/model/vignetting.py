"""The correction of a vignetting of the lens that a camera applies to its JPEGs only, by lens setting and channel."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from lutforge.arrays import Array
from lutforge.errors import ProfileError

VIGNETTING_DEGREE = 3
NO_SHADING = ((0.0,) * VIGNETTING_DEGREE,) * 3


def vignetting_basis(q: Array) -> Array:
    """Rising polynomials (n, VIGNETTING_DEGREE) of squared distances q (n,) ≥ 0: 0 at 0, 1 at 1, straight beyond.

    They are integrals of Bernstein's polynomials (Farouki 2012, https://doi.org/10.1016/j.cagd.2012.03.001). A sum with
    coefficients that are not negative never falls, and nearly every rising polynomial of that degree is such a sum.
    """
    inside, beyond = np.minimum(q, 1.0), np.maximum(q - 1.0, 0.0)
    remaining = 1.0 - inside
    cubic = inside**3
    second = cubic + 3.0 * inside**2 * remaining
    return np.stack([second + 3.0 * inside * remaining**2, second, cubic + VIGNETTING_DEGREE * beyond], axis=-1)


@dataclass(frozen=True)
class Vignetting:
    """The brightening of a JPEG beyond its centre, in stops, at one lens setting.

    coefficients: of `vignetting_basis`, ≥ 0, for all channels, their sum is the brightening at the corners; centre:
    where there is none. Both take places as samples have them: x to the right and y down from the middle of the visible
    area, half its diagonal = 1. lens: its name, "" where unknown; focal_mm, aperture (f-number): NaN where unknown.
    shading: of the same basis, by channel, what red, green and blue are brightened by besides, of any sign. Raises
    ProfileError on numbers that no lens has.
    """

    coefficients: tuple[float, float, float]
    centre: tuple[float, float] = (0.0, 0.0)
    lens: str = ""
    focal_mm: float = float("nan")
    aperture: float = float("nan")
    shading: tuple[tuple[float, ...], ...] = NO_SHADING

    def __post_init__(self) -> None:
        if not (
            len(self.coefficients) == VIGNETTING_DEGREE
            and all(0.0 <= value <= 20.0 for value in self.coefficients)
            and all(-1.0 <= value <= 1.0 for value in self.centre)
            and [len(channel) for channel in self.shading] == [VIGNETTING_DEGREE] * 3
            and all(-20.0 <= value <= 20.0 for channel in self.shading for value in channel)
            and not any(value <= 0.0 for value in (self.focal_mm, self.aperture))  # NaN is unknown
            and len(self.lens) <= 200
            and self.lens.isprintable()
        ):
            raise ProfileError("a vignetting of the profile has a name or numbers that no lens has")

    @property
    def corner_ev(self) -> float:
        """The brightening of all channels in stops at half a diagonal from its centre, without the shading."""
        return sum(self.coefficients)

    @property
    def corners(self) -> str:
        """The brightening in stops at half a diagonal from its centre in words, by channel where these differ."""
        if self.shading == NO_SHADING:
            return f"{self.corner_ev:.2f} EV"
        stops = (self.corner_ev + sum(channel) for channel in self.shading)
        return (
            ", ".join(f"{name} {value:.2f}" for name, value in zip(("red", "green", "blue"), stops, strict=True))
            + " EV"
        )

    @property
    def setting(self) -> str:
        """The lens setting in words."""
        focal = f"{self.focal_mm:g} mm" if np.isfinite(self.focal_mm) else ""
        aperture = f"f/{self.aperture:g}" if np.isfinite(self.aperture) else ""
        return " ".join(word for word in (self.lens, focal, aperture) if word) or "an unknown lens"

    @property
    def note(self) -> str:
        """The vignetting in one sentence for a user."""
        return (
            f"{self.setting}: the JPEG's corners are {self.corners} brighter than the RAW's (vignetting, "
            "corrected by the camera); the profile renders the middle, and corrects other places where it knows them"
        )

    def stops(self, places: ArrayLike) -> Array:
        """The brightening in stops at places (…, 2) by channel, (…, 3); 0 where a place is NaN."""
        offset = np.asarray(places, dtype=np.float64) - self.centre
        basis = vignetting_basis(np.nan_to_num(np.sum(offset**2, axis=-1)))
        return np.asarray(basis @ (np.array(self.coefficients) + np.array(self.shading)).T)

    def gain(self, height: int, width: int, rows: slice = slice(None)) -> Array:
        """The factors (rows, width, 3) by which pixels of the visible area (height, width), or rows of it, brighten."""
        half = 0.5 * np.hypot(height, width)
        y, x = ((np.arange(size) + 0.5 - 0.5 * size) / half for size in (height, width))
        return np.asarray(2.0 ** self.stops(np.stack(np.meshgrid(x, y[rows]), axis=-1)))


def vignetting_of(vignettings: Iterable[Vignetting], lens: str, focal_mm: float, aperture: float) -> Vignetting | None:
    """The vignetting of the nearest lens setting, of the same lens and within half a stop; None where there is none.

    The distance is in stops of focal length and of aperture. A value that is unknown in both settings counts as equal.
    """
    setting = np.array([focal_mm, aperture])

    def distance(vignetting: Vignetting) -> float:
        known = np.array([vignetting.focal_mm, vignetting.aperture])
        stops = np.nan_to_num(np.abs(np.log2(setting / known)), nan=np.inf)
        return float(np.where(np.isnan(setting) & np.isnan(known), 0.0, stops).sum())

    near = min((vignetting for vignetting in vignettings if vignetting.lens == lens), key=distance, default=None)
    return near if near is not None and distance(near) <= 0.5 else None
