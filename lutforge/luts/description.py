"""What every file that LutForge writes says of itself, in the words of one place.

A LUT on the wrong pixels is the usual mistake, and most formats have no word for it: the lines are comments.
"""

from collections.abc import Iterable

from lutforge import __version__
from lutforge.luts.input_and_output import InputAndOutput

LICENCE = "CC0 1.0, no rights reserved"
"""What those who make a file with LutForge give others leave to do with it."""


def description(ends: InputAndOutput | None, place: str = "", details: Iterable[str] = ()) -> tuple[str, ...]:
    """Comment lines of a file: version, input, output and range, where to put it, details, and the licence.

    ends: input and output, where they are known; place: what to do with the file in its program; details: camera and
    settings, held-out errors.
    """
    lines = [f"LutForge {__version__}"]
    if ends is not None:
        lines += [*ends.comments, "range: full, not video levels"]
    if place:
        lines.append(f"place: {place}")
    return (*lines, *details, f"licence: {LICENCE}")
