"""Chromaticities of RGB primaries and of their white, by the name of the linear space.

The numbers are those of `colour.RGB_COLOURSPACES`, from each maker's own publication; they stand here because all of
colour-science takes a second to import.
"""

import numpy as np

from lutforge.arrays import Array

D65 = (0.3127, 0.3290)
_D50, _ACES = (0.3457, 0.3585), (0.32168, 0.33767)

CHROMATICITIES = {
    "linear-srgb": ((0.64, 0.33), (0.3, 0.6), (0.15, 0.06), D65),
    "linear-p3": ((0.68, 0.32), (0.265, 0.69), (0.15, 0.06), D65),
    "linear-rec2020": ((0.708, 0.292), (0.17, 0.797), (0.131, 0.046), D65),
    "linear-adobe-rgb": ((0.64, 0.33), (0.21, 0.71), (0.15, 0.06), D65),
    "linear-prophoto": ((0.7347, 0.2653), (0.1596, 0.8404), (0.0366, 0.0001), _D50),
    "linear-awg3": ((0.684, 0.313), (0.221, 0.848), (0.0861, -0.102), D65),
    "linear-awg4": ((0.7347, 0.2653), (0.1424, 0.8576), (0.0991, -0.0308), D65),
    "linear-sgamut": ((0.73, 0.28), (0.14, 0.855), (0.1, -0.05), D65),
    "linear-sgamut3": ((0.73, 0.28), (0.14, 0.855), (0.1, -0.05), D65),
    "linear-sgamut3-cine": ((0.766, 0.275), (0.225, 0.8), (0.089, -0.087), D65),
    "linear-vgamut": ((0.73, 0.28), (0.165, 0.84), (0.1, -0.03), D65),
    "linear-cinema-gamut": ((0.74, 0.27), (0.17, 1.14), (0.08, -0.1), D65),
    "linear-fgamut": ((0.708, 0.292), (0.17, 0.797), (0.131, 0.046), D65),
    "linear-fgamut-c": ((0.7347, 0.2653), (0.0263, 0.9737), (0.1173, -0.0224), D65),
    "linear-ngamut": ((0.708, 0.292), (0.17, 0.797), (0.131, 0.046), D65),
    "linear-dgamut": ((0.71, 0.31), (0.21, 0.88), (0.09, -0.08), D65),
    "linear-davinci-wide-gamut": ((0.8, 0.313), (0.1682, 0.9877), (0.079, -0.1155), D65),
    "linear-blackmagic-wide-gamut": (
        (0.7177215, 0.3171181), (0.228041, 0.861569), (0.1005841, -0.0820452), (0.312717, 0.3290312)
    ),
    "linear-redwidegamut": ((0.780308, 0.304253), (0.121595, 1.493994), (0.095612, -0.084589), D65),
    "linear-apple-wide-gamut": ((0.725, 0.301), (0.221, 0.814), (0.068, -0.076), D65),
    "acescg": ((0.713, 0.293), (0.165, 0.83), (0.128, 0.044), _ACES),
    "aces2065-1": ((0.7347, 0.2653), (0.0, 1.0), (0.0001, -0.077), _ACES),
}  # fmt: skip
"""(x, y) of red, green, blue and white."""


def xyz_matrix(name: str) -> Array:
    """(3, 3): linear RGB of a linear space → CIE XYZ, with Y = 1 for white (SMPTE RP 177-1993)."""
    x, y = np.array(CHROMATICITIES[name]).T
    directions = np.stack([x / y, np.ones(4), (1.0 - x - y) / y])
    return np.asarray(directions[:, :3] * np.linalg.solve(directions[:, :3], directions[:, 3]))
