"""The programs that read LUT files, and what each of them takes."""

import re
import unicodedata
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from lutforge.errors import LutError, alternatives
from lutforge.interpolation import Interpolation
from lutforge.luts import command_lines
from lutforge.luts.formats import format_of
from lutforge.luts.forms import MAX_SIZE, Form

CUBES = (".cube", ".cube, domain from 0", ".cube, domain", ".cube, range", ".cube, curve")
"""Kinds of .cube files without a shaper."""
TRIED = (9, 13, 17, 21, 25, 33, 41, 49, 57, 65)
"""Sizes that a tolerance is tried at."""


READS = "reads it"
REFUSES = "refuses it"
LEAVES = "leaves the picture as it is, without a word"
UNKNOWN = "is not known to read it"
GARBAGE = "reads it without a word and renders wrong colours"
"""What a program does with a file."""


@dataclass(frozen=True)
class Program:
    """What a program takes, and what it does with other files.

    shaper: it reads a .cube with a shaper; reads: suffixes, the best first; max_size: most nodes per axis; size: nodes
    per axis of a plain cube for it; interpolation: its own; use: what to do with the file; command: how it is run
    with it, where it is run by a command. develops: it develops RAW
    files itself, and feeds a LUT with what it developed, never with camera RAW.

    title: its name for people, empty for OpenColorIO and what reads files through it; tried: the version that `does`
    and `otherwise` were measured with, empty where they are what its makers and users write. does: by kind of file, as
    `check` names kinds; otherwise: with every other kind.
    """

    reads: tuple[str, ...]
    shaper: bool = False
    max_size: int = 129
    size: int = 65
    interpolation: Interpolation = "trilinear"
    use: str = ""
    command: command_lines.CommandLine | None = None
    develops: bool = False
    title: str = ""
    tried: str = ""
    does: Mapping[str, str] = field(default_factory=dict)
    otherwise: str = REFUSES

    def advice(self, path: Path) -> str:
        """What to do with a file of this program; empty where the program's name says it."""
        return self.use if self.command is None else self.command(path)


def _avfilter(refused: str) -> dict[str, str]:
    """What ffmpeg's filter lut3d does, by kind of file; refused: what becomes of a picture whose file it refuses."""
    return {
        **dict.fromkeys((".cube", ".cube, domain from 0", ".csp", ".3dl, 17 nodes, 12 bits"), READS),
        # Between two knots it goes as far up as their distance is, and not all the way.
        ".csp, bent": "reads it; its curve in steps where that has less than some thousand knots",
        ".cube, curve": f"{refused} as a 3D LUT; its filter lut1d reads it",
        **dict.fromkeys((".cube, domain", ".cube, shaper without ranges"), GARBAGE),
        ".3dl": f"takes 17 nodes and 12 bits only: {GARBAGE}",  # it skips a line, and takes the rest for 17³ rows
        "Hald image": f"{refused} as a 3D LUT; its filter haldclut reads it",
    }


OCIO_READS = (".clf", ".ctf", ".cube", ".csp", ".3dl", ".spi1d", ".spi3d")
HALD = (".png", ".tif", ".tiff")
HALDS = {"Hald image": READS}
ADOBE = dict.fromkeys(
    (".cube", ".cube, domain from 0", ".cube, domain", ".cube, curve", ".3dl", ".3dl, 17 nodes, 12 bits"), READS
)
AVFILTER = (".cube", ".csp", ".3dl")
_MLT = "the filter {}, and right behind it {} as it comes, without which HD film changes its colours"
PROGRAMS: dict[str, Program] = {
    "resolve": Program(
        shaper=True, reads=(".cube", ".clf"), use="put it into the LUT folder, then Update Lists",
        title="DaVinci Resolve",
        does={
            **dict.fromkeys(CUBES, READS), ".cube, shaper": "reads it, shaper included",
            ".cube, shaper without ranges": "reads it, shaper included", ".clf": READS, ".3dl": READS,
            ".3dl, 17 nodes, 12 bits": READS,
        },
    ),
    "nuke": Program(shaper=True, reads=OCIO_READS, use="OCIOFileTransform, not Vectorfield, reads the shaper"),
    "ocio": Program(shaper=True, reads=OCIO_READS),
    "oiio": Program(shaper=True, reads=OCIO_READS, interpolation="tetrahedral"),
    "baselight": Program(
        reads=(".clf", ".cube"), title="Baselight", does={**dict.fromkeys(CUBES[:1], READS), ".clf": READS}
    ),
    "flame": Program(
        reads=(".clf", ".ctf", ".3dl", ".csp", ".cube"), title="Flame",
        does=dict.fromkeys((".clf", ".ctf", ".3dl", ".3dl, 17 nodes, 12 bits", ".csp", ".csp, bent", ".cube"), READS),
    ),
    "blender": Program(shaper=True, reads=OCIO_READS, use="through an OpenColorIO config: lutforge config"),
    "photoshop": Program(
        reads=(".cube", ".3dl", ".csp"), title="Photoshop", does={**ADOBE, ".csp": READS, ".csp, bent": READS}
    ),
    "lightroom": Program(
        reads=(".cube", ".dcp"), size=33, use="in a profile made with Camera Raw", develops=True, title="Lightroom",
        does={".cube": "reads it in a profile made with Camera Raw"},
    ),
    "premiere": Program(reads=(".cube", ".3dl"), title="Premiere", does=ADOBE),
    "aftereffects": Program(
        reads=(".cube", ".3dl", ".csp"), max_size=64, size=64, title="After Effects",
        does={**ADOBE, ".csp": READS, ".csp, bent": READS},
    ),
    "finalcut": Program(reads=(".cube",), title="Final Cut", does={".cube": READS}),
    "ffmpeg": Program(
        reads=AVFILTER, interpolation="tetrahedral", command=command_lines.ffmpeg,
        title="ffmpeg", tried="5.1", does=_avfilter(REFUSES),
    ),
    "mpv": Program(
        reads=AVFILTER, interpolation="tetrahedral", command=command_lines.mpv,
        title="mpv", tried="0.35", does=_avfilter(REFUSES),
    ),
    "mlt": Program(
        reads=AVFILTER, interpolation="tetrahedral", command=command_lines.melt,
        title="MLT", tried="7.12", does=_avfilter(LEAVES), otherwise=LEAVES,
    ),
    "kdenlive": Program(
        reads=AVFILTER, interpolation="tetrahedral", use=_MLT.format("Apply LUT", "Lift/gamma/gain"),
        title="Kdenlive", tried="MLT 7.12", does=_avfilter(LEAVES), otherwise=LEAVES,
    ),
    "shotcut": Program(
        reads=AVFILTER, interpolation="tetrahedral", use=_MLT.format("LUT (3D)", "Color Grading"),
        title="Shotcut", tried="MLT 7.12", does=_avfilter(LEAVES), otherwise=LEAVES,
    ),
    "obs": Program(
        reads=(".cube",), title="OBS",
        does={
            ".cube": READS, ".cube, curve": READS,
            **dict.fromkeys((".cube, domain from 0", ".cube, domain"), f"ignores the domain: {GARBAGE}"),
            **dict.fromkeys((".cube, shaper", ".cube, shaper without ranges"), "loads the 1D part only: wrong colours"),
        },
    ),
    "darktable": Program(
        reads=(".icc", ".cube", ".3dl", ".png"), interpolation="tetrahedral", use="module input color profile",
        develops=True, title="darktable", tried="4.2",
        does={
            **dict.fromkeys((".cube", ".3dl", ".3dl, 17 nodes, 12 bits"), READS),
            "Hald image": "reads it as .png; with a .tif it leaves the picture as it is",
            **dict.fromkeys(
                (".cube, domain from 0", ".cube, domain"), "refuses a domain other than 0 to 1, and darktable-cli ends"
            ),
        },
        otherwise=LEAVES,
    ),
    "rawtherapee": Program(
        reads=(*HALD, ".dcp", ".icc"), use="Film Simulation, its folder in the preferences", develops=True,
        title="RawTherapee", tried="5.9", does=HALDS,
    ),
    "art": Program(
        reads=(*HALD, ".clf", ".dcp", ".icc"), develops=True, title="ART", does={**HALDS, ".clf": READS}
    ),
    "captureone": Program(reads=(".icc",), develops=True, title="Capture One"),
    "gmic": Program(
        reads=(".cube", ".png"), command=command_lines.gmic, title="G'MIC", tried="2.9",
        does={
            **dict.fromkeys((".cube", ".cube, range"), "reads it half a node too bright: enlarge it to 256³ first"),
            ".cube, curve": READS, "Hald image": "reads it, 1.2 codes too bright",
            **dict.fromkeys((".cube, domain from 0", ".cube, domain"), f"ignores the domain: {GARBAGE}"),
            **dict.fromkeys((".cube, shaper", ".cube, shaper without ranges"), GARBAGE),
        },
    ),
    "gimp": Program(reads=(".cube", ".png"), use="through G'MIC: Apply External CLUT"),
    "imagemagick": Program(
        reads=HALD, use="convert IN FILE -hald-clut OUT", title="ImageMagick", tried="6.9", does=HALDS
    ),
    "graphicsmagick": Program(
        reads=HALD, use="gm convert IN -hald-clut FILE OUT", title="GraphicsMagick", tried="1.3", does=HALDS,
        otherwise="says that it cannot read it, and writes the picture as it is",
    ),
    "pillow": Program(
        reads=(".cube",), use="pillow_lut.load_cube_file", title="pillow-lut", tried="1.1",
        does={
            **dict.fromkeys((".cube", ".cube, range"), READS),
            **dict.fromkeys((".cube, domain from 0", ".cube, domain"), f"ignores the domain: {GARBAGE}"),
        },
    ),
    "three": Program(
        reads=(".cube",), use="LUTCubeLoader", title="three.js", tried="r187",
        does={
            **dict.fromkeys((".cube", ".cube, range"), READS),
            **dict.fromkeys((".cube, domain from 0", ".cube, domain"), "reads it, and leaves the domain to its caller"),
            **dict.fromkeys((".cube, shaper", ".cube, shaper without ranges"), GARBAGE),
        },
    ),
    "parse-cube-lut": Program(
        reads=(".cube",), title="parse-cube-lut", tried="1.0",
        does={
            **dict.fromkeys((".cube", ".cube, curve"), READS),
            **dict.fromkeys((".cube, domain from 0", ".cube, domain"), "reads it, and leaves the domain to its caller"),
            ".cube, range": "takes the range for a row: all colours are off by one node",
            **dict.fromkeys((".cube, shaper", ".cube, shaper without ranges"), GARBAGE),
        },
    ),
}  # fmt: skip
"""Programs that `--for` names: what their readers take, and what they do with what they do not take."""


def readers_of(kind: str) -> dict[str, str]:
    """What each program that reads files without OpenColorIO does with a kind of file, by its name for people."""
    verdicts = {}
    for program in PROGRAMS.values():
        if program.title:
            verdict = program.does.get(kind, program.otherwise if program.tried else UNKNOWN)
            verdicts[program.title] = verdict if program.tried or verdict == UNKNOWN else f"{verdict} (not tried here)"
    return verdicts


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

    @property
    def method(self) -> Interpolation:
        """The interpolation of cubes that are fitted."""
        return self.interpolation or "tetrahedral"


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
