"""Lumix bodies: a table from V-Log to the look, as REAL TIME LUT loads it."""

from dataclasses import dataclass
from pathlib import Path

from lutforge.kits.kit import Kit, Look, Source
from lutforge.luts.bake import bake


@dataclass(frozen=True)
class LumixKit(Kit):
    """A cube of 17³ nodes from V-Log to sRGB, as the camera's own LUTs are."""

    program: str = "lumix"
    title: str = "Lumix bodies"
    source: Source = "any"
    tried: str = "not run; the file by a second parser"

    def write(self, look: Look, folder: Path) -> list[str]:
        """Write the table."""
        name = f"{look.style}.vlt"
        bake(look.between("vlog", "srgb"), folder / name, size=17, title=look.title)
        return [
            f"Copy {name} to the memory card, then Photo Style → REAL TIME LUT (or V-Log View Assist) → load it.",
            "It takes V-Log and gives the look for a display (sRGB).",
        ]
