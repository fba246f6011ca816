"""The profile file: a NumPy zip of `profile.json` and the arrays that it names. Read without unpickling."""

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
from lutforge.boundary import reading
from lutforge.errors import ProfileError
from lutforge.interpolation import INTERPOLATIONS
from lutforge.model.falloff import Falloff
from lutforge.model.gamut_map import GamutMap
from lutforge.model.lattice import Lattice
from lutforge.model.profile_data import DIRECTIONS, Diagnosis, Direction, PhysicalModel, PictureStyle, ProfileData
from lutforge.model.response import Response
from lutforge.model.white_balance import WhiteBalance

FORMAT_VERSION = 7
"""The one version that is read: profiles are quickly calibrated again."""


MOST_VALUES = {1: 1 << 16, 2: 3 << 16, 3: 129**3, 4: 3 * 129**3}
"""Numbers of an array by its dimensions: a level axis; a table or centres, 65,536 rows; coverage and values of 129³."""
MOST_CENTRES = 20_000
"""Centres of a gamut map: a fit takes 4,000, and each costs time at every node that is baked."""


def save_profile(profile: ProfileData, path: str | Path) -> None:
    """Write a profile (.npz). The same profile gives the same bytes. Atomic."""
    arrays: dict[str, Array] = {}
    document = {
        "format": "lutforge-profile",
        "version": FORMAT_VERSION,
        "software": f"LutForge {__version__}",
        "camera": profile.camera,
        "raw_camera": profile.raw_camera,
        "raw_transfer": None if profile.raw_transfer is None else profile.raw_transfer.tolist(),
        "matrix": profile.matrix.tolist(),
        "white_balances": {name: asdict(balance) for name, balance in profile.white_balances.items()},
        "styles": {
            name: _style_to_json(style, f"style{index}", arrays)
            for index, (name, style) in enumerate(profile.styles.items())
        },
        "shots": list(profile.shots),
        "options": dict(profile.options),
        "notes": list(profile.notes),
        "falloffs": [_falloff_to_json(falloff) for falloff in profile.falloffs],
        "diagnoses": [asdict(diagnosis) for diagnosis in profile.diagnoses],
    }
    with atomic_path(path) as temporary, zipfile.ZipFile(temporary, "w", zipfile.ZIP_DEFLATED) as archive:
        text = json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False)
        archive.writestr(zipfile.ZipInfo("profile.json"), text, zipfile.ZIP_DEFLATED)
        for name, array in arrays.items():
            # A ZipInfo made by hand carries no clock time: equal profiles are equal files.
            with archive.open(zipfile.ZipInfo(f"{name}.npy"), "w", force_zip64=True) as stream:
                npy.write_array(stream, np.ascontiguousarray(array), allow_pickle=False)


def _style_to_json(style: PictureStyle, prefix: str, arrays: dict[str, Array]) -> dict[str, Any]:
    result: dict[str, Any] = {"errors": {name: float(value) for name, value in style.errors.items()}, "physical": []}
    for direction, lattice in style.lattices.items():
        result[direction] = _lattice_to_json(lattice, f"{prefix}_{direction}", arrays)
        if direction in style.coverage:
            result[direction]["coverage"] = f"{prefix}_{direction}_coverage"
            arrays[f"{prefix}_{direction}_coverage"] = style.coverage[direction]
        if direction in style.expected:
            result[direction]["expected"] = f"{prefix}_{direction}_expected"
            arrays[f"{prefix}_{direction}_expected"] = style.expected[direction].round(5)
    for index, model in enumerate(style.physical):
        base = f"{prefix}_physical{index}"
        maps = {"gamut_map": model.gamut_map, "inverse_gamut_map": model.inverse_gamut_map}
        arrays[f"{base}_response"] = model.response.inverse
        for side, gamut_map in maps.items():
            for part in ("centres", "coefficients", "polynomial"):
                arrays[f"{base}_{side}_{part}"] = getattr(gamut_map, part)
        result["physical"].append(
            {
                "white_balances": list(model.white_balances),
                "matrix": model.matrix.tolist(),
                "arrays": base,
                "offsets": [gamut_map.offset for gamut_map in maps.values()],
                "kernels": [gamut_map.kernel for gamut_map in maps.values()],
            }
        )
    return result


def _lattice_to_json(lattice: Lattice, prefix: str, arrays: dict[str, Array]) -> dict[str, Any]:
    levels = [f"{prefix}_levels_{channel}" for channel in "rgb"]
    arrays[f"{prefix}_values"] = lattice.values
    arrays.update(zip(levels, lattice.levels, strict=True))
    entry: dict[str, Any] = {
        "values": f"{prefix}_values",
        "levels": levels,
        "interpolation": lattice.interpolation,
        "domain": [0.0, 1.0],
    }
    if lattice.output_curve is not None:
        entry["response"] = f"{prefix}_response"
        arrays[entry["response"]] = lattice.output_curve
    return entry


def read_profile(path: str | Path) -> ProfileData:
    """Read what a profile file holds. Raises ProfileError, in one line, on anything that is not one."""
    path = Path(path)
    if path.suffix.lower() == ".csv":
        raise ProfileError(
            f"{path}: not a LutForge profile but a table of samples; run `lutforge calibrate {path} -o camera.npz`"
        )
    if not path.is_file():
        raise ProfileError(f"{path}: no such profile; make one with `lutforge calibrate … -o {path}`")
    if not zipfile.is_zipfile(path):
        raise ProfileError(f"{path}: not a LutForge profile, which is a zip file")
    with reading(path, "a LutForge profile", ProfileError), zipfile.ZipFile(path) as archive:
        document = _read_document(archive)
        options = document["options"]
        if not isinstance(options, dict):
            raise ProfileError("damaged profile, its options are no table")

        def array(name: str) -> Array:
            return _read_array(archive, name)

        styles = {str(name): _style_from_json(entry, array) for name, entry in document["styles"].items()}
        transfer = document["raw_transfer"]
        return ProfileData(
            camera=str(document["camera"]),
            matrix=np.array(document["matrix"], dtype=np.float64),
            white_balances={str(name): _balance(entry) for name, entry in document["white_balances"].items()},
            styles=styles,
            shots=tuple(str(shot) for shot in document["shots"]),
            options=options,
            notes=tuple(str(note) for note in document["notes"]),
            raw_camera=str(document["raw_camera"]),
            raw_transfer=None if transfer is None else np.array(transfer, dtype=np.float64),
            falloffs=tuple(_falloff(entry) for entry in document["falloffs"]),
            diagnoses=tuple(
                Diagnosis(str(entry["cause"]), str(entry["evidence"]), str(entry["advice"]))
                for entry in document["diagnoses"]
            ),
        )


def _read_document(archive: zipfile.ZipFile) -> dict[str, Any]:
    names = archive.namelist()
    if "profile.json" not in names:
        raise ProfileError(
            "not a LutForge profile (it holds no profile.json)"
            + ("; it is a table of samples: run lutforge calibrate with it first" if "raw_r.npy" in names else "")
        )
    if len(names) > 4096 or archive.getinfo("profile.json").file_size > 16 << 20:
        raise ProfileError("refused, it is far larger than any profile")
    document = json.loads(archive.read("profile.json"))
    if not isinstance(document, dict) or document.get("format") != "lutforge-profile":
        raise ProfileError("profile.json is not a LutForge profile")
    version = document.get("version")
    if not isinstance(version, int) or isinstance(version, bool) or version < 1:
        raise ProfileError(f"damaged profile, its version is {version!r:.60}; calibrate again, or find a good copy")
    if version != FORMAT_VERSION:
        advice = "update it" if version > FORMAT_VERSION else "calibrate again"
        raise ProfileError(f"profile version {version}; this LutForge reads version {FORMAT_VERSION}: {advice}")
    return document


def _read_array(archive: zipfile.ZipFile, name: str) -> Array:
    """An array of the profile, whose header is judged before any memory is taken."""
    entry = f"{name}.npy"
    if entry not in archive.namelist():
        raise ProfileError(f"damaged profile, the array {name} is missing")
    size = archive.getinfo(entry).file_size
    if size > 8 * MOST_VALUES[4] + 4096:
        raise ProfileError(f"refused, the array {name} unpacks to {size} bytes")
    with archive.open(entry) as stream:
        if npy.read_magic(stream) != (1, 0):
            raise ProfileError(f"damaged profile, the array {name} has an unknown header")
        shape, _, dtype = npy.read_array_header_1_0(stream)
        if dtype != np.float64 or math.prod(shape) * 8 > size:
            raise ProfileError(f"damaged profile, the array {name} is not float64 of its stated shape")
        rows = MOST_CENTRES if name.endswith("_centres") else MOST_VALUES[1]
        if math.prod(shape) > MOST_VALUES.get(len(shape), 0) or (len(shape) == 2 and shape[0] > rows):
            raise ProfileError(f"refused, the array {name} of shape {shape} is larger than any profile's")
    with archive.open(entry) as stream:
        return np.asarray(npy.read_array(stream, allow_pickle=False))


def _balance(entry: Mapping[str, Any]) -> WhiteBalance:
    r, g, b = (float(value) for value in entry["multipliers"])
    return WhiteBalance((r, g, b), entry["kelvin"], float(entry["spread"]), float(entry["gain"]))


def _falloff_to_json(falloff: Falloff) -> dict[str, Any]:
    """JSON has no NaN: what is not known is null."""
    known = {name: value for name, value in asdict(falloff).items() if value == value}
    return {"focal_mm": None, "aperture": None, **known}


def _falloff(entry: Mapping[str, Any]) -> Falloff:
    a, b, c = (float(value) for value in entry["coefficients"])
    x, y = (float(value) for value in entry["centre"])
    focal_mm, aperture = (math.nan if entry[name] is None else float(entry[name]) for name in ("focal_mm", "aperture"))
    return Falloff((a, b, c), (x, y), str(entry["lens"]), focal_mm, aperture)


def _style_from_json(entry: Mapping[str, Any], array: Callable[[str], Array]) -> PictureStyle:
    lattices: dict[Direction, Lattice] = {}
    coverage: dict[Direction, Array] = {}
    expected: dict[Direction, Array] = {}
    for direction in DIRECTIONS:
        if direction in entry:
            stored = entry[direction]
            lattices[direction] = _lattice_from_json(stored, array)
            if "coverage" in stored:
                coverage[direction] = array(stored["coverage"])
            if "expected" in stored:
                expected[direction] = array(stored["expected"])
    physical = []
    for model in entry["physical"]:
        base = model["arrays"]
        forward, back = (
            GamutMap(
                array(f"{base}_{side}_centres"),
                array(f"{base}_{side}_coefficients"),
                array(f"{base}_{side}_polynomial"),
                float(offset),
                kernel,
            )
            for side, offset, kernel in zip(
                ("gamut_map", "inverse_gamut_map"), model["offsets"], model["kernels"], strict=True
            )
        )
        matrix = np.array(model["matrix"], dtype=np.float64)
        response = Response(array(f"{base}_response"))
        physical.append(PhysicalModel(tuple(map(str, model["white_balances"])), matrix, response, forward, back))
    errors = {str(name): float(value) for name, value in entry["errors"].items()}
    return PictureStyle(lattices.get("render"), lattices.get("linearize"), tuple(physical), errors, coverage, expected)


def _lattice_from_json(stored: Mapping[str, Any], array: Callable[[str], Array]) -> Lattice:
    if stored["interpolation"] not in INTERPOLATIONS:
        raise ProfileError(f"unknown interpolation {stored['interpolation']!r}")
    r, g, b = (array(name) for name in stored["levels"])
    if stored["domain"] != [0.0, 1.0] or any(axis[0] != 0 or axis[-1] != 1 for axis in (r, g, b)):
        raise ProfileError("damaged profile, the node levels of a lattice do not run from 0 to 1")
    response = array(stored["response"]) if "response" in stored else None
    return Lattice((r, g, b), array(stored["values"]), stored["interpolation"], response)
