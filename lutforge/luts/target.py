"""The target of a LUT: the form, size and interpolation that a file's format and the program that reads it need."""

import re
import unicodedata
from dataclasses import dataclass
from pathlib import Path

from lutforge.errors import LutError
from lutforge.interpolation import Interpolation
from lutforge.luts.formats import format_of
from lutforge.luts.forms import MAX_SIZE, Form
from lutforge.luts.lut_programs import Program

TOLERANCE_SIZES = (9, 13, 17, 21, 25, 33, 41, 49, 57, 65)
"""Nodes per axis that are tried in turn where a tolerance is given."""


@dataclass(frozen=True)
class Target:
    """The form of the LUT to bake.

    size: nodes per axis; None: as a lattice has it, else `default`. interpolation: that of the reader; None: as a
    lattice has it, else tetrahedral. sizes: tried in turn where a tolerance is given. curve: the file may hold a curve
    alone.
    """

    form: Form = "full"
    size: int | None = None
    interpolation: Interpolation | None = None
    default: int = 33
    sizes: tuple[int, ...] = TOLERANCE_SIZES
    curve: bool = False

    @property
    def method(self) -> Interpolation:
        """The interpolation of cubes that are fitted."""
        return self.interpolation or "tetrahedral"


def target_of(
    path: Path, reader: Program | None = None, size: int | None = None, interpolation: Interpolation | None = None,
    scenes: bool = False,
) -> Target:  # fmt: skip
    """The target of a file, found before any work.

    reader: the program that will read it, None for any; scenes: the input reaches beyond 1.

    A .cube is plain, except for a program that reads a shaper, or under a name that ends in .resolve.cube or
    .shaper.cube. Raises LutError where the format or the program cannot hold such a LUT.
    """
    file_format = format_of(path)
    suffix = path.suffix.lower()
    if reader is not None and suffix not in reader.reads:
        raise LutError(f"{path}: {reader.name} does not read {suffix} files; write {' or '.join(reader.reads)}")

    form = file_format.forms[0]
    named_shaper = path.name.lower().endswith((".resolve.cube", ".shaper.cube"))
    if suffix == ".cube" and (reader.shaper if reader else named_shaper):
        form = "shaper"
    if scenes and form == "plain":
        instead = "write .clf, .ctf, .resolve.cube, .csp or .spi1d"
        raise LutError(f"{path}: {file_format.name} holds no scene-linear input beyond 1; {instead}")

    default = file_format.size
    most = MAX_SIZE
    if form == "plain" and reader is not None:
        default = file_format.size if file_format.sizes else reader.size
        most = reader.max_size
    if size is not None and not 2 <= size <= most:
        raise LutError(f"{path}: {size} nodes per axis; this reader takes 2 to {most}")
    if size is not None and file_format.sizes and size not in file_format.sizes:
        sizes = ", ".join(map(str, file_format.sizes))
        raise LutError(f"{path}: {size} nodes per axis; {file_format.name} has {sizes}: choose one of these, or none")

    method = interpolation or (None if reader is None else reader.interpolation)
    tolerance_sizes = tuple(count for count in file_format.sizes or TOLERANCE_SIZES if count <= most)
    curve = suffix == ".cube" and reader is None and size is None
    return Target(form, size, method, default, tolerance_sizes, curve)


def files_for(program: Program, title: str) -> dict[Path, Program | None]:
    """Return the files to write for a program, each with the program that will read it.

    A program that reads a shaper also gets a plain cube as a fallback, for no program in particular (None). The name of
    a .cube with a shaper says so, since programs that read no shaper render wrong colours from it.
    """
    latin = unicodedata.normalize("NFKD", title).encode("ascii", "ignore").decode()
    stem = "_".join(re.findall(r"[\w+.-]+", latin))[:100]
    shaped = ".shaper" if program.shaper and program.reads[0] == ".cube" else ""
    first = f"{stem or 'lut'}{shaped}{program.reads[0]}"
    if program.shaper or program.reads[0] == ".clf":
        return {Path(first): program, Path(f"{stem or 'lut'}.plain.cube"): None}
    return {Path(first): program}
