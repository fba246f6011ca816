"""Take photographs with the simulated camera: DNGs of the noisy mosaic, and the JPEGs developed from it."""

from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from zlib import crc32

import numpy as np
import OpenImageIO as oiio  # noqa: N813 -- the name that its own documentation uses
import rawpy
from numpy.typing import NDArray
from scipy import ndimage

from lutforge.images.read import Image
from lutforge.images.write import write_image
from lutforge.simulate.camera import SimulatedCamera
from lutforge.simulate.develop import develop, shrink
from lutforge.simulate.dials import CameraSettings
from lutforge.simulate.dng import write_dng
from lutforge.simulate.scene import Scene
from lutforge.simulate.sensor import capture


@dataclass(frozen=True)
class Photograph:
    """The files of one shot; `jpeg` is None where only the preview inside the DNG was asked for."""

    dng: Path
    jpeg: Path | None


def photograph(
    camera: SimulatedCamera,
    scene: Scene,
    settings: CameraSettings,
    folder: str | Path,
    name: str,
    *,
    jpeg_beside: bool = True,
    light: str | None = None,
    seed: int = 0,
) -> Photograph:
    """Write `name`.dng, with an embedded preview, and `name`.JPG in the same folder unless jpeg_beside is False.

    light: the white-balance name whose light falls on the scene, if not the camera's. The noise is of seed and name.
    """
    irradiance = scene.irradiance(camera, light or settings.white_balance, settings.exposure_s)
    if settings.vignetting is not None:
        irradiance /= settings.vignetting.gain(*irradiance.shape[:2]).astype(np.float32)
    lens = settings.distortion
    if lens is not None and (lens.red or lens.blue):  # lateral chromatic aberration: red and blue are larger than green
        y, x = np.mgrid[: irradiance.shape[0], : irradiance.shape[1]] + 0.5
        for channel, larger in ((0, lens.red), (2, lens.blue)):
            places = [lens.y + (y - lens.y) / (1 + larger) - 0.5, lens.x + (x - lens.x) / (1 + larger) - 0.5]
            irradiance[..., channel] = ndimage.map_coordinates(irradiance[..., channel], places, mode="nearest")
    rng = np.random.default_rng([seed, crc32(name.encode())])
    mosaic = capture(camera, irradiance, rng, settings.iso)
    picture = develop(camera, mosaic, settings)
    with TemporaryDirectory() as scratch:
        write_jpeg(Path(scratch) / "preview.jpg", shrink(picture, settings.preview_scale), camera, settings)
        preview = (Path(scratch) / "preview.jpg").read_bytes()

    dng = Path(folder) / f"{name}.dng"
    jpeg = Path(folder) / f"{name}.JPG"
    write_dng(
        dng, mosaic, black=camera.black, white=camera.white, cfa=camera.cfa,
        as_shot_neutral=1 / camera.multipliers(settings.white_balance), color_matrix=camera.color_matrix(),
        make=camera.make, model=camera.model, exposure_s=settings.exposure_s, f_number=settings.f_number,
        iso=settings.iso, light_source=settings.light_source, saturation=settings.saturation,
        profile_name=settings.style, preview_jpeg=preview, orientation=settings.orientation,
    )  # fmt: skip
    if not jpeg_beside:
        return Photograph(dng, None)
    write_jpeg(jpeg, picture, camera, settings)
    return Photograph(dng, jpeg)


def develop_again(camera: SimulatedCamera, shot: Photograph, settings: CameraSettings, path: str | Path) -> Path:
    """Write the JPEG that the camera would have made of the same exposure, noise included, with other settings."""
    with rawpy.imread(str(shot.dng)) as raw:
        mosaic = np.array(raw.raw_image_visible, dtype=np.uint16)
    write_jpeg(Path(path), develop(camera, mosaic, settings), camera, settings)
    return Path(path)


def write_jpeg(path: Path, pixels: NDArray[np.uint8], camera: SimulatedCamera, settings: CameraSettings) -> None:
    """Write encoded sRGB (h, w, 3) as a JPEG file, with the tags that say how it was made."""
    height, width, _ = pixels.shape
    spec = oiio.ImageSpec(width, height, 3, "uint8")
    for key, value in {
        "jpeg:quality": settings.quality, "jpeg:subsampling": settings.subsampling, "oiio:ColorSpace": "sRGB",
        "Make": camera.make, "Model": camera.model, "Orientation": settings.orientation,
        "ImageDescription": f"PictureStyle={settings.style}; WhiteBalance={settings.white_balance}",
        "ExposureTime": float(settings.exposure_s), "FNumber": float(settings.f_number),
        "Exif:PhotographicSensitivity": settings.iso, "Exif:LightSource": settings.light_source,
        "Exif:WhiteBalance": int(settings.light_source != 0), "Exif:Saturation": settings.saturation,
        "Exif:ExposureMode": 1,
    }.items():  # fmt: skip
        spec.attribute(key, value)
    values = np.divide(pixels, 255, dtype=np.float32)
    write_image(path, values, Image(values, spec, "jpeg"))
