"""The file of a profile: a NumPy zip of `profile.json` and of the arrays that it names, read without unpickling.

Files may come from anywhere: what they state is judged before anything is unpacked.
"""

import json
import math
import zipfile
from collections.abc import Callable, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from numpy.lib import format as npy

from lutforge import __version__
from lutforge.arrays import Array
from lutforge.atomic_write import atomic_path
from lutforge.boundary import opened_archive, read_entry, reading
from lutforge.errors import ProfileError
from lutforge.interpolation import INTERPOLATIONS
from lutforge.model.gamut_map import GamutMap
from lutforge.model.inverse_gamut_map import SolvedInverse
from lutforge.model.lattice import Lattice
from lutforge.model.profile import DIRECTIONS, CameraModel, Diagnosis, Direction, PictureStyle, ProfileData
from lutforge.model.provenance import Chart, Developed, OwnRaw, Provenance, ReferenceRaw, ResponseOnly
from lutforge.model.response import Response
from lutforge.model.vignetting import Vignetting
from lutforge.model.white_balance import WhiteBalance

PROFILE_FORMAT = "lutforge-profile"
PROFILE_VERSION = 11
"""The one version that is read: profiles are quickly calibrated again."""

MOST_VALUES = {1: 1 << 16, 2: 3 << 16, 3: 129**3, 4: 3 * 129**3}
"""Numbers of an array by its dimensions: a level axis; a table or centres, 65,536 rows; coverage and values of 129³."""
MOST_STORED_CENTRES = 20_000
"""Centres of a gamut map: a fit takes 4,000, and each costs time at every node that is baked."""
MOST_ENTRIES = {
    "white_balances": 200, "styles": 100, "shots": 20_000, "notes": 2_000, "vignettings": 2_000, "diagnoses": 100,
    "options": 200,
}  # fmt: skip
"""Entries of a part of `profile.json`; the largest profiles have a tenth of that."""
MOST_MODELS = 100
"""Camera models of a style: one for each of its white balances."""
LONGEST_TEXT = 2_000
"""Characters of a text in `profile.json`."""
MOST_JSON = 4 << 20
"""Bytes of `profile.json`, of which Python makes up to forty times as much."""
LEAST_BYTES, MOST_RATIO = 64 << 20, 16
"""Bytes that any file may unpack to, and how many more for each byte of it: fitted numbers pack 1.1 to 4 fold."""
MAP_ARRAYS = ("centres", "coefficients", "polynomial")
"""The arrays of a gamut map."""


def write_profile(path: str | Path, profile: ProfileData) -> None:
    """Write a profile (.npz), atomically: equal profiles are equal files."""
    document, arrays = described(profile)
    stated = {"format": PROFILE_FORMAT, "version": PROFILE_VERSION, "software": f"LutForge {__version__}"} | document
    with atomic_path(path) as temporary, zipfile.ZipFile(temporary, "w", zipfile.ZIP_DEFLATED) as archive:
        text = json.dumps(stated, indent=1, ensure_ascii=False, allow_nan=False)
        archive.writestr(zipfile.ZipInfo("profile.json"), text, zipfile.ZIP_DEFLATED)
        for name, array in arrays.items():
            # A ZipInfo made by hand has no clock time: equal profiles are equal files.
            with archive.open(zipfile.ZipInfo(f"{name}.npy"), "w", force_zip64=True) as stream:
                npy.write_array(stream, np.ascontiguousarray(array), allow_pickle=False)


def described(profile: ProfileData) -> tuple[dict[str, Any], dict[str, Array]]:
    """A JSON object of a profile, and the arrays that it names."""
    arrays: dict[str, Array] = {}
    document = {
        "camera": profile.camera,
        "dng_camera": profile.dng_camera,
        "provenance": _provenance_to_json(profile.provenance),
        "matrix": profile.matrix.tolist(),
        "from_xyz": None if profile.from_xyz is None else profile.from_xyz.tolist(),
        "white_balances": {name: asdict(balance) for name, balance in profile.white_balances.items()},
        "styles": {
            name: _style_to_json(style, f"style{index}", arrays)
            for index, (name, style) in enumerate(profile.styles.items())
        },
        "shots": list(profile.shots),
        "options": dict(profile.options),
        "notes": list(profile.notes),
        "vignettings": [  # JSON has no NaN: what is not known is null
            {name: value if value == value else None for name, value in asdict(vignetting).items()}
            for vignetting in profile.vignettings
        ],
        "diagnoses": [asdict(diagnosis) for diagnosis in profile.diagnoses],
    }
    return document, arrays


def read_profile(path: Path) -> ProfileData:
    """Read a profile file. Raises ProfileError, with a message of one line, if the file is not a valid profile."""
    if path.suffix.lower() == ".csv":
        raise ProfileError(
            f"{path}: not a LutForge profile but a table of samples; run `lutforge calibrate {path} -o camera.npz`"
        )
    if not path.is_file():
        raise ProfileError(f"{path}: no such profile; make one with `lutforge calibrate … -o {path}`")
    if not zipfile.is_zipfile(path):
        raise ProfileError(f"{path}: not a LutForge profile, which is a zip file")
    with reading(path, "a LutForge profile", ProfileError), opened_archive(path, ProfileError) as archive:
        document = _read_document(archive, path.stat().st_size)
        arrays = _Arrays(archive)
        return ProfileData(
            camera=str(document["camera"]),
            matrix=np.array(document["matrix"], dtype=np.float64),
            white_balances={
                str(name): _white_balance_from_json(entry) for name, entry in document["white_balances"].items()
            },
            styles={str(name): _style_from_json(entry, arrays.read) for name, entry in document["styles"].items()},
            shots=tuple(map(str, document["shots"])),
            options=document["options"],
            notes=tuple(map(str, document["notes"])),
            provenance=_provenance_from_json(document["provenance"]),
            vignettings=tuple(map(_vignetting_from_json, document["vignettings"])),
            diagnoses=tuple(
                Diagnosis(str(entry["cause"]), str(entry["evidence"]), str(entry["advice"]))
                for entry in document["diagnoses"]
            ),
            dng_camera=str(document["dng_camera"]),
            from_xyz=None if document["from_xyz"] is None else np.array(document["from_xyz"], dtype=np.float64),
        )


def _provenance_to_json(provenance: Provenance) -> dict[str, Any]:
    match provenance:
        case OwnRaw():
            return {"kind": "own raw"}
        case ReferenceRaw(camera, transfer):
            return {"kind": "reference raw", "camera": camera, "transfer": transfer.tolist()}
        case Developed(program, space):
            return {"kind": "developed", "program": program, "space": space}
        case Chart(name, light, space):
            return {"kind": "chart", "name": name, "light": light, "space": space}
        case ResponseOnly():
            return {"kind": "response only"}


def _provenance_from_json(entry: Mapping[str, Any]) -> Provenance:
    match entry["kind"]:
        case "own raw":
            return OwnRaw()
        case "reference raw":
            return ReferenceRaw(str(entry["camera"]), np.array(entry["transfer"], dtype=np.float64))
        case "developed":
            return Developed(str(entry["program"]), str(entry["space"]))
        case "chart":
            return Chart(str(entry["name"]), str(entry["light"]), str(entry["space"]))
        case "response only":
            return ResponseOnly()
        case kind:
            raise ProfileError(f"damaged profile, its provenance is {kind!r:.60}")


def _white_balance_from_json(entry: Mapping[str, Any]) -> WhiteBalance:
    r, g, b = map(float, entry["multipliers"])
    return WhiteBalance((r, g, b), entry["kelvin"], float(entry["spread"]), float(entry["gain"]))


def _vignetting_from_json(entry: Mapping[str, Any]) -> Vignetting:
    r2, r4, r6 = map(float, entry["coefficients"])
    x, y = map(float, entry["centre"])
    focal_mm, aperture = (math.nan if entry[name] is None else float(entry[name]) for name in ("focal_mm", "aperture"))
    red, green, blue = (tuple(map(float, channel)) for channel in entry["shading"])
    return Vignetting((r2, r4, r6), (x, y), str(entry["lens"]), focal_mm, aperture, (red, green, blue))


def _style_to_json(style: PictureStyle, prefix: str, arrays: dict[str, Array]) -> dict[str, Any]:
    """Describe a style; its arrays join the others under the names that the description gives them."""

    def stored(name: str, array: Array) -> str:
        arrays[f"{prefix}_{name}"] = array
        return f"{prefix}_{name}"

    result: dict[str, Any] = {"errors": {name: float(value) for name, value in style.errors.items()}, "models": []}
    for direction, lattice in style.lattices.items():
        result[direction] = {
            "values": stored(f"{direction}_values", lattice.values),
            "levels": [stored(f"{direction}_levels_{c}", axis) for c, axis in zip("rgb", lattice.levels, strict=True)],
            "interpolation": lattice.interpolation,
            "domain": [0.0, 1.0],
        }
        for part, array in (
            ("response", lattice.output_curve),  # so named in files, as the curve of a camera is made from f
            ("input_matrix", lattice.input_matrix),
            ("coverage", style.coverage.get(direction)),
        ):
            if array is not None:
                result[direction][part] = stored(f"{direction}_{part}", array)
    for index, model in enumerate(style.models):
        base = f"model{index}"
        stored(f"{base}_response", model.response.inverse)
        inverse = model.inverse_gamut_map
        if isinstance(inverse, SolvedInverse):
            stored(f"{base}_likely", inverse.likely)
            stored_inverse: dict[str, Any] = {"top": inverse.top}
        else:
            stored_inverse = _map_to_json(f"{base}_inverse_gamut_map", inverse, stored)
        result["models"].append(
            {
                "white_balances": list(model.white_balances),
                "matrix": model.matrix.tolist(),
                "arrays": f"{prefix}_{base}",
                "gamut_map": _map_to_json(f"{base}_gamut_map", model.gamut_map, stored),
                "inverse_gamut_map": stored_inverse,
            }
        )
    return result


def _map_to_json(base: str, gamut_map: GamutMap, stored: Callable[[str, Array], str]) -> dict[str, Any]:
    """Describe a gamut map; its arrays are stored under names that begin with `base`."""
    for part in MAP_ARRAYS:
        stored(f"{base}_{part}", getattr(gamut_map, part))
    parts = ("offset", "kernel", "roughness", "correction_offset")
    return {part: getattr(gamut_map, part) for part in parts}


def _map_from_json(entry: Mapping[str, Any], base: str, array: Callable[[str], Array]) -> GamutMap:
    centres, weights, trend = (array(f"{base}_{part}") for part in MAP_ARRAYS)
    offset, roughness, of_corrections = (float(entry[part]) for part in ("offset", "roughness", "correction_offset"))
    return GamutMap(centres, weights, trend, offset, entry["kernel"], roughness, of_corrections)


def _style_from_json(entry: Mapping[str, Any], array: Callable[[str], Array]) -> PictureStyle:
    lattices: dict[Direction, Lattice] = {}
    arrays_of: dict[str, dict[Direction, Array]] = {"response": {}, "input_matrix": {}, "coverage": {}}
    for direction in DIRECTIONS:
        if direction not in entry:
            continue
        stored = entry[direction]
        if stored["interpolation"] not in INTERPOLATIONS:
            raise ProfileError(f"unknown interpolation {stored['interpolation']!r}")
        r, g, b = (array(name) for name in stored["levels"])
        if stored["domain"] != [0.0, 1.0] or any(axis[0] != 0 or axis[-1] != 1 for axis in (r, g, b)):
            raise ProfileError("damaged profile, the node levels of a lattice do not run from 0 to 1")
        for part, arrays in arrays_of.items():
            if part in stored:
                arrays[direction] = array(stored[part])
        output_curve = arrays_of["response"].get(direction)  # so named in files, see `_style_to_json`
        input_matrix = arrays_of["input_matrix"].get(direction)
        lattices[direction] = Lattice(
            (r, g, b), array(stored["values"]), stored["interpolation"], output_curve, input_matrix
        )
    models = []
    if len(entry["models"]) > MOST_MODELS:
        raise ProfileError(f"refused, a style has {len(entry['models'])} models, more than any profile's")
    for model in entry["models"]:
        base = model["arrays"]
        gamut_map = _map_from_json(model["gamut_map"], f"{base}_gamut_map", array)
        described = model["inverse_gamut_map"]
        matrix = np.array(model["matrix"], dtype=np.float64)
        inverse: GamutMap | SolvedInverse
        if "top" in described:
            inverse = SolvedInverse(gamut_map, matrix, array(f"{base}_likely"), float(described["top"]))
        else:
            inverse = _map_from_json(described, f"{base}_inverse_gamut_map", array)
        response = Response(array(f"{base}_response"))
        balances = tuple(map(str, model["white_balances"]))
        models.append(CameraModel(balances, matrix, response, gamut_map, inverse))
    errors = {str(name): float(value) for name, value in entry["errors"].items()}
    sides = lattices.get("render"), lattices.get("linearize")
    return PictureStyle(*sides, tuple(models), errors, arrays_of["coverage"])


def _read_document(archive: zipfile.ZipFile, size: int) -> dict[str, Any]:
    """`profile.json`, judged before anything is unpacked. size: of the file in bytes. Raises ProfileError."""
    names = archive.namelist()
    if "profile.json" not in names:
        raise ProfileError(
            "not a LutForge profile (it holds no profile.json)"
            + ("; it is a table of samples: run lutforge calibrate with it first" if "raw_r.npy" in names else "")
        )
    if len(names) > 4096 or archive.getinfo("profile.json").file_size > MOST_JSON:
        raise ProfileError("refused, it is far larger than any profile")
    unpacked = sum(entry.file_size for entry in archive.infolist())
    if unpacked > LEAST_BYTES + MOST_RATIO * size:
        raise ProfileError(f"refused, it unpacks to {unpacked:,} bytes, more than any profile of its size")
    document = json.loads(read_entry(archive, "profile.json"))
    if not isinstance(document, dict) or document.get("format") != PROFILE_FORMAT:
        raise ProfileError("profile.json is not a LutForge profile")
    version = document.get("version")
    if not isinstance(version, int) or isinstance(version, bool) or version < 1:
        raise ProfileError(f"damaged profile, its version is {version!r:.60}; calibrate again, or find a good copy")
    if version != PROFILE_VERSION:
        advice = "update it" if version > PROFILE_VERSION else "calibrate again"
        raise ProfileError(f"profile version {version}; this LutForge reads version {PROFILE_VERSION}: {advice}")
    if not isinstance(document["options"], dict):
        raise ProfileError("damaged profile, its options are no table")
    for part, most in MOST_ENTRIES.items():
        entries = document[part]
        if len(entries) > most:
            raise ProfileError(f"refused, it has {len(entries)} {part.replace('_', ' ')}, more than any profile's")
        if any(isinstance(text, str) and len(text) > LONGEST_TEXT for text in entries):
            raise ProfileError(f"refused, a text of its {part.replace('_', ' ')} is longer than any profile's")
    return document


class _Arrays:
    """The arrays of a profile, each of which is read once: a style that names another's is damaged."""

    def __init__(self, archive: zipfile.ZipFile) -> None:
        self.archive = archive
        self.unread = {name.removesuffix(".npy") for name in archive.namelist() if name.endswith(".npy")}
        self.names = frozenset(self.unread)

    def read(self, name: str) -> Array:
        """Read an array by its name in `profile.json`. Raises ProfileError where it is none, or was read before."""
        if name not in self.unread:
            state = "named twice" if name in self.names else "missing"
            raise ProfileError(f"damaged profile, the array {name} is {state}")
        self.unread.remove(name)
        return _read_array(self.archive, name)


def _read_array(archive: zipfile.ZipFile, name: str) -> Array:
    """An array of the profile, whose header is judged before any memory is taken."""
    entry = f"{name}.npy"
    size = archive.getinfo(entry).file_size
    if size > 8 * MOST_VALUES[4] + 4096:
        raise ProfileError(f"refused, the array {name} unpacks to {size} bytes")
    with archive.open(entry) as stream:
        if npy.read_magic(stream) != (1, 0):
            raise ProfileError(f"damaged profile, the array {name} has an unknown header")
        shape, _, dtype = npy.read_array_header_1_0(stream)
        if dtype != np.float64 or math.prod(shape) * 8 > size:
            raise ProfileError(f"damaged profile, the array {name} is not float64 of its stated shape")
        rows = MOST_STORED_CENTRES if name.endswith("_centres") else MOST_VALUES[1]
        if math.prod(shape) > MOST_VALUES.get(len(shape), 0) or (len(shape) == 2 and shape[0] > rows):
            raise ProfileError(f"refused, the array {name} of shape {shape} is larger than any profile's")
    with archive.open(entry) as stream:
        return np.asarray(npy.read_array(stream, allow_pickle=False))
