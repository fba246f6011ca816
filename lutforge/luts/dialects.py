"""The programs that read LUT files, and what each of them takes."""

import re
import unicodedata
from dataclasses import dataclass
from pathlib import Path

from lutforge.interpolation import Interpolation


@dataclass(frozen=True)
class Dialect:
    """What a program takes. shaper: reads a .cube with a shaper; max_size: most nodes per axis; reads: suffixes."""

    shaper: bool
    reads: tuple[str, ...]
    max_size: int = 129
    size: int = 65
    interpolation: Interpolation = "trilinear"
    use: str = ""


OCIO_READS = (".clf", ".ctf", ".cube", ".csp", ".cub", ".lut", ".3dl", ".spi1d", ".spi3d")
HALD = (".png", ".tif", ".tiff")
DIALECTS: dict[str, Dialect] = {
    "resolve": Dialect(shaper=True, reads=(".cube", ".clf"), use="put it into the LUT folder, then Refresh"),
    "nuke": Dialect(shaper=True, reads=OCIO_READS, use="OCIOFileTransform, not Vectorfield, reads the shaper"),
    "ocio": Dialect(shaper=True, reads=OCIO_READS),
    "oiio": Dialect(shaper=True, reads=OCIO_READS, interpolation="tetrahedral"),
    "baselight": Dialect(shaper=False, reads=(".cub", ".clf", ".cube")),
    "flame": Dialect(shaper=False, reads=(".clf", ".ctf", ".3dl", ".csp", ".cube")),
    "houdini": Dialect(shaper=True, reads=OCIO_READS),
    "blender": Dialect(shaper=True, reads=OCIO_READS, use="through an OpenColorIO config: lutforge config"),
    "photoshop": Dialect(shaper=False, reads=(".cube", ".3dl", ".csp")),
    "lightroom": Dialect(shaper=False, reads=(".cube",), size=33, use="in a profile made with Camera Raw"),
    "premiere": Dialect(shaper=False, reads=(".cube", ".3dl")),
    "aftereffects": Dialect(shaper=False, reads=(".cube", ".3dl", ".csp"), max_size=64, size=64),
    "finalcut": Dialect(shaper=False, reads=(".cube",)),
    "affinity": Dialect(shaper=False, reads=(".cube", ".3dl", ".csp")),
    "ffmpeg": Dialect(shaper=False, reads=(".cube", ".csp", ".3dl"), interpolation="tetrahedral"),
    "mlt": Dialect(shaper=False, reads=(".cube", ".csp", ".3dl"), interpolation="tetrahedral"),
    "obs": Dialect(shaper=False, reads=(".cube",)),
    "darktable": Dialect(
        shaper=False,
        reads=(".cube", ".3dl", ".png"),
        interpolation="tetrahedral",
        use="module lut 3D, colour space sRGB",
    ),
    "rawtherapee": Dialect(shaper=False, reads=HALD, use="Film Simulation, its folder in the preferences"),
    "art": Dialect(shaper=False, reads=(*HALD, ".clf")),
    "gmic": Dialect(shaper=False, reads=(".cube", ".png")),
    "gimp": Dialect(shaper=False, reads=(".cube", ".png"), use="through G'MIC: Apply External CLUT"),
    "imagemagick": Dialect(shaper=False, reads=HALD),
}
"""Programs that `--for` names, and what their readers take."""


def files_for(program: str, title: str) -> dict[Path, str | None]:
    """File names for a program, and the dialect of each; where it reads a shaper, a plain cube as the fallback, too."""
    stem = "_".join(re.findall(r"[\w+.-]+", unicodedata.normalize("NFKD", title).encode("ascii", "ignore").decode()))[
        :100
    ]
    dialect = DIALECTS[program]
    first = f"{stem or 'lut'}{dialect.reads[0]}"
    if dialect.shaper or dialect.reads[0] in (".clf", ".cub"):
        return {Path(first): program, Path(f"{stem or 'lut'}.plain.cube"): None}
    return {Path(first): program}
