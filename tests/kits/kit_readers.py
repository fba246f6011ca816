"""Second readers of what kits write, by the published descriptions of the formats."""

import struct
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lutforge.colour.rgb_spaces import matrix_between, rgb_space

Array = NDArray[np.float64]


def dcp_tags(path: Path) -> dict[int, Array | str]:
    """The tags of a DNG camera profile: text, or numbers."""
    data = path.read_bytes()
    order, magic, at = struct.unpack_from("<2sHI", data)
    assert (order, magic) == (b"II", 0x4352)
    (count,) = struct.unpack_from("<H", data, at)
    found: dict[int, Array | str] = {}
    previous = 0
    for entry in range(count):
        tag, kind, number = struct.unpack_from("<HHI", data, at + 2 + 12 * entry)
        assert tag > previous
        previous = tag
        size = {2: 1, 3: 2, 4: 4, 10: 8, 11: 4}[kind] * number
        place = at + 10 + 12 * entry
        if size > 4:
            (place,) = struct.unpack_from("<I", data, place)
        value = data[place : place + size]
        assert len(value) == size
        if kind == 2:
            found[tag] = value.rstrip(b"\0").decode()
        elif kind == 10:
            pairs = np.frombuffer(value, "<i4").reshape(-1, 2)
            found[tag] = pairs[:, 0] / pairs[:, 1]
        else:
            found[tag] = np.frombuffer(value, {3: "<u2", 4: "<u4", 11: "<f4"}[kind]).astype(np.float64)
    return found


def developed_by_dcp(tags: dict[int, Array | str], balanced: Array) -> Array:
    """What a DNG developer makes of balanced camera RGB (n, 3): encoded sRGB (DNG specification 1.7, chapter 6)."""
    forward, dims = np.asarray(tags[50964], dtype=np.float64).reshape(3, 3), np.asarray(tags[50981], dtype=int)
    curve = np.asarray(tags[50940]).reshape(-1, 2)
    hues, saturations, values = dims
    table = np.asarray(tags[50982]).reshape(values, hues, saturations, 3)
    to_xyz = np.array([[0.7976749, 0.1351917, 0.0313534], [0.2880402, 0.7118741, 0.0000857], [0.0, 0.0, 0.8252100]])
    rgb = np.clip(balanced @ (np.linalg.inv(to_xyz) @ forward).T, 0.0, 1.0)
    looked = np.array([_looked_up(pixel, table) for pixel in rgb])
    order = np.argsort(looked, axis=1)
    low, middle, high = np.take_along_axis(looked, order, axis=1).T
    top, bottom = np.interp(high, *curve.T), np.interp(low, *curve.T)
    share = np.where(high > low, (middle - low) / np.where(high > low, high - low, 1.0), 0.0)
    toned = np.empty_like(looked)
    np.put_along_axis(toned, order, np.stack([bottom, bottom + share * (top - bottom), top], axis=1), axis=1)
    light = toned @ matrix_between("linear-prophoto", "linear-srgb").T
    return rgb_space("srgb").encode(np.clip(light, 0.0, 1.0))


def _looked_up(rgb: Array, table: Array) -> Array:
    """One colour through the look table, whose values are spaced and scaled behind sRGB's curve."""
    import colorsys

    values, hues, saturations = table.shape[:3]
    hue, saturation, value = colorsys.rgb_to_hsv(*(float(channel) for channel in rgb))
    encoded = float(rgb_space("srgb").encode(value))
    place = np.array([encoded * (values - 1), hue * hues, saturation * (saturations - 1)])
    low = np.minimum(place.astype(int), [values - 2, hues - 1, saturations - 2])
    share = place - low
    entry = np.zeros(3)
    for corner in np.ndindex(2, 2, 2):
        weight = np.prod(np.where(corner, share, 1 - share))
        v, h, s = low + corner
        entry += weight * table[v, h % hues, s]
    lit = float(rgb_space("srgb").linearize(min(encoded * entry[2], 1.0)))
    return np.array(colorsys.hsv_to_rgb((hue + entry[0] / 360) % 1, min(saturation * entry[1], 1.0), lit))
