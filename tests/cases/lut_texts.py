"""A small sound file of each text format of LUTs that is read."""

from collections.abc import Sequence
from itertools import product

NODES = [(r, g, b) for b, g, r in product((0, 1), repeat=3)]
"""The nodes of a cube of two, red fastest."""
BLUE_FASTEST = [(r, g, b) for r, g, b in product((0, 1), repeat=3)]


def table(template: str = "{r}.0 {g}.0 {b}.0\n", nodes: Sequence[tuple[int, int, int]] = NODES) -> str:
    """A row for each node. Lines and numbers are such as the writers of LUT files have them."""
    return "".join(template.format(r=r, g=g, b=b, n=n) for n, (r, g, b) in enumerate(nodes))


PRELUTS = "2\n0.0 1.0\n0.0 1.0\n" * 3
CLF = (
    "<?xml version='1.0'?><ProcessList compCLFversion='3' id='a'><LUT1D inBitDepth='32f' outBitDepth='32f'>"
    "<Array dim='3 1'>\n0.0\n0.5\n1.0\n</Array></LUT1D><LUT3D inBitDepth='32f' outBitDepth='32f'>"
    f"<Array dim='2 2 2 3'>\n{table(nodes=BLUE_FASTEST)}</Array></LUT3D></ProcessList>\n"
)
VLT = "LUT_3D_SIZE 17\n\n" + "".join(f"{255 * r} {255 * g} {255 * b}\n" for b, g, r in product(range(17), repeat=3))
SOUND = {
    "a.cube": 'TITLE "x"\nLUT_3D_SIZE 2\nDOMAIN_MIN 0.0 0.0 0.0\nDOMAIN_MAX 1.0 1.0 1.0\n' + table(),
    "1d.cube": "LUT_1D_SIZE 3\n0.0 0.0 0.0\n0.5 0.5 0.5\n1.0 1.0 1.0\n",
    "shaper.cube": "LUT_1D_SIZE 2\nLUT_1D_INPUT_RANGE 0.0 1.0\nLUT_3D_SIZE 2\n0.0 0.0 0.0\n1.0 1.0 1.0\n" + table(),
    "a.itx": "LUT_3D_SIZE 2\n" + table(),
    "a.3dl": "0 341 682 1023\n" + "".join(
        f"{1365 * r} {1365 * g} {1365 * b}\n" for r, g, b in product(range(4), repeat=3)
    ),
    "a.csp": f"CSPLUTV100\n3D\n\nBEGIN METADATA\n1,5 is text\nEND METADATA\n\n{PRELUTS}\n2 2 2\n{table()}",
    "1d.csp": f"CSPLUTV100\n1D\n\n{PRELUTS}\n3\n0.0 0.0 0.0\n0.5 0.5 0.5\n1.0 1.0 1.0\n",
    "curve.spi1d": "Version 1\nFrom 0.0 1.0\nLength 3\nComponents 1\n{\n0.0\n0.5\n1.0\n}\n",
    "a.spi3d": "SPILUT 1.0\n3 3\n2 2 2\n" + table("{r} {g} {b} {r}.0 {g}.0 {b}.0\n"),
    "a.spimtx": "1.0 0.0 0.0 0.0\n0.0 1.0 0.0 0.0\n0.0 0.0 1.0 0.0\n",
    "a.cub": (
        "# Truelight Cube v2.0\n# iDims 3\n# oDims 3\n# width 2 2 2\n# lutLength 2\n# InputLUT\n0.0 0.0 0.0\n"
        f"1.0 1.0 1.0\n# Cube\n{table()}# end\n"
    ),
    "houdini.lut": (
        "Version 3\nFormat any\nType 3D+1D\nFrom 0.0 1.0\nTo 0.0 1.0\nBlack 0\nWhite 1\nLength 2 3\nLUT:\nPre {\n"
        f"0.0\n0.5\n1.0\n}}\n3D {{\n{table()}}}\n"
    ),
    "discreet.lut": "LUT: 3 1024\n" + "".join(f"{code}\n" for code in range(1024)) * 3,
    "a.m3d": "channel 3d\nin 8\nout 1024\nformat lut\nvalues\tred\tgreen\tblue\n" + "".join(
        f"{n}\t{1023 * r}\t{1023 * g}\t{1023 * b}\n" for n, (r, g, b) in enumerate(BLUE_FASTEST)
    ),
    "a.vf": (
        f"#Inventor V2.1 ascii\ngrid_size 2 2 2\nglobal_transform {'1 0 0 0 ' * 4}\ndata\n"
        f"{table(nodes=BLUE_FASTEST)}"
    ),
    "a.vlt": VLT,
    "a.clf": CLF,
    "a.ctf": CLF.replace("compCLFversion='3'", "version='1.3'"),
    "a.cc": (
        "<ColorCorrection id='a'><SOPNode><Slope>1.0 1.0 1.0</Slope><Offset>0.0 0.0 0.0</Offset><Power>1.0 1.0 1.0"
        "</Power></SOPNode><SatNode><Saturation>1.0</Saturation></SatNode></ColorCorrection>"
    ),
}  # fmt: skip
"""A small sound file of each format of text that is read."""
