"""Films in RAW, which are no photographs: their suffixes, and what to do with them instead."""

FILM_SUFFIXES = frozenset([".ari", ".arx", ".braw", ".crm", ".mov", ".mp4", ".mxf", ".nev", ".r3d"])
"""In lower case. LibRaw reads single frames of some."""

FILM_ADVICE = (
    "export frames of the film as TIFF or EXR, such as with DaVinci Resolve, and give these to apply, or to "
    "calibrate --pairs"
)
