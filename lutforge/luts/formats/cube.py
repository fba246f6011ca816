"""Reading `.cube`: 1D, 3D, or a 1D shaper in front of a 3D table, with the domain keywords of every dialect.

Adobe Cube LUT Specification 1.0, and Resolve's LUT_1D_INPUT_RANGE and LUT_3D_INPUT_RANGE.
"""

from pathlib import Path

from lutforge.errors import LutError
from lutforge.luts.contents import Curve, LutContents
from lutforge.luts.formats.lines import MAX_CURVE, MAX_SIZE, Lines, is_numeric, red_fastest


def read(path: Path, data: bytes) -> LutContents:
    """Read one. Raises LutError: file, line, text and cause in one line."""
    lines = Lines(path, data)
    sizes: dict[str, int] = {}
    title, keywords, low, high = "", set(), (0.0, 0.0, 0.0), (1.0, 1.0, 1.0)
    ranges = {"LUT_1D_INPUT_RANGE": (0.0, 1.0), "LUT_3D_INPUT_RANGE": (0.0, 1.0)}
    index = 0
    while index < len(lines) and not is_numeric(lines.texts[index]):
        word, *rest = lines.texts[index].split()
        keywords.add(word)
        if word == "TITLE":
            title = lines.texts[index][5:].strip().strip('"')
        elif word in ("LUT_1D_SIZE", "LUT_3D_SIZE"):
            if len(rest) != 1:
                raise lines.wrong(index, f"{word} takes one number")
            (sizes[word],) = lines.integers(index, rest, 2, MAX_CURVE if word == "LUT_1D_SIZE" else MAX_SIZE, word)
        elif word in ranges:
            first, second = lines.floats(index, rest, 2, word)
            ranges[word] = (first, second)
        elif word in ("DOMAIN_MIN", "DOMAIN_MAX"):
            r, g, b = lines.floats(index, rest, 3, word)
            low, high = ((r, g, b), high) if word == "DOMAIN_MIN" else (low, (r, g, b))
        else:
            raise lines.wrong(index, "not a keyword of .cube files")
        index += 1
    entries, size = sizes.get("LUT_1D_SIZE", 0), sizes.get("LUT_3D_SIZE", 0)
    if not entries and not size:
        raise LutError(f"{path}: neither LUT_1D_SIZE nor LUT_3D_SIZE; not a .cube file")
    for name, (first, second) in {
        **ranges,
        **{f"DOMAIN {c}": pair for c, pair in enumerate(zip(low, high, strict=True))},
    }.items():
        if not first < second:
            raise LutError(f"{path}: {name}: the range {first:g} to {second:g} is empty")
    shaper = cube = None
    if entries:
        domain = ranges["LUT_1D_INPUT_RANGE"] if "LUT_1D_INPUT_RANGE" in keywords else (low[0], high[0])
        shaper = Curve(lines.table(index, entries, 3, "the 1D table"), domain=domain)
    if size:
        cube = red_fastest(lines.table(index + entries, size**3, 3, "the 3D table"), (size, size, size))
    if len(lines) > index + entries + size**3:
        raise lines.wrong(index + entries + size**3, f"more rows than the {entries + size**3} that the header says")
    dialect = "1D shaper + 3D (Resolve)" if entries and size else "3D" if size else "1D"
    if size and shaper is not None:
        low, high = (shaper.domain[0],) * 3, (shaper.domain[1],) * 3
    if size and not entries and "LUT_3D_INPUT_RANGE" in keywords:
        first, second = ranges["LUT_3D_INPUT_RANGE"]
        low, high = (first, first, first), (second, second, second)
    return LutContents(
        ".cube", dialect, title, tuple(lines.comments), cube, shaper, None, (low, high), frozenset(keywords)
    )
