"""The kinds of LUT files among which programs differ: what one reads rightly, another refuses or renders wrongly."""

from enum import Enum


class LutKind(Enum):
    """A kind of LUT file, by which the table of programs gives verdicts."""

    CUBE = "plain .cube"
    CUBE_WITH_DOMAIN_FROM_0 = ".cube whose domain is from 0 to other than 1"
    CUBE_WITH_DOMAIN = ".cube whose domain does not begin at 0"
    CUBE_WITH_RANGE = ".cube with the line LUT_3D_INPUT_RANGE"
    CUBE_OF_CURVE = ".cube of a 1D table alone"
    CUBE_WITH_SHAPER = ".cube with a shaper, and with input ranges"
    CUBE_WITH_SHAPER_WITHOUT_RANGES = ".cube with a shaper, and without input ranges"
    CSP = ".csp whose prelut is straight"
    CSP_WITH_SHAPER = ".csp with a prelut"
    FLAME_3DL = ".3dl"
    FLAME_3DL_17_NODES_12_BITS = ".3dl of 17 nodes and 12 bits, without the line 3DMESH"
    CLF = ".clf"
    CTF = ".ctf"
    HALD = "Hald image"
    OTHER = "any other"
