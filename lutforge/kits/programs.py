"""The kits: what each program is fed, and the files that make it show the camera's look.

Most programs need no files but profiles and LUTs: they are rows of a table.
"""

import base64
import struct
import zlib
from pathlib import Path
from xml.sax.saxutils import escape, quoteattr

import numpy as np

from lutforge.colour.srgb import delta_e_2000
from lutforge.errors import SettingsError, alternatives
from lutforge.kits.dcp import fit_dng_profile, write_dcp
from lutforge.kits.icc import VARIANTS, fit_icc_profile, write_icc
from lutforge.kits.kit import Kit, Look, Script, Source, setting_of, write_script
from lutforge.luts.bake import bake
from lutforge.luts.check import verify
from lutforge.luts.reading import read_lut
from lutforge.model.camera_profile import CameraProfile, match
from lutforge.model.transform import Transform
from lutforge.ocio.blender import blender_config
from lutforge.ocio.config import write_config


def _write_icc_profiles(look: Look, folder: Path) -> None:
    for variant in VARIANTS:
        write_icc(fit_icc_profile(look, variant), folder / f"{look.file_name}{variant}.icc")


# --- RawTherapee: ICC and DNG camera profiles, and the processing profiles that choose them ---------------------------
# RawTherapee changes exposure behind an ICC profile, and in front of the tone curve of a DNG camera profile
# (https://rawpedia.rawtherapee.com/Color_Management).


_PROCESSING = {
    "Version": "AppVersion=5.9 Version=349",
    "Exposure": "Auto=false Compensation=0 Brightness=0 Contrast=0 Saturation=0 Black=0 HighlightCompr=0 ShadowCompr=0 "
    "HistogramMatching=false Curve=0; Curve2=0;",
    "HLRecovery": "Enabled=false",
    "White Balance": "Enabled=true Setting=Camera",
    "Color Management": "ToneCurve=true ApplyLookTable=true ApplyBaselineExposureOffset=false ApplyHueSatMap=false "
    "WorkingProfile=ProPhoto OutputProfile=RTv4_sRGB",
    "RAW": "CA=false HotPixelFilter=false DeadPixelFilter=false",
}
"""Sections of a processing profile that develops by a camera profile: camera white balance, nothing else."""


def _rawtherapee(look: Look, folder: Path) -> list[str]:
    """Write camera profiles of the look, ICC profiles of it and of the colours alone, a processing profile for each."""
    name = look.file_name
    write_dcp(fit_dng_profile(look), folder / f"{name}.dcp")
    _write_icc_profiles(look, folder)
    presets = {name: f"{name}.dcp", f"{name} icc": f"{name}.icc", f"{name} colours": f"{name} colours.icc"}
    for preset, camera_profile in presets.items():
        sections = {section: values.split() for section, values in _PROCESSING.items()}
        sections["Color Management"].append(f"InputProfile=file:{camera_profile}")
        blocks = ["\n".join([f"[{section}]", *values]) for section, values in sections.items()]
        (folder / f"{preset}.pp3").write_text("\n\n".join(blocks) + "\n", encoding="utf-8")
    return [
        f"Open a RAW photograph, and load {name}.pp3 as its processing profile: it chooses the .dcp beside it in "
        "Color → Color Management → Input Profile → Custom, and makes everything else neutral. White balance and "
        "Exposure → Compensation act in front of the camera's tone curve, as on the camera.",
        f"{name} icc.pp3 takes the ICC profile instead. Exposure → Compensation then acts behind the look: use "
        "Raw → Raw White Points.",
        f"{name} colours.pp3 leaves the camera's tone curve out, for tone curves of your own.",
    ]


_RAWTHERAPEE_SCRIPT = (
    # A processing profile in another folder than the camera profile has to name its whole path.
    "place=$(printf '%s' \"$here\" | sed 's/[&|\\\\]/\\\\&/g')\n"
    'sed "s|^InputProfile=file:|&$place/|" "$here/$look.pp3" >"$work/kit.pp3"\n'
    'rawtherapee-cli -o "$picture" -p "$work/kit.pp3" -t -b16 -Y -c "$raw" >"$work/log" 2>&1 || true\n'
    '[ -s "$picture" ] || refuse "RawTherapee made no picture of it" "$work/log"\n'
)
"""rawtherapee-cli, with the processing profile of a look."""


# --- darktable: an ICC profile for the module *input color profile*, and a style and a sidecar that choose it ---------
# The module's parameters are those of version 7 in darktable's `src/iop/colorin.c` (darktable 3.4 to 4.2), which later
# versions convert: kind of profile, its file name in 512 bytes, intent, clipping gamut, blue mapping, and the same of
# the working profile. An earlier version would drop what it does not know, and show its own colours.


NEUTRAL = {
    "plugins/darkroom/workflow": "none",
    "plugins/darkroom/chromatic-adaptation": "legacy",
    "plugins/imageio/format/tiff/bpp": "16",
}
"""Settings of a neutral development: no tone curve or exposure, white balance as shot on the camera's own RGB."""

TONE_MODULES = ("agx", "basecurve", "channelmixerrgb", "exposure", "filmicrgb", "sigmoid")
"""Modules that darktable's workflows switch on by themselves: they change the look."""

_MODULE_VERSION = 7


def _darktable(look: Look, folder: Path) -> list[str]:
    """Write profiles of the look, and of the colours alone, each with a style and a sidecar."""
    _write_icc_profiles(look, folder)
    for variant in VARIANTS:
        name = f"{look.file_name}{variant}"
        (folder / f"{name}.dtstyle").write_text(_style(f"{look.title}{variant}", name), encoding="utf-8")
        (folder / f"{name}.xmp").write_text(_sidecar(name), encoding="utf-8")
    return [
        "Copy the .icc files into the folder color/in of darktable's settings (~/.config/darktable/color/in on "
        "Linux; make it where it is missing), and start darktable again.",
        "Preferences → processing → auto-apply chromatic adaptation defaults: legacy, so that the module white "
        "balance balances as shot; and auto-apply pixel workflow defaults: none, which leaves filmic rgb, sigmoid, "
        "base curve and exposure off. On photographs that have them, switch them off.",
        "Lighttable → styles → import: the .dtstyle files. Apply one to RAW photographs of this camera.",
        f'"{look.title}" is the camera\'s JPEG. "{look.title} colours" leaves its tone curve out, for your own '
        "tone mapper behind it: sigmoid, filmic rgb or AgX.",
    ]


def _parameters(name: str) -> str:
    """The module's parameters as darktable stores bytes: "gz", a factor in two digits, a zlib stream in Base64."""
    file, perceptual, no_clipping, unmapped, linear_rec2020 = 0, 0, 0, 0, 4
    data = struct.pack("<i512s4i512x", file, f"{name}.icc".encode(), perceptual, no_clipping, unmapped, linear_rec2020)
    packed = zlib.compress(data, 9)
    return f"gz{min(len(data) // len(packed) + 1, 99):02d}" + base64.b64encode(packed).decode("ascii")


def _sidecar(name: str) -> str:
    return f"""<?xml version="1.0" encoding="UTF-8"?>
<x:xmpmeta xmlns:x="adobe:ns:meta/">
 <rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#">
  <rdf:Description rdf:about="" xmlns:darktable="http://darktable.sf.net/"
    darktable:xmp_version="4" darktable:raw_params="0" darktable:history_end="1">
   <darktable:history>
    <rdf:Seq>
     <rdf:li darktable:num="0" darktable:operation="colorin" darktable:enabled="1"
       darktable:modversion="{_MODULE_VERSION}" darktable:params={quoteattr(_parameters(name))}
       darktable:multi_name="" darktable:multi_priority="0"/>
    </rdf:Seq>
   </darktable:history>
  </rdf:Description>
 </rdf:RDF>
</x:xmpmeta>
"""


def _style(title: str, name: str) -> str:
    plugin = (
        f"<plugin><num>0</num><module>{_MODULE_VERSION}</module><operation>colorin</operation>"
        f"<op_params>{_parameters(name)}</op_params><enabled>1</enabled><blendop_params></blendop_params>"
        "<blendop_version>0</blendop_version><multi_priority>0</multi_priority><multi_name></multi_name></plugin>"
    )
    return (
        '<?xml version="1.0" encoding="UTF-8"?>\n<darktable_style version="1.0">'
        f"<info><name>{escape(title)}</name><description>the camera's own look, by LutForge</description></info>"
        f"<style>{plugin}</style></darktable_style>\n"
    )


_CONFIGURATION = " ".join(f'--conf "{key}={value}"' for key, value in NEUTRAL.items())
_TONES = "\\|".join(TONE_MODULES)
_DARKTABLE_SCRIPT = (
    'mkdir -p "$work/config/color/in"\ncp "$here"/*.icc "$work/config/color/in"\n'
    'darktable-cli "$raw" "$here/$look.xmp" "$picture" --icc-type SRGB --core --configdir "$work/config" '
    f'--library :memory: {_CONFIGURATION} >"$work/log" 2>&1 || true\n'
    '[ -s "$picture" ] || refuse "darktable made no picture of it" "$work/log"\n'
    # darktable goes on after a module whose parameters it does not know, or a profile that it cannot read.
    'grep colorin "$work/log" >"$work/use" && refuse "darktable did not use the profile" "$work/use"\n'
    f"""grep -a -A1 'darktable:operation="\\({_TONES}\\)"' "$picture" | grep -B1 'enabled="1"' |\n"""
    """  grep -o 'operation="[a-z]*"' >"$work/tone" &&\n"""
    '  refuse "darktable changed the tone, though it was asked not to" "$work/tone"\n'
)
"""darktable-cli, in a configuration of its own."""


# --- Lumix bodies: the camera's own LUT, as REAL TIME LUT loads it, from V-Log or from a base style to the look -------


FILES = ((".vlt", 17), (".cube", 33))
"""What bodies read: the older ones the first alone."""


def lumix_kit(camera: CameraProfile | None = None, base: str = "") -> Kit:
    """The kit of V-Log; or on a base style of the camera, with its profile. Raises SettingsError on an unknown one."""
    base = base.lower()
    if camera is not None and base not in camera.styles:
        raise SettingsError(
            f'{camera.camera}: unknown style "{base}" for --base; {alternatives(base, sorted(camera.styles))}'
        )

    def write(look: Look, folder: Path) -> list[str]:
        """Write a .vlt and a .cube, and tell their error under each white balance of the camera."""
        name = look.file_name + (f" on {base}" if base else " from V-Log")
        paths = [folder / f"{name}{suffix}" for suffix, _ in FILES]
        function = look.between("vlog", "srgb")
        if camera is not None:
            function = over_base(camera, setting_of(camera, base), look)
        for path, (_, size) in zip(paths, FILES, strict=True):
            bake(function, path, size=size, title=look.title)
        body = "" if camera is None else f" of the {camera.camera}"
        steps = [
            f"Copy {paths[0].name} or, for bodies that read it, {paths[1].name} to the memory card{body}. Some bodies "
            "take names of eight letters only: rename it.",
            f"Menu → Photo Style → REAL TIME LUT → load it, with the base {base or 'V-Log'}.",
        ]
        if camera is None:
            return steps
        # What the files, read back, make of colours that the base style shows, against the model.
        balanced = np.random.default_rng(0).random((20_000, 3)) ** 2  # as many dark colours as light ones
        rows = []
        for white_balance in camera.white_balances:
            setting = f"{base}/{white_balance}"
            jpeg = np.clip(camera.render_balanced(setting)(balanced), 0.0, 1.0)
            wanted = over_base(camera, setting, look)(jpeg)
            figures = []
            for path in paths:
                error = delta_e_2000(read_lut(path)(jpeg), wanted)
                figures.append(f"{path.suffix} {error.mean():.2f}, {np.quantile(error, 0.99):.2f}")
            rows.append(f" {white_balance}: {'; '.join(figures)}")
        heading = "One LUT serves all white balances. Its error, ΔE00, mean and 99 %:"
        return [*steps, f"{heading}{'.'.join(rows)}."]

    return Kit("lumix", "Lumix bodies", "any", "not run; the .vlt by a second parser", write)


def over_base(camera: CameraProfile, base: str, look: Look) -> Transform:
    """A camera's JPEG of a base setting → a look, of this camera or another, under the same white balance."""
    white_balance = str(camera.selector(base).white_balance)
    known = white_balance in look.profile.white_balances
    target = f"{look.style}/{white_balance if known else look.white_balance}"
    return match(camera, base, look.profile, target, neutral_highlights=False)  # the same for all white balances


# --- Blender, and programs that need no files but profiles and LUTs ---------------------------------------------------


def _blender(look: Look, folder: Path) -> list[str]:
    """Write a config, whose views show scene-linear renders as the camera would, and a script that starts Blender.

    Where Blender is installed, the camera is added to its own config: everything else in a file looks as before.
    """
    own = blender_config()
    if not (folder / "ocio").exists():
        write_config([look.profile], folder / "ocio", merge=own)
    display = "sRGB - Display" if own is None else "sRGB"
    write_script(folder / "blender.sh", "blender", 'OCIO="$here/ocio/config.ocio" exec blender "$@"\n')
    return [
        "Start Blender by blender.sh, or with the environment variable OCIO set to ocio/config.ocio.",
        f'Render properties → Color Management: display device "{display}", view transform "{look.title}".',
    ]


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
                _write_icc_profiles(look, folder)
            else:
                function, shown = look.between(space, space), space == "srgb"
                lut = bake(function, path, size=size, display_referred=shown, title=look.title)
                errors[path.name] = verify(path, function, lut, display_referred=shown).mean
        best = min(errors, key=errors.__getitem__, default="")
        return [step.format(look.file_name, best=best) for step in steps]

    return Kit(program, title, source, tried, write)


_ICC = '"{}.icc" is the camera\'s JPEG; "{} colours.icc" leaves its tone curve out.'.replace("{}", "{0}")
_FED = (
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
        "gimp", "GIMP with G'MIC", "any", "G'MIC 2.9 (command line)", (".cube",),
        ("Filters → G'MIC → Colors → Apply External CLUT: {}.cube.",), size=65,
    ),
)  # fmt: skip

KITS = {
    kit.program: kit
    for kit in (
        Kit(
            "darktable", "darktable", "raw",
            "darktable 4.2.1 (the sidecar and the style, by darktable-cli; its window was not opened)", _darktable,
            Script("darktable-cli", ".xmp", _DARKTABLE_SCRIPT),
        ),
        Kit(
            "rawtherapee", "RawTherapee", "raw", "RawTherapee 5.9 (rawtherapee-cli)", _rawtherapee,
            Script("rawtherapee-cli", ".pp3", _RAWTHERAPEE_SCRIPT),
        ),
        Kit("blender", "Blender", "raw", "Blender 3.4.1 (in the background)", _blender),
        lumix_kit(),
        *_FED,
    )
}  # fmt: skip
"""The programs that `--for` names."""
