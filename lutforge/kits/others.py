"""Kits of programs that need no files but profiles and LUTs: a table of what each is fed, and what to do there.

And that of Blender, which needs a config.
"""

from dataclasses import dataclass
from pathlib import Path

from lutforge.kits.dcp import fit_dng_profile, write_dcp
from lutforge.kits.icc import VARIANTS, fit_icc_profile, write_icc
from lutforge.kits.kit import Kit, Look, Source, write_script
from lutforge.luts.bake import bake
from lutforge.luts.check import verify
from lutforge.ocio.config import write_config


@dataclass(frozen=True)
class LutFile:
    """A LUT of a kit. ending: of its name; space: of the colours on both sides; size: nodes per axis."""

    ending: str
    space: str
    size: int | None = None


def _fed(
    program: str, title: str, source: Source, tried: str, files: tuple[str | LutFile, ...], steps: tuple[str, ...]
) -> Kit:
    """A kit of ".icc", ".dcp" and LUTs.

    steps: what to do; "{}" is the name of the look, "{best}" that of the LUT whose error is least, read back.
    """

    def write(look: Look, folder: Path) -> list[str]:
        errors = {}
        for file in files:
            if file == ".dcp":
                write_dcp(fit_dng_profile(look), folder / f"{look.file_name}.dcp")
            elif file == ".icc":
                for variant in VARIANTS:
                    write_icc(fit_icc_profile(look, variant), folder / f"{look.file_name}{variant}.icc")
            elif isinstance(file, LutFile):
                path, function = folder / f"{look.file_name}{file.ending}", look.between(file.space, file.space)
                shown = file.space == "srgb"
                lut = bake(function, path, size=file.size, display_referred=shown, title=look.title)
                errors[path.name] = verify(path, function, lut, display_referred=shown).mean
        best = min(errors, key=errors.__getitem__, default="")
        return [step.format(look.file_name, best=best) for step in steps]

    return Kit(program, title, source, tried, write)


_ICC = '"{}.icc" is the camera\'s JPEG; "{} colours.icc" leaves its tone curve out.'.replace("{}", "{0}")
OTHER_KITS = (
    _fed(
        "art", "ART", "raw", "the same files in RawTherapee 5.9; ART itself was not run", (".dcp", ".icc"),
        (
            "Color Management → Input Profile → Custom: {}.dcp, tone curve and look table ticked; "
            "Tone Curves: neutral.",
            "Or the ICC profile: " + _ICC,
        ),
    ),
    _fed(
        "lightroom", "Lightroom and Camera Raw", "raw", "the .dcp in RawTherapee 5.9; not in Adobe's programs",
        (".dcp",),
        (
            "Lightroom: profile browser → + → Import Profiles: {}.dcp (or copy it into the CameraRaw folder "
            "CameraProfiles), and start the program again.",
            "Choose its profile for RAW photographs of this camera. White balance, exposure and highlights stay as "
            "free as with Adobe's own profiles.",
        ),
    ),
    _fed(
        "captureone", "Capture One", "raw", "the profile in Little CMS, darktable and RawTherapee; not in Capture One",
        (".icc",),
        (
            "Copy the .icc files into the system's folder of colour profiles (macOS: ~/Library/ColorSync/Profiles; "
            "Windows: right-click → Install Profile), and start Capture One again.",
            "Base Characteristics → ICC Profile → Show All → Other: choose it; Curve: Linear Response. " + _ICC,
        ),
    ),
    _fed(
        "digikam", "digiKam", "raw", "the profile in Little CMS, darktable and RawTherapee; not in digiKam", (".icc",),
        (
            "Settings → Configure digiKam → Image Editor → RAW Behavior: 16-bit, colour space RAW (no conversion), "
            "white balance of the camera.",
            "Image Editor → Color → Color Management → Convert from the camera's profile: choose the .icc. " + _ICC,
        ),
    ),
    _fed(
        "rapidraw", "RapidRAW", "raw", "the .dcp in RawTherapee 5.9; RapidRAW itself was not run", (".dcp",),
        ("Choose {}.dcp as the camera profile of RAW photographs of this camera.",),
    ),
    _fed(
        "resolve", "DaVinci Resolve", "any", "the files in OpenColorIO; Resolve itself was not run",
        (
            LutFile(" davinci-intermediate.resolve.cube", "davinci-intermediate", 65),
            LutFile(" davinci-intermediate.plain.cube", "davinci-intermediate", 65),
        ),
        (
            "Project settings → Color management: timeline space DaVinci Wide Gamut, gamma DaVinci Intermediate.",
            'Lookup tables → Open LUT folder: copy "{best}" there, the nearer of the two, and Update lists. Apply it '
            "to a node of footage in the timeline's space.",
        ),
    ),
    _fed(
        "nuke", "Nuke", "any", "the CLF in OpenColorIO; Nuke itself was not run",
        (LutFile(" acescg.clf", "acescg"),),
        ('A node OCIOFileTransform with "{} acescg.clf" takes and gives scene-linear ACEScg.',),
    ),
    _fed(
        "ffmpeg", "ffmpeg", "any", "ffmpeg 5.1 (lut3d)", (LutFile(".cube", "srgb", 65),),
        ('ffmpeg -i IN.mov -vf "lut3d=file={}.cube:interp=tetrahedral" OUT.mov',),
    ),
    _fed(
        "obs", "OBS Studio", "any", "not run; a plain cube, which it reads by its manual",
        (LutFile(".cube", "srgb", 33),),
        ("Right-click the source → Filters → + → Apply LUT: {}.cube.",),
    ),
    _fed(
        "gimp", "GIMP with G'MIC", "any", "G'MIC 2.9 (command line)", (LutFile(".cube", "srgb", 65),),
        ("Filters → G'MIC → Colors → Apply External CLUT: {}.cube.",),
    ),
)  # fmt: skip


def _write(look: Look, folder: Path) -> list[str]:
    """Write the config, which holds every style, and a script that starts Blender with it."""
    if not (folder / "ocio").exists():
        write_config([look.profile], folder / "ocio", version="2.1")
    write_script(folder / "blender.sh", "blender", 'OCIO="$here/ocio/config.ocio" exec blender "$@"\n')
    return [
        "Start Blender by blender.sh, or with the environment variable OCIO set to ocio/config.ocio.",
        f'Render properties → Color Management: display device "sRGB - Display", view transform "{look.title}".',
    ]


BLENDER = Kit("blender", "Blender", "raw", "Blender 3.4.1 (in the background)", _write)
"""Blender reads a whole OpenColorIO config, whose views show scene-linear renders as the camera would."""
