"""Take photographs with the simulated camera: DNGs of the noisy mosaic, and the JPEGs developed from it."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Literal
from zlib import crc32

import numpy as np
import OpenImageIO as oiio  # noqa: N813 -- the name that its own documentation uses
import rawpy
from numpy.typing import ArrayLike, NDArray
from scipy import ndimage

from lutforge.arrays import Array, Pixels
from lutforge.atomic_write import atomic_path
from lutforge.colour.srgb import SRGB_TO_XYZ
from lutforge.images.jpeg import read_header
from lutforge.images.read import Image
from lutforge.images.tiff import Field, TiffWriter, byte_field, long_field, rational_field, short_field, text_field
from lutforge.images.write import write_image
from lutforge.model.vignetting import Vignetting
from lutforge.model.white_balance import LIGHT_SOURCES
from lutforge.shots.geometry import Distortion
from lutforge.simulate.camera import SimulatedCamera
from lutforge.simulate.scene import Scene

Subsampling = Literal["4:4:4", "4:2:2", "4:2:0"]
BORDER = 8
"""Sensor pixels left out of the JPEG at the left and at the right; half as many above and below."""


@dataclass(frozen=True)
class CameraSettings:
    """The dials of the camera.

    preview_scale: size of the embedded JPEG relative to the full one. push_ev: brightening in the development, in
    stops. orientation: how the camera was held (TIFF 1, 3, 6 or 8); pixels stay as the sensor has them.
    vignetting: what the lens loses, which the development brings back. distortion: how the lens bends
    the scene, which the development straightens and scales to fill the JPEG.
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


@dataclass(frozen=True)
class Photograph:
    """The files of one shot; `jpeg` is None where only the preview inside the DNG was asked for."""

    dng: Path
    jpeg: Path | None


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

    light: the white-balance name whose light falls on the scene, if not the camera's. The noise is of seed and name.
    """
    irradiance = scene.irradiance(camera, light or settings.white_balance, settings.exposure_s)
    if settings.vignetting is not None:
        irradiance /= settings.vignetting.gain(*irradiance.shape[:2]).astype(np.float32)
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


def develop(camera: SimulatedCamera, mosaic: NDArray[np.uint16], settings: CameraSettings) -> NDArray[np.uint8]:
    """What the camera does to its mosaic (h, w) for a JPEG: all of `rendered`, rounded to 8 bits."""
    return np.rint(255 * rendered(camera, mosaic, settings)).astype(np.uint8)


def rendered(camera: SimulatedCamera, mosaic: NDArray[np.uint16], settings: CameraSettings) -> Array:
    """Encoded values (h, w, 3) of a mosaic (h, w): demosaicked, its border cropped, and rendered."""
    raw = demosaic(normalized(camera, mosaic), camera.cfa)
    if settings.vignetting is not None:
        raw *= settings.vignetting.gain(*mosaic.shape).astype(np.float32)
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


def capture(camera: SimulatedCamera, light: Pixels, rng: np.random.Generator, iso: int = 100) -> NDArray[np.uint16]:
    """One exposure: light on the sensor (h, w, 3), 1 = saturation, to a mosaic (h, w) of sensor codes."""
    # Shot noise is Poisson's, as a normal distribution: variance = electrons. A higher ISO fills less of the well.
    blurred = ndimage.gaussian_filter(light, (0.7, 0.7, 0), mode="nearest")  # pixels: lens and low-pass filter
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
    2004), figure 2: kernels times 16 for green at red or blue, red at green in a red or blue row, red at blue.
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


# --- A Bayer mosaic as a DNG 1.4 file (Adobe, "Digital Negative Specification", 2012; TIFF 6.0; Exif) -----------------
# IFD 0 holds the embedded JPEG preview and the camera's metadata, its SubIFD the mosaic, its Exif IFD the exposure, as
# the specification recommends. Without a preview the mosaic is in IFD 0.


DATE_TIME = "2015:06:15 12:00:00"


def write_dng(
    path: str | Path,
    mosaic: NDArray[np.uint16],
    *,
    black: int = 0,
    white: int = 65535,
    cfa: str = "RGGB",
    as_shot_neutral: Iterable[float] = (1.0, 1.0, 1.0),
    color_matrix: ArrayLike | None = None,
    make: str = "LutForge",
    model: str = "Simulated",
    exposure_s: float = 1 / 60,
    f_number: float = 8.0,
    iso: int = 100,
    light_source: int = 0,
    saturation: int = 0,
    profile_name: str | None = None,
    preview_jpeg: bytes | None = None,
    orientation: int = 1,
) -> None:
    """Write a mosaic (h, w) of sensor codes, with the metadata that RAW converters need, atomically.

    black, white: the codes of no light and of saturation. cfa: colours of the top-left 2 × 2 pixels by row.
    as_shot_neutral: camera RGB of a neutral surface; its reciprocals are the multipliers. color_matrix: XYZ →
    camera RGB (3, 3), None where the sensor sees linear sRGB. light_source, saturation: codes of the Exif tags.
    profile_name: the picture style. preview_jpeg: a whole JPEG file. orientation: 1 … 8 (TIFF).
    """
    matrix = np.asarray(np.linalg.inv(SRGB_TO_XYZ) if color_matrix is None else color_matrix, dtype=np.float64)
    tiff = TiffWriter()
    raw = _mosaic_fields(tiff, mosaic, black, white, cfa)
    first = raw if preview_jpeg is None else _preview_fields(tiff, preview_jpeg)
    if preview_jpeg is not None:
        first[330] = long_field(tiff.directory(raw))  # SubIFDs
    first |= {
        271: text_field(make),
        272: text_field(model),
        274: short_field(orientation),
        305: text_field("LutForge simulated camera"),
        306: text_field(DATE_TIME),
        50706: byte_field(1, 4, 0, 0),  # DNGVersion
        50707: byte_field(1, 1, 0, 0),  # DNGBackwardVersion
        50708: text_field(model if model.lower().startswith(make.lower()) else f"{make} {model}"),  # UniqueCameraModel
        50721: rational_field(matrix.ravel(), signed=True),  # ColorMatrix1
        50728: rational_field(as_shot_neutral),
        50778: short_field(21),  # CalibrationIlluminant1: D65
    }
    if profile_name is not None:
        first |= {50934: text_field(profile_name), 50936: text_field(profile_name)}  # AsShotProfileName, ProfileName
    exif: dict[int, Field] = {
        33434: rational_field([exposure_s]),
        33437: rational_field([f_number]),
        34850: short_field(1),  # ExposureProgram: manual
        34855: short_field(iso),
        36864: (7, 4, b"0232"),  # ExifVersion, of type UNDEFINED
        36867: text_field(DATE_TIME),
        37384: short_field(light_source),
        41986: short_field(1),  # ExposureMode: manual
        41987: short_field(int(light_source != 0)),  # WhiteBalance: 0 auto, 1 manual
        41993: short_field(saturation),
    }
    first[34665] = long_field(tiff.directory(exif))
    content = tiff.finish(tiff.directory(first))
    with atomic_path(path) as temporary:
        temporary.write_bytes(content)


def _mosaic_fields(tiff: TiffWriter, mosaic: NDArray[np.uint16], black: int, white: int, cfa: str) -> dict[int, Field]:
    height, width = mosaic.shape
    pixels = mosaic.astype("<u2", copy=False).tobytes()
    return {
        254: long_field(0),  # NewSubfileType: the main image
        256: long_field(width),
        257: long_field(height),
        258: short_field(16),
        259: short_field(1),  # uncompressed
        262: short_field(32803),  # PhotometricInterpretation: colour filter array
        273: long_field(tiff.append(pixels)),
        277: short_field(1),
        278: long_field(height),
        279: long_field(len(pixels)),
        284: short_field(1),
        33421: short_field(2, 2),
        33422: byte_field(*("RGB".index(color) for color in cfa)),  # CFAPattern (TIFF/EP)
        50710: byte_field(0, 1, 2),  # CFAPlaneColor
        50711: short_field(1),  # CFALayout: rectangular
        50713: short_field(1, 1),
        50714: short_field(black),
        50717: short_field(white),
        50718: rational_field([1.0, 1.0]),
        50719: long_field(0, 0),  # DefaultCropOrigin
        50720: long_field(width, height),
        50829: long_field(0, 0, height, width),  # ActiveArea
    }


def _preview_fields(tiff: TiffWriter, jpeg: bytes) -> dict[int, Field]:
    header = read_header(jpeg)
    assert header is not None
    return {
        254: long_field(1),  # NewSubfileType: a reduced-resolution image
        256: long_field(header.width),
        257: long_field(header.height),
        258: short_field(8, 8, 8),
        259: short_field(7),  # JPEG
        262: short_field(6),  # YCbCr
        273: long_field(tiff.append(jpeg)),
        277: short_field(3),
        278: long_field(header.height),
        279: long_field(len(jpeg)),
        284: short_field(1),
        530: short_field(*header.sampling[0]),
        532: rational_field([0, 255, 128, 255, 128, 255]),
        50970: long_field(2),  # PreviewColorSpace: sRGB
    }
