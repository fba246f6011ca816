"""RawTherapee: a DNG camera profile, or a HaldCLUT for Film Simulation, and the processing profile that places it.

Film Simulation is fed the picture in the primaries that the last word of the CLUT's file name names, behind sRGB's
curve (https://rawpedia.rawtherapee.com/Film_Simulation).
"""

from dataclasses import dataclass
from pathlib import Path

from lutforge.developers.rawtherapee import profile_text
from lutforge.kits.dcp import fit_dng_profile, write_dcp
from lutforge.kits.kit import Look, Source
from lutforge.kits.scripts import write_develop_script
from lutforge.luts.bake import bake

_PLACE = "@KIT@"
"""Stands for the kit's folder in the processing profile, which needs whole paths."""


@dataclass(frozen=True)
class RawTherapeeKit:
    """A profile of RAW files becomes a .dcp, one of RawTherapee's own developments a HaldCLUT."""

    program: str = "rawtherapee"
    title: str = "RawTherapee"
    source: Source = "any"
    tried: str = "RawTherapee 5.9 (rawtherapee-cli)"

    def write(self, look: Look, folder: Path) -> list[str]:
        """Write the camera profile or the CLUT, the processing profile and develop.sh."""
        if look.space == "raw":
            name = f"{look.style}.dcp"
            write_dcp(fit_dng_profile(look), folder / name)
            change = {
                "InputProfile": f"file:{_PLACE}/{name}",
                "ToneCurve": "true",
                "ApplyLookTable": "true",
            }
            settings = {"Color Management": change}
            step = (
                f"Color tab → Color Management → Input Profile → Custom: {name}, with tone curve and look table ticked."
            )
        else:
            name = f"{look.file_name} Rec2020.png"
            bake(look.within("rec2020-srgb"), folder / name, title=look.title)
            settings = {"Film Simulation": {"Enabled": "true", "ClutFilename": f"{_PLACE}/{name}", "Strength": "100"}}
            step = (
                f'Copy "{name}" into the folder of CLUTs (Preferences → Image Processing → Directories), and choose it '
                "in Color tab → Film Simulation. Keep its name: the last word tells RawTherapee the colour space."
            )
        output = {"Color Management": {"OutputProfile": "RTv4_sRGB"}}
        text = profile_text(settings, output)
        (folder / "lutforge.pp3").write_text(text, encoding="utf-8")
        write_develop_script(
            folder / "develop.sh",
            "rawtherapee-cli",
            "place=$(printf '%s' \"$here\" | sed 's/[&|\\\\]/\\\\&/g')\n"
            f'sed "s|{_PLACE}|$place|" "$here/lutforge.pp3" > "$work/lutforge.pp3"\n'
            'rawtherapee-cli -o "$2" -p "$work/lutforge.pp3" -t -b16 -Y -c "$1" >/dev/null\n'
            'if [ ! -s "$2" ]; then echo "RawTherapee made no picture of $1" >&2; exit 1; fi\n',
        )
        return [
            "Open a RAW photograph, and load lutforge.pp3 as its processing profile: it makes everything else neutral.",
            step,
        ]
