"""RAW files, read by LibRaw: demosaicked linear camera RGB on [0, 1], and the metadata of the shot."""

import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import rawpy
from numpy.typing import NDArray

from lutforge.arrays import Array, Index, Single
from lutforge.boundary import reading, require_file
from lutforge.colour.srgb import SRGB_TO_XYZ
from lutforge.compiled import compiled
from lutforge.errors import ImageError
from lutforge.images.films import FILM_ADVICE, FILM_SUFFIXES
from lutforge.images.orientation import ORIENTATION_OF_FLIP
from lutforge.images.saturation import clip_levels


@dataclass(frozen=True, eq=False)
class RawImage:
    """Demosaicked RAW in sensor orientation, before white balance.

    pixels: (h, w, 3) float32, linear; 0 = black level, 1 = sensor saturation; saturated pixels are exactly 1.
    pixel_size: side of one array pixel in full-resolution pixels of the visible area: 1, or 2 at half size. Array pixel
    i covers [pixel_size * i, pixel_size * (i + 1)]. flip: LibRaw's code of what displays the picture upright, a key of
    `ORIENTATION_OF_FLIP`; orientation: the same as EXIF numbers it. multipliers: (3,) as-shot white balance with green
    = 1; None where the file has none that is valid. preview: the embedded JPEG; None where there is none, for the
    reason in `preview_note`. exposure_s, iso, focal_mm, aperture (f-number): NaN where unknown. lens: its name; taken:
    the time of the exposure, as EXIF writes it; both "" where unknown. d65: (3,) multipliers with green = 1 under which
    light D65 is neutral, from_xyz: (3, 3) XYZ → RAW of any scale; both None where neither LibRaw nor a DNG file states
    them. clip_level: (3,) the level from which pixels of this file are saturated.
    """

    pixels: Single
    pixel_size: float
    flip: int
    multipliers: Array | None
    preview: bytes | None
    preview_note: str
    exposure_s: float
    iso: float
    clip_level: Array
    focal_mm: float = math.nan
    aperture: float = math.nan
    lens: str = ""
    taken: str = ""
    d65: Array | None = None
    from_xyz: Array | None = None

    @property
    def orientation(self) -> int:
        """Orientation (1 … 8) of the pixels."""
        return ORIENTATION_OF_FLIP.get(self.flip, 1)


_CONVERTER_ADVICE = (
    "if it is whole, LibRaw does not know its camera or its compression yet: convert it with Adobe DNG Converter, with "
    "the compatibility Camera Raw 11.2"
)
"""For compressions such as a GoPro's, JPEG XL in DNG, and Nikon's high efficiency."""


def read_raw(path: Path | str, half_size: bool = False) -> RawImage:
    """Decode a RAW file with LibRaw: no white balance, no brightening, no highlight recovery, no rotation.

    half_size: one pixel per 2×2 Bayer block, red and blue moved to its centre, for sampling colours: no demosaicking
    artefact enters a mean. Black and white level are the camera's, so shots stay comparable. Raises ImageError.
    """
    path = Path(path)
    require_file(path, "a RAW file", ImageError)
    with _translated(path), rawpy.imread(str(path)) as raw:
        _require_supported(raw, path)

        # All of this before postprocess, which changes sizes, colour indices and the flip.
        flip = int(raw.sizes.flip)
        colours = np.zeros((0, 0), np.uint8)  # indices of the pattern that repeats over the visible mosaic
        if raw.raw_type is rawpy.RawType.Flat and raw.raw_pattern is not None and raw.raw_image_visible.ndim == 2:
            colours = np.roll(raw.raw_pattern, (-raw.sizes.top_margin, -raw.sizes.left_margin), axis=(0, 1))
        scale, clip_scale = _scales_to_saturation(raw, colours)
        clip_level = np.minimum(1.0, clip_levels(raw, colours) * clip_scale)
        steps = _steps_to_centres(colours) if half_size else np.zeros((3, 2), np.intp)

        rendered = raw.postprocess(
            half_size=half_size, gamma=(1, 1), output_color=rawpy.ColorSpace.raw, user_wb=[1, 1, 1, 1],
            no_auto_bright=True, adjust_maximum_thr=0, highlight_mode=rawpy.HighlightMode.Clip, output_bps=16,
            user_flip=0,
        )  # fmt: skip
        if rendered.ndim != 3 or rendered.shape[2] != 3 or 0 in rendered.shape:
            raise ImageError(f"{path}: LibRaw made an image of shape {rendered.shape} of it, not one of three colours")
        preview, preview_note = _preview(raw)

        # In many files pixels saturate below the camera's nominal level: these are set to 1, too.
        pixels = np.empty(rendered.shape, np.float32)
        clipped = (clip_level - 3e-5).astype(np.float32)  # LibRaw's white is one of the two highest codes of 16 bits
        _finish(rendered.view(np.uint16), (scale / 65535).astype(np.float32), clipped, steps, pixels)

        shot = raw.other  # LibRaw's name of the data on the exposure
        date = shot.timestamp
        numbers = (shot.shutter_speed, shot.iso_speed, shot.focal_length, shot.aperture)
        exposure_s, iso, focal_mm, aperture = (
            float(value) if math.isfinite(value) and value > 0 else math.nan for value in numbers
        )
        # LibRaw's multipliers of daylight are from its own table, or from the ColorMatrix that a DNG file states.
        by_dng = path.suffix.lower() == ".dng" and bool(np.any(raw.color_matrix))
        return RawImage(
            pixels=pixels,
            pixel_size=2.0 if half_size else 1.0,
            flip=flip,
            multipliers=_multipliers(list(raw.camera_whitebalance)),
            preview=preview,
            preview_note=preview_note,
            exposure_s=exposure_s,
            iso=iso,
            clip_level=clip_level,
            focal_mm=focal_mm,
            aperture=aperture,
            lens=" ".join(str(raw.lens.model).split()),
            taken="" if date is None or date.year < 1980 else date.strftime("%Y:%m:%d %H:%M:%S"),  # the epoch: unknown
            d65=_multipliers(list(raw.daylight_whitebalance)) if by_dng or np.any(raw.rgb_xyz_matrix) else None,
            from_xyz=_from_xyz(raw, by_dng=by_dng),
        )


def _require_supported(raw: rawpy.RawPy, path: Path) -> None:
    """Raise ImageError on a damaged file, and on a sensor with other colours than red, green and blue."""
    # The largest sensors have about 150 million pixels. A file that claims more than 64 pixels per byte cannot hold
    # them: it is truncated, or made to exhaust memory.
    pixels = int(raw.sizes.raw_width) * int(raw.sizes.raw_height)
    size = path.stat().st_size
    if pixels > 400_000_000 or pixels > 64 * size:
        claim = f"{raw.sizes.raw_width} × {raw.sizes.raw_height} pixels"
        raise ImageError(f"{path}: claims {claim}, which {size} bytes cannot hold; the file is damaged")
    names = raw.color_desc.decode("ascii", "replace")
    if raw.num_colors == 1:
        raise ImageError(f"{path}: a monochrome sensor; colour calibration needs three colours")
    if raw.num_colors != 3 or not set("RGB") <= set(names):
        mosaic = f"a mosaic of {raw.num_colors} colours ({names})"
        raise ImageError(f"{path}: {mosaic}; only red-green-blue sensors are supported")


def _steps_to_centres(colours: NDArray[np.uint8]) -> Index:
    """The steps (3, 2), in rows and columns, −1 … 1, from a 2 × 2 block to the neighbour that a channel is mixed with.

    Red and blue are sampled at a corner of each Bayer block; the centre of the block lies between this sample and that
    of the neighbour. The steps are 0 for green, whose samples lie around the centre, and for any other mosaic.
    """
    steps = np.zeros((3, 2), np.intp)
    for channel in (0, 2) if colours.shape == (2, 2) else ():
        corner = np.argwhere(colours == channel)
        if len(corner) == 1:
            steps[channel] = 1 - 2 * corner[0]
    return steps


def _from_xyz(raw: rawpy.RawPy, *, by_dng: bool) -> Array | None:
    """(3, 3) XYZ → RAW before white balance, of any scale; None where unknown.

    by_dng: a DNG file states it; LibRaw has converted it to white-balanced RAW → linear sRGB, and multipliers of D65.
    """
    if by_dng:
        to_srgb = np.array(raw.color_matrix, dtype=np.float64)[:, :3]
        d65 = np.array(raw.daylight_whitebalance[:3])
        if _is_usable(to_srgb) and np.all(d65 > 0):
            return np.asarray(np.linalg.inv(SRGB_TO_XYZ @ to_srgb @ np.diag(d65)))
    matrix = np.array(raw.rgb_xyz_matrix, dtype=np.float64)[:3]
    return matrix if _is_usable(matrix) else None


def _is_usable(matrix: Array) -> bool:
    """True of 3 × 3 finite numbers that can be inverted."""
    return matrix.shape == (3, 3) and bool(np.all(np.isfinite(matrix)) and np.linalg.cond(matrix) < 1e4)


def read_multipliers(path: Path | str) -> Array | None:
    """As-shot white balance (3,) of a RAW file with green = 1, without decoding it; None where it has no valid one."""
    path = Path(path)
    require_file(path, "a RAW file", ImageError)
    with _translated(path), rawpy.imread(str(path)) as raw:
        return _multipliers(list(raw.camera_whitebalance))


def read_preview(path: Path | str) -> tuple[bytes, int]:
    """The embedded JPEG of a RAW file, without decoding that, and its orientation (1 … 8). Raises ImageError: none."""
    path = Path(path)
    require_file(path, "a RAW file", ImageError)
    with _translated(path), rawpy.imread(str(path)) as raw:
        preview, note = _preview(raw)
        if preview is None:
            raise ImageError(f"{path}: {note}")
        return preview, ORIENTATION_OF_FLIP.get(int(raw.sizes.flip), 1)


@contextmanager
def _translated(path: Path) -> Iterator[None]:
    """Turn LibRaw's errors into ImageError."""
    try:
        with reading(path, "a RAW file, it is damaged or unsupported", ImageError):
            yield
    except ImageError as error:
        if isinstance(error.__cause__, rawpy.LibRawFileUnsupportedError):
            advice = FILM_ADVICE if path.suffix.lower() in FILM_SUFFIXES else _CONVERTER_ADVICE
            raise ImageError(f"{path}: not a RAW file that LibRaw can read; {advice}") from error
        raise


def _preview(raw: rawpy.RawPy) -> tuple[bytes | None, str]:
    """The embedded JPEG, or None, and a note: what it is, or why there is none."""
    try:
        thumbnail = raw.extract_thumb()
    except rawpy.LibRawNoThumbnailError:
        return None, "no embedded preview"
    except Exception:  # LibRaw's errors, OSError for positive codes, assertions on odd geometry
        return None, "an embedded preview of a kind that LibRaw cannot extract"
    if thumbnail.format is not rawpy.ThumbFormat.JPEG or not isinstance(thumbnail.data, bytes):
        height, width = np.shape(thumbnail.data)[:2]
        return None, f"only a {width}×{height} bitmap thumbnail"
    return thumbnail.data, "embedded JPEG preview"


def _scales_to_saturation(raw: rawpy.RawPy, colours: NDArray[np.uint8]) -> tuple[Array, Array]:
    """Factors (3,) from LibRaw's output, and from 1 = white level above black, to 1 = saturation.

    LibRaw subtracts each colour's black level, and divides all colours by the white level above the lowest black. Maker
    notes may state per channel the level up to which the sensor is linear, below LibRaw's white level: the lowest is
    used for all channels, so that these keep their ratios; an implausible one is ignored.
    """
    levels = raw.camera_white_level_per_channel
    blacks = np.array(raw.black_level_per_channel, dtype=np.float64)
    black = blacks[:3].copy()
    if 3 in colours:
        black[1] = (blacks[1] + blacks[3]) / 2
    white = float(raw.white_level)
    nominal = white - blacks.min()
    linear = float(min(levels)) if levels else white
    if not 0.75 * nominal <= linear - blacks.min() <= nominal:
        linear = white
    if not np.all(linear > black):
        return np.ones(3), np.ones(3)
    return nominal / (linear - black), (white - black) / (linear - black)


@compiled()
def _finish(rendered: NDArray[np.uint16], scales: Single, clip_level: Single, steps: Index, pixels: Single) -> None:
    """Fill pixels (h, w, 3) with LibRaw's codes, scaled; red and blue are moved to the centres of their blocks.

    Clipped pixels become 1. A channel that is sampled at one corner of each block is interpolated a quarter of a block
    from there (steps: see `_steps_to_centres`); without this, red and blue are a whole sensor pixel apart.
    """
    height, width = rendered.shape[:2]
    near = np.float32(0.75)
    far = np.float32(0.25)
    line = np.empty(width, np.float32)
    for y in range(height):
        for channel in range(3):
            scale = scales[channel]
            down, right = steps[channel]
            row = rendered[y, :, channel]
            neighbour = rendered[min(max(y + down, 0), height - 1), :, channel]
            for x in range(width):
                line[x] = np.float32(row[x]) * scale
                if down:
                    line[x] = near * line[x] + far * (np.float32(neighbour[x]) * scale)
            for x in range(width):
                value = line[x]
                if right:
                    value = near * value + far * line[min(max(x + right, 0), width - 1)]
                clipped = np.float32(row[x]) * scale >= clip_level[channel]
                pixels[y, x, channel] = np.float32(1) if clipped else min(value, np.float32(1))


def _multipliers(camera: list[float]) -> Array | None:
    """As-shot multipliers with green = 1; None where LibRaw does not know them: −1, 0, NaN, all equal."""
    red, green, blue = camera[:3]
    second = camera[3] if len(camera) > 3 else 0.0
    if second > 0 and math.isfinite(second) and green > 0:
        green = (green + second) / 2
    values = np.array([red, green, blue], dtype=np.float64)
    if not np.all(np.isfinite(values)) or np.any(values <= 0) or np.all(values == values[0]):
        return None
    values /= values[1]
    return values if np.all((values > 0.05) & (values < 20)) else None
