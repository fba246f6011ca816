"""What programs other than OpenColorIO do with a LUT file, looked up in the table of programs."""

from lutforge.luts.lut_programs import verdicts_on
from lutforge.luts.sequence import Lut
from lutforge.luts.verification import Colour


def kind_of(lut: Lut, dialect: str, domain: tuple[Colour, Colour]) -> str:
    """The kind of a file, by which verdicts are looked up in the table of programs."""
    suffix = lut.metadata.format
    keywords = " ".join(lut.metadata.keywords)
    match suffix, dialect:
        case ".cube", "1D shaper + 3D":
            return ".cube, shaper" if "INPUT_RANGE" in keywords else ".cube, shaper without ranges"
        case ".cube", "1D":
            return ".cube, curve"
        case ".cube", _ if "INPUT_RANGE" in keywords:
            return ".cube, range"
        case ".cube", _ if domain != ((0.0, 0.0, 0.0), (1.0, 1.0, 1.0)):
            return ".cube, domain" if any(domain[0]) else ".cube, domain from 0"
        case ".csp", _:
            return ".csp" if lut.shaper is None else ".csp, bent"
        case ".3dl", _:
            plain = lut.size == 17 and lut.metadata.bits == 12 and "3DMESH" not in keywords
            return ".3dl, 17 nodes, 12 bits" if plain else ".3dl"
    return suffix


def readers_of(lut: Lut, dialect: str, domain: tuple[Colour, Colour]) -> dict[str, str]:
    """What programs other than OpenColorIO do with a file, by program. dialect, domain: as in `check_lut`."""
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
    readers = verdicts_on(kind_of(lut, dialect, domain))
    if suffix == ".cube" and dialect == "3D" and lut.size not in (17, 33, 65):
        readers["cameras and monitors"] = f"often take 17, 33 or 65 nodes per axis only, not {lut.size}"
    return readers
