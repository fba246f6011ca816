"""What programs beside OpenColorIO make of LUT files: by their sources, and by trials."""

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
        case ((".clf" | ".ctf") as kind, _):
            found = {"Resolve, Flame, Baselight, ART": "read CLF" if kind == ".clf" else "Flame reads CTF"}
            found["ffmpeg, Photoshop, darktable"] = "cannot read it: give them a 3D-only .cube"
            return found
        case ".csp", _:
            # Between two knots ffmpeg goes as far up as their distance is, and not all the way (5.1.9, by trials).
            shaped = "reads it; its curve in steps where that has less than some thousand knots"
            found = {"ffmpeg": "reads it" if lut.shaper is None else shaped, "Photoshop, After Effects": "read it"}
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
