"""ffmpeg, OBS Studio and GIMP: a cube for neutral pictures encoded in sRGB."""

from dataclasses import dataclass
from pathlib import Path

from lutforge.kits.kit import Kit, Look
from lutforge.luts.bake import bake


@dataclass(frozen=True)
class SrgbCubeKit(Kit):
    """A cube from sRGB to sRGB that gives neutral pictures, such as renders, the camera's look.

    size: nodes per axis; step: what to do with the file, whose name stands for {}.
    """

    size: int
    step: str

    def write(self, look: Look, folder: Path) -> list[str]:
        """Write the cube."""
        name = f"{look.file_name}.cube"
        bake(look.within("srgb"), folder / name, size=self.size, title=look.title)
        return [self.step.format(name)]


SRGB_CUBE_KITS = (
    SrgbCubeKit(
        "ffmpeg", "ffmpeg", "any", "ffmpeg 5.1 (lut3d)", 65,
        'ffmpeg -i IN.mov -vf "lut3d=file={}:interp=tetrahedral" OUT.mov',
    ),
    SrgbCubeKit(
        "obs", "OBS Studio", "any", "not run; a plain cube, which it reads by its manual", 33,
        "Right-click the source → Filters → + → Apply LUT: {}.",
    ),
    SrgbCubeKit(
        "gimp", "GIMP with G'MIC", "any", "G'MIC 2.9 (command line)", 65,
        "Filters → G'MIC → Colors → Apply External CLUT: {}.",
    ),
)  # fmt: skip
