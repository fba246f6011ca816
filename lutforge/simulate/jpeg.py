"""Camera JPEG files: 8 bits, with the Exif tags that say how they were made."""

from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Literal

import numpy as np
import OpenImageIO as oiio  # noqa: N813 -- the name that its own documentation uses
from numpy.typing import NDArray

from lutforge.errors import ImageError

Subsampling = Literal["4:4:4", "4:2:2", "4:2:0"]


@dataclass(frozen=True)
class ExposureTags:
    """What the camera writes about a shot: style and white balance by name, the rest as in Exif."""

    make: str
    model: str
    style: str
    white_balance: str
    exposure_s: float
    iso: int
    f_number: float
    light_source: int
    saturation: int
    orientation: int = 1


def encode_jpeg(
    pixels: NDArray[np.uint8], tags: ExposureTags, quality: int = 95, subsampling: Subsampling = "4:2:2"
) -> bytes:
    """A whole JPEG file from encoded sRGB (h, w, 3).

    ImageDescription says "PictureStyle=vivid; WhiteBalance=daylight". Raises ImageError where the encoder
    fails.
    """
    height, width, _ = pixels.shape
    spec = oiio.ImageSpec(width, height, 3, "uint8")
    for key, value in {
        "Compression": f"jpeg:{quality}",
        "jpeg:subsampling": subsampling,
        "oiio:ColorSpace": "sRGB",
        "Make": tags.make,
        "Model": tags.model,
        "Orientation": tags.orientation,
        "ImageDescription": f"PictureStyle={tags.style}; WhiteBalance={tags.white_balance}",
        "ExposureTime": float(tags.exposure_s),
        "FNumber": float(tags.f_number),
        "Exif:PhotographicSensitivity": tags.iso,
        "Exif:LightSource": tags.light_source,
        "Exif:WhiteBalance": int(tags.light_source != 0),
        "Exif:Saturation": tags.saturation,
        "Exif:ExposureMode": 1,
    }.items():
        spec.attribute(key, value)
    with TemporaryDirectory() as folder:
        path = Path(folder) / "camera.jpg"
        output = oiio.ImageOutput.create(str(path))
        if output is None or not output.open(str(path), spec):
            raise ImageError(f"cannot encode a JPEG: {oiio.geterror() if output is None else output.geterror()}")
        written = output.write_image(np.ascontiguousarray(pixels))
        if not (output.close() and written):
            raise ImageError(f"cannot encode a JPEG: {output.geterror()}")
        return path.read_bytes()
