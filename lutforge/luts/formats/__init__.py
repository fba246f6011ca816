"""LUT file formats: a file for each, which says what sequences it holds, reads them and writes them.

A new one is a file with `read`, `write` and a registered `FileFormat`, and its name in the line below.
"""

from lutforge.luts.formats import clf, csp, cube, dctl, hald, houdini, spi, threedl, truelight, vlt

__all__ = ["clf", "csp", "cube", "dctl", "hald", "houdini", "spi", "threedl", "truelight", "vlt"]
