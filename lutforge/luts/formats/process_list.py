"""Read the stages of a CLF or CTF process list (SMPTE ST 2136-1; Academy S-2014-006)."""

from pathlib import Path
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from lutforge.errors import LutError
from lutforge.luts.contents import Curve, LutContents
from lutforge.luts.formats.lines import MAX_CURVE, MAX_SIZE

Array = NDArray[np.float64]

MOST_STAGES = 100
SCALES = {"8i": 255.0, "10i": 1023.0, "12i": 4095.0, "16i": 65535.0, "16f": 1.0, "32f": 1.0}


def read(path: Path, data: bytes) -> LutContents:
    """Read a process list: its cubes and curves, and the other stages by name. Raises LutError."""
    head = data[:4096].lower()
    if b"<!doctype" in data.lower() or b"<!entity" in data.lower():
        raise LutError(f"{path}: a document type or entity is declared; a LUT needs none, and it is refused")
    if b"<" not in head:
        raise LutError(f"{path}: not an XML file, as a {path.suffix} is")
    try:
        root = ElementTree.fromstring(data)
    except (ElementTree.ParseError, ValueError, LookupError) as error:
        line = getattr(error, "position", (0, 0))[0]
        lines = data.split(b"\n")
        text = lines[line - 1].decode("utf-8", "replace").strip()[:60] if 0 < line <= len(lines) else ""
        shown = "".join(c if c.isprintable() else "?" for c in text)
        raise LutError(f'{path}, line {line}: not well-formed XML ({error}): "{shown}"') from error
    if _name(root) != "ProcessList":
        raise LutError(f'{path}: its root is "{_name(root)[:40]}", not ProcessList')
    nodes = [
        child for child in root if _name(child) not in ("Description", "InputDescriptor", "OutputDescriptor", "Info")
    ]
    if not 1 <= len(nodes) <= MOST_STAGES:
        raise LutError(f"{path}: {len(nodes)} stages; expected 1 to {MOST_STAGES}")
    stages: list[str] = []
    cubes: list[Array] = []
    before: list[Curve] = []
    after: list[Curve] = []
    for number, node in enumerate(nodes, 1):
        where = f"{path}, stage {number} ({_name(node)[:30]})"
        stage, value = _stage(node, where)
        stages.append(stage)
        if isinstance(value, Curve):
            (after if cubes else before).append(value)
        elif value is not None:
            cubes.append(value)
    comments = tuple((child.text or "").strip()[:200] for child in root if _name(child) == "Description")
    return LutContents(
        "CTF" if path.suffix.lower() == ".ctf" else "CLF",
        "process list",
        root.get("name", "")[:200],
        comments,
        cubes[0] if cubes else None,
        before[-1] if before else None,
        after[0] if after else None,
        keywords=frozenset({"SMPTE"} if "smpte" in root.tag.lower() else ()),
        stages=tuple(stages),
    )


def _name(element: ElementTree.Element) -> str:
    return element.tag.rsplit("}", 1)[-1] if isinstance(element.tag, str) else "?"


def _stage(node: ElementTree.Element, where: str) -> tuple[str, Array | Curve | None]:
    """What a stage is in words, and its table."""
    kind = _name(node)
    if kind in ("LUT1D", "LUT3D", "Matrix"):
        array = next((child for child in node if _name(child) == "Array"), None)
        if array is None:
            raise LutError(f"{where}: it has no Array")
        dimensions = _dimensions(array, where)
        scale = SCALES.get(node.get("outBitDepth", "32f"))
        if scale is None:
            raise LutError(f'{where}: unknown outBitDepth "{node.get("outBitDepth", "")[:20]}"')
        count = int(np.prod(dimensions, dtype=np.int64))
        values = _values(array, count, where)
        if kind == "LUT3D":
            if len(dimensions) != 4 or dimensions[3] != 3 or len(set(dimensions[:3])) != 1:
                raise LutError(f"{where}: an Array of {' × '.join(map(str, dimensions))}; expected N N N 3")
            method = node.get("interpolation", "trilinear")
            return f"LUT3D {dimensions[0]}³ {method[:20]}", values.reshape(dimensions) / scale
        if kind == "LUT1D":
            if len(dimensions) != 2 or dimensions[1] not in (1, 3):
                raise LutError(f"{where}: an Array of {' × '.join(map(str, dimensions))}; expected M 3 or M 1")
            half = node.get("halfDomain") == "true"
            table = values.reshape(dimensions) / scale
            return f"LUT1D {dimensions[0]}{' half-domain' if half else ''}", None if half else Curve(table)
        return "Matrix", None
    if kind in ("Range", "Log", "Exponent", "ASC_CDL", "Gamma", "ExposureContrast", "FixedFunction"):
        return kind, None
    return f"{kind[:30]} (not CLF)", None


def _dimensions(array: ElementTree.Element, where: str) -> list[int]:
    words = array.get("dim", "").split()
    if not 1 <= len(words) <= 4 or not all(word.isascii() and word.isdigit() and len(word) < 9 for word in words):
        raise LutError(f'{where}: dim "{array.get("dim", "")[:40]}" is not one to four whole numbers')
    sizes = [int(word) for word in words]
    most = MAX_SIZE if len(sizes) == 4 else MAX_CURVE
    if not all(1 <= size <= most for size in sizes):
        raise LutError(f'{where}: dim "{array.get("dim", "")[:40]}" is beyond what readers take')
    return sizes


def _values(array: ElementTree.Element, count: int, where: str) -> Array:
    words = (array.text or "").split()
    if len(words) != count:
        raise LutError(f"{where}: its Array says {count} numbers and holds {len(words)}")
    try:
        values = np.array(words, dtype=np.float64)
    except ValueError:
        bad = next(word for word in words if not _is_number(word))
        raise LutError(f'{where}: not a number: "{bad[:40]}"') from None
    if not np.all(np.isfinite(values)):
        raise LutError(f"{where}: a number is not finite")
    return values


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True
