"""`.clf` and `.ctf`: the Academy/ASC Common LUT Format (SMPTE ST 2136-1) and Autodesk's superset of it."""

import hashlib
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import PyOpenColorIO as OCIO  # noqa: N814 - the name that its documentation uses
from numpy.typing import NDArray

from lutforge.errors import LutError
from lutforge.luts.lut import Lut

FORMATS = {".clf": "Academy/ASC Common LUT Format", ".ctf": "Color Transform Format"}


def transforms(lut: Lut) -> OCIO.GroupTransform:
    """Matrix (gain, scene space, range) → Range (to [0, 1]) → LUT1D (shaper) → LUT3D → LUT1D (response) → Matrix."""
    group = OCIO.GroupTransform()
    if lut.has_gain or lut.is_for_scenes:
        ahead = np.eye(4)
        span = lut.highest - lut.lowest
        ahead[:3, :3] = (lut.gain / span)[:, None] * (np.eye(3) if lut.before is None else lut.before)
        group.appendTransform(OCIO.MatrixTransform(ahead.ravel().tolist(), [-lut.lowest / span] * 3 + [0.0]))
    group.appendTransform(OCIO.RangeTransform(minInValue=0.0, maxInValue=1.0, minOutValue=0.0, maxOutValue=1.0))
    if not lut.is_uniform:
        group.appendTransform(_lut1d(lut.shaper))
    group.appendTransform(_lut3d(lut))
    if lut.response is not None:
        group.appendTransform(_lut1d(lut.response))
    if lut.has_matrix:
        matrix = np.eye(4)
        matrix[:3, :3] = lut.matrix
        group.appendTransform(OCIO.MatrixTransform(matrix.ravel().tolist()))
    return group


def write(lut: Lut, path: Path) -> None:
    """Write any LUT, exactly; the suffix says whether CLF or CTF. Raises LutError."""
    write_all((lut,), path)


def write_all(luts: Sequence[Lut], path: Path) -> None:
    """Write LUTs to be applied one after the other, exactly; titled and commented as the first. Raises LutError."""
    group = OCIO.GroupTransform()
    for lut in luts:
        for transform in transforms(lut):
            group.appendTransform(transform)
    metadata = group.getFormatMetadata()
    metadata.setID(_identifier(luts))
    if luts[0].title:
        metadata.setName(_line(luts[0].title))
    for comment in luts[0].comments:
        if line := _line(comment):
            metadata.addChildElement("Description", line)
    try:
        text = group.write(FORMATS[path.suffix.lower()], OCIO.Config.CreateRaw())
    except OCIO.Exception as error:
        raise LutError(f"{path}: OpenColorIO cannot write it: {' '.join(str(error).split())}") from error
    path.write_text(text, encoding="utf-8", newline="\n")


def _lut1d(table: NDArray[np.float64]) -> OCIO.Lut1DTransform:
    curve = OCIO.Lut1DTransform(len(table), False)
    curve.setFileOutputBitDepth(OCIO.BIT_DEPTH_F32)
    curve.setInterpolation(OCIO.INTERP_LINEAR)
    curve.setData(np.ascontiguousarray(table, dtype=np.float32).ravel())
    return curve


def _lut3d(lut: Lut) -> OCIO.Lut3DTransform:
    cube = OCIO.Lut3DTransform(lut.size)
    cube.setFileOutputBitDepth(OCIO.BIT_DEPTH_F32)
    tetrahedral = lut.interpolation == "tetrahedral"
    cube.setInterpolation(OCIO.INTERP_TETRAHEDRAL if tetrahedral else OCIO.INTERP_LINEAR)
    cube.setData(np.ascontiguousarray(lut.cube, dtype=np.float32).ravel())  # blue fastest, as CLF has it
    return cube


def _identifier(luts: Sequence[Lut]) -> str:
    """An id that depends on the content alone, so that the same LUT is the same file."""
    digest = hashlib.sha256()
    for lut in luts:
        curves = (curve for curve in (lut.curve, lut.response, lut.before) if curve is not None)
        if lut.lowest:
            digest.update(np.float64(lut.lowest).tobytes())
        for array in (lut.gain / (lut.highest - lut.lowest), *lut.levels, lut.cube, lut.matrix, *curves):
            digest.update(np.ascontiguousarray(array, dtype=np.float64).tobytes())
        digest.update(lut.interpolation.encode())
    h = digest.hexdigest()
    return f"urn:uuid:{h[:8]}-{h[8:12]}-8{h[13:16]}-8{h[17:20]}-{h[20:32]}"


def _line(text: str) -> str:
    """One line without characters that XML forbids."""
    return " ".join("".join(c if c.isprintable() else " " for c in text).split())[:500]
