"""darktable: a cube for the module "lut 3D", a style and a sidecar that place it.

The module's parameters are those of version 1 in darktable's `src/iop/lut3d.c`: a path of 512 bytes, colour space and
interpolation. Later versions of darktable convert them to their own; an earlier version would drop what it does not
know, and show the photograph without the LUT.
"""

import base64
import struct
import zlib
from dataclasses import dataclass
from pathlib import Path
from xml.sax.saxutils import escape, quoteattr

from lutforge.developers.darktable import NEUTRAL, TONE_MODULES
from lutforge.kits.kit import Kit, Look, Source
from lutforge.kits.scripts import write_develop_script
from lutforge.luts.bake import bake

_MODULE_VERSION = 1


@dataclass(frozen=True)
class DarktableKit(Kit):
    """A cube in Adobe RGB, the widest encoded space that the module knows, and a style and a sidecar that place it."""

    program: str = "darktable"
    title: str = "darktable"
    source: Source = "developed"
    tried: str = "darktable 4.2.1 (the sidecar and the style, by darktable-cli; its window was not opened)"

    def write(self, look: Look, folder: Path) -> list[str]:
        """Write the cube, the style, the sidecar and develop.sh."""
        cube = f"{look.file_name}.cube"
        bake(look.within("adobe-rgb"), folder / cube, size=65, interpolation="tetrahedral", title=look.title)
        (folder / f"{look.file_name}.dtstyle").write_text(_style(look, cube), encoding="utf-8")
        (folder / "lutforge.xmp").write_text(_sidecar(cube), encoding="utf-8")
        settings = {**NEUTRAL, "plugins/darkroom/lut3d/def_path": "$here"}
        words = " ".join(f'--conf "{key}={value}"' for key, value in settings.items())
        tones = "\\|".join(TONE_MODULES)
        write_develop_script(
            folder / "develop.sh",
            "darktable-cli",
            look.developer,
            'darktable-cli "$raw" "$here/lutforge.xmp" "$picture" --icc-type SRGB --core --configdir "$work/config" '
            f'--library :memory: {words} >"$work/log" 2>&1 || true\n'
            '[ -s "$picture" ] || refuse "darktable made no picture of it" "$work/log"\n'
            # darktable goes on after a module whose parameters it does not know, or a LUT that it cannot read.
            'grep lut3d "$work/log" | grep -v "out of range" >"$work/lut" && refuse "darktable did not use the LUT" '
            '"$work/lut"\n'
            f"""grep -a -A1 'darktable:operation="\\({tones}\\)"' "$picture" | grep -B1 'enabled="1"' |\n"""
            """  grep -o 'operation="[a-z]*"' >"$work/tone" &&\n"""
            '  refuse "darktable changed the tone in front of the LUT, though it was asked not to" "$work/tone"\n',
        )
        return [
            f'Copy "{cube}" into the folder that darktable names in preferences → processing → "3D lut root folder".',
            f'Import {look.file_name}.dtstyle in the lighttable: styles → import. Its name is "{look.title}".',
            "Apply the style to RAW photographs of this camera whose white balance is as shot.",
            "Switch off filmic rgb, sigmoid, base curve and exposure: they change the tone in front of the LUT. They "
            "stay off with preferences → processing → auto-apply pixel workflow defaults: none.",
        ]


def _parameters(cube: str) -> bytes:
    adobe_rgb, tetrahedral = 1, 0
    return struct.pack("<512sii", cube.encode(), adobe_rgb, tetrahedral)


def _packed(data: bytes) -> str:
    """Bytes as darktable stores them: "gz", the compression factor in two digits, and Base64 of a zlib stream."""
    packed = zlib.compress(data, 9)
    return f"gz{min(len(data) // len(packed) + 1, 99):02d}" + base64.b64encode(packed).decode("ascii")


def _sidecar(cube: str) -> str:
    return f"""<?xml version="1.0" encoding="UTF-8"?>
<x:xmpmeta xmlns:x="adobe:ns:meta/">
 <rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#">
  <rdf:Description rdf:about="" xmlns:darktable="http://darktable.sf.net/"
    darktable:xmp_version="4" darktable:raw_params="0" darktable:history_end="1">
   <darktable:history>
    <rdf:Seq>
     <rdf:li darktable:num="0" darktable:operation="lut3d" darktable:enabled="1"
       darktable:modversion="{_MODULE_VERSION}" darktable:params={quoteattr(_packed(_parameters(cube)))}
       darktable:multi_name="" darktable:multi_priority="0"/>
    </rdf:Seq>
   </darktable:history>
  </rdf:Description>
 </rdf:RDF>
</x:xmpmeta>
"""


def _style(look: Look, cube: str) -> str:
    plugin = (
        f"<plugin><num>0</num><module>{_MODULE_VERSION}</module><operation>lut3d</operation>"
        f"<op_params>{_packed(_parameters(cube))}</op_params><enabled>1</enabled><blendop_params></blendop_params>"
        "<blendop_version>0</blendop_version><multi_priority>0</multi_priority><multi_name></multi_name></plugin>"
    )
    return (
        '<?xml version="1.0" encoding="UTF-8"?>\n<darktable_style version="1.0">'
        f"<info><name>{escape(look.title)}</name><description>the camera's own look, by LutForge</description></info>"
        f"<style>{plugin}</style></darktable_style>\n"
    )
