"""A shot: one RAW image, the JPEG that the camera made of it, and how the two lie on each other."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lutforge.images.development import Development
from lutforge.images.raw import RawImage
from lutforge.shots.metadata import ShotMetadata


@dataclass(frozen=True)
class Registration:
    """x_raw = scale * x_jpeg + offset_x, and the same for y.

    Both count from the picture's top left corner: pixel i covers [i, i + 1], its centre is i + 0.5. RAW
    coordinates are full-resolution pixels of the visible area, whatever the size of the decoded array.
    correlation: of the two pictures' local structure, after registration, in [−1, 1].
    """

    scale: float
    offset_x: float
    offset_y: float
    correlation: float


def unreduced(found: Registration, factor: float) -> Registration:
    """Convert from coordinates of a JPEG reduced by `factor` to its own; 1 / factor goes the other way."""
    return Registration(found.scale / factor, found.offset_x, found.offset_y, found.correlation)


@dataclass(frozen=True)
class Placement:
    """The place of JPEGs of one size on RAW images of one size, which is the same in all shots of a camera.

    raw: height and width of the decoded array, and its pixels' size; jpeg: height and width, as the sensor lies.
    """

    raw: tuple[int, int, float]
    jpeg: tuple[int, int]
    registration: Registration


@dataclass(frozen=True, eq=False)
class Shot:
    """A RAW/JPEG pair, both oriented like the sensor.

    name: the file's stem. jpeg: (h, w, 3) uint8. jpeg_source: "embedded preview", or the path of the file
    beside it. development: the picture that stands in the RAW's place, where a program developed it. raw_camera: the
    other camera that the RAW is of, or "". fine: the same picture, 0 … 65535, where its file has more than 8 bits.
    encoder: of the JPEG (`JpegHeader.encoder`), "" where unknown.
    """

    name: str
    path: Path
    raw: RawImage
    jpeg: NDArray[np.uint8]
    jpeg_source: str
    metadata: ShotMetadata
    registration: Registration
    development: Development | None = None
    raw_camera: str = ""
    fine: NDArray[np.uint16] | None = None
    encoder: str = ""

    @property
    def placement(self) -> Placement:
        """The place of the JPEG on the RAW, at which other shots of the camera can be sought first."""
        height, width = self.raw.pixels.shape[:2]
        return Placement((height, width, self.raw.pixel_size), self.jpeg.shape[:2], self.registration)
