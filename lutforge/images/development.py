"""A picture that a program developed of a RAW file: the left side of a pair, in place of the RAW itself."""

from dataclasses import dataclass

from lutforge.arrays import Pixels


@dataclass(frozen=True, eq=False)
class Development:
    """A white-balanced linear picture, turned in any of the four ways.

    pixels: (h, w, 3) float32, linear RGB of `space` (a name of `lutforge.colour.rgb_spaces`). developer: the program
    and its version.
    """

    pixels: Pixels
    space: str
    developer: str
