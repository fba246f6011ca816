"""The verdicts of programs other than OpenColorIO on a LUT file, looked up in the table of programs."""

from lutforge.luts import picture
from lutforge.luts.lut_kind import LutKind
from lutforge.luts.lut_programs import verdicts_on
from lutforge.luts.sequence import Lut
from lutforge.luts.verification import Colour


def kind_of(lut: Lut, domain: tuple[Colour, Colour]) -> LutKind:
    """The kind of a file that was read. domain: lowest and highest input of its first table."""
    has_range = any("INPUT_RANGE" in keyword for keyword in lut.metadata.keywords)
    match lut.metadata.format:
        case ".cube" if lut.cube is None:
            return LutKind.CUBE_OF_CURVE
        case ".cube" if lut.shaper is not None:
            return LutKind.CUBE_WITH_SHAPER if has_range else LutKind.CUBE_WITH_SHAPER_WITHOUT_RANGES
        case ".cube" if has_range:
            return LutKind.CUBE_WITH_RANGE
        case ".cube" if domain != ((0.0, 0.0, 0.0), (1.0, 1.0, 1.0)):
            return LutKind.CUBE_WITH_DOMAIN if any(domain[0]) else LutKind.CUBE_WITH_DOMAIN_FROM_0
        case ".cube":
            return LutKind.CUBE
        case ".csp":
            return LutKind.CSP if lut.shaper is None else LutKind.CSP_WITH_SHAPER
        case ".3dl":
            is_plain = lut.size == 17 and lut.metadata.bits == 12 and "3DMESH" not in lut.metadata.keywords
            return LutKind.FLAME_3DL_17_NODES_12_BITS if is_plain else LutKind.FLAME_3DL
        case ".clf":
            return LutKind.CLF
        case ".ctf":
            return LutKind.CTF
        case picture.HALD:
            return LutKind.HALD
    return LutKind.OTHER


def readers_of(lut: Lut, domain: tuple[Colour, Colour]) -> dict[str, str]:
    """The verdicts of programs other than OpenColorIO on a file, by program. domain: as in `kind_of`."""
    suffix = lut.metadata.format
    if suffix == ".vlt":
        cameras = {"Panasonic Lumix and VariCam cameras": "read it from their card"}
        return {**cameras, "other programs": "cannot read it: give them a 3D-only .cube"}
    if suffix.startswith(("lookup", "strip", "column")):
        return {
            "GPUImage and other shaders, game engines": f"read such pictures: {suffix}",
            "programs of Hald images": "take it for a Hald, if for anything: garbage",
            "other programs": 'write a .cube for them: `lutforge.read_lut("a.png").write("a.cube")`',
        }
    readers = verdicts_on(kind_of(lut, domain))
    if suffix == ".cube" and lut.cube is not None and lut.shaper is None and lut.size not in (17, 33, 65):
        readers["cameras and monitors"] = f"often take 17, 33 or 65 nodes per axis only, not {lut.size}"
    return readers
