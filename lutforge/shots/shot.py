"""A shot: one RAW image, the JPEG that the camera made of it, and how the two lie on each other."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lutforge.images.raw import RawImage
from lutforge.images.read import Development
from lutforge.shots.cells import CellStatistics
from lutforge.shots.geometry import Placement, Registration
from lutforge.shots.metadata import ShotMetadata


@dataclass(frozen=True, eq=False)
class Shot:
    """A RAW/JPEG pair, both oriented like the sensor.

    name: the file's stem. jpeg: (h, w, 3) uint8. jpeg_source: "embedded preview", or the path of the file
    beside it. development: the picture that stands in the RAW's place, where a program developed it. raw_camera: the
    other camera that the RAW is of, or "". fine: the same picture, 0 … 65535, where its file has more than 8 bits.
    drawn: where the JPEG lies on the RAW as the lens drew it, where the camera straightened the JPEG: raw is then
    straightened, too, and the registration is of the JPEG on that.
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
    drawn: Placement | None = None

    @property
    def placement(self) -> Placement:
        """The place of the JPEG on the RAW as the lens drew it, at which other shots can be sought first."""
        if self.drawn is not None:
            return self.drawn
        height, width = self.raw.pixels.shape[:2]
        return Placement((height, width, self.raw.pixel_size), self.jpeg.shape[:2], self.registration)

    @property
    def lens_note(self) -> str:
        """What the camera corrected of the lens in its JPEG, in words for a user; "" where nothing."""
        lens = self.placement.registration.distortion
        if lens is None:
            return ""
        height, width = self.jpeg.shape[:2]
        corners = np.array([[0, 0], [width, 0], [0, height], [width, height]])
        at_corners = self.placement.registration.straight(corners)
        drawn = np.linalg.norm(lens.drawn(at_corners) - (lens.x, lens.y), axis=1)
        share = float(np.mean(drawn / np.linalg.norm(at_corners - (lens.x, lens.y), axis=1))) - 1
        shape = (
            "mustache"
            if lens.k1 * lens.k2 < 0 and abs(share) < abs(lens.k1) / 4
            else ("barrel", "pincushion")[share > 0]
        )
        parts = [f"{shape} distortion of {100 * share:+.1f} % in the corners"] if lens.k1 or lens.k2 else []
        if lens.red or lens.blue:
            parts.append(f"red {100 * lens.red:+.2f} % and blue {100 * lens.blue:+.2f} % beside green")
        return "corrected in the JPEG, and followed: " + ", ".join(parts)

    def raw_cells(self, cell: int, hot: bool = False) -> CellStatistics:
        """RAW statistics under the blocks of cell × cell JPEG pixels; a rest at the right and bottom is left out."""
        shape = self.jpeg.shape[0] // cell, self.jpeg.shape[1] // cell
        return CellStatistics.of(self.raw.pixels, *self.registration.borders(shape, cell, self.raw.pixel_size), hot)

    def jpeg_cells(self, cell: int, hot: bool = False) -> CellStatistics:
        """Statistics of the JPEG over the same blocks, in codes 0 … 255."""
        jpeg = self.jpeg if self.fine is None else self.fine
        rows, columns = (cell * np.arange(side // cell + 1.0) for side in jpeg.shape[:2])
        return CellStatistics.of(jpeg, rows, columns, hot)

    def straightened(self) -> "Shot":
        """The shot with a RAW as straight as its JPEG, where the registration says how the lens bent it."""
        if self.registration.distortion is None:
            return self
        pixels, place = self.registration.straightened(self.raw.pixels, self.raw.pixel_size, self.jpeg.shape)
        return replace(self, raw=replace(self.raw, pixels=pixels), registration=place, drawn=self.placement)
