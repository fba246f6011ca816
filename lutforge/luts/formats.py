"""The formats of LUT files: which sequences of operations each can hold, and the writing of a LUT to a file."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from lutforge.errors import LutError
from lutforge.luts.forms import HELD, MAX_SIZE, Form
from lutforge.luts.op_sequence import OpSequence
from lutforge.luts.writers.csp import write_csp
from lutforge.luts.writers.cube import write_cube
from lutforge.luts.writers.hald import HALD_SIZES, write_hald
from lutforge.luts.writers.integers import VLT_SIZE, write_3dl, write_vlt
from lutforge.luts.writers.process_list import PROCESS_LISTS, write_clf
from lutforge.luts.writers.spi import SPI_PAIR, write_spi


@dataclass(frozen=True)
class FileFormat:
    """A LUT file format: what it holds, and its writer.

    forms: the forms that it can hold, first the one that is baked for it; sizes: the numbers of nodes per axis that it
    can have, empty where any will do; size: nodes per axis where the user gives none; bits: of integer formats, which
    round, and clamp to [0, 1]; knots: its shaper may have entries at free knots, and not only at even steps of a range.
    """

    name: str
    suffixes: tuple[str, ...]
    forms: tuple[Form, ...]
    write: Callable[[OpSequence, Path], None]
    sizes: tuple[int, ...] = ()
    size: int = 65
    bits: int | None = None
    knots: bool = False


_SPI_PAIR_NAME = ".spi1d (shaper) and .spi3d (cube), used one after the other"
_ALL_FORMATS = (
    FileFormat("CLF", tuple(PROCESS_LISTS), ("full",), write_clf, size=33),
    FileFormat(".csp", (".csp",), ("shaper",), write_csp, size=33, knots=True),
    FileFormat(".cube", (".cube",), ("plain", "shaper"), write_cube),
    FileFormat("a Hald image", (".png", ".tif", ".tiff"), ("plain",), write_hald, HALD_SIZES, size=64, bits=16),
    FileFormat(_SPI_PAIR_NAME, SPI_PAIR, ("shaper",), write_spi, size=33),
    FileFormat(".3dl", (".3dl",), ("plain",), write_3dl, sizes=(17, 33, 65), size=33, bits=12),
    FileFormat(".vlt", (".vlt",), ("plain",), write_vlt, sizes=(VLT_SIZE,), size=VLT_SIZE, bits=12),
)
FORMATS: dict[str, FileFormat] = {
    suffix: file_format for file_format in _ALL_FORMATS for suffix in file_format.suffixes
}
"""The formats that are written, by suffix."""


def format_of(path: Path) -> FileFormat:
    """The format that the suffix of a path names. Raises LutError on an unknown one."""
    file_format = FORMATS.get(path.suffix.lower())
    if file_format is None:
        raise LutError(f'{path}: no LUT format has the suffix "{path.suffix}"; use {", ".join(FORMATS)}')
    return file_format


def write(lut: OpSequence, path: Path) -> Path:
    """Write a LUT to a file, atomically and exactly, in the format that the suffix names; return the path.

    Nothing is fitted or sampled here. Raises LutError, with the form that the file needs, where its format cannot hold
    the sequence.
    """
    file_format = format_of(path)
    _require_held(lut, path, file_format)
    file_format.write(lut, path)
    return path


def _require_held(lut: OpSequence, path: Path, file_format: FileFormat) -> None:
    """Raise LutError where a format cannot hold a LUT as it is."""
    name = file_format.name
    form = file_format.forms[0]
    if not any(lut.has_form(accepted) for accepted in file_format.forms):
        raise LutError(
            f"{path}: {name} holds {HELD[form]}, this LUT is {lut.summary}: bake it for this file, "
            f'bake(transform, "{path.name}") or bake(transform, form="{form}")'
        )
    if lut.size > MAX_SIZE:
        raise LutError(f"{path}: {lut.size} nodes per axis; OpenColorIO reads 2 to {MAX_SIZE}")
    if file_format.sizes and lut.size not in file_format.sizes:
        listed = ", ".join(map(str, file_format.sizes))
        raise LutError(f"{path}: {lut.size} nodes per axis; {name} has {listed}: choose a size among them")
    if lut.shaper is not None and lut.shaper.inputs is not None and not file_format.knots:
        raise LutError(f"{path}: {name} holds no curve at free knots; write a .csp")
