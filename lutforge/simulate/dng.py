"""Write a Bayer mosaic as a DNG 1.4 file (Adobe, "Digital Negative Specification", 2012; TIFF 6.0; Exif).

IFD 0 holds the embedded JPEG preview and the camera's metadata, its SubIFD the mosaic, its Exif IFD the
exposure, as the specification recommends. Without a preview the mosaic is in IFD 0.
"""

import struct
from collections.abc import Iterable, Mapping
from fractions import Fraction
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lutforge.arrays import Array
from lutforge.atomic_write import atomic_path
from lutforge.colour.srgb import SRGB_TO_XYZ
from lutforge.errors import ImageError

LIGHT_SOURCES: Final[Mapping[str, int]] = {
    "auto": 0,
    "daylight": 1,
    "fluorescent": 2,
    "tungsten": 3,
    "flash": 4,
    "cloudy": 10,
    "shade": 11,
}
"""White-balance names and their codes in the Exif tag LightSource (Exif 2.32, 4.6.5)."""

CFA_COLORS: Final = "RGB"
"""A colour's place here is its code in CFAPattern (TIFF/EP)."""

Field = tuple[int, int, bytes]
"""Type, count and packed values of one TIFF field."""


def write_dng(
    path: str | Path,
    mosaic: NDArray[np.uint16],
    *,
    black: int = 0,
    white: int = 65535,
    cfa: str = "RGGB",
    as_shot_neutral: ArrayLike = (1.0, 1.0, 1.0),
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
    date_time: str = "2015:06:15 12:00:00",
) -> None:
    """Write a mosaic (h, w) of sensor codes, with the metadata that RAW converters need, atomically.

    black, white: the codes of no light and of saturation. cfa: colours of the top-left 2 × 2 pixels by row.
    as_shot_neutral: camera RGB of a neutral surface; its reciprocals are the multipliers. color_matrix: XYZ →
    camera RGB (3, 3), None where the sensor sees linear sRGB. light_source, saturation: codes of the Exif tags.
    profile_name: the picture style. preview_jpeg: a whole JPEG file. orientation: 1 … 8 (TIFF). Raises ImageError on
    an illegal argument.
    """
    matrix = np.linalg.inv(SRGB_TO_XYZ) if color_matrix is None else np.asarray(color_matrix, dtype=np.float64)
    neutral = np.asarray(as_shot_neutral, dtype=np.float64)
    _validate(path, mosaic, black, white, cfa, orientation)
    _validate_numbers(path, np.array([exposure_s, f_number, *neutral.ravel()]), matrix, iso, light_source, saturation)
    tiff = _TiffWriter()
    raw = _mosaic_fields(tiff, mosaic, black, white, cfa)
    first = raw if preview_jpeg is None else _preview_fields(tiff, preview_jpeg, path)
    if preview_jpeg is not None:
        first[330] = _longs(tiff.directory(raw))  # SubIFDs
    first |= {
        271: _ascii(make),
        272: _ascii(model),
        274: _shorts(orientation),
        305: _ascii("LutForge simulated camera"),
        306: _ascii(date_time),
        50706: _bytes(1, 4, 0, 0),  # DNGVersion
        50707: _bytes(1, 1, 0, 0),  # DNGBackwardVersion
        50708: _ascii(model if model.lower().startswith(make.lower()) else f"{make} {model}"),  # UniqueCameraModel
        50721: _rationals(matrix.ravel(), signed=True),  # ColorMatrix1
        50728: _rationals(neutral),
        50778: _shorts(21),  # CalibrationIlluminant1: D65
    }
    if profile_name is not None:
        first |= {50934: _ascii(profile_name), 50936: _ascii(profile_name)}  # AsShotProfileName, ProfileName
    exif = _exif_fields(exposure_s, f_number, iso, light_source, saturation, date_time)
    first[34665] = _longs(tiff.directory(exif))
    content = tiff.finish(tiff.directory(first))
    with atomic_path(path) as temporary:
        temporary.write_bytes(content)


def _validate(path: str | Path, mosaic: NDArray[np.uint16], black: int, white: int, cfa: str, orientation: int) -> None:
    if mosaic.ndim != 2 or mosaic.dtype != np.uint16 or 0 in mosaic.shape:
        raise ImageError(f"{path}: a mosaic is a uint16 array (h, w), not {mosaic.dtype} {mosaic.shape}")
    if len(cfa) != 4 or set(cfa) != set(CFA_COLORS):
        raise ImageError(f'{path}: "{cfa}" is not a Bayer pattern; write for example "RGGB"')
    if not 0 <= black < white <= 65535:
        raise ImageError(f"{path}: black level {black} and white level {white} are not 0 ≤ black < white ≤ 65535")
    if not 1 <= orientation <= 8:
        raise ImageError(f"{path}: orientation {orientation} is not 1 … 8")


def _validate_numbers(
    path: str | Path, positive: Array, matrix: Array, iso: int, light_source: int, saturation: int
) -> None:
    """Larger numbers are no exposure, aperture, neutral or matrix, and with six decimals overflow a rational."""
    for key, number in (("ISO", iso), ("light source", light_source), ("saturation", saturation)):
        if not 0 <= number <= 65535:
            raise ImageError(f"{path}: {key} {number} is not 0 … 65535")
    if not np.all((positive > 1e-6) & (positive < 2000)):
        raise ImageError(f"{path}: exposure, aperture and neutral are not all positive numbers: {positive}")
    if not np.all(np.abs(matrix) < 2000):
        raise ImageError(f"{path}: the colour matrix holds something that is not a number, or is too large")


def _exif_fields(
    exposure_s: float, f_number: float, iso: int, light_source: int, saturation: int, date_time: str
) -> dict[int, Field]:
    return {
        33434: _rationals([exposure_s]),
        33437: _rationals([f_number]),
        34850: _shorts(1),  # ExposureProgram: manual
        34855: _shorts(iso),
        36864: (7, 4, b"0232"),  # ExifVersion, of type UNDEFINED
        36867: _ascii(date_time),
        37384: _shorts(light_source),
        41986: _shorts(1),  # ExposureMode: manual
        41987: _shorts(int(light_source != 0)),  # WhiteBalance: 0 auto, 1 manual
        41993: _shorts(saturation),
    }


def _mosaic_fields(
    tiff: "_TiffWriter", mosaic: NDArray[np.uint16], black: int, white: int, cfa: str
) -> dict[int, Field]:
    height, width = mosaic.shape
    pixels = mosaic.astype("<u2", copy=False).tobytes()
    return {
        254: _longs(0),  # NewSubfileType: the main image
        256: _longs(width),
        257: _longs(height),
        258: _shorts(16),
        259: _shorts(1),  # uncompressed
        262: _shorts(32803),  # PhotometricInterpretation: colour filter array
        273: _longs(tiff.append(pixels)),
        277: _shorts(1),
        278: _longs(height),
        279: _longs(len(pixels)),
        284: _shorts(1),
        33421: _shorts(2, 2),
        33422: _bytes(*(CFA_COLORS.index(color) for color in cfa)),
        50710: _bytes(0, 1, 2),  # CFAPlaneColor
        50711: _shorts(1),  # CFALayout: rectangular
        50713: _shorts(1, 1),
        50714: _shorts(black),
        50717: _shorts(white),
        50718: _rationals([1.0, 1.0]),
        50719: _longs(0, 0),  # DefaultCropOrigin
        50720: _longs(width, height),
        50829: _longs(0, 0, height, width),  # ActiveArea
    }


def _preview_fields(tiff: "_TiffWriter", jpeg: bytes, path: str | Path) -> dict[int, Field]:
    width, height, sampling = _jpeg_frame(jpeg, path)
    return {
        254: _longs(1),  # NewSubfileType: a reduced-resolution image
        256: _longs(width),
        257: _longs(height),
        258: _shorts(8, 8, 8),
        259: _shorts(7),  # JPEG
        262: _shorts(6),  # YCbCr
        273: _longs(tiff.append(jpeg)),
        277: _shorts(3),
        278: _longs(height),
        279: _longs(len(jpeg)),
        284: _shorts(1),
        530: _shorts(*sampling),
        532: _rationals([0, 255, 128, 255, 128, 255]),
        50970: _longs(2),  # PreviewColorSpace: sRGB
    }


def _jpeg_frame(jpeg: bytes, path: str | Path) -> tuple[int, int, tuple[int, int]]:
    """Width, height and chroma subsampling (h, v) from the frame header (ITU-T T.81, B.2.2)."""
    position = 2
    while jpeg[:2] == b"\xff\xd8" and position + 12 <= len(jpeg) and jpeg[position] == 0xFF:
        marker, length = struct.unpack_from(">BH", jpeg, position + 1)
        if 0xC0 <= marker <= 0xC2:
            height, width, components, _, factors = struct.unpack_from(">HHBBB", jpeg, position + 5)
            if components == 3:
                return width, height, (factors >> 4, factors & 15)
            break
        position += 2 + length
    raise ImageError(f"{path}: the preview to embed is not a colour JPEG file")


class _TiffWriter:
    """Collects the blocks of a little-endian TIFF file; a block's offset is known once it is appended."""

    def __init__(self) -> None:
        self._content = bytearray(struct.pack("<2sHI", b"II", 42, 0))

    def append(self, block: bytes) -> int:
        """Add a block on an even offset and return the offset."""
        self._content += b"\0" * (len(self._content) % 2)
        offset = len(self._content)
        self._content += block
        return offset

    def directory(self, fields: Mapping[int, Field]) -> int:
        """Add an image file directory, tags in rising order, and return its offset."""
        entries = bytearray(struct.pack("<H", len(fields)))
        for tag, (kind, count, values) in sorted(fields.items()):
            inline = values.ljust(4, b"\0") if len(values) <= 4 else struct.pack("<I", self.append(values))
            entries += struct.pack("<HHI", tag, kind, count) + inline
        return self.append(bytes(entries + struct.pack("<I", 0)))

    def finish(self, first_directory: int) -> bytes:
        struct.pack_into("<I", self._content, 4, first_directory)
        return bytes(self._content)


# The fields of TIFF: their type code, their count, and their values packed.


def _bytes(*values: int) -> Field:
    return 1, len(values), bytes(values)


def _ascii(text: str) -> Field:
    values = text.encode() + b"\0"
    return 2, len(values), values


def _shorts(*values: int) -> Field:
    return 3, len(values), struct.pack(f"<{len(values)}H", *values)


def _longs(*values: int) -> Field:
    return 4, len(values), struct.pack(f"<{len(values)}I", *values)


def _rationals(values: Iterable[float], signed: bool = False) -> Field:
    pairs = [Fraction(float(value)).limit_denominator(1_000_000) for value in values]
    numbers = [number for pair in pairs for number in pair.as_integer_ratio()]
    return 10 if signed else 5, len(pairs), struct.pack(f"<{len(numbers)}{'i' if signed else 'I'}", *numbers)
