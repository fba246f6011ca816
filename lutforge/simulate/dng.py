"""A Bayer mosaic as a DNG 1.4 file (Adobe, "Digital Negative Specification", 2012; TIFF 6.0; Exif).

IFD 0 holds the embedded JPEG preview and the camera's metadata, its SubIFD the mosaic, its Exif IFD the exposure, as
the specification recommends. Without a preview the mosaic is in IFD 0.
"""

from collections.abc import Iterable
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lutforge.atomic_write import atomic_path
from lutforge.colour.srgb import SRGB_TO_XYZ
from lutforge.images.jpeg import read_header
from lutforge.images.tiff_writer import (
    Field,
    TiffWriter,
    byte_field,
    long_field,
    rational_field,
    short_field,
    text_field,
)

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
