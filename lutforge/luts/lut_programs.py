"""The programs that read LUT files, and their verdicts on the kinds of files."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from lutforge.errors import LutError, alternatives
from lutforge.interpolation import Interpolation
from lutforge.luts import command_lines
from lutforge.luts.lut_kind import LutKind

WITH_DOMAIN = (LutKind.CUBE_WITH_DOMAIN_FROM_0, LutKind.CUBE_WITH_DOMAIN)
"""Kinds of .cube files with a domain other than 0 to 1."""
WITHOUT_SHAPER = (LutKind.CUBE, *WITH_DOMAIN, LutKind.CUBE_WITH_RANGE, LutKind.CUBE_OF_CURVE)
"""Kinds of .cube files without a shaper."""
WITH_SHAPER = (LutKind.CUBE_WITH_SHAPER, LutKind.CUBE_WITH_SHAPER_WITHOUT_RANGES)
"""Kinds of .cube files with a shaper."""
CSP = (LutKind.CSP, LutKind.CSP_WITH_SHAPER)
FLAME_3DL = (LutKind.FLAME_3DL, LutKind.FLAME_3DL_17_NODES_12_BITS)

READS = "reads it"
REFUSES = "refuses it"
LEAVES = "leaves the picture as it is, without a word"
NOT_KNOWN = "is not known to read it"
GARBAGE = "reads it without a word and renders wrong colours"
"""The verdicts of programs on a file; the last of these five is the worst."""


@dataclass(frozen=True)
class Program:
    """A program that reads LUT files: which it reads, and what it does with others.

    name: the word by which `--for` names it; reads: suffixes, the best first; shaper: it reads a .cube with a shaper;
    max_size: most nodes per axis; size: nodes per axis of a plain cube for it; interpolation: its own; use: what the
    user does with the file; command: the command line, for programs that have one. develops: it develops RAW files
    itself, and applies a LUT to developed colours, never to camera RAW.

    title: its name for people, "" for OpenColorIO and programs that read files through it. does: its verdict by kind
    of file; otherwise: its verdict on every other kind; tried: the version that these were measured with, empty where
    they come from its makers and users.
    """

    name: str
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
    does: Mapping[LutKind, str] = field(default_factory=dict)
    otherwise: str = REFUSES

    def advice(self, path: Path) -> str:
        """What to do with a file of this program; empty where the program's name says it."""
        return self.use if self.command is None else self.command(path)


def _avfilter(refused: str, hald: str) -> dict[LutKind, str]:
    """The verdicts of ffmpeg's filters, by kind of file; refused, hald: on what lut3d refuses, and on Hald images."""
    return {
        **dict.fromkeys(
            (LutKind.CUBE, LutKind.CUBE_WITH_DOMAIN_FROM_0, LutKind.CSP, LutKind.FLAME_3DL_17_NODES_12_BITS), READS
        ),
        # Between two knots its interpolation weight goes up to the distance of the knots, and not to 1.
        LutKind.CSP_WITH_SHAPER: "reads it; its curve in steps where that has less than some thousand knots",
        LutKind.CUBE_OF_CURVE: f"its filter lut3d {refused}; its filter lut1d reads it",
        **dict.fromkeys((LutKind.CUBE_WITH_DOMAIN, LutKind.CUBE_WITH_SHAPER_WITHOUT_RANGES), GARBAGE),
        # It skips one line, and reads 17³ rows after it.
        LutKind.FLAME_3DL: f"takes 17 nodes and 12 bits only: {GARBAGE}",
        LutKind.HALD: hald,
    }


OCIO_READS = (".clf", ".ctf", ".cube", ".csp", ".3dl", ".spi1d", ".spi3d")
HALD_SUFFIXES = (".png", ".tif", ".tiff")
READS_HALDS = {LutKind.HALD: READS}
READ_BY_ADOBE = dict.fromkeys((LutKind.CUBE, *WITH_DOMAIN, LutKind.CUBE_OF_CURVE, *FLAME_3DL), READS)
AVFILTER = (".cube", ".csp", ".3dl")
_HALD_IN_FFMPEG = f"its filter lut3d {REFUSES}; its filter haldclut reads it"
_MLT = "the filter {}, and right behind it {} as it comes, without which HD film changes its colours"
_ALL_PROGRAMS = (
    Program(
        "resolve",
        shaper=True, reads=(".cube", ".clf"), use="put it into the LUT folder, then Update Lists",
        title="DaVinci Resolve",
        does={
            **dict.fromkeys((*WITHOUT_SHAPER, LutKind.CLF, *FLAME_3DL), READS),
            **dict.fromkeys(WITH_SHAPER, "reads it, shaper included"),
        },
    ),
    Program("nuke", shaper=True, reads=OCIO_READS, use="OCIOFileTransform, not Vectorfield, reads the shaper"),
    Program("ocio", shaper=True, reads=OCIO_READS),
    Program("oiio", shaper=True, reads=OCIO_READS, interpolation="tetrahedral"),
    Program(
        "baselight",
        reads=(".clf", ".cube"), title="Baselight", does=dict.fromkeys((LutKind.CUBE, LutKind.CLF), READS)
    ),
    Program(
        "flame",
        reads=(".clf", ".ctf", ".3dl", ".csp", ".cube"), title="Flame",
        does=dict.fromkeys((LutKind.CLF, LutKind.CTF, *FLAME_3DL, *CSP, LutKind.CUBE), READS),
    ),
    Program("blender", shaper=True, reads=OCIO_READS, use="through an OpenColorIO config: lutforge config"),
    Program(
        "photoshop",
        reads=(".cube", ".3dl", ".csp"), title="Photoshop", does=READ_BY_ADOBE | dict.fromkeys(CSP, READS)
    ),
    Program(
        "lightroom",
        reads=(".cube", ".dcp"), size=33, use="in a profile made with Camera Raw", develops=True, title="Lightroom",
        does={LutKind.CUBE: "reads it in a profile made with Camera Raw"},
    ),
    Program("premiere", reads=(".cube", ".3dl"), title="Premiere", does=READ_BY_ADOBE),
    Program(
        "aftereffects",
        reads=(".cube", ".3dl", ".csp"), max_size=64, size=64, title="After Effects",
        does=READ_BY_ADOBE | dict.fromkeys(CSP, READS),
    ),
    Program("finalcut", reads=(".cube",), title="Final Cut", does={LutKind.CUBE: READS}),
    Program(
        "ffmpeg",
        reads=AVFILTER, interpolation="tetrahedral", command=command_lines.ffmpeg,
        title="ffmpeg", tried="5.1", does=_avfilter(REFUSES, _HALD_IN_FFMPEG),
    ),
    Program(
        "mpv",
        reads=AVFILTER, interpolation="tetrahedral", command=command_lines.mpv,
        title="mpv", tried="0.35", does=_avfilter(REFUSES, _HALD_IN_FFMPEG),
    ),
    Program(
        "mlt",
        reads=AVFILTER, interpolation="tetrahedral", command=command_lines.melt,
        title="MLT", tried="7.12", does=_avfilter(LEAVES, LEAVES), otherwise=LEAVES,
    ),
    Program(
        "kdenlive",
        reads=AVFILTER, interpolation="tetrahedral", use=_MLT.format("Apply LUT", "Lift/gamma/gain"),
        title="Kdenlive", tried="MLT 7.12", does=_avfilter(LEAVES, LEAVES), otherwise=LEAVES,
    ),
    Program(
        "shotcut",
        reads=AVFILTER, interpolation="tetrahedral", use=_MLT.format("LUT (3D)", "Color Grading"),
        title="Shotcut", tried="MLT 7.12", does=_avfilter(LEAVES, LEAVES), otherwise=LEAVES,
    ),
    Program(
        "obs",
        reads=(".cube",), title="OBS",
        does={
            LutKind.CUBE: READS, LutKind.CUBE_OF_CURVE: READS,
            **dict.fromkeys(WITH_DOMAIN, f"ignores the domain: {GARBAGE}"),
            **dict.fromkeys(WITH_SHAPER, "loads the 1D part only: wrong colours"),
        },
    ),
    Program(
        "darktable",
        reads=(".icc", ".cube", ".3dl", ".png"), interpolation="tetrahedral", use="module input color profile",
        develops=True, title="darktable", tried="4.2",
        does={
            **dict.fromkeys((LutKind.CUBE, *FLAME_3DL), READS),
            LutKind.HALD: "reads it as .png; with a .tif it leaves the picture as it is",
            **dict.fromkeys(WITH_DOMAIN, "refuses a domain other than 0 to 1, and darktable-cli ends"),
        },
        otherwise=LEAVES,
    ),
    Program(
        "rawtherapee",
        reads=(*HALD_SUFFIXES, ".dcp", ".icc"), use="Film Simulation, its folder in the preferences", develops=True,
        title="RawTherapee", tried="5.9", does=READS_HALDS,
    ),
    Program(
        "art",
        reads=(*HALD_SUFFIXES, ".clf", ".dcp", ".icc"), develops=True, title="ART",
        does={**READS_HALDS, LutKind.CLF: READS},
    ),
    Program("captureone", reads=(".icc",), develops=True, title="Capture One"),
    Program(
        "gmic",
        reads=(".cube", ".png"), command=command_lines.gmic, title="G'MIC", tried="2.9",
        does={
            LutKind.CUBE: "reads it half a node too bright: enlarge it to 256³ first",
            LutKind.CUBE_WITH_RANGE: "reads it half a node too bright: enlarge it to 256³ first",
            LutKind.CUBE_OF_CURVE: "makes a cube of it, with as many nodes per axis as entries: 1,024 take 13 GB",
            LutKind.HALD: "reads it, 1.2 codes too bright",
            **dict.fromkeys(WITH_DOMAIN, f"ignores the domain: {GARBAGE}"),
            **dict.fromkeys(WITH_SHAPER, GARBAGE),
        },
    ),
    Program("gimp", reads=(".cube", ".png"), use="through G'MIC: Apply External CLUT"),
    Program(
        "imagemagick",
        reads=HALD_SUFFIXES, use="convert IN FILE -hald-clut OUT", title="ImageMagick", tried="6.9", does=READS_HALDS
    ),
    Program(
        "graphicsmagick",
        reads=HALD_SUFFIXES, use="gm convert IN -hald-clut FILE OUT", title="GraphicsMagick", tried="1.3",
        does=READS_HALDS, otherwise="says that it cannot read it, and writes the picture as it is",
    ),
    Program(
        "pillow",
        reads=(".cube",), use="pillow_lut.load_cube_file", title="pillow-lut", tried="1.1",
        does={
            **dict.fromkeys((LutKind.CUBE, LutKind.CUBE_WITH_RANGE), READS),
            **dict.fromkeys(WITH_DOMAIN, f"ignores the domain: {GARBAGE}"),
        },
    ),
    Program(
        "three",
        reads=(".cube",), use="LUTCubeLoader", title="three.js", tried="r187",
        does={
            **dict.fromkeys((LutKind.CUBE, LutKind.CUBE_WITH_RANGE), READS),
            **dict.fromkeys(WITH_DOMAIN, "reads it, and leaves the domain to its caller"),
            **dict.fromkeys(WITH_SHAPER, GARBAGE),
        },
    ),
    Program(
        "parse-cube-lut",
        reads=(".cube",), title="parse-cube-lut", tried="1.0",
        does={
            **dict.fromkeys((LutKind.CUBE, LutKind.CUBE_OF_CURVE), READS),
            **dict.fromkeys(WITH_DOMAIN, "reads it, and leaves the domain to its caller"),
            LutKind.CUBE_WITH_RANGE: "takes the range for a row: all colours are off by one node",
            **dict.fromkeys(WITH_SHAPER, GARBAGE),
        },
    ),
)  # fmt: skip
PROGRAMS = {program.name: program for program in _ALL_PROGRAMS}
"""The programs that `--for` names."""


def verdicts_on(kind: LutKind) -> dict[str, str]:
    """The verdict on a kind of file of each program that does not read through OpenColorIO, by its name for people."""
    verdicts = {}
    for program in PROGRAMS.values():
        if program.title:
            verdict = program.does.get(kind, program.otherwise if program.tried else NOT_KNOWN)
            verdicts[program.title] = (
                verdict if program.tried or verdict == NOT_KNOWN else f"{verdict} (not tried here)"
            )
    return verdicts


def program_named(name: str) -> Program:
    """The program of a name, in upper or lower case. Raises LutError, which lists the names, on an unknown one."""
    program = PROGRAMS.get(name.lower())
    if program is None:
        raise LutError(f'unknown program "{name}"; {alternatives(name, PROGRAMS)}')
    return program
