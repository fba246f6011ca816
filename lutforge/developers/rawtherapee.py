"""RawTherapee: `rawtherapee-cli` with a neutral processing profile (https://rawpedia.rawtherapee.com/Command-Line_Options)."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lutforge.arrays import Pixels
from lutforge.colour.rgb_spaces import rgb_space
from lutforge.developers.developer import Developer

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
        "InputProfile": "(camera)",
        "ToneCurve": "false",
        "ApplyLookTable": "false",
        "ApplyBaselineExposureOffset": "false",
        "ApplyHueSatMap": "false",
        "WorkingProfile": "ProPhoto",
        "OutputProfile": "RTv4_Rec2020",
    },
    "RAW": {"CA": "false", "HotPixelFilter": "false", "DeadPixelFilter": "false"},
}
"""Sections of a processing profile that develops neutrally: camera white balance and matrix, nothing else."""


def profile_text(*changes: dict[str, dict[str, str]]) -> str:
    """A processing profile (.pp3): the neutral one with `changes` by section and key, later ones first."""
    sections = {name: dict(values) for name, values in NEUTRAL.items()}
    for change in changes:
        for name, values in change.items():
            sections.setdefault(name, {}).update(values)
    blocks = []
    for name, values in sections.items():
        blocks.append("\n".join([f"[{name}]", *(f"{key}={value}" for key, value in values.items())]))
    return "\n\n".join(blocks) + "\n"


@dataclass(frozen=True)
class RawTherapee(Developer):
    """Develops in linear Rec. 2020, with white balance as shot and RawTherapee's matrix of the camera."""

    name: str = "rawtherapee"
    program: str = "rawtherapee-cli"
    space: str = "linear-rec2020"
    install: str = "install RawTherapee (apt install rawtherapee, or https://rawtherapee.com/downloads)"

    def command(self, raw: Path, output: Path, folder: Path) -> list[str]:
        """The command of a neutral development to a 16-bit TIFF."""
        settings = folder / "neutral.pp3"
        settings.write_text(profile_text(), encoding="utf-8")
        return [self.program, "-o", str(output), "-p", str(settings), "-t", "-b16", "-Y", "-c", str(raw)]

    def linear(self, pixels: Pixels) -> Pixels:
        """Its Rec. 2020 output profile encodes by sRGB's curve."""
        return rgb_space("rec2020-srgb").decode(pixels).astype(np.float32)
