"""Read a LUT file of any kind, ours or a stranger's: contents or one clear error, whatever the bytes are.

Sizes are checked before anything is made of them. Readers of the text formats are here, one function each; process
lists are in `read_process_list`, Hald images in `read_hald`.
"""

from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lutforge.errors import LutError
from lutforge.luts.contents import Curve, LutContents
from lutforge.luts.formats.lines import LONGEST_CURVE, MAX_CURVE, MAX_SIZE, Lines, red_fastest
from lutforge.luts.read_hald import read_hald
from lutforge.luts.read_process_list import read_process_list

Array = NDArray[np.float64]

MAX_BYTES = 128 * 1024 * 1024
"""Largest file that is read: a 129³ cube as text takes about 70 MB."""


def read_lut(path: str | Path) -> LutContents:
    """Read a LUT file; the suffix says which kind. Raises LutError: file, line, text and cause in one line."""
    path = Path(path)
    reader = READERS.get(path.suffix.lower())
    if reader is None:
        raise LutError(f'{path}: no LUT format has the suffix "{path.suffix}"; known: {", ".join(READERS)}')
    try:
        if path.is_dir():
            raise LutError(f"{path}: a folder, not a LUT file")
        size = path.stat().st_size
        if size == 0:
            raise LutError(f"{path}: the file is empty")
        if size > MAX_BYTES:
            raise LutError(f"{path}: {size / 2**20:.0f} MB, too large for a LUT (up to {MAX_BYTES >> 20} MB)")
        data = path.read_bytes()
    except OSError as error:
        raise LutError(f"{path}: {error.strerror or 'cannot be opened'}") from error
    return reader(path, data)


def _cube(path: Path, data: bytes) -> LutContents:
    lines = Lines(path, data)
    sizes: dict[str, int] = {}
    title, keywords, low, high = "", set(), (0.0, 0.0, 0.0), (1.0, 1.0, 1.0)
    ranges = {"LUT_1D_INPUT_RANGE": (0.0, 1.0), "LUT_3D_INPUT_RANGE": (0.0, 1.0)}
    index = 0
    while index < len(lines) and not _numeric(lines.texts[index]):
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


def _csp(path: Path, data: bytes) -> LutContents:
    lines = Lines(path, data, LONGEST_CURVE)
    if lines.at(0, "CSPLUTV100") != "CSPLUTV100":
        raise lines.wrong(0, "a .csp begins with CSPLUTV100")
    kind = lines.at(1, "1D or 3D")
    if kind not in ("1D", "3D"):
        raise lines.wrong(1, "expected 1D or 3D")
    index, notes = 2, []
    if lines.at(index, "the prelut") == "BEGIN METADATA":
        while lines.at(index, "END METADATA") != "END METADATA":
            index += 1
            notes.append(lines.at(index, "END METADATA"))
        index += 1
        notes.pop()
    inputs: list[list[float]] = []
    outputs: list[list[float]] = []
    for channel in "RGB":
        what = f"the {channel} prelut"
        (count,) = lines.integers(index, lines.at(index, what).split()[:1], 2, 1 << 16, what)
        for offset, store in ((1, inputs), (2, outputs)):
            lines.at(index + offset, what)
            store.append(lines.floats(index + offset, lines.texts[index + offset].split(), count, what))
        if np.any(np.diff(inputs[-1]) <= 0):
            raise lines.wrong(index + 1, f"{what}: its inputs do not increase")
        index += 3
    domain = tuple(knots[0] for knots in inputs), tuple(knots[-1] for knots in inputs)
    shaper = None
    if any(len(knots) > 2 or values != [0.0, 1.0] for knots, values in zip(inputs, outputs, strict=True)):
        even = np.linspace(0.0, 1.0, 4096)
        sampled = [
            np.interp(knots[0] + even * (knots[-1] - knots[0]), knots, values)
            for knots, values in zip(inputs, outputs, strict=True)
        ]
        shaper = Curve(np.stack(sampled, axis=1), domain=(domain[0][0], domain[1][0]))
    words = lines.at(index, "the size").split()
    (low_r, low_g, low_b), (high_r, high_g, high_b) = domain
    common = ((low_r, low_g, low_b), (high_r, high_g, high_b))
    if kind == "1D":
        (entries,) = lines.integers(index, words[:1], 2, MAX_CURVE, "the size")
        return LutContents(
            ".csp", "1D", "", tuple(notes), None, Curve(lines.table(index + 1, entries, 3, "the table")), None, common
        )
    if len(words) != 3:
        raise lines.wrong(index, "expected three sizes")
    r, g, b = lines.integers(index, words, 2, MAX_SIZE, "the size")
    cube = red_fastest(lines.table(index + 1, r * g * b, 3, "the cube"), (r, g, b))
    return LutContents(".csp", "prelut + 3D", "", tuple(notes), cube, shaper, None, common)


def _spi1d(path: Path, data: bytes) -> LutContents:
    lines = Lines(path, data)
    found: dict[str, list[str]] = {}
    domain, index = (0.0, 1.0), 0
    while lines.at(index, "the table in { }") != "{":
        word, *rest = lines.texts[index].split()
        if word not in ("Version", "From", "Length", "Components"):
            raise lines.wrong(index, "not a keyword of .spi1d files")
        found[word] = rest
        if word == "From":
            first, second = lines.floats(index, rest, 2, "From")
            domain = (first, second)
        elif word != "Version":
            limit = MAX_CURVE if word == "Length" else 3
            lines.integers(index, rest[:1] or ["?"], 1, limit, word)
        index += 1
    if "Length" not in found:
        raise LutError(f"{path}: no Length before the table")
    if domain[0] >= domain[1]:
        raise LutError(f"{path}: From: the range {domain[0]:g} to {domain[1]:g} is empty")
    width = int(found["Components"][0]) if "Components" in found else 1
    table = lines.table(index + 1, int(found["Length"][0]), width, "the table")
    if lines.at(index + 1 + len(table), "}") != "}":
        raise lines.wrong(index + 1 + len(table), "expected the table's end, }")
    low, high = domain
    return LutContents(".spi1d", "1D", shaper=Curve(table, domain=domain), domain=((low,) * 3, (high,) * 3))


def _spi3d(path: Path, data: bytes) -> LutContents:
    lines = Lines(path, data)
    if not lines.at(0, "SPILUT").upper().startswith("SPILUT"):  # Blender's own are in lower case
        raise lines.wrong(0, "a .spi3d begins with SPILUT 1.0")
    if lines.at(1, "3 3").split() != ["3", "3"]:
        raise lines.wrong(1, "expected 3 3")
    words = lines.at(2, "the size").split()
    if len(words) != 3:
        raise lines.wrong(2, "expected three sizes")
    r, g, b = lines.integers(2, words, 2, MAX_SIZE, "the size")
    table = lines.table(3, r * g * b, 6, "the cube")
    places = table[:, :3]
    if np.any(places != np.rint(places)) or np.any(places < 0) or np.any(places >= [r, g, b]):
        row = int(np.flatnonzero(np.any((places != np.rint(places)) | (places < 0) | (places >= [r, g, b]), axis=1))[0])
        raise lines.wrong(3 + row, "node indices outside the cube")
    cube = np.full((r, g, b, 3), np.nan)
    i, j, k = places.astype(np.int64).T
    cube[i, j, k] = table[:, 3:]
    if not np.all(np.isfinite(cube)):
        raise LutError(f"{path}: some nodes are given twice, others never")
    return LutContents(".spi3d", "3D", cube=cube)


def _threedl(path: Path, data: bytes) -> LutContents:
    lines = Lines(path, data)
    index = 0
    while index < len(lines) and lines.texts[index].split()[0].upper() in ("3DMESH", "MESH"):  # Lustre's header
        index += 1
    if index < len(lines) and not _numeric(lines.texts[index]):
        raise lines.wrong(index, "not a line of .3dl files")
    mesh = lines.at(index, "the mesh line").split()
    size = len(mesh)
    if not 2 <= size <= MAX_SIZE or size == 3:
        raise lines.wrong(index, f"the mesh line has {size} numbers")
    lines.integers(index, mesh, 0, 1 << 20, "the mesh")
    table = lines.table(index + 1, size**3, 3, "the cube")
    if np.any(table < 0) or np.any(table != np.rint(table)):
        row = int(np.flatnonzero(np.any((table < 0) | (table != np.rint(table)), axis=1))[0])
        raise lines.wrong(index + 1 + row, "a .3dl holds whole numbers from 0")
    top = float(table.max())
    bits = next((depth for depth in (8, 10, 12, 16) if top < 2**depth), None)
    if bits is None:
        raise LutError(f"{path}: a value of {top:g}; a .3dl holds up to 16 bits")
    cube = table.reshape(size, size, size, 3) / (2**bits - 1)
    return LutContents(".3dl", "3D, integers", comments=tuple(lines.comments), cube=cube, bits=bits)


def _truelight(path: Path, data: bytes) -> LutContents:
    lines = Lines(path, data)
    header: dict[str, list[str]] = {}
    for comment in lines.comments:
        word, *rest = comment.split() or [""]
        header.setdefault(word, rest)
    if "Truelight" not in header:
        raise LutError(f'{path}: no "# Truelight Cube" line; not a Truelight .cub')

    def whole(word: str, low: int, high: int, count: int) -> list[int]:
        words = header.get(word, [])
        if len(words) != count or not all(w.isascii() and w.isdigit() and len(w) < 9 for w in words):
            raise LutError(f'{path}: "# {word}" needs {count} whole number{"s" if count > 1 else ""}')
        values = [int(w) for w in words]
        if not all(low <= value <= high for value in values):
            raise LutError(f'{path}: "# {word}" is not within {low} to {high}')
        return values

    r, g, b = whole("width", 2, MAX_SIZE, 3)
    (entries,) = whole("lutLength", 2, MAX_CURVE, 1) if "InputLUT" in header else (0,)
    shaper = None
    if entries:
        nodes = np.array([r - 1, g - 1, b - 1], dtype=np.float64)
        shaper = Curve(lines.table(0, entries, 3, "InputLUT") / nodes)
    cube = red_fastest(lines.table(entries, r * g * b, 3, "Cube"), (r, g, b))
    return LutContents("Truelight .cub", "shaper + 3D", comments=tuple(lines.comments), cube=cube, shaper=shaper)


def _houdini(path: Path, data: bytes) -> LutContents:
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
    body = [i for i in range(index + 1, len(lines)) if _numeric(lines.texts[i])]
    marks = [i for i in range(index + 1, len(lines)) if not _numeric(lines.texts[i])]
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


def _numeric(text: str) -> bool:
    """True where a line begins like a number."""
    return not text.endswith("{") and (text[0] in "+-.0123456789" or text[:3].lower() in ("nan", "inf"))


READERS: dict[str, Callable[[Path, bytes], LutContents]] = {
    ".cube": _cube,
    ".clf": read_process_list,
    ".ctf": read_process_list,
    ".csp": _csp,
    ".3dl": _threedl,
    ".cub": _truelight,
    ".lut": _houdini,
    ".spi1d": _spi1d,
    ".spi3d": _spi3d,
    ".png": read_hald,
    ".tif": read_hald,
    ".tiff": read_hald,
}
