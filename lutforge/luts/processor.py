"""A LUT file as OpenColorIO evaluates it."""

import tempfile
from codecs import BOM_UTF8
from pathlib import Path

import numpy as np
import PyOpenColorIO as OCIO  # noqa: N814 - the name that its documentation uses
from numpy.typing import ArrayLike, NDArray

from lutforge.errors import LutError
from lutforge.interpolation import Interpolation

OCIO_ERRORS = (OCIO.Exception, OCIO.ExceptionMissingFile)
"""What OpenColorIO raises; in Python the second is not a kind of the first."""

MAX_BYTES = 512 * 1024 * 1024
"""Largest LUT file that is read; a 129³ cube as text takes about 70 MB."""


def file_processor(
    path: str | Path, interpolation: Interpolation = "tetrahedral", inverse: bool = False
) -> OCIO.CPUProcessor:
    """An OpenColorIO processor, float32 in and out, of any LUT file that it reads.

    interpolation: for cubes of files that name none themselves (CLF and CTF do). inverse: the file backward.
    Raises LutError, in one line, also where a table holds what is not a finite number.
    """
    path = Path(path)
    try:
        size = path.stat().st_size
    except OSError as error:
        raise LutError(f"{path}: {error.strerror or 'cannot be opened'}") from error
    if path.is_dir() or size == 0 or size > MAX_BYTES:
        what = "a folder" if path.is_dir() else "empty" if size == 0 else "too large for a LUT"
        raise LutError(f"{path}: {what}, not a LUT file")
    OCIO.ClearAllCaches()  # else a file that was written again is read from memory
    direction = OCIO.TRANSFORM_DIR_INVERSE if inverse else OCIO.TRANSFORM_DIR_FORWARD
    # "Best" is tetrahedral for cubes, and unlike that name it is quiet about files of 1D tables.
    method = OCIO.INTERP_BEST if interpolation == "tetrahedral" else OCIO.INTERP_LINEAR
    with tempfile.TemporaryDirectory() as folder:
        link = path.absolute()
        if {"$", "%"} & set(str(path)):  # OpenColorIO replaces variables in a path: give it one that has none
            link = Path(folder) / f"lut{path.suffix}"
            link.symlink_to(path.resolve())
        try:
            transform = OCIO.FileTransform(str(link), "", method, direction)
            processor = OCIO.Config.CreateRaw().getProcessor(transform)
            _require_finite(processor.createGroupTransform(), path)
            return processor.getOptimizedCPUProcessor(OCIO.OPTIMIZATION_LOSSLESS)
        except OCIO_ERRORS as error:
            raise LutError(f"{path}: {_reason(str(error), str(link), path)}") from error
        except UnicodeDecodeError as error:  # its message quotes bytes of the file
            raise LutError(f"{path}: OpenColorIO cannot read it: there is text in it that is not UTF-8") from error


def evaluate(processor: OCIO.CPUProcessor, x: ArrayLike) -> NDArray[np.float32]:
    """Apply a processor to colours (…, 3); float32."""
    y = np.array(x, dtype=np.float32, order="C", ndmin=2)
    processor.applyRGB(y)
    return y.reshape(np.shape(x))


def _require_finite(parts: OCIO.GroupTransform, path: Path) -> None:
    """Raise LutError where a table holds NaN or infinity. Those of half-float inputs may: for such inputs."""
    for part in parts:
        cube = isinstance(part, OCIO.Lut3DTransform)
        curve = isinstance(part, OCIO.Lut1DTransform) and not part.getInputHalfDomain()
        if (cube or curve) and not np.all(np.isfinite(part.getData())):
            raise LutError(f"{path}: a number in its {'cube' if cube else 'curve'} is not finite; make the file anew")


def _reason(message: str, link: str, path: Path) -> str:
    """OpenColorIO's message about a file as part of one line, with what to do where the cause is known."""
    line = " ".join(message.replace(link, path.name).split())
    with path.open("rb") as file:
        if file.read(len(BOM_UTF8)) == BOM_UTF8:
            return "begins with a byte order mark, which OpenColorIO does not read; save it as UTF-8 without one"
    if path.suffix.lower() == ".cube":
        text = path.read_text("utf-8", "replace")[:4000].upper()
        if "LUT_1D_SIZE" in text and "LUT_3D_SIZE" in text and ("TITLE" in text or "DOMAIN_M" in text):
            return (
                "a .cube with a shaper (LUT_1D_SIZE and LUT_3D_SIZE) must hold neither TITLE nor DOMAIN "
                "lines for OpenColorIO; delete those lines"
            )
    return f"OpenColorIO cannot read it: {line[:300]}"
