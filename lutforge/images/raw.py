"""RAW files: demosaicked linear camera RGB on [0, 1], and what the file says about itself."""

import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import rawpy
from numpy.typing import NDArray

from lutforge.arrays import Array, Index, Pixels, Single
from lutforge.boundary import reading, require_file
from lutforge.colour.srgb import SRGB_TO_XYZ
from lutforge.compiled import compiled
from lutforge.errors import ImageError
from lutforge.images.orientation import ORIENTATION_OF_FLIP


@dataclass(frozen=True, eq=False)
class RawImage:
    """Demosaicked RAW in sensor orientation, before white balance.

    pixels: (h, w, 3) float32, linear; 0 = black level, 1 = sensor saturation; saturated pixels are exactly 1.
    pixel_size: side of one array pixel in full-resolution pixels of the visible area: 1, or 2 at half size. Array pixel
    i covers [pixel_size * i, pixel_size * (i + 1)]. flip: LibRaw's code of what displays the picture upright, a key of
    `ORIENTATION_OF_FLIP`; orientation: the same as EXIF numbers it. multipliers: (3,) as-shot white balance with green
    = 1; None where the file has none that is valid. preview: the embedded JPEG, else `preview_note` says why there is
    none. exposure_s, iso, focal_mm, aperture (f-number): NaN where unknown. lens: its name; taken: EXIF's form of the
    time of the exposure; "" where unknown. d65: (3,) multipliers with green = 1 that make light D65 neutral, where
    LibRaw or a DNG file knows the camera's colours. clip_level: (3,) level above which this file's pixels were taken
    for saturated.
    """

    pixels: Pixels
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


def read_raw(path: Path | str, half_size: bool = False) -> RawImage:
    """Decode a RAW file with LibRaw: no white balance, no brightening, no highlight recovery, no rotation.

    half_size: one pixel per 2×2 Bayer block, red and blue moved to its centre, for sampling colours: no demosaicking
    artefact enters a mean. Black and white level are the camera's, so shots stay comparable. Raises ImageError.
    """
    path = Path(path)
    require_file(path, "a RAW file", ImageError)
    with _translated(path), rawpy.imread(str(path)) as raw:
        # Above this a file's claimed size is not believed (the largest sensors have about 150 million). A file that
        # claims more pixels than this per byte cannot hold them: it is truncated, or made to exhaust memory.
        size, most = int(raw.sizes.raw_width) * int(raw.sizes.raw_height), path.stat().st_size
        if size > 400_000_000 or size > 64 * most:
            claim = f"{raw.sizes.raw_width} × {raw.sizes.raw_height} pixels"
            raise ImageError(f"{path}: claims {claim}, which {most} bytes cannot hold; the file is damaged")
        names = raw.color_desc.decode("ascii", "replace")
        if raw.num_colors == 1:
            raise ImageError(f"{path}: a monochrome sensor; colour calibration needs three colours")
        if raw.num_colors != 3 or not set("RGB") <= set(names):
            colours_of = f"a mosaic of {raw.num_colors} colours ({names})"
            raise ImageError(f"{path}: {colours_of}; only red-green-blue sensors are supported")
        # Before postprocess, which leaves sizes, colour indices and the flip changed.
        flip = int(raw.sizes.flip)
        colours = np.zeros((0, 0), np.uint8)  # indices of the pattern that repeats over the visible mosaic
        if raw.raw_type is rawpy.RawType.Flat and raw.raw_pattern is not None and raw.raw_image_visible.ndim == 2:
            colours = np.roll(raw.raw_pattern, (-raw.sizes.top_margin, -raw.sizes.left_margin), axis=(0, 1))
        scale, clip_scale = _scales_to_saturation(raw, colours)
        clip_level = np.minimum(1.0, clip_levels(raw, colours) * clip_scale)
        # Rows and columns, −1 … 1, from the 2×2 block whose red or blue is seen at its corner to the next one: the
        # blocks' centres lie between the two. 0 for green, which lies there, and where the mosaic is no Bayer one.
        steps = np.zeros((3, 2), np.intp)
        for channel in (0, 2) if half_size and colours.shape == (2, 2) else ():
            at = np.argwhere(colours == channel)
            if len(at) == 1:
                steps[channel] = 1 - 2 * at[0]
        rendered = raw.postprocess(
            half_size=half_size, gamma=(1, 1), output_color=rawpy.ColorSpace.raw, user_wb=[1, 1, 1, 1],
            no_auto_bright=True, adjust_maximum_thr=0, highlight_mode=rawpy.HighlightMode.Clip, output_bps=16,
            user_flip=0,
        )  # fmt: skip
        if rendered.ndim != 3 or rendered.shape[2] != 3 or 0 in rendered.shape:
            raise ImageError(f"{path}: LibRaw made an image of shape {rendered.shape} of it, not one of three colours")
        preview, preview_note = _preview(raw)
        # A picture's own clipping level lies below the camera's nominal one in many files: those pixels are saturated.
        pixels = np.empty(rendered.shape, np.float32)
        clipped = (clip_level - 3e-5).astype(np.float32)  # LibRaw rounds white to one of the highest two of 16 bits
        _finish(rendered.view(np.uint16), (scale / 65535).astype(np.float32), clipped, steps, pixels)
        other, date = raw.other, raw.other.timestamp
        numbers = (other.shutter_speed, other.iso_speed, other.focal_length, other.aperture)
        exposure_s, iso, focal_mm, aperture = (
            float(value) if math.isfinite(value) and value > 0 else math.nan for value in numbers
        )
        # LibRaw's multipliers of daylight are those of its own table, or of the ColorMatrix that a DNG file states.
        stated = path.suffix.lower() == ".dng" and np.any(raw.color_matrix)
        return RawImage(
            pixels, 2.0 if half_size else 1.0, flip, _multipliers(list(raw.camera_whitebalance)),
            preview, preview_note, exposure_s, iso, clip_level, focal_mm, aperture,
            lens=" ".join(str(raw.lens.model).split()),
            taken="" if date is None or date.year < 1980 else date.strftime("%Y:%m:%d %H:%M:%S"),  # the epoch: unknown
            d65=_multipliers(list(raw.daylight_whitebalance)) if stated or np.any(raw.rgb_xyz_matrix) else None,
            from_xyz=_from_xyz(raw, stated=bool(stated)),
        )  # fmt: skip


def _from_xyz(raw: rawpy.RawPy, *, stated: bool) -> Array | None:
    """(3, 3) XYZ → RAW before white balance, of any scale; None where unknown.

    stated: a DNG file states it. LibRaw has turned that into white-balanced RAW → linear sRGB, and multipliers of D65.
    """
    if stated:
        to_srgb, d65 = np.array(raw.color_matrix, dtype=np.float64)[:, :3], np.array(raw.daylight_whitebalance[:3])
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


@contextmanager
def _translated(path: Path) -> Iterator[None]:
    try:
        with reading(path, "a RAW file, it is damaged or unsupported", ImageError):
            yield
    except ImageError as error:
        if isinstance(error.__cause__, rawpy.LibRawFileUnsupportedError):
            way_out = "; convert it to DNG with Adobe DNG Converter" if path.suffix.lower() == ".gpr" else ""
            raise ImageError(f"{path}: not a RAW file that LibRaw can read{way_out}") from error
        raise


def _preview(raw: rawpy.RawPy) -> tuple[bytes | None, str]:
    """The embedded JPEG, or None and why."""
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

    LibRaw subtracts each colour's black level, and divides all by the white level above the lowest of them. Maker
    notes may give the level up to which the sensor is linear, below LibRaw's table value: the lowest of them holds for
    all channels, so that these keep their ratios; an implausible one is ignored.
    """
    levels, blacks = raw.camera_white_level_per_channel, np.array(raw.black_level_per_channel, dtype=np.float64)
    black = blacks[:3].copy()
    if 3 in colours:
        black[1] = (blacks[1] + blacks[3]) / 2
    white = float(raw.white_level)
    nominal, linear = white - blacks.min(), float(min(levels)) if levels else white
    if not 0.75 * nominal <= linear - blacks.min() <= nominal:
        linear = white
    if not np.all(linear > black):
        return np.ones(3), np.ones(3)
    return nominal / (linear - black), (white - black) / (linear - black)


@compiled()
def _finish(rendered: NDArray[np.uint16], scales: Single, clip_level: Single, steps: Index, pixels: Pixels) -> None:
    """Fill pixels (h, w, 3) with what LibRaw made, scaled; red and blue moved to their blocks' centres; clipped ones 1.

    A plane sampled at one corner of each block is interpolated a quarter of a block from there; left uncorrected, red
    and blue are a whole sensor pixel apart.
    """
    height, width = rendered.shape[:2]
    here, next_one, line = np.float32(0.75), np.float32(0.25), np.empty(width, np.float32)
    for y in range(height):
        for channel in range(3):
            scale, (down, right) = scales[channel], steps[channel]
            own, other = rendered[y, :, channel], rendered[min(max(y + down, 0), height - 1), :, channel]
            for x in range(width):
                line[x] = np.float32(own[x]) * scale
                if down:
                    line[x] = here * line[x] + next_one * (np.float32(other[x]) * scale)
            for x in range(width):
                value = line[x]
                if right:
                    value = here * value + next_one * line[min(max(x + right, 0), width - 1)]
                clipped = np.float32(own[x]) * scale >= clip_level[channel]
                pixels[y, x, channel] = np.float32(1) if clipped else min(value, np.float32(1))


def _multipliers(camera: list[float]) -> Array | None:
    """As-shot multipliers with green = 1; None for LibRaw's ways of saying unknown: −1, 0, NaN, all equal."""
    red, green, blue = camera[:3]
    second = camera[3] if len(camera) > 3 else 0.0
    if second > 0 and math.isfinite(second) and green > 0:
        green = (green + second) / 2
    values = np.array([red, green, blue], dtype=np.float64)
    if not np.all(np.isfinite(values)) or np.any(values <= 0) or np.all(values == values[0]):
        return None
    values /= values[1]
    return values if np.all((values > 0.05) & (values < 20)) else None


# --- The level at which a RAW file's own pixels saturate: the spike of clipping in its histogram ---------------------


def clip_levels(raw: rawpy.RawPy, colours: NDArray[np.uint8]) -> Array:
    """Return the level (3,) at which each channel of a file saturates, 1 = LibRaw's nominal maximum.

    It is 1 where the file shows no other level. colours: indices (n, n) of the pattern that repeats over the visible
    mosaic, (0, 0) where there is none.
    """
    levels = np.ones(3)
    if not colours.size:
        return levels
    counts = np.zeros((4, 65536), np.intp)
    _count(raw.raw_image_visible, colours, counts)
    black, white = raw.black_level_per_channel, int(raw.white_level)
    for index in range(4):
        channel = 1 if index == 3 else index
        offset = int(black[min(index, len(black) - 1)])
        if white > offset:
            level = saturation_spike(counts[index, offset:], white - offset)
            levels[channel] = min(levels[channel], level)
    return levels


@compiled()
def _count(mosaic: NDArray[np.uint16], colours: NDArray[np.uint8], counts: Index) -> None:
    """Add to counts (4, 65536) how often each colour of a mosaic (h, w) has each value."""
    period = len(colours)
    for y in range(len(mosaic)):
        for start in range(period):
            own, row = counts[colours[y % period, start]], mosaic[y, start::period]
            for value in row:
                own[value] += 1


def saturation_spike(histogram: NDArray[np.intp], white: int) -> float:
    """Level in (0, 1], 1 = `white`, where the spike begins that clipping leaves in a histogram; 1 where there is none.

    histogram: counts of the values 0, 1, 2 … above black. A saturated channel piles up with a standard
    deviation of at most about 0.2 % of white, with next to nothing above; the photon noise of an evenly lit
    surface of that brightness is wider (0.35 % at 80,000 electrons).
    """
    bins = min(1000, white)
    edges = np.linspace(0, white, bins + 1).astype(int)
    counts = np.concatenate([histogram, np.zeros(max(0, white + 1 - len(histogram)), histogram.dtype)])
    density = np.add.reduceat(counts, edges[:-1]).astype(np.float64)  # the last bin takes all above
    reached = np.flatnonzero(np.cumsum(density[::-1]) >= 50)  # beyond it lie hot pixels only
    top = bins - 1 - int(reached[0]) if reached.size else 0
    if top < 0.7 * bins:
        return 1.0
    peak = top - 15 + int(np.argmax(density[top - 15 : top + 1]))
    near = np.arange(max(0, peak - 10), min(bins, peak + 11))
    spike = density[near].sum()
    if spike < 200 or peak >= bins - 2:
        return 1.0
    centre = float(near @ density[near] / spike)
    spread = math.sqrt(float(((near - centre) ** 2) @ density[near] / spike)) / bins
    below = len(near) * density[max(0, peak - 40) : max(1, peak - 12)].mean()
    above = density[peak + 11 :].sum()
    if spread > 0.0028 or spike < 4 * below or above > 0.005 * spike:
        return 1.0
    return max(0.0, centre / bins - max(3 * spread, 1.5 / bins))
