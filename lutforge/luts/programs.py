"""The programs that read LUT files, and what each of them takes."""

import re
import unicodedata
from dataclasses import dataclass
from pathlib import Path

from lutforge.errors import LutError, alternatives
from lutforge.interpolation import Interpolation
from lutforge.luts import command_lines
from lutforge.luts.sequence import MAX_SIZE, Form, format_of

TRIED = (9, 13, 17, 21, 25, 33, 41, 49, 57, 65)
"""Sizes that a tolerance is tried at."""


@dataclass(frozen=True)
class Program:
    """What a program takes.

    shaper: it reads a .cube with a shaper; reads: suffixes, the best first; max_size: most nodes per axis; size: nodes
    per axis of a plain cube for it; interpolation: its own; use: what to do with the file; command: how it is run with
    it, where it is run by a command. develops: it develops RAW files itself, and feeds a LUT with what it developed,
    never with camera RAW.
    """

    reads: tuple[str, ...]
    shaper: bool = False
    max_size: int = 129
    size: int = 65
    interpolation: Interpolation = "trilinear"
    use: str = ""
    command: command_lines.CommandLine | None = None
    develops: bool = False

    def advice(self, path: Path) -> str:
        """What to do with a file of this program; empty where the program's name says it."""
        return self.use if self.command is None else self.command(path)


OCIO_READS = (".clf", ".ctf", ".cube", ".csp", ".3dl", ".spi1d", ".spi3d")
HALD = (".png", ".tif", ".tiff")
LIBAVFILTER_READS = (".cube", ".csp", ".3dl")
_MLT = "the filter {}, and right behind it {} as it comes, without which HD film changes its colours"
PROGRAMS: dict[str, Program] = {
    "resolve": Program(shaper=True, reads=(".cube", ".clf"), use="put it into the LUT folder, then Update Lists"),
    "nuke": Program(shaper=True, reads=OCIO_READS, use="OCIOFileTransform, not Vectorfield, reads the shaper"),
    "ocio": Program(shaper=True, reads=OCIO_READS),
    "oiio": Program(shaper=True, reads=OCIO_READS, interpolation="tetrahedral"),
    "baselight": Program(reads=(".clf", ".cube")),
    "flame": Program(reads=(".clf", ".ctf", ".3dl", ".csp", ".cube")),
    "blender": Program(shaper=True, reads=OCIO_READS, use="through an OpenColorIO config: lutforge config"),
    "photoshop": Program(reads=(".cube", ".3dl", ".csp")),
    "lightroom": Program(reads=(".cube", ".dcp"), size=33, use="in a profile made with Camera Raw", develops=True),
    "premiere": Program(reads=(".cube", ".3dl")),
    "aftereffects": Program(reads=(".cube", ".3dl", ".csp"), max_size=64, size=64),
    "finalcut": Program(reads=(".cube",)),
    "ffmpeg": Program(reads=LIBAVFILTER_READS, interpolation="tetrahedral", command=command_lines.ffmpeg),
    "mpv": Program(reads=LIBAVFILTER_READS, interpolation="tetrahedral", command=command_lines.mpv),
    "mlt": Program(reads=LIBAVFILTER_READS, interpolation="tetrahedral", command=command_lines.melt),
    "kdenlive": Program(
        reads=LIBAVFILTER_READS, interpolation="tetrahedral", use=_MLT.format("Apply LUT", "Lift/gamma/gain")
    ),
    "shotcut": Program(
        reads=LIBAVFILTER_READS, interpolation="tetrahedral", use=_MLT.format("LUT (3D)", "Color Grading")
    ),
    "obs": Program(reads=(".cube",)),
    "darktable": Program(
        reads=(".icc", ".cube", ".3dl", ".png"), interpolation="tetrahedral", use="module input color profile",
        develops=True,
    ),
    "rawtherapee": Program(
        reads=(*HALD, ".dcp", ".icc"), use="Film Simulation, its folder in the preferences", develops=True
    ),
    "art": Program(reads=(*HALD, ".clf", ".dcp", ".icc"), develops=True),
    "captureone": Program(reads=(".icc",), develops=True),
    "gmic": Program(reads=(".cube", ".png"), command=command_lines.gmic),
    "gimp": Program(reads=(".cube", ".png"), use="through G'MIC: Apply External CLUT"),
}  # fmt: skip
"""Programs that `--for` names, and what their readers take."""


@dataclass(frozen=True)
class Target:
    """What is to be baked.

    size: nodes per axis, or none for a lattice's own, else `default`; interpolation: that of the reader, or none for a
    lattice's own, else tetrahedral; sizes: those that a tolerance is tried at. curve: the file may hold a curve alone.
    """

    form: Form = "full"
    size: int | None = None
    interpolation: Interpolation | None = None
    default: int = 33
    sizes: tuple[int, ...] = TRIED
    curve: bool = False


def program_named(name: str) -> Program:
    """The program of a name, in any case. Raises LutError listing those that are known."""
    known = PROGRAMS.get(name.lower())
    if known is None:
        raise LutError(f'unknown program "{name}"; {alternatives(name, PROGRAMS)}')
    return known


def target_of(
    path: Path, program: str | None = None, size: int | None = None, interpolation: Interpolation | None = None,
    scenes: bool = False,
) -> Target:  # fmt: skip
    """What to bake for a file, before any work. scenes: the input reaches beyond 1.

    A .cube is plain, save for a program that reads a shaper, or under a name that ends in .resolve.cube or
    .shaper.cube. Raises LutError where the format or the program cannot hold it.
    """
    known, file_format = None if program is None else program_named(program), format_of(path)
    suffix = path.suffix.lower()
    if known is not None and suffix not in known.reads:
        raise LutError(f"{path}: {program} does not read {suffix} files; write {' or '.join(known.reads)}")
    form, default = file_format.forms[0], file_format.size
    if suffix == ".cube" and (known.shaper if known else path.name.lower().endswith((".resolve.cube", ".shaper.cube"))):
        form = "shaper"
    if scenes and form == "plain":
        instead = "write .clf, .ctf, .resolve.cube, .csp or .spi1d"
        raise LutError(f"{path}: {file_format.name} holds no scene-linear input beyond 1; {instead}")
    most = MAX_SIZE
    if form == "plain" and known is not None:
        default, most = known.size if not file_format.sizes else default, known.max_size
    if size is not None and not 2 <= size <= most:
        raise LutError(f"{path}: {size} nodes per axis; this reader takes 2 to {most}")
    if size is not None and file_format.sizes and size not in file_format.sizes:
        sizes = ", ".join(map(str, file_format.sizes))
        raise LutError(f"{path}: {size} nodes per axis; {file_format.name} has {sizes}: choose one of these, or none")
    chosen = interpolation or (None if known is None else known.interpolation)
    curve = suffix == ".cube" and known is None and size is None
    return Target(form, size, chosen, default, tuple(n for n in file_format.sizes or TRIED if n <= most), curve)


def files_for(program: str, title: str) -> dict[Path, str | None]:
    """Return the files to write for a program, each with the program that will read it.

    A program that reads a shaper also gets a plain cube as a fallback, for no program in particular (None). A
    .cube with a shaper is named so: programs that read none would render garbage by one in the place of theirs.
    """
    latin = unicodedata.normalize("NFKD", title).encode("ascii", "ignore").decode()
    stem = "_".join(re.findall(r"[\w+.-]+", latin))[:100]
    known = program_named(program)
    shaped = ".shaper" if known.shaper and known.reads[0] == ".cube" else ""
    first = f"{stem or 'lut'}{shaped}{known.reads[0]}"
    if known.shaper or known.reads[0] == ".clf":
        return {Path(first): program, Path(f"{stem or 'lut'}.plain.cube"): None}
    return {Path(first): program}
