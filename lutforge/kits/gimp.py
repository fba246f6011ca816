"""GIMP with G'MIC: a cube for neutral pictures encoded in sRGB."""

from dataclasses import dataclass
from pathlib import Path

from lutforge.kits.kit import Look, Source
from lutforge.luts.bake import bake


@dataclass(frozen=True)
class GimpKit:
    """A cube from sRGB to sRGB that gives neutral pictures, such as renders, the camera's look."""

    program: str = "gimp"
    title: str = "GIMP with G'MIC"
    source: Source = "any"
    tried: str = "G'MIC 2.9 (command line)"

    def write(self, look: Look, folder: Path) -> list[str]:
        """Write the table."""
        name = f"{look.file_name}.cube"
        bake(look.within("srgb"), folder / name, size=65, title=look.title)
        return [
            f"Filters → G'MIC → Colors → Apply External CLUT: {name}.",
        ]
