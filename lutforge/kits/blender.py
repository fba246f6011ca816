"""Blender: an OpenColorIO config whose views show scene-linear renders as the camera would."""

from dataclasses import dataclass
from pathlib import Path

from lutforge.kits.kit import Kit, Look, Source, write_script
from lutforge.ocio.config import write_config


@dataclass(frozen=True)
class BlenderKit(Kit):
    """Blender reads a whole config, named by the environment variable OCIO."""

    program: str = "blender"
    title: str = "Blender"
    source: Source = "raw"
    tried: str = "Blender 3.4.1 (in the background)"

    def write(self, look: Look, folder: Path) -> list[str]:
        """Write the config and a script that starts Blender with it."""
        write_config([look.profile], folder / "ocio", version="2.1")
        write_script(folder / "blender.sh", "blender", 'OCIO="$here/ocio/config.ocio" exec blender "$@"\n')
        return [
            "Start Blender by blender.sh, or with the environment variable OCIO set to ocio/config.ocio.",
            f'Render properties → Color Management: display device "sRGB - Display", view transform "{look.title}".',
        ]
