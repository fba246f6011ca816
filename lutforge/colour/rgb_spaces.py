"""RGB colour spaces by their usual names: primaries with a transfer function or none.

Matrices
are derived from the chromaticities, as OpenColorIO's are, and adapt to the white by Bradford's transform (ICC.1:2022,
annex E). Linear values are relative to the space's white: 1 is diffuse white, 0.18 mid grey. Of Adobe RGB (1998) there
is an ICC profile, too: cameras tell it in EXIF tags alone, which programs that write files lose.
"""

import struct
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import ArrayLike

from lutforge.arrays import Array
from lutforge.colour.chromaticities import xyz_matrix
from lutforge.colour.transfer_functions import TRANSFER_FUNCTIONS
from lutforge.errors import SettingsError

BRADFORD = np.array([[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]])
"""XYZ → cone responses (ICC.1:2022, annex E)."""

D50 = (0.9642, 1.0, 0.8249)
"""XYZ of the white of ICC's profile connection space (ICC.1:2022, 7.2.16)."""


@dataclass(frozen=True)
class RgbSpace:
    """An RGB space. primaries: a name in CHROMATICITIES; transfer: one in TRANSFER_FUNCTIONS, "" where linear."""

    name: str
    primaries: str
    transfer: str = ""

    @property
    def is_linear(self) -> bool:
        """True where values are proportional to light."""
        return not self.transfer

    @property
    def linear(self) -> "RgbSpace":
        """The linear space of the same primaries."""
        return next(space for space in SPACES.values() if space.is_linear and space.primaries == self.primaries)

    def encode(self, linear: ArrayLike) -> Array:
        """Linear values (…,) → encoded ones."""
        x = np.asarray(linear, dtype=np.float64)
        if self.is_linear:
            return x
        return TRANSFER_FUNCTIONS[self.transfer].encode(x)

    def decode(self, encoded: ArrayLike) -> Array:
        """Encoded values (…,) → linear ones: the inverse of `encode`."""
        y = np.asarray(encoded, dtype=np.float64)
        if self.is_linear:
            return y
        return TRANSFER_FUNCTIONS[self.transfer].decode(y)


SPACES: dict[str, RgbSpace] = {
    space.name: space
    for space in (
        RgbSpace("linear-srgb", "sRGB"),
        RgbSpace("linear-p3", "P3-D65"),
        RgbSpace("linear-rec2020", "ITU-R BT.2020"),
        RgbSpace("linear-adobe-rgb", "Adobe RGB (1998)"),
        RgbSpace("linear-prophoto", "ProPhoto RGB"),
        RgbSpace("linear-awg3", "ARRI Wide Gamut 3"),
        RgbSpace("linear-awg4", "ARRI Wide Gamut 4"),
        RgbSpace("linear-sgamut", "S-Gamut"),
        RgbSpace("linear-sgamut3", "S-Gamut3"),
        RgbSpace("linear-sgamut3-cine", "S-Gamut3.Cine"),
        RgbSpace("linear-vgamut", "V-Gamut"),
        RgbSpace("linear-cinema-gamut", "Cinema Gamut"),
        RgbSpace("linear-fgamut", "F-Gamut"),
        RgbSpace("linear-fgamut-c", "F-Gamut C"),
        RgbSpace("linear-ngamut", "N-Gamut"),
        RgbSpace("linear-dgamut", "DJI D-Gamut"),
        RgbSpace("linear-davinci-wide-gamut", "DaVinci Wide Gamut"),
        RgbSpace("linear-blackmagic-wide-gamut", "Blackmagic Wide Gamut"),
        RgbSpace("linear-redwidegamut", "REDWideGamutRGB"),
        RgbSpace("linear-apple-wide-gamut", "Apple Wide Gamut"),
        RgbSpace("acescg", "ACEScg"),
        RgbSpace("aces2065-1", "ACES2065-1"),
        RgbSpace("srgb", "sRGB", "sRGB"),
        RgbSpace("display-p3", "P3-D65", "sRGB"),
        RgbSpace("rec2020-srgb", "ITU-R BT.2020", "sRGB"),
        RgbSpace("adobe-rgb", "Adobe RGB (1998)", "Adobe RGB (1998)"),
        RgbSpace("prophoto", "ProPhoto RGB", "ROMM RGB"),
        RgbSpace("acescc", "ACEScg", "ACEScc"),
        RgbSpace("acescct", "ACEScg", "ACEScct"),
        RgbSpace("logc3", "ARRI Wide Gamut 3", "ARRI LogC3"),
        RgbSpace("logc4", "ARRI Wide Gamut 4", "ARRI LogC4"),
        RgbSpace("s-log2", "S-Gamut", "S-Log2"),
        RgbSpace("slog3", "S-Gamut3", "S-Log3"),
        RgbSpace("slog3-cine", "S-Gamut3.Cine", "S-Log3"),
        RgbSpace("vlog", "V-Gamut", "V-Log"),
        RgbSpace("clog2", "Cinema Gamut", "Canon Log 2"),
        RgbSpace("clog3", "Cinema Gamut", "Canon Log 3"),
        RgbSpace("flog", "F-Gamut", "F-Log"),
        RgbSpace("flog2", "F-Gamut", "F-Log2"),
        RgbSpace("f-log2-c", "F-Gamut C", "F-Log2"),
        RgbSpace("l-log", "ITU-R BT.2020", "L-Log"),
        RgbSpace("nlog", "N-Gamut", "N-Log"),
        RgbSpace("dlog", "DJI D-Gamut", "D-Log"),
        RgbSpace("davinci-intermediate", "DaVinci Wide Gamut", "DaVinci Intermediate"),
        RgbSpace("blackmagic-film-gen5", "Blackmagic Wide Gamut", "Blackmagic Film Generation 5"),
        RgbSpace("redlog3g10", "REDWideGamutRGB", "Log3G10"),
        RgbSpace("applelog", "ITU-R BT.2020", "Apple Log"),
        RgbSpace("apple-log-2", "Apple Wide Gamut", "Apple Log"),
        RgbSpace("rec2100-pq", "ITU-R BT.2020", "PQ"),
        RgbSpace("rec2100-hlg", "ITU-R BT.2020", "HLG"),
    )
}
"""The spaces that `--space` takes, by name."""


INTEROP_IDS = {
    "acescg": "lin_ap1_scene",
    "aces2065-1": "lin_ap0_scene",
    "linear-srgb": "lin_rec709_scene",
    "linear-p3": "lin_p3d65_scene",
    "linear-rec2020": "lin_rec2020_scene",
    "linear-adobe-rgb": "lin_adobergb_scene",
}
"""What files of scene-linear light name their space by (Color Interop Forum, Color Space Encodings for Texture Assets
and CG Rendering, 2024), where there is such a name."""


def from_linear_srgb(name: str) -> Array:
    """(3, 3): linear sRGB → the linear RGB of a space, by its name in SPACES."""
    return matrix_between("linear-srgb", rgb_space(name).linear.name)


def rgb_space(name: str) -> RgbSpace:
    """A space by its name, in any case. Raises SettingsError, which lists the names, on an unknown one."""
    word = name.strip().lower()
    found = SPACES.get(word)
    if found is None:
        known = sorted(SPACES, key=lambda each: word not in each)  # names that hold the word first: the list is long
        raise SettingsError(f'no colour space "{name[:60]}"; known: {", ".join(known)}')
    return found


@cache
def matrix_between(source: str, target: str) -> Array:
    """(3, 3): linear RGB of the space `source` → linear RGB of the space `target`, by their names in SPACES."""
    if rgb_space(source).primaries == rgb_space(target).primaries:
        return np.eye(3)
    return np.asarray(np.linalg.inv(to_xyz_d50(target)) @ to_xyz_d50(source))


def to_xyz(name: str) -> Array:
    """(3, 3): linear RGB of a space → CIE XYZ, not adapted, with Y = 1 for white."""
    return xyz_matrix(rgb_space(name).primaries)


def to_xyz_d50(name: str) -> Array:
    """(3, 3): linear RGB of a space → CIE XYZ adapted to D50."""
    cones = BRADFORD @ to_xyz(name)
    d50 = BRADFORD @ D50
    return np.asarray(np.linalg.solve(BRADFORD, cones * (d50 / cones.sum(axis=1))[:, None]))


NAME = "Compatible with Adobe RGB (1998)"


@cache
def adobe_rgb_profile() -> bytes:
    """A matrix profile of version 2 (ICC.1:2001-04)."""
    curve = struct.pack(">4s4xIHxx", b"curv", 1, round(256 * 2.19921875))
    # XYZ of red, green and blue, adapted to D50 (Adobe RGB (1998) Color Image Encoding, 4.3).
    primaries = ((0.60974, 0.31111, 0.01947), (0.20528, 0.62567, 0.06087), (0.14919, 0.06322, 0.74457))
    tags = {
        b"wtpt": icc_xyz((0.95045, 1.0, 1.08905)),
        **{name: icc_xyz(colour) for name, colour in zip((b"rXYZ", b"gXYZ", b"bXYZ"), primaries, strict=True)},
        **dict.fromkeys((b"rTRC", b"gTRC", b"bTRC"), curve),
    }
    return icc_file(b"mntr", b"XYZ ", NAME, "No copyright, use freely", tags)


def icc_file(kind: bytes, connection: bytes, name: str, copyright_: str, more: Mapping[bytes, bytes]) -> bytes:
    """An ICC profile of RGB, version 2.4 (ICC.1:2001-04): class, connection space, tags beside name and copyright."""
    text = name.encode("ascii", "replace") + b"\0"
    tags = {
        b"desc": struct.pack(">4s4xI", b"desc", len(text)) + text + bytes(78),
        b"cprt": struct.pack(">4s4x", b"text") + copyright_.encode() + b"\0",
        **more,
    }
    start, places, body = 132 + 12 * len(tags), b"", b""
    for tag, data in tags.items():
        places += struct.pack(">4sII", tag, start + len(body), len(data))
        body += data + bytes(-len(data) % 4)
    date = (2026, 1, 1, 0, 0, 0)  # of no meaning: the same numbers give the same file
    head = struct.pack(">I4xI4s4s4s6H4s", start + len(body), 0x02400000, kind, b"RGB ", connection, *date, b"acsp")
    return head + bytes(28) + icc_xyz(D50)[8:] + bytes(48) + struct.pack(">I", len(tags)) + places + body


def icc_xyz(values: tuple[float, float, float]) -> bytes:
    """XYZ as a tag's data (XYZType)."""
    return struct.pack(">4s4x3i", b"XYZ ", *(round(65536 * value) for value in values))
