"""Take a photograph with the simulated camera: a DNG of the noisy mosaic, and the JPEG developed from it.

JPEGs have 8 bits and the Exif tags that say how they were made.
"""

from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Literal
from zlib import crc32

import numpy as np
import OpenImageIO as oiio  # noqa: N813 -- the name that its own documentation uses
import rawpy
from numpy.typing import NDArray
from scipy import ndimage

from lutforge.arrays import Array, Pixels
from lutforge.images.read import Image
from lutforge.images.write import write_image
from lutforge.model.falloff import Falloff
from lutforge.model.white_balance import LIGHT_SOURCES
from lutforge.shots.geometry import Distortion
from lutforge.simulate.camera import SimulatedCamera
from lutforge.simulate.dng import write_dng
from lutforge.simulate.scene import Scene

Subsampling = Literal["4:4:4", "4:2:2", "4:2:0"]


BORDER = 8
"""Sensor pixels left out of the JPEG at the left and at the right; half as many above and below."""


@dataclass(frozen=True)
class CameraSettings:
    """The dials of the camera.

    preview_scale: size of the embedded JPEG relative to the full one. push_ev: brightening in the development, in
    stops. orientation: how the camera was held (TIFF 1, 3, 6 or 8); pixels stay as the sensor has them. falloff: what
    the lens loses, which the development brings back. distortion: how the lens bends the scene, which the development
    straightens and scales to fill the JPEG.
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
    falloff: Falloff | None = None
    distortion: Distortion | None = None

    @property
    def light_source(self) -> int:
        """Exif's code of the white balance."""
        return LIGHT_SOURCES.get(self.white_balance, 0)

    @property
    def saturation(self) -> int:
        """Exif's code of a style: 2 where it boosts colours (Exif 2.32, 4.6.5)."""
        return 0 if self.style == "standard" else 2


@dataclass(frozen=True)
class Photograph:
    """The files of one shot; `jpeg` is None where only the preview inside the DNG was asked for."""

    dng: Path
    jpeg: Path | None


def write_jpeg(path: Path, pixels: NDArray[np.uint8], camera: SimulatedCamera, settings: CameraSettings) -> None:
    """Write a JPEG file of encoded sRGB (h, w, 3), with the tags that say how it was made.

    ImageDescription says "PictureStyle=vivid; WhiteBalance=daylight". Raises ImageError where it cannot be written.
    """
    height, width, _ = pixels.shape
    spec = oiio.ImageSpec(width, height, 3, "uint8")
    for key, value in {
        "jpeg:quality": settings.quality,
        "jpeg:subsampling": settings.subsampling,
        "oiio:ColorSpace": "sRGB",
        "Make": camera.make,
        "Model": camera.model,
        "Orientation": settings.orientation,
        "ImageDescription": f"PictureStyle={settings.style}; WhiteBalance={settings.white_balance}",
        "ExposureTime": float(settings.exposure_s),
        "FNumber": float(settings.f_number),
        "Exif:PhotographicSensitivity": settings.iso,
        "Exif:LightSource": settings.light_source,
        "Exif:WhiteBalance": int(settings.light_source != 0),
        "Exif:Saturation": settings.saturation,
        "Exif:ExposureMode": 1,
    }.items():
        spec.attribute(key, value)
    values = np.divide(pixels, 255, dtype=np.float32)
    write_image(path, values, Image(values, spec, "jpeg"))


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
    """Write `name`.dng, with an embedded preview, and `name`.JPG beside it unless it is not wanted.

    light: the white-balance name whose light falls on the scene; None for the one that the camera is set to. The noise
    depends on seed and name only.
    """
    irradiance = scene.irradiance(camera, light or settings.white_balance, settings.exposure_s)
    if settings.falloff is not None:
        irradiance /= settings.falloff.gain(*irradiance.shape[:2])[..., None].astype(np.float32)
    lens = settings.distortion
    if lens is not None and (lens.red or lens.blue):  # red and blue are drawn larger than green
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
    dng, jpeg = Path(folder) / f"{name}.dng", Path(folder) / f"{name}.JPG"
    write_dng(
        dng,
        mosaic,
        black=camera.black,
        white=camera.white,
        cfa=camera.cfa,
        as_shot_neutral=1 / camera.multipliers(settings.white_balance),
        color_matrix=camera.color_matrix(),
        make=camera.make,
        model=camera.model,
        exposure_s=settings.exposure_s,
        f_number=settings.f_number,
        iso=settings.iso,
        light_source=settings.light_source,
        saturation=settings.saturation,
        profile_name=settings.style,
        preview_jpeg=preview,
        orientation=settings.orientation,
    )
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


def develop(camera: SimulatedCamera, mosaic: NDArray[np.uint16], settings: CameraSettings) -> NDArray[np.uint8]:
    """What the camera does to its mosaic (h, w) for a JPEG: all of `rendered`, rounded to 8 bits."""
    return np.rint(255 * rendered(camera, mosaic, settings)).astype(np.uint8)


def rendered(camera: SimulatedCamera, mosaic: NDArray[np.uint16], settings: CameraSettings) -> Array:
    """Encoded values (h, w, 3) of a mosaic (h, w): demosaicked, its border cropped, and rendered."""
    raw = demosaic(normalized(camera, mosaic), camera.cfa)
    if settings.falloff is not None:
        raw *= settings.falloff.gain(*mosaic.shape)[..., None].astype(np.float32)
    raw = raw[BORDER // 2 : -BORDER // 2, BORDER:-BORDER]
    if settings.distortion is not None:
        # What the lens drew, as large as it fills the picture when it is straight
        lens = replace(settings.distortion, x=settings.distortion.x - BORDER, y=settings.distortion.y - BORDER // 2)
        size = np.array(raw.shape[1::-1])
        grid = np.stack(np.meshgrid(*(np.arange(side) + 0.5 for side in size)), axis=-1)
        edges = np.concatenate([grid[0], grid[-1], grid[:, 0], grid[:, -1]]) - size / 2
        zooms = np.linspace(0.8, 1.25, 901)
        fits = [np.all(np.abs(lens.drawn(size / 2 + zoom * edges) - size / 2) <= size / 2) for zoom in zooms]
        straight = size / 2 + zooms[np.flatnonzero(fits)[-1]] * (grid - size / 2)
        places = lens.drawn(straight) - (lens.x, lens.y)
        channels = []
        for channel, magnified in enumerate((1 + lens.red, 1.0, 1 + lens.blue)):
            x, y = np.moveaxis(magnified * places + (lens.x, lens.y), -1, 0)
            channels.append(ndimage.map_coordinates(raw[..., channel], [y - 0.5, x - 0.5], mode="nearest"))
        raw = np.stack(channels, axis=-1)
    return camera.render(raw, settings.style, settings.white_balance, settings.push_ev)


def shrink(picture: NDArray[np.uint8], scale: float) -> NDArray[np.uint8]:
    """A finished picture (h, w, 3) made smaller, with no more than its share of aliasing."""
    if scale == 1:
        return picture
    height, width, _ = picture.shape
    rows, columns = max(round(height * scale), 1), max(round(width * scale), 1)
    blur = 0.42 * np.sqrt(max(scale**-2 - 1, 0.0))
    soft = ndimage.gaussian_filter(picture.astype(np.float32), (blur, blur, 0), mode="nearest")
    y, x = ((np.arange(n) + 0.5) / n for n in (rows, columns))
    grid = np.meshgrid(y * height - 0.5, x * width - 0.5, indexing="ij")
    channels = [ndimage.map_coordinates(soft[..., c], grid, order=1, mode="nearest") for c in range(3)]
    return np.asarray(np.clip(np.rint(np.stack(channels, axis=-1)), 0, 255), dtype=np.uint8)


# --- The sensor: lens blur, filter array, photon and read noise, quantization; and demosaicking ----------------------


def capture(
    camera: SimulatedCamera, irradiance: Pixels, rng: np.random.Generator, iso: int = 100
) -> NDArray[np.uint16]:
    """One exposure: irradiance (h, w, 3), 1 = saturation, to a mosaic (h, w) of sensor codes.

    Shot noise is Poisson's, as a normal distribution: variance = electrons; read noise is added, then the
    value is clipped at saturation and rounded. A higher ISO fills less of the well.
    """
    blurred = ndimage.gaussian_filter(irradiance, (0.7, 0.7, 0), mode="nearest")  # pixels: lens and low-pass filter
    well = camera.full_well * 100 / iso
    electrons = np.minimum(filtered(blurred, camera.cfa), 1.5) * well
    noise = rng.standard_normal(electrons.shape, dtype=np.float32)
    electrons += noise * np.sqrt(np.maximum(electrons, 0) + camera.read_noise**2)
    codes = camera.black + electrons * ((camera.white - camera.black) / well)
    return np.clip(np.rint(codes), 0, camera.white).astype(np.uint16)


def filtered(image: Pixels, cfa: str) -> Pixels:
    """The mosaic (h, w) that a 2 × 2 filter array, such as "RGGB", lets through of an image (h, w, 3)."""
    mosaic = np.empty(image.shape[:2], dtype=image.dtype)
    for place, color in enumerate(cfa):
        row, column = divmod(place, 2)
        mosaic[row::2, column::2] = image[row::2, column::2, "RGB".index(color)]
    return mosaic


def normalized(camera: SimulatedCamera, mosaic: NDArray[np.uint16]) -> Pixels:
    """Sensor codes to E: black = 0, white = 1."""
    return (mosaic.astype(np.float32) - camera.black) / np.float32(camera.white - camera.black)


def demosaic(mosaic: Pixels, cfa: str) -> Pixels:
    """Full colour (h, w, 3) from a Bayer mosaic: gradient-corrected linear interpolation.

    Malvar, He & Cutler, "High-quality linear interpolation for demosaicing of Bayer-patterned color images" (ICASSP
    2004), figure 2: kernels times 16 for green at red or blue, red at green in a red row, red at green in a blue row,
    red at blue.
    """
    at_colour = [[0, 0, -2, 0, 0], [0, 0, 4, 0, 0], [-2, 4, 8, 4, -2], [0, 0, 4, 0, 0], [0, 0, -2, 0, 0]]
    in_row = [[0, 0, 1, 0, 0], [0, -2, 0, -2, 0], [-2, 8, 10, 8, -2], [0, -2, 0, -2, 0], [0, 0, 1, 0, 0]]
    at_other = [[0, 0, -3, 0, 0], [0, 4, 0, 4, 0], [-3, 0, 12, 0, -3], [0, 4, 0, 4, 0], [0, 0, -3, 0, 0]]
    green, along_row, along_column, diagonal = (
        ndimage.convolve(mosaic, np.array(kernel, dtype=np.float32) / 16, mode="mirror")
        for kernel in (at_colour, in_row, np.transpose(in_row), at_other)
    )
    image = np.empty((*mosaic.shape, 3), dtype=np.float32)
    for place, color in enumerate(cfa):
        area = (slice(place // 2, None, 2), slice(place % 2, None, 2))
        if color == "G":
            row_color = "RGB".index(cfa[place ^ 1])  # the filter beside this one
            image[..., 1][area] = mosaic[area]
            image[..., row_color][area] = along_row[area]
            image[..., 2 - row_color][area] = along_column[area]
        else:
            own = "RGB".index(color)
            image[..., own][area] = mosaic[area]
            image[..., 1][area] = green[area]
            image[..., 2 - own][area] = diagonal[area]
    return image
