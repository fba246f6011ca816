"""`.clf` and `.ctf`: the Academy/ASC Common LUT Format (SMPTE ST 2136-1) and Autodesk's superset of it.

OpenColorIO reads and writes them: it is the reference implementation of both.
"""

import hashlib
from pathlib import Path

import numpy as np
import PyOpenColorIO as OCIO  # noqa: N814 - the name that its documentation uses

from lutforge.arrays import Array
from lutforge.errors import LutError, one_line
from lutforge.luts.formats.text import write_text
from lutforge.luts.ops import Cube, Curve, Matrix
from lutforge.luts.sequence import FileFormat, Lut, group_of

ACES_ID = "ACEStransformID"
"""The element of Info that names an ACES transform (SMPTE ST 2136-1, Info), and its key in the metadata of a Lut."""

KINDS = {".clf": "Academy/ASC Common LUT Format", ".ctf": "Color Transform Format"}


def write(lut: Lut, path: Path) -> None:
    """Write any LUT; the suffix says whether CLF or CTF. Raises LutError."""
    write_text(path, text_of(lut, path.suffix.lower()), "utf-8")


def text_of(lut: Lut, suffix: str = ".clf") -> str:
    """The text of a process list. Raises LutError where OpenColorIO cannot write it."""
    group = group_of(lut.ops)
    metadata = group.getFormatMetadata()
    metadata.setID(identifier(lut))
    if lut.title:
        metadata.setName(one_line(lut.title))
    for comment in lut.comments:
        if comment.strip():
            metadata.addChildElement("Description", one_line(comment, 500))
    if ACES_ID in lut.metadata:
        metadata.addChildElement("Info", "")
        info = list(metadata.getChildElements())[-1]
        info.addChildElement(ACES_ID, lut.metadata[ACES_ID])
        info.addChildElement("ACESuserName", one_line(lut.title))
    try:
        return str(group.write(KINDS[suffix], OCIO.Config.CreateRaw()))
    except OCIO.Exception as error:
        raise LutError(f"LUT: OpenColorIO cannot write it as {suffix}: {error}") from error


def identifier(lut: Lut) -> str:
    """An id that depends on the content alone, so that the same LUT is the same file."""
    digest = hashlib.sha256()
    for op in lut.ops:
        digest.update(str(op).encode())
        arrays: tuple[Array, ...] = ()  # a range is its text
        match op:
            case Matrix():
                arrays = op.matrix, op.offset
            case Curve():
                arrays = (op.outputs,)
            case Cube():
                arrays = (op.values,)
        for array in arrays:
            digest.update(np.ascontiguousarray(array, dtype=np.float64).tobytes())
    h = digest.hexdigest()
    return f"urn:uuid:{h[:8]}-{h[8:12]}-8{h[13:16]}-8{h[17:20]}-{h[20:32]}"


CLF = FileFormat("CLF", tuple(KINDS), ("full",), write, size=33)
