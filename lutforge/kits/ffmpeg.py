"""ffmpeg: a cube for neutral pictures encoded in sRGB."""

from dataclasses import dataclass
from pathlib import Path

from lutforge.kits.kit import Look, Source
from lutforge.luts.bake import bake


@dataclass(frozen=True)
class FfmpegKit:
    """A cube from sRGB to sRGB that gives neutral pictures, such as renders, the camera's look."""

    program: str = "ffmpeg"
    title: str = "ffmpeg"
    source: Source = "any"
    tried: str = "ffmpeg 5.1 (lut3d)"

    def write(self, look: Look, folder: Path) -> list[str]:
        """Write the table."""
        name = f"{look.file_name}.cube"
        bake(look.within("srgb"), folder / name, size=65, title=look.title)
        return [
            f'ffmpeg -i IN.mov -vf "lut3d=file={name}:interp=tetrahedral" OUT.mov',
        ]
