"""OBS Studio: a cube for neutral pictures encoded in sRGB."""

from dataclasses import dataclass
from pathlib import Path

from lutforge.kits.kit import Look, Source
from lutforge.luts.bake import bake


@dataclass(frozen=True)
class ObsKit:
    """A cube from sRGB to sRGB that gives neutral pictures, such as renders, the camera's look."""

    program: str = "obs"
    title: str = "OBS Studio"
    source: Source = "any"
    tried: str = "not run; a plain cube, which it reads by its manual"

    def write(self, look: Look, folder: Path) -> list[str]:
        """Write the table."""
        name = f"{look.file_name}.cube"
        bake(look.within("srgb"), folder / name, size=33, title=look.title)
        return [
            f"Right-click the source → Filters → + → Apply LUT: {name}.",
        ]
