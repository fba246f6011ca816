"""The two dialects of .cube files: the Adobe Cube LUT Specification 1.0, and that of DaVinci Resolve."""

from collections.abc import Collection
from pathlib import Path

from lutforge.errors import LutError, one_line

RANGES = {"LUT_1D_INPUT_RANGE", "LUT_3D_INPUT_RANGE"}
"""Header lines of DaVinci Resolve's dialect of .cube."""
HEADER_WORDS = {"TITLE", "LUT_1D_SIZE", "LUT_3D_SIZE", "DOMAIN_MIN", "DOMAIN_MAX"} | RANGES
"""First words of the header lines of both dialects."""
VIDEO_LEVELS = ("LUT_IN_VIDEO_RANGE", "LUT_OUT_VIDEO_RANGE")
"""Header lines by which DaVinci Resolve marks a LUT from or to video levels, 64 to 940 of 1023."""


def is_resolve_cube(words: Collection[str]) -> bool:
    """True where these words of a .cube's header are those of DaVinci Resolve's dialect."""
    return not RANGES.isdisjoint(words) or {"LUT_1D_SIZE", "LUT_3D_SIZE"} <= {*words}


def require_header_words(lines: list[str], path: Path) -> None:
    """Raise LutError on the first header line that no dialect has, which OpenColorIO refuses under another's name."""
    for number, line in enumerate(lines, 1):
        word = line.split(maxsplit=1)[0] if line[:1].isalpha() else ""
        if word.upper() in VIDEO_LEVELS:
            raise LutError(
                f"{path}: line {number}: {word}: its numbers are video levels, and only DaVinci Resolve reads that "
                "word: export the LUT for full range (data levels)"
            )
        if word and word.upper() not in HEADER_WORDS:
            raise LutError(
                f'{path}: line {number}: "{one_line(word, 40)}" is no word of the header of a .cube: '
                'write "#" before it if it is a note, else make or copy the file again'
            )


def of_one_dialect(lines: list[str], path: Path) -> tuple[list[str], list[str]]:
    """The lines of a .cube without those of a second dialect, and the problem with the lines that are left out.

    Resolve's dialect has input ranges, or a shaper, and neither TITLE nor DOMAIN lines; the Adobe Cube LUT
    Specification 1.0 has these and no ranges. LUTCalc and others write both into one file. Raises LutError where the
    two contradict each other.
    """
    header: dict[str, int] = {}
    for number, line in enumerate(lines):
        if line[:1].isalpha():
            header.setdefault(line.split(maxsplit=1)[0], number)
    ranges = RANGES & header.keys()
    adobe = [word for word in ("TITLE", "DOMAIN_MIN", "DOMAIN_MAX") if word in header]
    if not is_resolve_cube(header.keys()) or not adobe:
        return lines, []

    # DOMAIN_MIN and DOMAIN_MAX must state the first and the second number of the input ranges; without these 0 and 1.
    for word, end in (("DOMAIN_MIN", 0), ("DOMAIN_MAX", 1)):
        if word not in header:
            continue
        of_domain = {float(value) for value in lines[header[word]].split()[1:]}
        of_ranges = {float(lines[header[name]].split()[1 + end]) for name in ranges} or {float(end)}
        if of_domain != of_ranges:
            raise LutError(
                f"{path}: line {header[word] + 1}: {word} states another range than "
                f"{' and '.join(sorted(ranges)) or 'a shaper has'}: delete the line that is wrong"
            )

    left_out = {number for number, line in enumerate(lines) if line[:1].isalpha() and line.split()[0] in adobe}
    has_shaper = {"LUT_1D_SIZE", "LUT_3D_SIZE"} <= header.keys()
    resolve_words = "LUT_1D_SIZE and LUT_3D_SIZE" if has_shaper else " and ".join(sorted(ranges))
    problem = f"{', '.join(adobe)} together with {resolve_words}, which OpenColorIO and Nuke refuse: delete the line"
    return [line for number, line in enumerate(lines) if number not in left_out], [problem + "s" * (len(adobe) > 1)]
