"""The .clf and .ctf formats: the Academy/ASC Common LUT Format (SMPTE ST 2136-1), and Autodesk's superset of it.

OpenColorIO reads and writes them: it is the reference implementation of both.
"""

import hashlib
import re
from pathlib import Path

import numpy as np
import PyOpenColorIO as OCIO  # noqa: N814 - the name that its documentation uses

from lutforge.arrays import Array
from lutforge.errors import LutError, one_line
from lutforge.luts.input_and_output import read_input_and_output
from lutforge.luts.ocio_transforms import group_of
from lutforge.luts.op_sequence import OpSequence
from lutforge.luts.ops import Cube, Curve, Matrix
from lutforge.luts.writers.text import write_text

AMPAS_CLF_3 = "urn:AMPAS:CLF:v3.0"
"""The namespace of version 3.0 of the Academy's specification (S-2014-006), which more readers take than SMPTE's."""

PROCESS_LISTS = {".clf": "Academy/ASC Common LUT Format", ".ctf": "Color Transform Format"}


def write_clf(lut: OpSequence, path: Path) -> None:
    """Write any LUT; the suffix says whether CLF or CTF. Raises LutError."""
    write_text(path, clf_text(lut, path.suffix.lower()), "utf-8")


def clf_text(lut: OpSequence, suffix: str = ".clf") -> str:
    """The text of a process list. Raises LutError where OpenColorIO cannot write it."""
    group = group_of(lut.ops)
    metadata = group.getFormatMetadata()
    metadata.setID(_clf_identifier(lut))
    if lut.title:
        metadata.setName(one_line(lut.title))
    for comment in lut.comments:
        if comment.strip():
            metadata.addChildElement("Description", one_line(comment, 500))
    stated = read_input_and_output(lut.comments)
    if stated is not None:
        metadata.addChildElement("InputDescriptor", one_line(stated.input))
        metadata.addChildElement("OutputDescriptor", one_line(stated.output))
    try:
        text = str(group.write(PROCESS_LISTS[suffix], OCIO.Config.CreateRaw()))
    except OCIO.Exception as error:
        raise LutError(f"LUT: OpenColorIO cannot write it as {suffix}: {error}") from error
    if suffix != ".clf" or lut.metadata.clf_namespace is None:
        return text
    head = f'compCLFversion="3.0" xmlns="{lut.metadata.clf_namespace}"'
    return re.sub(r'compCLFversion="[^"]*" xmlns="[^"]*"', head, text, count=1)


def _clf_identifier(lut: OpSequence) -> str:
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
