"""Read DNG camera profiles (.dcp), anyone's, and say what is in them."""

import struct
from pathlib import Path

import numpy as np

from lutforge.arrays import Array
from lutforge.boundary import reading, require_file
from lutforge.errors import LutError, one_line
from lutforge.kits.dcp import DngProfile

_TYPES = {1: "u1", 2: "u1", 3: "u2", 4: "u4", 5: "u4", 9: "i4", 10: "i4", 11: "f4", 12: "f8"}
"""TIFF 6.0's types of numbers; rationals are two of them."""

_LIGHTS = {17: "illuminant A", 20: "D55", 21: "D65", 22: "D75", 23: "D50", 255: "another light"}


def read_dcp(path: str | Path) -> DngProfile:
    """Read a camera profile that LutForge can evaluate: one with a forward matrix. Raises LutError, one line."""
    tags = _tags(Path(path))
    if 50964 not in tags or 50721 not in tags:
        raise LutError(f"{path}: this camera profile has no forward matrix, from which its colours could be computed")
    curve = tags.get(50940, np.array([0.0, 0.0, 1.0, 1.0]))
    table = np.tile([0.0, 1.0, 1.0], (2, 1, 2, 1))  # of a profile without one: it changes nothing
    with reading(path, "a camera profile", LutError):
        if 50981 in tags and 50982 in tags:
            hues, saturations, values = (int(count) for count in tags[50981])
            table = tags[50982].reshape(max(values, 1), hues, saturations, 3)
        return DngProfile(
            name=_text(tags, 50936),
            camera=_text(tags, 50708),
            color_matrix=tags[50721].reshape(3, 3),
            forward_matrix=tags[50964].reshape(3, 3),
            tone_curve=curve.reshape(-1, 2),
            look_table=table,
            encoded_values=bool(tags.get(51108, np.zeros(1))[0]),
        )


def dcp_lines(path: str | Path) -> list[str]:
    """What is in a camera profile and who reads it, as lines of text. Raises LutError where it cannot be read."""
    tags = _tags(Path(path))
    parts = [f"colour matrix for {_LIGHTS.get(int(tags[tag][0]), 'a light')}" for tag in (50778, 50779) if tag in tags]
    parts += [f"forward matrix {number}" for number, tag in ((1, 50964), (2, 50965)) if tag in tags]
    for name, tag in (("hue and saturation map", 50937), ("look table", 50981)):
        if tag in tags:
            parts.append(f"{name} {' × '.join(str(int(count)) for count in tags[tag])} (hue, saturation, value)")
    if 50940 in tags:
        parts.append(f"tone curve of {tags[50940].size // 2} points")
    lines = [f"{path}: DNG camera profile", f"  title     {_text(tags, 50936)}", f"  camera    {_text(tags, 50708)}"]
    lines += [f"  {number}. {part}" for number, part in enumerate(parts, 1)]
    if 50964 in tags and 50721 in tags:
        profile = read_dcp(path)
        black, grey, white = profile(np.repeat([[0.0], [0.18], [1.0]], 3, axis=1))
        for name, colour in (("black", black), ("grey 18 %", grey), ("white", white)):
            lines.append(f"  {name:10} {' '.join(f'{value:.5f}' for value in colour)} (encoded sRGB)")
        curve = profile.tone_curve
        if np.any(np.diff(curve, axis=0) < 0):
            lines.append("  problem   the tone curve falls somewhere")
    else:
        lines.append("  problem   no forward matrix: developers take the inverse of the colour matrix")
    return [
        *lines,
        f"  RawTherapee, ART, Lightroom, Camera Raw: read it, for RAW files of {_text(tags, 50708) or 'this camera'}",
        "  darktable, OpenColorIO, Resolve, ffmpeg: do not read camera profiles: make a LUT of it with `lutforge kit`",
    ]


def _tags(path: Path) -> dict[int, Array]:
    """The numbers of each tag of the first directory, text as its bytes. Raises LutError."""
    require_file(path, "a camera profile", LutError, 64 << 20)
    data = path.read_bytes()
    order = {b"II": "<", b"MM": ">"}.get(data[:2])
    if order is None or len(data) < 8 or struct.unpack_from(f"{order}H", data, 2)[0] != 0x4352:
        raise LutError(f"{path}: no DNG camera profile: it does not begin with IIRC or MMCR")
    found: dict[int, Array] = {}
    with reading(path, "a camera profile", LutError):
        (at,) = struct.unpack_from(f"{order}I", data, 4)
        (count,) = struct.unpack_from(f"{order}H", data, at)
        for entry in range(at + 2, at + 2 + 12 * count, 12):
            tag, kind, number = struct.unpack_from(f"{order}HHI", data, entry)
            if kind not in _TYPES:
                continue
            numbers = number * (2 if kind in (5, 10) else 1)
            if numbers > 1 << 20:  # Adobe's largest tables have a fifth of that
                raise LutError(f"{path}: tag {tag} names {number:,} values, more than a camera profile has")
            dtype = np.dtype(f"{order}{_TYPES[kind]}")
            place = entry + 8
            if numbers * dtype.itemsize > 4:
                (place,) = struct.unpack_from(f"{order}I", data, place)
            values = np.frombuffer(data, dtype, numbers, place).astype(np.float64)
            if kind in (5, 10):
                values = values[::2] / np.where(values[1::2] == 0, 1.0, values[1::2])
            if not np.all(np.isfinite(values)):
                raise LutError(f"{path}: tag {tag} holds a number that is not finite")
            found[tag] = values
    return found


def _text(tags: dict[int, Array], tag: int) -> str:
    return one_line(bytes(tags.get(tag, np.zeros(0)).astype(np.uint8)).split(b"\0")[0].decode("utf-8", "replace"), 160)
