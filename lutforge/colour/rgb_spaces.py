"""RGB colour spaces by their usual names: primaries with a transfer function or none.

Matrices are derived from the chromaticities, as OpenColorIO's are, and adapt to the white by Bradford's transform
(ICC.1:2022, annex E). Linear values are relative to the space's white: 1 is diffuse white, 0.18 mid grey.
"""

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import ArrayLike

from lutforge.arrays import Array
from lutforge.colour.srgb import SRGB_CHROMATICITIES, Chromaticities, xyz_matrix
from lutforge.colour.transfer_functions import TRANSFER_FUNCTIONS
from lutforge.errors import SettingsError, alternatives

BRADFORD = np.array([[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]])
"""XYZ → cone responses (ICC.1:2022, annex E)."""

D50_XYZ = (0.9642, 1.0, 0.8249)
"""XYZ of the white of ICC's profile connection space (ICC.1:2022, 7.2.16)."""


_D65_XY = SRGB_CHROMATICITIES[3]
_D50_XY = (0.3457, 0.3585)
_ACES_XY = (0.32168, 0.33767)

CHROMATICITIES: dict[str, Chromaticities] = {
    "linear-srgb": SRGB_CHROMATICITIES,
    "linear-p3": ((0.68, 0.32), (0.265, 0.69), (0.15, 0.06), _D65_XY),
    "linear-rec2020": ((0.708, 0.292), (0.17, 0.797), (0.131, 0.046), _D65_XY),
    "linear-adobe-rgb": ((0.64, 0.33), (0.21, 0.71), (0.15, 0.06), _D65_XY),
    "linear-prophoto": ((0.7347, 0.2653), (0.1596, 0.8404), (0.0366, 0.0001), _D50_XY),
    "linear-awg3": ((0.684, 0.313), (0.221, 0.848), (0.0861, -0.102), _D65_XY),
    "linear-awg4": ((0.7347, 0.2653), (0.1424, 0.8576), (0.0991, -0.0308), _D65_XY),
    "linear-sgamut": ((0.73, 0.28), (0.14, 0.855), (0.1, -0.05), _D65_XY),
    "linear-sgamut3": ((0.73, 0.28), (0.14, 0.855), (0.1, -0.05), _D65_XY),
    "linear-sgamut3-cine": ((0.766, 0.275), (0.225, 0.8), (0.089, -0.087), _D65_XY),
    "linear-vgamut": ((0.73, 0.28), (0.165, 0.84), (0.1, -0.03), _D65_XY),
    "linear-cinema-gamut": ((0.74, 0.27), (0.17, 1.14), (0.08, -0.1), _D65_XY),
    "linear-fgamut": ((0.708, 0.292), (0.17, 0.797), (0.131, 0.046), _D65_XY),
    "linear-fgamut-c": ((0.7347, 0.2653), (0.0263, 0.9737), (0.1173, -0.0224), _D65_XY),
    "linear-ngamut": ((0.708, 0.292), (0.17, 0.797), (0.131, 0.046), _D65_XY),
    "linear-dgamut": ((0.71, 0.31), (0.21, 0.88), (0.09, -0.08), _D65_XY),
    "linear-davinci-wide-gamut": ((0.8, 0.313), (0.1682, 0.9877), (0.079, -0.1155), _D65_XY),
    "linear-blackmagic-wide-gamut": (
        (0.7177215, 0.3171181), (0.228041, 0.861569), (0.1005841, -0.0820452), (0.312717, 0.3290312)
    ),
    "linear-redwidegamut": ((0.780308, 0.304253), (0.121595, 1.493994), (0.095612, -0.084589), _D65_XY),
    "linear-apple-wide-gamut": ((0.725, 0.301), (0.221, 0.814), (0.068, -0.076), _D65_XY),
    "acescg": ((0.713, 0.293), (0.165, 0.83), (0.128, 0.044), _ACES_XY),
    "aces2065-1": ((0.7347, 0.2653), (0.0, 1.0), (0.0001, -0.077), _ACES_XY),
}  # fmt: skip
"""The chromaticities of red, green, blue and white of each linear space, by its name.

They are the numbers of `colour.RGB_COLOURSPACES`, which come from the publications of the makers.
"""


@dataclass(frozen=True)
class RgbSpace:
    """An RGB space. primaries: the linear space of the same; transfer: one of TRANSFER_FUNCTIONS, "" where linear."""

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
        return SPACES[self.primaries]

    def encode(self, linear: ArrayLike) -> Array:
        """Linear values (…,) → encoded ones."""
        return TRANSFER_FUNCTIONS[self.transfer][0](np.asarray(linear, dtype=np.float64))

    def linearize(self, encoded: ArrayLike) -> Array:
        """Encoded values (…,) → linear ones: the inverse of `encode`."""
        return TRANSFER_FUNCTIONS[self.transfer][1](np.asarray(encoded, dtype=np.float64))


SPACES: dict[str, RgbSpace] = {
    space.name: space
    for space in (
        *(RgbSpace(name, name) for name in CHROMATICITIES),
        RgbSpace("srgb", "linear-srgb", "sRGB"),
        RgbSpace("display-p3", "linear-p3", "sRGB"),
        RgbSpace("rec2020-srgb", "linear-rec2020", "sRGB"),
        RgbSpace("adobe-rgb", "linear-adobe-rgb", "Adobe RGB (1998)"),
        RgbSpace("prophoto", "linear-prophoto", "ROMM RGB"),
        RgbSpace("acescc", "acescg", "ACEScc"),
        RgbSpace("acescct", "acescg", "ACEScct"),
        RgbSpace("logc3", "linear-awg3", "ARRI LogC3"),
        RgbSpace("logc4", "linear-awg4", "ARRI LogC4"),
        RgbSpace("s-log2", "linear-sgamut", "S-Log2"),
        RgbSpace("slog3", "linear-sgamut3", "S-Log3"),
        RgbSpace("slog3-cine", "linear-sgamut3-cine", "S-Log3"),
        RgbSpace("vlog", "linear-vgamut", "V-Log"),
        RgbSpace("clog2", "linear-cinema-gamut", "Canon Log 2"),
        RgbSpace("clog3", "linear-cinema-gamut", "Canon Log 3"),
        RgbSpace("flog", "linear-fgamut", "F-Log"),
        RgbSpace("flog2", "linear-fgamut", "F-Log2"),
        RgbSpace("f-log2-c", "linear-fgamut-c", "F-Log2"),
        RgbSpace("l-log", "linear-rec2020", "L-Log"),
        RgbSpace("nlog", "linear-ngamut", "N-Log"),
        RgbSpace("dlog", "linear-dgamut", "D-Log"),
        RgbSpace("davinci-intermediate", "linear-davinci-wide-gamut", "DaVinci Intermediate"),
        RgbSpace("blackmagic-film-gen5", "linear-blackmagic-wide-gamut", "Blackmagic Film Generation 5"),
        RgbSpace("redlog3g10", "linear-redwidegamut", "Log3G10"),
        RgbSpace("applelog", "linear-rec2020", "Apple Log Profile"),
        RgbSpace("apple-log-2", "linear-apple-wide-gamut", "Apple Log Profile"),
        RgbSpace("rec2100-pq", "linear-rec2020", "PQ"),
        RgbSpace("rec2100-hlg", "linear-rec2020", "HLG"),
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
"""The names by which files of scene-linear light state their space (Color Interop Forum, Color Space Encodings for
Texture Assets and CG Rendering, 2024), where there is such a name."""


def from_linear_srgb(name: str) -> Array:
    """The matrix (3, 3) from linear sRGB to the linear RGB of a space, by its name in SPACES."""
    return matrix_between("linear-srgb", rgb_space(name).linear.name)


def rgb_space(name: str) -> RgbSpace:
    """A space by its name, in any case. Raises SettingsError, which lists the names, on an unknown one."""
    word = name.strip().lower()
    space = SPACES.get(word)
    if space is None:
        # The list is long: names that contain the word come first.
        names = sorted(SPACES, key=lambda space_name: word not in space_name)
        raise SettingsError(f'no colour space "{name[:60]}"; {alternatives(word, names)}')
    return space


SRGB = rgb_space("srgb")
"""The space of the camera's JPEGs and of finished pictures, encoded."""


@cache
def matrix_between(source: str, target: str) -> Array:
    """The matrix (3, 3) from linear RGB of the space `source` to that of `target`, by their names in SPACES."""
    if rgb_space(source).primaries == rgb_space(target).primaries:
        return np.eye(3)
    return np.asarray(np.linalg.inv(to_xyz_d50(target)) @ to_xyz_d50(source))


def to_xyz(name: str) -> Array:
    """The matrix (3, 3) from linear RGB of a space to CIE XYZ, not adapted, with Y = 1 for white."""
    return xyz_matrix(CHROMATICITIES[rgb_space(name).primaries])


def to_xyz_d50(name: str) -> Array:
    """The matrix (3, 3) from linear RGB of a space to CIE XYZ adapted to D50."""
    cones = BRADFORD @ to_xyz(name)
    d50 = BRADFORD @ D50_XYZ
    return np.asarray(np.linalg.solve(BRADFORD, cones * (d50 / cones.sum(axis=1))[:, None]))
