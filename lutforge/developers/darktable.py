"""darktable: `darktable-cli` with an empty history (https://docs.darktable.org, special topics, darktable-cli)."""

import re
from dataclasses import dataclass
from pathlib import Path

from lutforge.developers.developer import Developer

NEUTRAL = {
    "plugins/darkroom/workflow": "none",
    "plugins/darkroom/chromatic-adaptation": "legacy",
    "plugins/imageio/format/tiff/bpp": "16",
}
"""Settings of a neutral development: no tone curve or exposure, white balance as shot on the camera's own RGB."""

TONE_MODULES = ("agx", "basecurve", "channelmixerrgb", "exposure", "filmicrgb", "sigmoid")
"""Modules that darktable's workflows switch on by themselves: none of them belongs to a neutral development."""


@dataclass(frozen=True)
class Darktable(Developer):
    """Develops in linear Rec. 2020, with white balance as shot and darktable's input matrix."""

    name: str = "darktable"
    program: str = "darktable-cli"
    space: str = "linear-rec2020"
    install: str = "install darktable (apt install darktable, or https://www.darktable.org/install)"

    def command(self, raw: Path, output: Path, folder: Path) -> list[str]:
        """The command of a neutral development to a 16-bit TIFF."""
        settings = [word for key, value in NEUTRAL.items() for word in ("--conf", f"{key}={value}")]
        own = ["--core", "--configdir", str(folder / "config"), "--library", ":memory:"]
        return [self.program, str(raw), str(output), "--icc-type", "LIN_REC2020", *own, *settings]

    def objection(self, output: Path) -> str:
        """Name the modules that ran although none was asked for: the TIFF holds the history of its development."""
        ran = re.findall(rb'darktable:operation="(\w+)"\s+darktable:enabled="1"', output.read_bytes())
        unwanted = [name for name in TONE_MODULES if name.encode() in ran]
        return f"it used {', '.join(unwanted)} although asked for no workflow" if unwanted else ""
