"""A picture that a program developed from a RAW file; calibration can use it instead of the RAW."""

from dataclasses import dataclass

from lutforge.arrays import Pixels


@dataclass(frozen=True, eq=False)
class Development:
    """A white-balanced linear picture, in any of the four orientations.

    pixels: (h, w, 3) float32, linear RGB of `space` (a name of `lutforge.colour.rgb_spaces`). developer: the program
    and its version.
    """

    pixels: Pixels
    space: str
    developer: str
