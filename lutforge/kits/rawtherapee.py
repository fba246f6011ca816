"""RawTherapee's kit: DNG and ICC camera profiles, and the processing profiles that choose them.

RawTherapee changes exposure after an ICC profile, but before the tone curve of a DNG camera profile
(https://rawpedia.rawtherapee.com/Color_Management).
"""

from pathlib import Path

from lutforge.kits.camera_profiles import write_dng_profile, write_icc_profiles
from lutforge.kits.kit import KitFiles, Look

_PROCESSING = {
    "Version": "AppVersion=5.9 Version=349",
    "Exposure": "Auto=false Compensation=0 Brightness=0 Contrast=0 Saturation=0 Black=0 HighlightCompr=0 ShadowCompr=0 "
    "HistogramMatching=false CurveMode=Standard Curve=0; Curve2=0;",
    "HLRecovery": "Enabled=false",
    "LensProfile": "LcMode=none UseDistortion=false UseVignette=false UseCA=false",
    "PostDemosaicSharpening": "Enabled=false",
    "Directional Pyramid Denoising": "Enabled=false",
    "White Balance": "Enabled=true Setting=Camera",
    "Color Management": "ToneCurve=true ApplyLookTable=true ApplyBaselineExposureOffset=false ApplyHueSatMap=false "
    "WorkingProfile=ProPhoto OutputProfile=RTv4_sRGB",
    "RAW": "CA=false HotPixelFilter=false DeadPixelFilter=false",
}
"""Sections of a processing profile that applies the camera's white balance and a camera profile, and nothing else.

RawTherapee keeps what a profile does not name, by its preferences as they come, and has opened the photograph with a
profile of its own by then: all that those profiles switch on is switched off here, but for the demosaicing.
"""


def write_rawtherapee(look: Look, folder: Path) -> KitFiles:
    """Write camera profiles of the look, ICC profiles of it and of the colours alone, a processing profile for each."""
    name = look.file_name
    errors = write_dng_profile(look, folder) | write_icc_profiles(look, folder)
    presets = {name: f"{name}.dcp", f"{name} icc": f"{name}.icc", f"{name} colours": f"{name} colours.icc"}
    for preset, camera_profile in presets.items():
        sections = {section: values.split() for section, values in _PROCESSING.items()}
        sections["Color Management"].append(f"InputProfile=file:{camera_profile}")
        blocks = ["\n".join([f"[{section}]", *values]) for section, values in sections.items()]
        (folder / f"{preset}.pp3").write_text("\n\n".join(blocks) + "\n", encoding="utf-8")
    steps = [
        f"Open a RAW photograph, and load {name}.pp3 as its processing profile: it chooses the .dcp beside it in "
        "Color → Color Management → Input Profile → Custom, and makes everything else neutral. White balance and "
        "Exposure → Compensation act in front of the camera's tone curve, as on the camera.",
        f"{name} icc.pp3 takes the ICC profile instead. Brighten and darken with Raw → Raw White Points, which act in "
        "front of the look: 0.25 is −2 EV. Exposure → Compensation acts behind it here, and makes burnt-out white a "
        "flat grey below 0. Darkened by Raw White Points burnt-out white turns a little pink; with the .dcp it stays "
        "neutral.",
        f"{name} colours.pp3 leaves the camera's tone curve out, for tone curves of your own.",
    ]
    return KitFiles(steps, errors)


RAWTHERAPEE_LINES = (
    # The processing profile is copied to another folder, so it must name the whole path of the camera profile.
    "place=$(printf '%s' \"$here\" | sed 's/[&|\\\\]/\\\\&/g')\n"
    'sed "s|^InputProfile=file:|&$place/|" "$here/$look.pp3" >"$work/kit.pp3"\n'
    'rawtherapee-cli -o "$picture" -p "$work/kit.pp3" -t -b16 -Y -c "$raw" >"$work/log" 2>&1 || true\n'
    '[ -s "$picture" ] || refuse "RawTherapee made no picture of it" "$work/log"\n'
)
"""The lines of a script that run rawtherapee-cli, with the processing profile of a look."""
