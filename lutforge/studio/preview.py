"""A refinished photograph that follows the sliders: the chain of LUTs that `lutforge apply` grades with."""

import time
from base64 import b64encode
from dataclasses import dataclass
from io import BytesIO

import numpy as np
from numpy.typing import NDArray

from lutforge.apply.blocks import apply_to_pixels
from lutforge.apply.gradings import Gradings
from lutforge.arrays import Array, Pixels
from lutforge.errors import SettingsError
from lutforge.model.camera_profile import CameraProfile
from lutforge.model.white_balance import temperature_range

MARK_WHITE, MARK_BLACK = (230, 97, 1), (94, 60, 153)
"""Orange over what is clipped to white, violet over black: told apart by colour-blind eyes."""


@dataclass(frozen=True, eq=False)
class Shown:
    """A graded preview. pixels: (h, w, 3) codes; histogram: (128, 3) shares; clipped: shares at 255 and at 0 in any
    channel; seconds: what grading took."""

    pixels: NDArray[np.uint8]
    histogram: Array
    clipped: tuple[float, float]
    seconds: float


class Preview:
    """One photograph under one profile; baked steps and grades are kept between changes."""

    def __init__(self, profile: CameraProfile, pixels: Pixels) -> None:
        self.profile = profile
        self.pixels = pixels
        self._gradings = Gradings()

    @staticmethod
    def kelvins(profile: CameraProfile) -> tuple[float, float] | None:
        """The temperatures that the profile can render; None where it knows too few."""
        try:
            return None if profile.raw_camera else temperature_range(profile.white_balances)
        except SettingsError:
            return None

    def show(self, source: str, target: str, ev: float = 0.0, overlay: bool = False) -> Shown:
        """The photograph, taken as `source`, as `target` and `ev` stops would have made it; overlay: mark clipping.

        Raises SettingsError on selectors that the profile does not know.
        """
        began = time.perf_counter()
        profile = self.profile
        given, wanted = profile.selector(source), profile.selector(target)
        if ev or str(given) != str(wanted):
            _, processor = self._gradings.refinish(profile, given, profile, wanted, ev)
            return _shown(_codes(apply_to_pixels(processor, self.pixels)), overlay, began)
        return _shown(self.original(), overlay, began)

    def original(self) -> NDArray[np.uint8]:
        """The photograph as it is."""
        return _codes(self.pixels)


def _codes(pixels: Pixels) -> NDArray[np.uint8]:
    return (np.clip(pixels, 0.0, 1.0) * np.float32(255) + np.float32(0.5)).astype(np.uint8)


def _shown(codes: NDArray[np.uint8], overlay: bool, began: float) -> Shown:
    thinned = codes[::2, ::2]
    counts = [np.bincount(thinned[..., c].ravel() // 2, minlength=128) for c in range(3)]
    white, black = (thinned == 255).any(axis=2), (thinned == 0).any(axis=2)
    if overlay:
        low, high = (codes == 0).any(axis=2), (codes == 255).any(axis=2)
        codes = codes.copy()
        codes[low] = MARK_BLACK
        codes[high] = MARK_WHITE
    histogram = np.stack(counts, axis=1) / (thinned.size / 3)
    return Shown(codes, histogram, (float(white.mean()), float(black.mean())), time.perf_counter() - began)


def data_url(codes: NDArray[np.uint8]) -> str:
    """A picture (h, w, 3) as a JPEG data URL."""
    from PIL import Image

    buffer = BytesIO()
    Image.fromarray(codes).save(buffer, format="JPEG", quality=90, subsampling=0)
    return "data:image/jpeg;base64," + b64encode(buffer.getvalue()).decode("ascii")
