"""DNG camera profiles (.dcp) of any origin: matrices, a tone curve, a look table in hue, saturation and value.

The Digital Negative specification 1.7.1, chapter 6 ("Mapping Camera Color Space to CIE XYZ Space") and the tags of
chapter 4, https://helpx.adobe.com/camera-raw/digital-negative.html. A profile is a TIFF file of one directory whose
magic number is 0x4352. A developer balances the RAW, multiplies it by the forward matrix to XYZ (D50), applies the look
table in HSV of linear ProPhoto RGB, and then the tone curve such that hues are kept.
"""

from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum
from pathlib import Path

import numpy as np

from lutforge.arrays import Array
from lutforge.atomic_write import atomic_path
from lutforge.boundary import reading, require_file
from lutforge.colour.rgb_spaces import SRGB, matrix_between, to_xyz, to_xyz_d50
from lutforge.errors import LutError, one_line
from lutforge.images.tiff import byte_order, number, read_directory
from lutforge.images.tiff_writer import (
    Field,
    TiffWriter,
    float_field,
    long_field,
    rational_field,
    short_field,
    text_field,
)
from lutforge.kits.kit import BALANCED_RAW, Look
from lutforge.luts.writers.text import plain
from lutforge.model.camera_profile import CameraProfile

_MAGIC = 0x4352
"""The number after the byte order of a camera profile, in place of TIFF's 42."""


class _Tag(IntEnum):
    """The tags of a camera profile, by their names in the specification."""

    UNIQUE_CAMERA_MODEL = 50708
    COLOR_MATRIX_1 = 50721
    CALIBRATION_ILLUMINANT_1 = 50778
    PROFILE_CALIBRATION_SIGNATURE = 50932
    PROFILE_NAME = 50936
    PROFILE_HUE_SAT_MAP_DIMS = 50937
    PROFILE_TONE_CURVE = 50940
    PROFILE_EMBED_POLICY = 50941
    PROFILE_COPYRIGHT = 50942
    FORWARD_MATRIX_1 = 50964
    PROFILE_LOOK_TABLE_DIMS = 50981
    PROFILE_LOOK_TABLE_DATA = 50982
    PROFILE_LOOK_TABLE_ENCODING = 51108
    DEFAULT_BLACK_RENDER = 51110


_TYPES = {1: "u1", 2: "u1", 3: "u2", 4: "u4", 5: "u4", 9: "i4", 10: "i4", 11: "f4", 12: "f8"}
"""TIFF 6.0's types of numbers, as NumPy's; a rational is two integers."""
_RATIONALS = (5, 10)
"""The types of unsigned and signed rationals."""

_IN_CAPITALS = ("Leica", "Ricoh", "Sigma")
"""Brands that DNG files and Adobe's profiles write in capitals."""

DIVISIONS = (90, 30, 30)
"""Hue, saturation and value divisions of the look table: 4° of hue, as in the finest of Adobe's own profiles."""


@dataclass(frozen=True, eq=False)
class DngProfile:
    """The contents of a .dcp file.

    color_matrix: (3, 3), XYZ → camera RGB before white balance, under D65. forward_matrix: (3, 3), camera RGB after
    white balance → XYZ of D50. tone_curve: (n, 2), linear input and output on [0, 1], increasing. look_table:
    (value, hue, saturation, 3) of hue shift in degrees, saturation factor and value factor. encoded_values: values are
    spaced evenly, and multiplied, in sRGB's encoding. camera: the UniqueCameraModel of the RAW files that the profile
    is for. description: one line per entry.
    """

    name: str
    camera: str
    color_matrix: Array
    forward_matrix: Array
    tone_curve: Array
    look_table: Array
    encoded_values: bool = True
    description: tuple[str, ...] = ()

    def __call__(self, balanced: Array) -> Array:
        """Encoded sRGB (…, 3), clipped to [0, 1], that a developer renders from white-balanced camera RGB (…, 3)."""
        from scipy.ndimage import map_coordinates  # imported here: only checks of a written file need it

        rgb = np.clip(balanced @ (np.linalg.inv(to_xyz_d50("linear-prophoto")) @ self.forward_matrix).T, 0.0, 1.0)

        # The look table, interpolated; hues go round the circle.
        hue, saturation, value = np.moveaxis(hsv_of_prophoto(rgb), -1, 0)
        level = SRGB.encode(value) if self.encoded_values else value
        values, hues, saturations = self.look_table.shape[:3]
        closed = np.concatenate([self.look_table, self.look_table[:, :1]], axis=1)
        at = [level * (values - 1), hue * hues / 360.0, saturation * (saturations - 1)]
        shift, saturation_factor, value_factor = (
            map_coordinates(closed[..., i], at, order=1, mode="nearest") for i in range(3)
        )
        new_level = np.clip(level * value_factor, 0.0, 1.0)
        new_hue = np.mod(hue + shift, 360.0)
        new_saturation = np.clip(saturation * saturation_factor, 0.0, 1.0)
        new_value = SRGB.linearize(new_level) if self.encoded_values else new_level
        by_table = np.clip(prophoto_of_hsv(np.stack([new_hue, new_saturation, new_value], axis=-1)), 0.0, 1.0)

        toned = _between_ends(by_table, lambda x: np.interp(x, *self.tone_curve.T))
        linear = toned @ matrix_between("linear-prophoto", "linear-srgb").T
        return SRGB.encode(np.clip(linear, 0.0, 1.0))


def fit_dng_profile(look: Look) -> DngProfile:
    """Express the look of a profile of RAW files as a DNG profile, which is exact at the nodes of its table."""
    # Developers scale a forward matrix so that a balanced white stays white (chapter 6); this one is scaled already.
    to_srgb = look.to_srgb / look.to_srgb.sum(axis=1, keepdims=True)
    to_prophoto = matrix_between("linear-srgb", "linear-prophoto") @ to_srgb
    forward = to_xyz_d50("linear-srgb") @ to_srgb
    # Under D65 a perfect white has camera RGB 1 / multipliers.
    under_d65 = to_xyz("linear-srgb") @ to_srgb @ np.diag(look.multipliers)

    # The tone curve: the rendering of greys, in linear values, strictly increasing from (0, 0) to (1, 1). Its points
    # are even in sRGB's encoding, so that they are dense in dark tones.
    grey = SRGB.linearize(np.linspace(0.0, 1.0, 257))
    rendered = SRGB.linearize(look.render(np.repeat(grey[:, None], 3, axis=1))).mean(axis=1)
    tone = np.clip(np.maximum.accumulate(rendered), 0.0, 1.0)
    tone[0], tone[-1] = 0.0, 1.0
    rises = np.concatenate([[True], np.diff(tone) > 1e-7])
    rises[-1] = True
    curve = np.stack([grey[rises], tone[rises]], axis=1)

    # The nodes of the look table in the file's order, (values · hues · saturations, 3). Black has no hue: its entries
    # are computed just above it.
    hues, saturations, values = DIVISIONS
    value = SRGB.linearize(np.linspace(0.0, 1.0, values))
    value[0] = 0.25 * value[1]
    grid = np.meshgrid(value, np.arange(hues) * (360.0 / hues), np.linspace(0.0, 1.0, saturations), indexing="ij")
    nodes = np.stack([grid[1], grid[2], grid[0]], axis=-1).reshape(-1, 3)
    codes = look.render(np.clip(prophoto_of_hsv(nodes) @ np.linalg.inv(to_prophoto).T, 0.0, 1.0))
    rgb = np.clip(SRGB.linearize(codes) @ matrix_between("linear-srgb", "linear-prophoto").T, 0.0, 1.0)
    rising = np.concatenate([[True], np.diff(curve[:, 1]) > 0])  # of the inputs that clip, the least
    before_curve = _between_ends(rgb, lambda y: np.interp(y, curve[rising, 1], curve[rising, 0]))

    # From hue, saturation and value of the nodes to those before the tone curve. The factor of value applies to values
    # in the table's encoding.
    target = hsv_of_prophoto(before_curve)
    shift = np.mod(target[:, 0] - nodes[:, 0] + 180.0, 360.0) - 180.0
    is_grey = (nodes[:, 1] == 0) | (target[:, 1] == 0)
    saturation = np.where(nodes[:, 1] > 0, target[:, 1] / np.where(nodes[:, 1] > 0, nodes[:, 1], 1.0), 1.0)
    value_factor = SRGB.encode(target[:, 2]) / SRGB.encode(nodes[:, 2])
    entries = np.stack([np.where(is_grey, 0.0, shift), saturation, value_factor], axis=1)

    color_matrix = np.asarray(np.linalg.inv(under_d65), dtype=np.float64)
    table = entries.reshape(values, hues, saturations, 3)
    lines = look.description(BALANCED_RAW, "linear ProPhoto RGB of the camera's JPEG, which the developer encodes")
    return DngProfile(
        look.title, unique_camera_model(look.profile), color_matrix, forward, curve, table, description=lines
    )


def unique_camera_model(profile: CameraProfile) -> str:
    """The name by which developers match profiles with RAW files: that of the camera's DNG files, else Adobe's."""
    if profile.dng_camera:
        return profile.dng_camera
    brand, blank, model = profile.camera.partition(" ")
    return f"{brand.upper() if brand in _IN_CAPITALS else brand}{blank}{model}"


def write_dcp(profile: DngProfile, path: Path) -> None:
    """Write a .dcp file, atomically."""
    values, hues, saturations = profile.look_table.shape[:3]
    d65 = 21  # EXIF's code of the light source
    no_restrictions, no_black_subtraction, srgb_values = 3, 1, 1
    file = TiffWriter(magic=_MAGIC)
    fields: dict[int, Field] = {
        _Tag.UNIQUE_CAMERA_MODEL: text_field(profile.camera),
        _Tag.COLOR_MATRIX_1: rational_field(profile.color_matrix.ravel(), signed=True),
        _Tag.CALIBRATION_ILLUMINANT_1: short_field(d65),
        _Tag.PROFILE_CALIBRATION_SIGNATURE: text_field(""),
        _Tag.PROFILE_NAME: text_field(profile.name),
        _Tag.PROFILE_TONE_CURVE: float_field(profile.tone_curve),
        _Tag.PROFILE_EMBED_POLICY: long_field(no_restrictions),
        _Tag.PROFILE_COPYRIGHT: text_field("; ".join(plain(line) for line in profile.description)),
        _Tag.FORWARD_MATRIX_1: rational_field(profile.forward_matrix.ravel(), signed=True),
        _Tag.PROFILE_LOOK_TABLE_DIMS: long_field(hues, saturations, values),
        _Tag.PROFILE_LOOK_TABLE_DATA: float_field(profile.look_table),
        _Tag.PROFILE_LOOK_TABLE_ENCODING: long_field(srgb_values),
        _Tag.DEFAULT_BLACK_RENDER: long_field(no_black_subtraction),
    }
    content = file.finish(file.directory(fields))
    with atomic_path(path) as temporary:
        temporary.write_bytes(content)


def hsv_of_prophoto(rgb: Array) -> Array:
    """Linear RGB (…, 3) → hue in degrees [0, 360), saturation and value (DNG specification, chapter 6)."""
    value = rgb.max(axis=-1)
    gap = value - rgb.min(axis=-1)
    safe = np.where(gap > 0, gap, 1.0)
    r, g, b = rgb[..., 0], rgb[..., 1], rgb[..., 2]
    sector = np.select(
        [r == value, g == value], [np.mod((g - b) / safe, 6.0), 2.0 + (b - r) / safe], 4.0 + (r - g) / safe
    )
    saturation = np.where(value > 0, gap / np.where(value > 0, value, 1.0), 0.0)
    return np.stack([60.0 * np.where(gap > 0, sector, 0.0), saturation, value], axis=-1)


def prophoto_of_hsv(hsv: Array) -> Array:
    """Hue in degrees, saturation and value (…, 3) → linear RGB: the inverse of `hsv_of_prophoto`."""
    hue, saturation, value = hsv[..., 0] / 60.0, hsv[..., 1], hsv[..., 2]
    corners = np.mod(np.array([5.0, 3.0, 1.0]) + hue[..., None], 6.0)
    share = np.clip(np.minimum(corners, 4.0 - corners), 0.0, 1.0)
    return np.asarray(value[..., None] * (1.0 - saturation[..., None] * share))


def _between_ends(rgb: Array, curve: Callable[[Array], Array]) -> Array:
    """A tone curve that keeps hues: applied to the largest and the least channel, the middle one in proportion."""
    largest = rgb.max(axis=-1, keepdims=True)
    least = rgb.min(axis=-1, keepdims=True)
    gap = largest - least
    share = np.where(gap > 0, (rgb - least) / np.where(gap > 0, gap, 1.0), 0.0)
    top = curve(largest)
    bottom = curve(least)
    return bottom + share * (top - bottom)


def read_dcp(path: str | Path) -> DngProfile:
    """Read a camera profile that LutForge can evaluate: one with a forward matrix. Raises LutError, one line."""
    tags = _tags(Path(path))
    if _Tag.FORWARD_MATRIX_1 not in tags or _Tag.COLOR_MATRIX_1 not in tags:
        raise LutError(f"{path}: this camera profile has no forward matrix, from which its colours could be computed")
    curve = tags.get(_Tag.PROFILE_TONE_CURVE, np.array([0.0, 0.0, 1.0, 1.0]))
    table = np.tile([0.0, 1.0, 1.0], (2, 1, 2, 1))  # the identity, for a profile without a look table
    with reading(path, "a camera profile", LutError):
        if _Tag.PROFILE_LOOK_TABLE_DIMS in tags:
            hues, saturations, values = (int(count) for count in tags[_Tag.PROFILE_LOOK_TABLE_DIMS])
            table = tags[_Tag.PROFILE_LOOK_TABLE_DATA].reshape(max(values, 1), hues, saturations, 3)
        return DngProfile(
            name=_text(tags, _Tag.PROFILE_NAME),
            camera=_text(tags, _Tag.UNIQUE_CAMERA_MODEL),
            color_matrix=tags[_Tag.COLOR_MATRIX_1].reshape(3, 3),
            forward_matrix=tags[_Tag.FORWARD_MATRIX_1].reshape(3, 3),
            tone_curve=curve.reshape(-1, 2),
            look_table=table,
            encoded_values=bool(tags.get(_Tag.PROFILE_LOOK_TABLE_ENCODING, np.zeros(1))[0]),
            description=tuple(_text(tags, _Tag.PROFILE_COPYRIGHT, 1000).split("; ")),
        )


def dcp_lines(path: str | Path) -> list[str]:
    """The report on a DNG camera profile, as lines of text: what it holds and which programs read it.

    Raises LutError where it cannot be read.
    """
    tags = _tags(Path(path))
    names = {
        _Tag.FORWARD_MATRIX_1: "forward matrix",
        _Tag.PROFILE_HUE_SAT_MAP_DIMS: "hue and saturation map",
        _Tag.PROFILE_LOOK_TABLE_DIMS: "look table",
        _Tag.PROFILE_TONE_CURVE: "tone curve",
    }
    lines = [
        f"{path}: DNG camera profile",
        f"  title     {_text(tags, _Tag.PROFILE_NAME)}",
        f"  camera    {_text(tags, _Tag.UNIQUE_CAMERA_MODEL)}",
    ]
    lines += [f"  comment   {text}" for text in _text(tags, _Tag.PROFILE_COPYRIGHT, 1000).split("; ") if text]
    lines.append(f"  holds     {', '.join(name for tag, name in names.items() if tag in tags)}")
    if _Tag.FORWARD_MATRIX_1 in tags and _Tag.COLOR_MATRIX_1 in tags:
        profile = read_dcp(path)
        black, grey, white = profile(np.repeat([[0.0], [0.18], [1.0]], 3, axis=1))
        for name, colour in (("black", black), ("grey 18 %", grey), ("white", white)):
            lines.append(f"  {name:10} {' '.join(f'{value:.5f}' for value in colour)} (encoded sRGB)")
        if np.any(np.diff(profile.tone_curve, axis=0) < 0):
            lines.append("  problem   the tone curve falls somewhere")
    else:
        lines.append("  problem   no forward matrix: developers take the inverse of the colour matrix")
    camera = _text(tags, _Tag.UNIQUE_CAMERA_MODEL) or "this camera"
    return [
        *lines,
        f"  RawTherapee, ART, Lightroom, Camera Raw: read it, for RAW files of {camera}",
        "  darktable, Capture One, digiKam: do not read DNG camera profiles: they take an ICC profile (.icc)",
    ]


def _tags(path: Path) -> dict[int, Array]:
    """The numbers of each tag in a file's first directory; text is given as its bytes. Raises LutError."""
    require_file(path, "a camera profile", LutError, 64 << 20)
    data = path.read_bytes()
    order = byte_order(data)
    if order is None or len(data) < 8 or number(data, order, "H", 2) != _MAGIC:
        raise LutError(f"{path}: no DNG camera profile: it does not begin with IIRC or MMCR")
    numbers: dict[int, Array] = {}
    with reading(path, "a camera profile", LutError):
        entries, _ = read_directory(data, order, number(data, order, "I", 4))
        for tag, entry in entries.items():
            if entry.kind not in _TYPES:
                continue
            values = np.frombuffer(data[entry.place], f"{order}{_TYPES[entry.kind]}").astype(np.float64)
            if entry.kind in _RATIONALS:
                values = values[::2] / np.where(values[1::2] == 0, 1.0, values[1::2])
            if not np.all(np.isfinite(values)):
                raise LutError(f"{path}: tag {tag} holds a number that is not finite")
            if values.size:
                numbers[tag] = values
    return numbers


def _text(tags: dict[int, Array], tag: int, most: int = 160) -> str:
    """The text of a tag in one line; "" where there is none."""
    text = bytes(tags.get(tag, np.zeros(0)).astype(np.uint8)).split(b"\0")[0]
    return one_line(text.decode("utf-8", "replace"), most)
