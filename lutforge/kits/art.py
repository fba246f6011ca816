"""ART: a DNG camera profile, or a CLF file that takes linear ACES2065-1 and gives it back."""

from dataclasses import dataclass
from pathlib import Path

from lutforge.kits.dcp import fit_dng_profile, write_dcp
from lutforge.kits.kit import Kit, Look, Source
from lutforge.luts.bake import bake


@dataclass(frozen=True)
class ArtKit(Kit):
    """A profile of RAW files becomes a .dcp, one of developed pictures a CLF from linear to linear ACES2065-1."""

    program: str = "art"
    title: str = "ART"
    source: Source = "any"
    tried: str = "the .dcp in RawTherapee 5.9, the CLF in OpenColorIO; ART itself was not run"

    def write(self, look: Look, folder: Path) -> list[str]:
        """Write the camera profile or the CLF."""
        if look.space == "raw":
            write_dcp(fit_dng_profile(look), folder / f"{look.file_name}.dcp")
            return [
                f"Color Management → Input Profile → Custom: {look.file_name}.dcp, tone curve and look table ticked."
            ]
        bake(look.within("aces2065-1"), folder / f"{look.file_name}.clf", display_referred=False, title=look.title)
        return [
            f"Copy {look.file_name}.clf into the folder of CLUTs (Preferences → Image Processing), and choose it in "
            "Color → Film Simulation. Keep every other tool neutral.",
        ]
