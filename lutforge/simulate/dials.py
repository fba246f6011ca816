"""The dials of the simulated camera: what its user sets for a photograph."""

from dataclasses import dataclass
from typing import Literal

from lutforge.model.vignetting import Vignetting
from lutforge.model.white_balance import LIGHT_SOURCES
from lutforge.shots.geometry import Distortion

Subsampling = Literal["4:4:4", "4:2:2", "4:2:0"]


@dataclass(frozen=True)
class CameraSettings:
    """The dials of the camera.

    preview_scale: size of the embedded JPEG relative to the full one. push_ev: brightening in the development, in
    stops. orientation: how the camera was held (TIFF 1, 3, 6 or 8); pixels stay as the sensor has them.
    vignetting: that of the lens, which the development corrects. distortion: that of the lens; the development
    straightens the picture and scales it to fill the JPEG.
    """

    style: str = "standard"
    white_balance: str = "daylight"
    exposure_s: float = 1 / 60
    iso: int = 100
    f_number: float = 8.0
    quality: int = 95
    subsampling: Subsampling = "4:2:2"
    preview_scale: float = 0.5
    push_ev: float = 0.0
    orientation: int = 1
    vignetting: Vignetting | None = None
    distortion: Distortion | None = None

    @property
    def light_source(self) -> int:
        """Exif's code of the white balance."""
        return LIGHT_SOURCES.get(self.white_balance, 0)

    @property
    def saturation(self) -> int:
        """Exif's code of a style: 2 where it boosts colours (Exif 2.32, 4.6.5)."""
        return 0 if self.style == "standard" else 2
