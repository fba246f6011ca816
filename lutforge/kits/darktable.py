"""darktable's kit: ICC profiles for its module *input color profile*, and styles and sidecars that choose them.

The module's parameters are those of version 7 in darktable's `src/iop/colorin.c` (darktable 3.4 to 4.2), which later
versions convert: kind of profile, its file name in 512 bytes, intent, clipping gamut, blue mapping, and the same of the
working profile. An earlier version of darktable would ignore the module, and show its own colours.
"""

import base64
import struct
import zlib
from pathlib import Path
from xml.sax.saxutils import escape, quoteattr

from lutforge.kits.camera_profiles import write_icc_profiles
from lutforge.kits.icc import Variant
from lutforge.kits.kit import KitFiles, Look

NEUTRAL_SETTINGS = {
    "plugins/darkroom/workflow": "none",
    "plugins/darkroom/chromatic-adaptation": "legacy",
    "plugins/imageio/format/tiff/bpp": "16",
}
"""Settings of a neutral development: no tone curve or exposure, white balance as shot on the camera's own RGB."""

TONE_MODULES = ("agx", "basecurve", "channelmixerrgb", "exposure", "filmicrgb", "sigmoid")
"""Modules that darktable's workflows switch on by themselves, and that change the look."""

SWITCHED_OFF = {
    "exposure": (6, struct.pack("<i4fi", 0, 0.0, 0.0, 50.0, -4.0, 1)),
    "channelmixerrgb": (3, bytes(160)),
    "basecurve": (6, struct.pack("<4f464x3i3ii2fi", 0, 0, 1, 1, 2, 2, 2, 2, 2, 2, 0, 1.0, 1.0, 0)),
    "sigmoid": (1, struct.pack("<4fif", 1.5, 0.0, 100.0, 0.0152, 0, 100.0)),
    "filmicrgb": (6, bytes(116)),
}
"""The modules that a style switches off, since darktable's workflows may have switched them on, with version and
parameters.

Of the parameters of a module that is off only their length matters; it is that of darktable 4.2.
"""

_MODULE_VERSION = 7


def write_darktable(look: Look, folder: Path) -> KitFiles:
    """Write profiles of the look, and of the colours alone, each with a style and a sidecar."""
    errors = write_icc_profiles(look, folder)
    for variant in Variant:
        name = f"{look.file_name}{variant.value}"
        (folder / f"{name}.dtstyle").write_text(_style(f"{look.title}{variant.value}", name), encoding="utf-8")
        (folder / f"{name}.xmp").write_text(_sidecar(name), encoding="utf-8")
    steps = [
        "If the kit was not made with --install: copy the .icc files into the folder color/in of darktable's settings "
        "(~/.config/darktable/color/in on Linux; make it where it is missing). Then start darktable again.",
        "Lighttable → styles → import: the .dtstyle files. Apply one to RAW photographs of this camera; it switches "
        "off what would be a second tone curve or balance.",
        f'"{look.title}" is the camera\'s JPEG. "{look.title} colours" leaves its tone curve out, for your own '
        "tone mapper after it: sigmoid, filmic rgb or AgX.",
    ]
    return KitFiles(steps, errors)


def _parameters(name: str) -> str:
    """The parameters of the module *input color profile* that choose a profile."""
    kind_file = 0
    intent_perceptual = 0
    clipping_off = 0
    blue_mapping_off = 0
    working_linear_rec2020 = 4
    numbers = (intent_perceptual, clipping_off, blue_mapping_off, working_linear_rec2020)
    return _packed(struct.pack("<i512s4i512x", kind_file, f"{name}.icc".encode(), *numbers))


def _packed(data: bytes) -> str:
    """Bytes as darktable stores them: "gz", a factor in two digits, a zlib stream in Base64."""
    packed = zlib.compress(data, 9)
    return f"gz{min(len(data) // len(packed) + 1, 99):02d}" + base64.b64encode(packed).decode("ascii")


def _sidecar(name: str) -> str:
    """A sidecar file (.xmp), whose only step is the module *input color profile*."""
    return f"""<?xml version="1.0" encoding="UTF-8"?>
<x:xmpmeta xmlns:x="adobe:ns:meta/">
 <rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#">
  <rdf:Description rdf:about="" xmlns:darktable="http://darktable.sf.net/"
    darktable:xmp_version="4" darktable:raw_params="0" darktable:auto_presets_applied="1"
    darktable:history_end="1">
   <darktable:history>
    <rdf:Seq>
     <rdf:li darktable:num="0" darktable:operation="colorin" darktable:enabled="1"
       darktable:modversion="{_MODULE_VERSION}" darktable:params={quoteattr(_parameters(name))}
       darktable:multi_name="" darktable:multi_priority="0"/>
    </rdf:Seq>
   </darktable:history>
  </rdf:Description>
 </rdf:RDF>
</x:xmpmeta>
"""


def _style(title: str, name: str) -> str:
    """A style: it chooses the profile, and switches off what darktable's workflows have switched on."""
    modules = [("colorin", _MODULE_VERSION, _parameters(name), 1)]
    modules += [(module, version, _packed(data), 0) for module, (version, data) in SWITCHED_OFF.items()]
    plugins = "".join(
        f"<plugin><num>{number}</num><module>{version}</module><operation>{module}</operation>"
        f"<op_params>{parameters}</op_params><enabled>{enabled}</enabled><blendop_params></blendop_params>"
        "<blendop_version>0</blendop_version><multi_priority>0</multi_priority><multi_name></multi_name></plugin>"
        for number, (module, version, parameters, enabled) in enumerate(modules)
    )
    return (
        '<?xml version="1.0" encoding="UTF-8"?>\n<darktable_style version="1.0">'
        f"<info><name>{escape(title)}</name><description>the camera's own look, by LutForge</description></info>"
        f"<style>{plugins}</style></darktable_style>\n"
    )


_CONFIGURATION = " ".join(f'--conf "{key}={value}"' for key, value in NEUTRAL_SETTINGS.items())
_TONES = "\\|".join(TONE_MODULES)
DARKTABLE_LINES = (
    'mkdir -p "$work/config/color/in"\ncp "$here"/*.icc "$work/config/color/in"\n'
    'darktable-cli "$raw" "$here/$look.xmp" "$picture" --icc-type SRGB --core --configdir "$work/config" '
    f'--library :memory: {_CONFIGURATION} >"$work/log" 2>&1 || true\n'
    '[ -s "$picture" ] || refuse "darktable made no picture of it" "$work/log"\n'
    # darktable does not stop at a module with unknown parameters, or at a profile that it cannot read.
    'grep colorin "$work/log" >"$work/use" && refuse "darktable did not use the profile" "$work/use"\n'
    f"""grep -a -A1 'darktable:operation="\\({_TONES}\\)"' "$picture" | grep -B1 'enabled="1"' |\n"""
    """  grep -o 'operation="[a-z]*"' >"$work/tone" &&\n"""
    '  refuse "darktable changed the tone, though it was asked not to" "$work/tone"\n'
)
"""The lines of a script that run darktable-cli, with settings apart from the user's."""
