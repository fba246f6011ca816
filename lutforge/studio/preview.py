"""A refinished photograph that follows the sliders: baked LUTs through OpenColorIO, white balance and exposure between.

A refinish is linearize → gain → render (equation 6.1). The first step depends on the source alone and the last on the
style alone: both are baked once, the photograph is linearised once, and a slider costs one multiplication and one LUT.
"""

import time
from base64 import b64encode
from collections import deque
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from io import BytesIO
from os import cpu_count
from pathlib import Path

import numpy as np
import PyOpenColorIO as OCIO  # noqa: N814 - the name that its documentation uses
from numpy.typing import NDArray

from lutforge.apply.image import apply_to_pixels
from lutforge.errors import ImageError, SettingsError
from lutforge.images.read import read_image
from lutforge.images.write import upright
from lutforge.luts.bake import bake
from lutforge.model.camera_profile import CameraProfile
from lutforge.model.transform import LatticeTransform, LinearizeChain, RenderChain, Transform
from lutforge.model.white_balance import temperature_range

Pixels = NDArray[np.float32]

MOST_PIXELS = 2_100_000
BAND = 32
"""Rows that a thread takes at a time: they stay in its cache from the gain to the codes."""
BINS = 128
CLIPPED_LOW, CLIPPED_HIGH = 0, 255
MARK_WHITE, MARK_BLACK = (230, 97, 1), (94, 60, 153)
"""Orange over what is clipped to white, violet over black: told apart by colour-blind eyes."""


@dataclass(frozen=True, eq=False)
class Shown:
    """A graded preview. pixels: (h, w, 3) codes; histogram: (BINS, 3) shares; clipped: shares at 255 and at 0 in any
    channel; seconds: what grading took."""

    pixels: NDArray[np.uint8]
    histogram: NDArray[np.float64]
    clipped: tuple[float, float]
    seconds: float


def read_preview(path: Path, most: int = MOST_PIXELS) -> Pixels:
    """An image upright, RGB in [0, 1], averaged down to at most so many pixels. Raises ImageError."""
    image = read_image(path)
    if image.pixels.ndim != 3 or image.pixels.shape[2] < 3:
        raise ImageError(f"{path.name}: a preview needs red, green and blue")
    pixels = np.clip(upright(image.pixels[..., :3], image.spec.get_int_attribute("Orientation", 1)), 0.0, 1.0)
    height, width = pixels.shape[:2]
    factor = int(np.ceil(np.sqrt(height * width / most)))
    if factor > 1:
        pixels = pixels[: height // factor * factor, : width // factor * factor]
        pixels = pixels.reshape(height // factor, factor, width // factor, factor, 3).mean(axis=(1, 3))
    return np.ascontiguousarray(pixels, dtype=np.float32)


class Preview:
    """One photograph under one profile. LUTs and the linearised photograph are kept between changes."""

    def __init__(self, profile: CameraProfile, pixels: Pixels) -> None:
        self.profile = profile
        self.pixels = pixels
        self._linear: tuple[str, Pixels] | None = None
        self._renders: dict[str, OCIO.CPUProcessor] = {}

    @staticmethod
    def kelvins(profile: CameraProfile) -> tuple[float, float] | None:
        """The temperatures that the profile can render; None where it knows too few."""
        try:
            return temperature_range(profile.white_balances)
        except SettingsError:
            return None

    def show(self, source: str, target: str, ev: float = 0.0, overlay: bool = False) -> Shown:
        """The photograph, taken as `source`, as `target` and `ev` stops would have made it; overlay: mark clipping.

        Raises SettingsError on selectors that the profile does not know.
        """
        began = time.perf_counter()
        selector = self.profile.selector(target)
        gain = np.asarray(self.profile.multipliers(selector) * 2.0**ev, dtype=np.float32)
        linear, processor = self._linearized(source), self._render(selector.style, target)
        codes = np.empty(linear.shape, dtype=np.uint8)

        def grade(top: int) -> None:
            rows = slice(top, top + BAND)
            # The LUT clips what comes in to [0, 1], as the camera does.
            graded = apply_to_pixels(processor, linear[rows] * gain, workers=1)
            np.clip(graded, 0.0, 1.0, out=graded)
            graded *= np.float32(255)
            graded += np.float32(0.5)
            codes[rows] = graded

        with ThreadPoolExecutor(cpu_count() or 1) as threads:
            deque(threads.map(grade, range(0, len(linear), BAND)), maxlen=0)
        return _shown(codes, overlay, began)

    def original(self) -> NDArray[np.uint8]:
        """The photograph as it is."""
        return (self.pixels * np.float32(255) + np.float32(0.5)).astype(np.uint8)

    def _linearized(self, source: str) -> Pixels:
        """RAW before white balance."""
        key = str(self.profile.selector(source))
        if self._linear is None or self._linear[0] != key:
            processor = _processor(self.profile.linearize(source))
            self._linear = (key, apply_to_pixels(processor, self.pixels))
        return self._linear[1]

    def _render(self, style: str, target: str) -> OCIO.CPUProcessor:
        """White-balanced RAW → JPEG of a style."""
        if style not in self._renders:
            transform = self.profile.render(target)
            assert isinstance(transform, LatticeTransform | RenderChain | LinearizeChain)
            self._renders[style] = _processor(replace(transform, gain=np.ones(3)))
        return self._renders[style]


def _processor(transform: Transform) -> OCIO.CPUProcessor:
    return bake(transform).processor()


def _shown(codes: NDArray[np.uint8], overlay: bool, began: float) -> Shown:
    thinned = codes[::2, ::2]
    counts = [np.bincount(thinned[..., c].ravel() // (256 // BINS), minlength=BINS) for c in range(3)]
    white, black = (thinned == CLIPPED_HIGH).any(axis=2), (thinned == CLIPPED_LOW).any(axis=2)
    if overlay:
        codes = codes.copy()
        codes[(codes == CLIPPED_LOW).any(axis=2)] = MARK_BLACK
        codes[(codes == CLIPPED_HIGH).any(axis=2)] = MARK_WHITE
    histogram = np.stack(counts, axis=1) / (thinned.size / 3)
    return Shown(codes, histogram, (float(white.mean()), float(black.mean())), time.perf_counter() - began)


def data_url(codes: NDArray[np.uint8]) -> str:
    """A picture (h, w, 3) as a JPEG data URL."""
    from PIL import Image

    buffer = BytesIO()
    Image.fromarray(codes).save(buffer, format="JPEG", quality=90, subsampling=0)
    return "data:image/jpeg;base64," + b64encode(buffer.getvalue()).decode("ascii")
