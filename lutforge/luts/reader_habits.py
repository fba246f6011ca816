"""What programs beside OpenColorIO make of LUT files: by their sources, and by trials."""

import numpy as np

from lutforge.luts.ops import Curve
from lutforge.luts.sequence import Lut

Colour = tuple[float, float, float]


def readers_of(lut: Lut, dialect: str, domain: tuple[Colour, Colour]) -> dict[str, str]:
    """What programs other than OpenColorIO make of such a file, by name of the program."""
    match lut.metadata.get("format"), dialect:
        case ".cube", "1D shaper + 3D":
            refuses = "INPUT_RANGE" in lut.metadata.get("keywords", "")
            wrong = "refuses it" if refuses else "reads it without a word and renders wrong colours"
            return {
                "DaVinci Resolve": "reads it, shaper included",
                "ffmpeg, Kdenlive, Shotcut": f"{wrong}: give it a 3D-only .cube or a .csp",
                "OBS": "loads the 1D part only: wrong colours",
                "G'MIC, GIMP, OpenShot": "read wrong colours",
                "darktable": "refuses it",
                "Premiere, After Effects, Photoshop, Final Cut": "do not expect them to read the shaper",
            }
        case ".cube", "3D":
            return _plain_cube_readers(lut.size, domain)
        case ".cube", _:
            return {"ffmpeg lut1d, Resolve, OBS": "read it", "programs of 3D LUTs": "refuse it, or misread it"}
        case (("CLF" | "CTF") as kind, _):
            found = {"Resolve, Flame, Baselight, ART": "read CLF" if kind == "CLF" else "Flame reads CTF"}
            if "namespace" in lut.metadata:
                found["colour-clf-io 0.2.0"] = "refuses its namespace (SMPTE ST 2136-1)"
            found["ffmpeg, Photoshop, darktable"] = "cannot read it: give them a 3D-only .cube"
            return found
        case ".csp", _:
            found = {"ffmpeg": _ffmpeg_shaper(lut.shaper), "Photoshop, After Effects": "read it"}
            return found | {"Resolve, darktable": "do not read .csp"}
        case ".3dl", _:
            return _3dl_readers(lut)
        case "Hald image", _:
            return {"RawTherapee, ART, ImageMagick, G'MIC, darktable": "read it", "video programs": "mostly do not"}
        case ((".spi1d" | ".spi3d"), _):
            return {"other programs": "mostly do not read it; it belongs in an OpenColorIO config"}
        case ".dctl", _:
            return {"Resolve": "reads it", "other programs": "do not read it"}
        case _:
            return {"other programs": "mostly do not read it"}


def _ffmpeg_shaper(curve: Curve | None) -> str:
    """What ffmpeg makes of the curve of a .csp.

    Between two knots it goes as far up as their distance is, and not all the way to the next (5.1.9, by trials; within
    a code of them).
    """
    if curve is None:
        return "reads it"
    knots = curve.inputs
    if knots is None:
        knots = np.linspace(curve.low, curve.high, len(curve.outputs))[:, None].repeat(3, axis=1)
    off = 0.0
    for x, y in zip(knots.T, curve.outputs.T, strict=True):
        codes = np.linspace(x[0], x[-1], 256)
        at = np.clip(np.searchsorted(x, codes, side="right") - 1, 0, len(x) - 2)
        off = max(off, float(np.abs((y[at + 1] - y[at]) * (codes - x[at]) * (1 / np.diff(x)[at] - 1)).max()))
    if 255 * off < 2:
        return "reads it"
    return f"reads the curve in steps, up to {255 * off:.0f} codes of 255 off: give it 4096 entries"


def _3dl_readers(lut: Lut) -> dict[str, str]:
    """ffmpeg skips one line and takes the rest for 17³ rows of 12 bits (libavfilter/vf_lut3d.c, parse_3dl)."""
    found = {"Flame, Lustre, darktable": "read it"}
    if "3DMESH" in lut.metadata.get("keywords", ""):
        found["ffmpeg"] = "cannot read a .3dl that begins with 3DMESH"
    elif lut.size != 17:
        found["ffmpeg"] = f"takes 17 nodes per axis only, not {lut.size}: garbage"
    elif lut.metadata.get("bits") != "12":
        found["ffmpeg"] = f"takes the numbers for 12 bits, not {lut.metadata.get('bits')}: wrong colours"
    else:
        found["ffmpeg"] = "reads it"
    return found


def _plain_cube_readers(size: int, domain: tuple[Colour, Colour]) -> dict[str, str]:
    low, high = domain
    found = {"Resolve, Premiere, Photoshop, Final Cut, ffmpeg, OBS, darktable, G'MIC": "read it"}
    if (low, high) != ((0.0, 0.0, 0.0), (1.0, 1.0, 1.0)):
        found = {
            "Resolve, Premiere, Photoshop": "read it",
            "darktable": "refuses a domain other than 0 to 1",
            "G'MIC, OpenShot, OBS": "ignore the domain: wrong colours",
            "ffmpeg": "misreads a domain that does not begin at 0" if any(low) else "reads it",
        }
    if size > 64:
        found["After Effects before 2022"] = f"takes up to 64 nodes per axis, not {size}"
    if size > 129:
        found["OpenColorIO, Nuke"] = f"takes up to 129 nodes per axis, not {size}"
    elif size not in (17, 33, 65):
        found["cameras and monitors"] = f"often take 17, 33 or 65 nodes per axis only, not {size}"
    return found
