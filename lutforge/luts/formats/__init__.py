"""LUT file formats, one module each: it says which sequences of operations a file can hold, reads and writes them.

To add one, write a module with `read`, `write` and a registered `FileFormat`, and add its name to both lists below.
"""

from lutforge.luts.formats import clf, csp, cube, dctl, hald, houdini, spi, threedl, truelight, vlt

__all__ = ["clf", "csp", "cube", "dctl", "hald", "houdini", "spi", "threedl", "truelight", "vlt"]
