"""`.lut` (SideFX Houdini, version 3): one shaper for all three channels, and a cube."""

from pathlib import Path

import numpy as np

from lutforge.errors import LutError
from lutforge.luts.contents import Curve, LutContents
from lutforge.luts.formats.lines import MAX_CURVE, MAX_SIZE, Lines, is_numeric, red_fastest
from lutforge.luts.formats.text import rows
from lutforge.luts.lut import Lut


def write(lut: Lut, path: Path) -> None:
    """Write a LUT whose axes share their levels, without gain, response or matrix. Raises LutError on any other."""
    shaper = lut.shaper
    if lut.has_gain or lut.has_matrix or lut.response is not None or np.ptp(shaper, axis=1).max() > 1e-9:
        raise LutError(f"{path}: a Houdini .lut holds one shaper for all channels, and no gain, response or matrix")
    kind = "Type\t\t3D" if lut.is_uniform else "Type\t\t3D+1D"
    length = str(lut.size) if lut.is_uniform else f"{lut.size} {lut.shaper_size}"
    lines = [
        "Version\t\t3",
        "Format\t\tany",
        kind,
        "From\t\t0.000000 1.000000",
        "To\t\t0.000000 1.000000",
        "Black\t\t0.000000",
        "White\t\t1.000000",
        f"Length\t\t{length}",
        "LUT:",
    ]
    table = np.ascontiguousarray(lut.cube.transpose(2, 1, 0, 3)).reshape(-1, 3)
    text = "\n".join(lines) + "\n"
    if lut.is_uniform:
        text += " {\n" + rows(table) + "}\n"
    else:
        text += "Pre {\n" + "".join(f"{v:.10f}\n" for v in shaper[:, 0].tolist()) + "}\n3D {\n" + rows(table) + "}\n"
    path.write_text(text, encoding="ascii", newline="\n")


def read(path: Path, data: bytes) -> LutContents:
    """Read one. Raises LutError: file, line, text and cause in one line."""
    lines = Lines(path, data)
    if lines.at(0, "Version").split()[0].lower() != "version":
        raise lines.wrong(0, "a Houdini .lut begins with Version")
    header: dict[str, tuple[int, list[str]]] = {}
    index = 0
    while lines.at(index, "LUT:").lower() != "lut:":
        word, *rest = lines.texts[index].split()
        header[word.lower()] = (index, rest)
        index += 1
    kind = " ".join(header.get("type", (0, []))[1]).lower()
    if kind not in ("3d", "3d+1d", "c", "rgb", "rgba", "all", "a"):
        raise LutError(f'{path}: Type "{kind[:20]}" is none of 3D, 3D+1D, RGB, C')
    if "length" not in header or not header["length"][1]:
        raise LutError(f"{path}: no Length before LUT:")
    at, words = header["length"]
    domain = (0.0, 1.0)
    if "from" in header:
        place, pair = header["from"]
        first, second = lines.floats(place, pair, 2, "From")
        domain = (first, second)
        if first >= second:
            raise lines.wrong(place, "the range is empty")
    body = [i for i in range(index + 1, len(lines)) if is_numeric(lines.texts[i])]
    marks = [i for i in range(index + 1, len(lines)) if not is_numeric(lines.texts[i])]
    for i in marks:
        if lines.texts[i].replace(" ", "") not in ("{", "}", "Pre{", "3D{", "RGB{", "C{", "A{", "R{", "G{", "B{"):
            raise lines.wrong(i, "not a line of Houdini LUTs")
    low, high = ((domain[0],) * 3), ((domain[1],) * 3)
    if not kind.startswith("3d"):
        (entries,) = lines.integers(at, words[:1], 2, MAX_CURVE, "Length")
        if not body:
            raise LutError(f"{path}: no rows of numbers")
        curve = Curve(lines.table(body[0], min(entries, len(body)), 1, "the curve"), domain=domain)
        return LutContents("Houdini .lut", "1D", shaper=curve, domain=(low, high))
    (size,) = lines.integers(at, words[:1], 2, MAX_SIZE, "Length")
    entries, shaper = 0, None
    if kind == "3d+1d":
        (entries,) = lines.integers(at, words[1:2] or ["?"], 2, MAX_CURVE, "Length")
    if len(body) != entries + size**3:
        raise LutError(f"{path}: expected {entries + size**3} rows of numbers, found {len(body)}")
    if entries:
        one = lines.table(body[0], entries, 1, "Pre")
        shaper = Curve(np.repeat(one, 3, axis=1), domain=domain)
    cube = red_fastest(lines.table(body[entries], size**3, 3, "3D"), (size, size, size))
    return LutContents("Houdini .lut", kind.upper(), cube=cube, shaper=shaper, domain=(low, high))
