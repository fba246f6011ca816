"""RawTherapee: a DNG camera profile, or a HaldCLUT for Film Simulation, and the processing profile that places it.

Film Simulation is fed the picture in the primaries that the last word of the CLUT's file name names, behind sRGB's
curve (https://rawpedia.rawtherapee.com/Film_Simulation).
"""

from dataclasses import dataclass
from pathlib import Path

from lutforge.developers.rawtherapee import profile_text
from lutforge.kits.dcp import fit_dng_profile, write_dcp
from lutforge.kits.kit import Kit, Look, Source
from lutforge.kits.scripts import write_develop_script
from lutforge.luts.bake import bake


@dataclass(frozen=True)
class RawTherapeeKit(Kit):
    """A profile of RAW files becomes a .dcp, one of RawTherapee's own developments a HaldCLUT."""

    program: str = "rawtherapee"
    title: str = "RawTherapee"
    source: Source = "any"
    tried: str = "RawTherapee 5.9 (rawtherapee-cli)"

    def write(self, look: Look, folder: Path) -> list[str]:
        """Write the camera profile or the CLUT, the processing profile and develop.sh."""
        if look.space == "raw":
            name = f"{look.file_name}.dcp"
            write_dcp(fit_dng_profile(look), folder / name)
            change = {
                "InputProfile": f"file:{name}",  # beside the processing profile
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
            # Within the folder of CLUTs: the window shows no others.
            settings = {"Film Simulation": {"Enabled": "true", "ClutFilename": name, "Strength": "100"}}
            step = (
                f'Copy "{name}" into the folder of CLUTs first (Preferences → Image Processing → Directories): the '
                "profile names it there. Keep its name: the last word tells RawTherapee the colour space."
            )
        output = {"Color Management": {"OutputProfile": "RTv4_sRGB"}}
        text = profile_text(settings, output)
        (folder / "lutforge.pp3").write_text(text, encoding="utf-8")
        write_develop_script(
            folder / "develop.sh",
            "rawtherapee-cli",
            look.developer,
            # RawTherapee looks for a CLUT in the user's folder of CLUTs, and for a camera profile beside its .pp3.
            "place=$(printf '%s' \"$here\" | sed 's/[&|\\\\]/\\\\&/g')\n"
            'sed "s|^ClutFilename=|&$place/|; s|^InputProfile=file:|&$place/|" "$here/lutforge.pp3" >"$work/kit.pp3"\n'
            'rawtherapee-cli -o "$picture" -p "$work/kit.pp3" -t -b16 -Y -c "$raw" >"$work/log" 2>&1 || true\n'
            '[ -s "$picture" ] || refuse "RawTherapee made no picture of it" "$work/log"\n',
        )
        return [
            "Open a RAW photograph, and load lutforge.pp3 as its processing profile: it makes everything else neutral.",
            step,
        ]
