"""The comment lines of every file that LutForge writes: what it is for, what it was made from, its licence.

To apply a LUT to the wrong kind of pixels is the usual mistake, and most formats have no field for the kind.
"""

from collections.abc import Iterable

from lutforge import __version__
from lutforge.luts.input_and_output import InputAndOutput

LICENCE = "CC0 1.0, no rights reserved"
"""The licence of files that are made with LutForge."""


def description(stated: InputAndOutput | None, place: str = "", details: Iterable[str] = ()) -> tuple[str, ...]:
    """Comment lines of a file: version, input, output and range, where to put it, details, and the licence.

    stated: input and output, where they are known; place: where its program takes the file; details: camera and
    settings, held-out errors.
    """
    lines = [f"LutForge {__version__}"]
    if stated is not None:
        lines += [*stated.comments, "range: full, not video levels"]
    if place:
        lines.append(f"place: {place}")
    return (*lines, *details, f"licence: {LICENCE}")
