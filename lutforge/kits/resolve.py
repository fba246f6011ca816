"""DaVinci Resolve: a .cube with a shaper in the project's own space, the same as a .dctl, and a plain .cube."""

from dataclasses import dataclass
from pathlib import Path

from lutforge.kits.kit import Kit, Look, Source
from lutforge.luts.bake import bake


@dataclass(frozen=True)
class ResolveKit(Kit):
    """Takes and gives the project's space: DaVinci Wide Gamut with DaVinci Intermediate, its default."""

    program: str = "resolve"
    title: str = "DaVinci Resolve"
    source: Source = "any"
    tried: str = "the files in OpenColorIO; Resolve itself was not run"
    space: str = "davinci-intermediate"

    def write(self, look: Look, folder: Path) -> list[str]:
        """Write the cube with a shaper, the .dctl with its cube, and the plain cube."""
        stem, look_in_space = f"{look.file_name} {self.space}", look.within(self.space)
        shaped = bake(look_in_space, size=65, form="shaper", display_referred=False, title=look.title)
        for suffix in (".resolve.cube", ".dctl"):
            shaped.write(folder / f"{stem}{suffix}")
        bake(look_in_space, folder / f"{stem}.plain.cube", display_referred=False, title=look.title)
        return [
            "Project settings → Color management: timeline space DaVinci Wide Gamut, gamma DaVinci Intermediate.",
            f'Lookup tables → Open LUT folder: copy "{stem}.resolve.cube" there, and Update lists. Apply it to a node '
            "of footage in the timeline's space.",
            f'Where no shaper is read, use "{stem}.plain.cube". As a program for the effect "DCTL", copy "{stem}.dctl" '
            f'and "{stem}.cube" into one folder.',
        ]
