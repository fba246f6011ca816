"""The programs that read LUT files, and what each of them takes."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from lutforge.errors import LutError, alternatives
from lutforge.interpolation import Interpolation
from lutforge.luts import command_lines

CUBES = (".cube", ".cube, domain from 0", ".cube, domain", ".cube, range", ".cube, curve")
"""Kinds of .cube files without a shaper."""

READS = "reads it"
REFUSES = "refuses it"
LEAVES = "leaves the picture as it is, without a word"
NOT_KNOWN = "is not known to read it"
GARBAGE = "reads it without a word and renders wrong colours"
"""What a program does with a file: the last of these five ways is the worst."""


@dataclass(frozen=True)
class Program:
    """A program that reads LUT files: which it reads, and what it does with others.

    reads: suffixes, the best first; shaper: it reads a .cube with a shaper; max_size: most nodes per axis; size: nodes
    per axis of a plain cube for it; interpolation: its own; use: what the user does with the file; command: the command
    line, for programs that have one. develops: it develops RAW files itself, and applies a LUT to developed colours,
    never to camera RAW.

    title: its name for people, empty for OpenColorIO and programs that read files through it. does: its verdict by kind
    of file, as `check` names kinds; otherwise: its verdict on every other kind; tried: the version that these were
    measured with, empty where they come from its makers and users.
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
    """The verdicts of ffmpeg's filter lut3d, by kind of file; refused: the verdict on files that it refuses."""
    return {
        **dict.fromkeys((".cube", ".cube, domain from 0", ".csp", ".3dl, 17 nodes, 12 bits"), READS),
        # Between two knots its interpolation weight goes up to the distance of the knots, and not to 1.
        ".csp, bent": "reads it; its curve in steps where that has less than some thousand knots",
        ".cube, curve": f"{refused} as a 3D LUT; its filter lut1d reads it",
        **dict.fromkeys((".cube, domain", ".cube, shaper without ranges"), GARBAGE),
        ".3dl": f"takes 17 nodes and 12 bits only: {GARBAGE}",  # it skips one line, and reads 17³ rows after it
        "Hald image": f"{refused} as a 3D LUT; its filter haldclut reads it",
    }


OCIO_READS = (".clf", ".ctf", ".cube", ".csp", ".3dl", ".spi1d", ".spi3d")
HALD_SUFFIXES = (".png", ".tif", ".tiff")
READS_HALDS = {"Hald image": READS}
READ_BY_ADOBE = dict.fromkeys(
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
        reads=(".cube", ".3dl", ".csp"), title="Photoshop", does={**READ_BY_ADOBE, ".csp": READS, ".csp, bent": READS}
    ),
    "lightroom": Program(
        reads=(".cube", ".dcp"), size=33, use="in a profile made with Camera Raw", develops=True, title="Lightroom",
        does={".cube": "reads it in a profile made with Camera Raw"},
    ),
    "premiere": Program(reads=(".cube", ".3dl"), title="Premiere", does=READ_BY_ADOBE),
    "aftereffects": Program(
        reads=(".cube", ".3dl", ".csp"), max_size=64, size=64, title="After Effects",
        does={**READ_BY_ADOBE, ".csp": READS, ".csp, bent": READS},
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
        reads=(*HALD_SUFFIXES, ".dcp", ".icc"), use="Film Simulation, its folder in the preferences", develops=True,
        title="RawTherapee", tried="5.9", does=READS_HALDS,
    ),
    "art": Program(
        reads=(*HALD_SUFFIXES, ".clf", ".dcp", ".icc"), develops=True, title="ART", does={**READS_HALDS, ".clf": READS}
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
        reads=HALD_SUFFIXES, use="convert IN FILE -hald-clut OUT", title="ImageMagick", tried="6.9", does=READS_HALDS
    ),
    "graphicsmagick": Program(
        reads=HALD_SUFFIXES, use="gm convert IN -hald-clut FILE OUT", title="GraphicsMagick", tried="1.3",
        does=READS_HALDS, otherwise="says that it cannot read it, and writes the picture as it is",
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
"""The programs that `--for` names."""


def verdicts_on(kind: str) -> dict[str, str]:
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
