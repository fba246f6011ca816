"""RawTherapee: ICC and DNG camera profiles, and the processing profiles that choose them.

RawTherapee changes exposure behind an ICC profile, and in front of the tone curve of a DNG camera profile
(https://rawpedia.rawtherapee.com/Color_Management).
"""

from pathlib import Path

from lutforge.kits.dcp import fit_dng_profile, write_dcp
from lutforge.kits.icc import VARIANTS, fit_icc_profile, write_icc
from lutforge.kits.kit import Kit, Look, Script

NEUTRAL = {
    "Version": {"AppVersion": "5.9", "Version": "349"},
    "Exposure": {
        "Auto": "false",
        "Compensation": "0",
        "Brightness": "0",
        "Contrast": "0",
        "Saturation": "0",
        "Black": "0",
        "HighlightCompr": "0",
        "ShadowCompr": "0",
        "HistogramMatching": "false",
        "Curve": "0;",
        "Curve2": "0;",
    },
    "HLRecovery": {"Enabled": "false"},
    "White Balance": {"Enabled": "true", "Setting": "Camera"},
    "Color Management": {
        "ToneCurve": "true",
        "ApplyLookTable": "true",
        "ApplyBaselineExposureOffset": "false",
        "ApplyHueSatMap": "false",
        "WorkingProfile": "ProPhoto",
        "OutputProfile": "RTv4_sRGB",
    },
    "RAW": {"CA": "false", "HotPixelFilter": "false", "DeadPixelFilter": "false"},
}
"""Sections of a processing profile that develops by a camera profile: camera white balance, nothing else."""


def _write(look: Look, folder: Path) -> list[str]:
    """Write camera profiles of the look, ICC profiles of it and of the colours alone, a processing profile for each."""
    name = look.file_name
    presets = {name: f"{name}.dcp", f"{name} icc": f"{name}.icc", f"{name} colours": f"{name} colours.icc"}
    write_dcp(fit_dng_profile(look), folder / f"{name}.dcp")
    for variant in VARIANTS:
        write_icc(fit_icc_profile(look, variant), folder / f"{name}{variant}.icc")
    for preset, camera_profile in presets.items():
        sections = {section: dict(values) for section, values in NEUTRAL.items()}
        sections["Color Management"]["InputProfile"] = f"file:{camera_profile}"
        blocks = [
            "\n".join([f"[{section}]", *(f"{key}={value}" for key, value in values.items())])
            for section, values in sections.items()
        ]
        (folder / f"{preset}.pp3").write_text("\n\n".join(blocks) + "\n", encoding="utf-8")
    return [
        f"Open a RAW photograph, and load {name}.pp3 as its processing profile: it chooses the .dcp beside it in "
        "Color → Color Management → Input Profile → Custom, and makes everything else neutral. White balance and "
        "Exposure → Compensation act in front of the camera's tone curve, as on the camera.",
        f"{name} icc.pp3 takes the ICC profile instead. Exposure → Compensation then acts behind the look: use "
        "Raw → Raw White Points.",
        f"{name} colours.pp3 leaves the camera's tone curve out, for tone curves of your own.",
    ]


_SCRIPT = (
    # A processing profile in another folder than the camera profile has to name its whole path.
    "place=$(printf '%s' \"$here\" | sed 's/[&|\\\\]/\\\\&/g')\n"
    'sed "s|^InputProfile=file:|&$place/|" "$here/$look.pp3" >"$work/kit.pp3"\n'
    'rawtherapee-cli -o "$picture" -p "$work/kit.pp3" -t -b16 -Y -c "$raw" >"$work/log" 2>&1 || true\n'
    '[ -s "$picture" ] || refuse "RawTherapee made no picture of it" "$work/log"\n'
)
"""rawtherapee-cli, with the processing profile of a look."""

RAWTHERAPEE = Kit(
    "rawtherapee", "RawTherapee", "raw", "RawTherapee 5.9 (rawtherapee-cli)", _write,
    Script("rawtherapee-cli", ".pp3", _SCRIPT),
)  # fmt: skip
