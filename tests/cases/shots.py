"""A shot whose truth is known: any linear scene, rendered by a known function, with noise."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lutforge.images.raw import RawImage
from lutforge.shots.geometry import Registration
from lutforge.shots.metadata import ShotMetadata
from lutforge.shots.read import Shot

MULTIPLIERS = np.array([2.0, 1.0, 1.5])


def render(raw: NDArray[np.float64]) -> NDArray[np.float64]:
    """White balance and a power, codes 0–255 (not rounded)."""
    codes: NDArray[np.float64] = 255 * np.clip(raw * MULTIPLIERS, 0, 1) ** (1 / 2.2)
    return codes


def synthetic_shot(raw: NDArray[np.float64], jpeg: NDArray[np.uint8] | None = None, name: str = "a") -> Shot:
    """RAW array pixel i, two sensor pixels wide, lies exactly on JPEG pixel i."""
    pixels = np.clip(raw, 0, 1).astype(np.float32)
    if jpeg is None:
        jpeg = np.rint(render(raw)).astype(np.uint8)
    image = RawImage(
        pixels=pixels, pixel_size=2.0, flip=0, multipliers=MULTIPLIERS, preview=None, preview_note="",
        exposure_s=0.01, iso=100.0, clip_level=np.ones(3),
    )  # fmt: skip
    metadata = ShotMetadata("Test Camera", "standard", "daylight", MULTIPLIERS, 0.01)
    return Shot(name, Path(f"{name}.dng"), image, jpeg, "embedded preview", metadata, Registration(2, 0.5, 0.5, 1))
