"""Kits of programs that need no files but profiles and LUTs: a table of what each is fed, and what to do there.

And that of Blender, which needs a config.
"""

from pathlib import Path

from lutforge.kits.dcp import fit_dng_profile, write_dcp
from lutforge.kits.icc import VARIANTS, fit_icc_profile, write_icc
from lutforge.kits.kit import Kit, Look, Source, write_script
from lutforge.luts.bake import bake
from lutforge.luts.check import verify
from lutforge.ocio.config import write_config


def _fed(
    program: str,
    title: str,
    source: Source,
    tried: str,
    files: tuple[str, ...],
    steps: tuple[str, ...],
    space: str = "srgb",
    size: int | None = None,
) -> Kit:
    """A kit of files with these endings: ".dcp", ".icc", and LUTs of `size` nodes per axis within a space.

    steps: what to do; "{}" is the name of the look, "{best}" that of the LUT whose error is least, read back.
    """

    def write(look: Look, folder: Path) -> list[str]:
        errors = {}
        for ending in files:
            path = folder / f"{look.file_name}{ending}"
            if ending == ".dcp":
                write_dcp(fit_dng_profile(look), path)
            elif ending == ".icc":
                for variant in VARIANTS:
                    write_icc(fit_icc_profile(look, variant), folder / f"{look.file_name}{variant}.icc")
            else:
                function, shown = look.between(space, space), space == "srgb"
                lut = bake(function, path, size=size, display_referred=shown, title=look.title)
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
        (" davinci-intermediate.resolve.cube", " davinci-intermediate.plain.cube"),
        (
            "Project settings → Color management: timeline space DaVinci Wide Gamut, gamma DaVinci Intermediate.",
            'Lookup tables → Open LUT folder: copy "{best}" there, the nearer of the two, and Update lists. Apply it '
            "to a node of footage in the timeline's space.",
        ),
        "davinci-intermediate", 65,
    ),
    _fed(
        "nuke", "Nuke", "any", "the CLF in OpenColorIO; Nuke itself was not run",
        (" acescg.clf",),
        ('A node OCIOFileTransform with "{} acescg.clf" takes and gives scene-linear ACEScg.',), "acescg",
    ),
    _fed(
        "ffmpeg", "ffmpeg", "any", "ffmpeg 5.1 (lut3d)", (".cube",),
        ('ffmpeg -i IN.mov -vf "lut3d=file={}.cube:interp=tetrahedral" OUT.mov',), size=65,
    ),
    _fed(
        "obs", "OBS Studio", "any", "not run; a plain cube, which it reads by its manual",
        (".cube",), ("Right-click the source → Filters → + → Apply LUT: {}.cube.",), size=33,
    ),
    _fed(
        "gimp", "GIMP with G'MIC", "any", "G'MIC 2.9 (command line)", (".cube",),
        ("Filters → G'MIC → Colors → Apply External CLUT: {}.cube.",), size=65,
    ),
)  # fmt: skip


def _write(look: Look, folder: Path) -> list[str]:
    """Write the config, which holds every style, and a script that starts Blender with it."""
    if not (folder / "ocio").exists():
        write_config([look.profile], folder / "ocio")
    write_script(folder / "blender.sh", "blender", 'OCIO="$here/ocio/config.ocio" exec blender "$@"\n')
    return [
        "Start Blender by blender.sh, or with the environment variable OCIO set to ocio/config.ocio.",
        f'Render properties → Color Management: display device "sRGB - Display", view transform "{look.title}".',
    ]


BLENDER = Kit("blender", "Blender", "raw", "Blender 3.4.1 (in the background)", _write)
"""Blender reads a whole OpenColorIO config, whose views show scene-linear renders as the camera would."""
