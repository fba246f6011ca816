"""DNG camera profiles (.dcp): matrices, a tone curve and a look table in hue, saturation and value.

The Digital Negative specification 1.7.1, chapter 6 ("Mapping Camera Color Space to CIE XYZ Space") and the tags of
chapter 4, https://helpx.adobe.com/camera-raw/digital-negative.html. A profile is a TIFF file of one directory whose
magic number is 0x4352. A developer balances the RAW, multiplies it by the forward matrix to XYZ (D50), looks the colour
up in HSV of linear ProPhoto RGB, and applies the tone curve so that hues are kept.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lutforge.arrays import Array
from lutforge.atomic_write import atomic_path
from lutforge.colour.rgb_spaces import matrix_between, rgb_space
from lutforge.images.tiff import TiffWriter, float_field, long_field, rational_field, short_field, text_field
from lutforge.kits.kit import Look

XYZ_D50_FROM_PROPHOTO = np.array(
    [[0.7976749, 0.1351917, 0.0313534], [0.2880402, 0.7118741, 0.0000857], [0.0, 0.0, 0.8252100]]
)
"""(3, 3): linear ProPhoto RGB → CIE XYZ of D50 (ISO 22028-2, ROMM RGB)."""

BRADFORD_D50_FROM_D65 = np.array(
    [[1.0478112, 0.0228866, -0.0501270], [0.0295424, 0.9904844, -0.0170491], [-0.0092345, 0.0150436, 0.7521316]]
)
"""(3, 3): XYZ under D65 → under D50 (Bradford, as in ICC.1:2022, annex E)."""

_SRGB = rgb_space("srgb")

DIVISIONS = (90, 30, 30)
"""Hue, saturation and value divisions of the look table: 4° of hue, as in the finest of Adobe's own profiles."""


@dataclass(frozen=True, eq=False)
class DngProfile:
    """What a .dcp file holds.

    color_matrix: (3, 3), XYZ → camera RGB before white balance, under D65. forward_matrix: (3, 3), camera RGB behind
    white balance → XYZ of D50. tone_curve: (n, 2), linear input and output on [0, 1], increasing. look_table:
    (value, hue, saturation, 3) of hue shift in degrees, saturation factor and value factor. encoded_values: values
    are spaced evenly, and multiplied, behind sRGB's curve.
    """

    name: str
    camera: str
    color_matrix: Array
    forward_matrix: Array
    tone_curve: Array
    look_table: Array
    encoded_values: bool = True

    def __call__(self, balanced: Array) -> Array:
        """What a developer makes of white-balanced camera RGB (…, 3): encoded sRGB, clipped to [0, 1]."""
        rgb = np.clip(balanced @ (np.linalg.inv(XYZ_D50_FROM_PROPHOTO) @ self.forward_matrix).T, 0.0, 1.0)
        looked = np.clip(self._looked_up(hsv_of_prophoto(rgb)), 0.0, 1.0)
        toned = _between_ends(looked, lambda x: np.interp(x, *self.tone_curve.T))
        light = toned @ matrix_between("linear-prophoto", "linear-srgb").T
        return _SRGB.encode(np.clip(light, 0.0, 1.0))

    def _looked_up(self, hsv: Array) -> Array:
        from scipy.ndimage import map_coordinates

        hue, saturation, value = np.moveaxis(hsv, -1, 0)
        place = _SRGB.encode(value) if self.encoded_values else value
        values, hues, saturations = self.look_table.shape[:3]
        around = np.concatenate([self.look_table, self.look_table[:, :1]], axis=1)
        at = [place * (values - 1), hue * hues / 360.0, saturation * (saturations - 1)]
        shift, more, lighter = (map_coordinates(around[..., i], at, order=1, mode="nearest") for i in range(3))
        lit = np.clip(place * lighter, 0.0, 1.0)
        changed = [np.mod(hue + shift, 360.0), np.clip(saturation * more, 0.0, 1.0)]
        return prophoto_of_hsv(np.stack([*changed, _SRGB.decode(lit) if self.encoded_values else lit], axis=-1))


def fit_dng_profile(look: Look) -> DngProfile:
    """Express the look of a profile of RAW files as a DNG profile.

    At every node of the look table that lies in the camera's range, table and tone curve together give the rendering.
    """
    to_prophoto = matrix_between("linear-srgb", "linear-prophoto") @ look.to_srgb
    forward = XYZ_D50_FROM_PROPHOTO @ to_prophoto
    # Under D65 a perfect white has camera RGB 1 / multipliers.
    to_xyz = np.linalg.inv(BRADFORD_D50_FROM_D65) @ forward @ np.diag(look.multipliers)
    curve = _tone_curve(look.render)
    nodes = _look_nodes()
    scene = prophoto_of_hsv(nodes)
    codes = look.render(np.clip(scene @ np.linalg.inv(to_prophoto).T, 0.0, 1.0))
    wanted = np.clip(_SRGB.decode(codes) @ matrix_between("linear-srgb", "linear-prophoto").T, 0.0, 1.0)
    entries = _deltas(nodes, hsv_of_prophoto(_before_tone_curve(wanted, curve)))
    hues, saturations, values = DIVISIONS
    return DngProfile(
        name=look.title,
        camera=look.camera,
        color_matrix=np.asarray(np.linalg.inv(to_xyz), dtype=np.float64),
        forward_matrix=forward,
        tone_curve=curve,
        look_table=entries.reshape(values, hues, saturations, 3),
    )


def write_dcp(profile: DngProfile, path: Path) -> None:
    """Write a .dcp file, atomically."""
    values, hues, saturations = profile.look_table.shape[:3]
    d65 = 21  # EXIF's code of the light source
    no_restrictions, no_black_subtraction, srgb_values = 3, 1, 1
    file = TiffWriter(magic=0x4352)
    directory = {
        50708: text_field(profile.camera),
        50721: rational_field(profile.color_matrix.ravel(), signed=True),
        50778: short_field(d65),
        50932: text_field(""),
        50936: text_field(profile.name),
        50940: float_field(profile.tone_curve),
        50941: long_field(no_restrictions),
        50942: text_field("made with LutForge"),
        50964: rational_field(profile.forward_matrix.ravel(), signed=True),
        50981: long_field(hues, saturations, values),
        50982: float_field(profile.look_table),
        51108: long_field(srgb_values),
        51110: long_field(no_black_subtraction),
    }
    content = file.finish(file.directory(directory))
    with atomic_path(path) as temporary:
        temporary.write_bytes(content)


def hsv_of_prophoto(rgb: Array) -> Array:
    """Linear RGB (…, 3) → hue in degrees [0, 360), saturation and value (DNG specification, chapter 6)."""
    value, least = rgb.max(axis=-1), rgb.min(axis=-1)
    gap = value - least
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


def _before_tone_curve(rgb: Array, curve: Array) -> Array:
    rising = np.concatenate([[True], np.diff(curve[:, 1]) > 0])  # of the inputs that clip, the least
    return _between_ends(rgb, lambda y: np.interp(y, curve[rising, 1], curve[rising, 0]))


def _between_ends(rgb: Array, curve: Callable[[Array], Array]) -> Array:
    largest, least = rgb.max(axis=-1, keepdims=True), rgb.min(axis=-1, keepdims=True)
    gap = largest - least
    place = np.where(gap > 0, (rgb - least) / np.where(gap > 0, gap, 1.0), 0.0)
    top, bottom = curve(largest), curve(least)
    return bottom + place * (top - bottom)


def _tone_curve(render: Callable[[Array], Array]) -> Array:
    """(n, 2): what the rendering makes of greys, in linear light, strictly increasing from (0, 0) to (1, 1)."""
    even = np.linspace(0.0, 1.0, 257)
    grey = _SRGB.decode(even)  # as dense in the dark tones as the eye asks for
    codes = render(np.repeat(grey[:, None], 3, axis=1))
    light = np.clip(np.maximum.accumulate(_SRGB.decode(codes).mean(axis=1)), 0.0, 1.0)
    light[0], light[-1] = 0.0, 1.0
    kept = np.concatenate([[True], np.diff(light) > 1e-7])
    kept[-1] = True
    return np.stack([grey[kept], light[kept]], axis=1)


def _look_nodes() -> Array:
    """(values · hues · saturations, 3): HSV of the table's nodes in the file's order."""
    hues, saturations, values = DIVISIONS
    value = _SRGB.decode(np.linspace(0.0, 1.0, values))
    value[0] = 0.25 * value[1]  # black has no hue: what holds just above it
    grid = np.meshgrid(value, np.arange(hues) * (360.0 / hues), np.linspace(0.0, 1.0, saturations), indexing="ij")
    return np.stack([grid[1], grid[2], grid[0]], axis=-1).reshape(-1, 3)


def _deltas(nodes: Array, wanted: Array) -> Array:
    shift = np.mod(wanted[:, 0] - nodes[:, 0] + 180.0, 360.0) - 180.0
    grey = (nodes[:, 1] == 0) | (wanted[:, 1] == 0)
    saturation = np.where(nodes[:, 1] > 0, wanted[:, 1] / np.where(nodes[:, 1] > 0, nodes[:, 1], 1.0), 1.0)
    value = _SRGB.encode(wanted[:, 2]) / _SRGB.encode(nodes[:, 2])  # the factor counts behind the encoding of the table
    return np.stack([np.where(grey, 0.0, shift), saturation, value], axis=1)
