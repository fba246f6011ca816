"""The table of kits: for each program, the files that make it show the camera's look.

Most programs need only camera profiles or LUTs: they are rows of `_PROFILES_AND_LUTS`.
"""

from pathlib import Path

from lutforge.kits.camera_profiles import write_dng_profile, write_icc_profiles
from lutforge.kits.darktable import DARKTABLE_LINES, write_darktable
from lutforge.kits.kit import Kit, KitFiles, Look, Script, Source, write_script
from lutforge.kits.lumix import v_log_kit
from lutforge.kits.luts import write_lut
from lutforge.kits.measure import error_of_view
from lutforge.kits.rawtherapee import RAWTHERAPEE_LINES, write_rawtherapee
from lutforge.luts import command_lines
from lutforge.luts.verification import FileError
from lutforge.ocio.blender import blender_config
from lutforge.ocio.config import write_config


def _blender(look: Look, folder: Path) -> KitFiles:
    """Write a config, whose views show scene-linear renders as the camera would, and a script that starts Blender.

    Where Blender is installed, the camera is added to Blender's config, so that everything else looks as before.
    """
    base = blender_config()
    if not (folder / "ocio").exists():
        write_config([look.profile], folder / "ocio", merge=base)
    display = "sRGB - Display" if base is None else "sRGB"
    write_script(folder / "blender.sh", "blender", 'OCIO="$here/ocio/config.ocio" exec blender "$@"\n')
    steps = [
        "Start Blender by blender.sh, or with the environment variable OCIO set to ocio/config.ocio.",
        f'Render properties → Color Management: display device "{display}", view transform "{look.title}".',
    ]
    return KitFiles(steps, {f"{look.title} in ocio": error_of_view(folder / "ocio" / "config.ocio", look, display)})


def _profiles_and_luts(
    program: str,
    title: str,
    source: Source,
    tried: str,
    files: tuple[str, ...],
    steps: tuple[str, ...],
    space: str = "srgb",
    size: int | None = None,
    place: str = "",
) -> Kit:
    """A kit of files with these endings: ".dcp", ".icc", and LUTs of `size` nodes per axis from and to a space.

    steps: of the user, where "{}" becomes the name of the look, and "{best}" the name of the LUT with the least error,
    read back; place: where the program takes the LUTs, in a few words that they state.
    """

    def write(look: Look, folder: Path) -> KitFiles:
        errors: dict[str, FileError] = {}
        for ending in files:
            path = folder / f"{look.file_name}{ending}"
            if ending == ".dcp":
                errors |= write_dng_profile(look, folder)
            elif ending == ".icc":
                errors |= write_icc_profiles(look, folder)
            else:
                errors[path.name] = write_lut(look, path, space, space, size, place)
        best = min(errors, key=lambda name: errors[name].mean)
        return KitFiles([step.replace("{best}", best).replace("{}", look.file_name) for step in steps], errors)

    return Kit(program, title, source, tried, write)


_ICC = '"{}.icc" is the camera\'s JPEG; "{} colours.icc" leaves its tone curve out.'
_PROFILES_AND_LUTS = (
    _profiles_and_luts(
        "art", "ART", "raw", "the same files in RawTherapee 5.9; ART itself was not run", (".dcp", ".icc"),
        (
            "Color Management → Input Profile → Custom: {}.dcp, tone curve and look table ticked; "
            "Tone Curves: neutral.",
            "Or the ICC profile: " + _ICC,
        ),
    ),
    _profiles_and_luts(
        "lightroom", "Lightroom and Camera Raw", "raw", "the .dcp in RawTherapee 5.9; not in Adobe's programs",
        (".dcp",),
        (
            "Lightroom: profile browser → + → Import Profiles: {}.dcp (or copy it into the CameraRaw folder "
            "CameraProfiles), and start the program again.",
            "Choose its profile for RAW photographs of this camera. White balance, exposure and highlights stay as "
            "free as with Adobe's own profiles.",
        ),
    ),
    _profiles_and_luts(
        "captureone", "Capture One", "raw", "the profile in Little CMS, darktable and RawTherapee; not in Capture One",
        (".icc",),
        (
            "Copy the .icc files into the system's folder of colour profiles (macOS: ~/Library/ColorSync/Profiles; "
            "Windows: right-click → Install Profile), and start Capture One again.",
            "Base Characteristics → ICC Profile → Show All → Other: choose it; Curve: Linear Response. " + _ICC,
        ),
    ),
    _profiles_and_luts(
        "resolve", "DaVinci Resolve", "any", "the files in OpenColorIO; Resolve itself was not run",
        (" davinci-intermediate.resolve.cube", " davinci-intermediate.plain.cube"),
        (
            "Project settings → Color management: timeline space DaVinci Wide Gamut, gamma DaVinci Intermediate.",
            'Lookup tables → Open LUT folder: copy "{best}" there, the nearer of the two, and Update lists. Apply it '
            "to a node of footage in the timeline's space.",
        ),
        "davinci-intermediate", 65, "DaVinci Resolve's LUT folder, on a node of DaVinci Wide Gamut / Intermediate",
    ),
    _profiles_and_luts(
        "nuke", "Nuke", "any", "the CLF in OpenColorIO; Nuke itself was not run",
        (" acescg.clf",),
        ('A node OCIOFileTransform with "{} acescg.clf" takes and gives scene-linear ACEScg.',), "acescg",
        place="Nuke, OCIOFileTransform",
    ),
    _profiles_and_luts(
        "ffmpeg", "ffmpeg, mpv, Kdenlive and Shotcut", "any", "ffmpeg 5.1, mpv 0.35, MLT 7.12 (on the command line)",
        (".cube",),
        (
            command_lines.ffmpeg("{}.cube"),
            "That writes HD film of 8 bits. For 10 bits:",
            command_lines.ffmpeg("{}.cube", 10),
            "To see it through the cube alone:",
            command_lines.mpv("{}.cube"),
            "MLT, the engine of Kdenlive and Shotcut, to 8 and to 10 bits:",
            command_lines.melt("{}.cube"),
            command_lines.melt("{}.cube", 10),
            "Kdenlive: Apply LUT, and behind it Lift/gamma/gain as it comes; Shotcut: LUT (3D), and behind it Color "
            "Grading as it comes. Without the second HD film changes its colours.",
        ),
        size=65, place="the filter lut3d of ffmpeg, Kdenlive, Shotcut",
    ),
    _profiles_and_luts(
        "gimp", "GIMP with G'MIC", "any", "G'MIC 2.9 (command line)", (".cube",),
        (
            "Filters → G'MIC → Colors → Apply External CLUT: {}.cube. G'MIC makes pictures about 1 % brighter by it.",
            f"Exact, on the command line: `{command_lines.gmic('{}.cube')}`; for 16 bits a channel: "
            f"`{command_lines.gmic('{}.cube', 16)}`.",
        ),
        size=65, place="G'MIC, filter Apply External CLUT",
    ),
    _profiles_and_luts(
        "obs", "OBS Studio", "any", "not run", (".cube",),
        (
            "Right-click the source → Filters → Effect Filters → + → Apply LUT; Path: {}.cube, Amount: 1. The source's "
            "own picture profile: neutral.",
        ),
        size=33, place="OBS, effect filter Apply LUT",
    ),
)  # fmt: skip

KITS = {
    kit.program: kit
    for kit in (
        Kit(
            "darktable", "darktable", "raw",
            "darktable 4.2.1 (the sidecar and the style, by darktable-cli; its window was not opened)", write_darktable,
            Script("darktable-cli", ".xmp", DARKTABLE_LINES),
        ),
        Kit(
            "rawtherapee", "RawTherapee", "raw", "RawTherapee 5.9 (rawtherapee-cli)", write_rawtherapee,
            Script("rawtherapee-cli", ".pp3", RAWTHERAPEE_LINES),
        ),
        Kit("blender", "Blender", "raw", "Blender 3.4.1 (in the background)", _blender),
        v_log_kit(),
        *_PROFILES_AND_LUTS,
    )
}  # fmt: skip
"""The programs that `--for` names."""
