"""The profile file: a NumPy zip of `profile.json` and the arrays that it names. Read without unpickling."""

import json
import math
import zipfile
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.lib import format as npy

from lutforge import __version__
from lutforge.arrays import Array
from lutforge.atomic_write import atomic_path
from lutforge.errors import ProfileError
from lutforge.interpolation import INTERPOLATIONS
from lutforge.model.camera_profile import CameraProfile, PhysicalModel, PictureStyle
from lutforge.model.gamut_map import GamutMap
from lutforge.model.lattice import Lattice
from lutforge.model.response import Response
from lutforge.model.white_balance import WhiteBalance

FORMAT_VERSION = 4
"""2: lattices may have a response. 3: gamut maps may be on an even scale. 4: white balances have a gain."""
LARGEST_ENTRY = 512 * 1024 * 1024
"""Bytes that one array of a profile may unpack to; a 129³ lattice takes 52 MB."""
MOST_ENTRIES = 4096
DIRECTIONS = ("render", "linearize")
LONGEST_REASON = 200
"""Characters of what a library says of a damaged file."""


def save_profile(profile: CameraProfile, path: str | Path) -> None:
    """Write a profile (.npz). The same profile gives the same bytes. Atomic."""
    arrays: dict[str, Array] = {}
    document = {
        "format": "lutforge-profile",
        "version": FORMAT_VERSION,
        "software": f"LutForge {__version__}",
        "camera": profile.camera,
        "raw_camera": profile.raw_camera,
        "matrix": profile.matrix.tolist(),
        "white_balances": {
            name: {
                "multipliers": list(balance.multipliers),
                "kelvin": balance.kelvin,
                "spread": balance.spread,
                "gain": balance.gain,
            }
            for name, balance in profile.white_balances.items()
        },
        "styles": {
            name: _style_to_json(style, f"style{index}", arrays)
            for index, (name, style) in enumerate(profile.styles.items())
        },
        "shots": list(profile.shots),
        "options": dict(profile.options),
        "notes": list(profile.notes),
    }
    with atomic_path(path) as temporary, zipfile.ZipFile(temporary, "w", zipfile.ZIP_DEFLATED) as archive:
        text = json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False)
        archive.writestr(zipfile.ZipInfo("profile.json"), text, zipfile.ZIP_DEFLATED)
        for name, array in arrays.items():
            # A ZipInfo made by hand carries no clock time: equal profiles are equal files.
            with archive.open(zipfile.ZipInfo(f"{name}.npy"), "w", force_zip64=True) as stream:
                npy.write_array(stream, np.ascontiguousarray(array), allow_pickle=False)


def _style_to_json(style: PictureStyle, prefix: str, arrays: dict[str, Array]) -> dict[str, Any]:
    result: dict[str, Any] = {"errors": {name: float(value) for name, value in style.errors.items()}}
    for direction in DIRECTIONS:
        lattice: Lattice | None = getattr(style, direction)
        if lattice is None:
            continue
        entry = _lattice_to_json(lattice, f"{prefix}_{direction}", arrays)
        if direction in style.coverage:
            entry["coverage"] = f"{prefix}_{direction}_coverage"
            arrays[entry["coverage"]] = style.coverage[direction]
        result[direction] = entry
    result["physical"] = []
    for index, model in enumerate(style.physical):
        base = f"{prefix}_physical{index}"
        arrays[f"{base}_response"] = model.response.inverse
        for side, gamut_map in (
            ("gamut_map", model.gamut_map),
            ("inverse_gamut_map", model.inverse_gamut_map),
        ):
            arrays[f"{base}_{side}_centres"] = gamut_map.centres
            arrays[f"{base}_{side}_coefficients"] = gamut_map.coefficients
            arrays[f"{base}_{side}_polynomial"] = gamut_map.polynomial
        result["physical"].append(
            {
                "white_balances": list(model.white_balances),
                "matrix": model.matrix.tolist(),
                "arrays": base,
                "offsets": [model.gamut_map.offset, model.inverse_gamut_map.offset],
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
    if lattice.response is not None:
        entry["response"] = f"{prefix}_response"
        arrays[entry["response"]] = lattice.response
    if lattice.plain is not None:
        entry["plain"] = _lattice_to_json(lattice.plain, f"{prefix}_plain", arrays)
    return entry


def load_profile(path: str | Path) -> CameraProfile:
    """Read a profile. Raises ProfileError, in one line, on anything that is not one."""
    path = Path(path)
    if not path.is_file():
        raise ProfileError(f"{path}: no such profile; make one with `lutforge calibrate … -o {path.name}`")
    try:
        with zipfile.ZipFile(path) as archive:
            document = _read_document(archive, path)
            arrays = _Arrays(archive, path)
            return _profile_from_json(document, arrays, path)
    except (zipfile.BadZipFile, zlib.error, OSError, EOFError) as error:
        raise ProfileError(f"{path}: not a LutForge profile ({error})") from error
    except ProfileError as error:
        raise error if str(path) in str(error) else ProfileError(f"{path}: {error}") from error
    except (KeyError, TypeError, ValueError, AttributeError, RecursionError, zipfile.LargeZipFile) as error:
        said = " ".join(str(error).split())[:LONGEST_REASON]
        raise ProfileError(f"{path}: damaged profile ({type(error).__name__}: {said})") from error
    except (RuntimeError, NotImplementedError) as error:  # encrypted, or an unknown compression
        raise ProfileError(f"{path}: cannot unpack this profile ({error})") from error


def _read_document(archive: zipfile.ZipFile, path: Path) -> dict[str, Any]:
    names = archive.namelist()
    if "profile.json" not in names:
        raise ProfileError(f"{path}: not a LutForge profile (it holds no profile.json)")
    if len(names) > MOST_ENTRIES or archive.getinfo("profile.json").file_size > 16 * 1024 * 1024:
        raise ProfileError(f"{path}: refused, it is far larger than any profile")
    document = json.loads(archive.read("profile.json"))
    if not isinstance(document, dict) or document.get("format") != "lutforge-profile":
        raise ProfileError(f"{path}: profile.json is not a LutForge profile")
    version = document.get("version")
    if not isinstance(version, int) or isinstance(version, bool) or not 1 <= version <= FORMAT_VERSION:
        raise ProfileError(f"{path}: profile version {version}; this LutForge reads up to {FORMAT_VERSION}: update it")
    return document


class _Arrays:
    """The arrays of an open profile, read on demand with limits."""

    def __init__(self, archive: zipfile.ZipFile, path: Path) -> None:
        self._archive = archive
        self._path = path

    def __getitem__(self, name: str) -> Array:
        entry = f"{name}.npy"
        if entry not in self._archive.namelist():
            raise ProfileError(f"{self._path}: damaged profile, the array {name} is missing")
        size = self._archive.getinfo(entry).file_size
        if size > LARGEST_ENTRY:
            raise ProfileError(f"{self._path}: refused, the array {name} unpacks to {size} bytes")
        with self._archive.open(entry) as stream:
            version = npy.read_magic(stream)
            if version != (1, 0):
                raise ProfileError(f"{self._path}: damaged profile, the array {name} has an unknown header")
            shape, _, dtype = npy.read_array_header_1_0(stream)
            if dtype != np.float64 or math.prod(shape) * 8 > size:
                raise ProfileError(
                    f"{self._path}: damaged profile, the array {name} is not float64 of its stated shape"
                )
        with self._archive.open(entry) as stream:
            array: Array = npy.read_array(stream, allow_pickle=False)
        return array


def _profile_from_json(document: dict[str, Any], arrays: _Arrays, path: Path) -> CameraProfile:
    balances = {
        str(name): WhiteBalance(
            _triple(entry["multipliers"]),
            entry["kelvin"],
            float(entry.get("spread", 0.0)),
            float(entry.get("gain", 1.0)),
        )
        for name, entry in document["white_balances"].items()
    }
    styles = {str(name): _style_from_json(entry, arrays, path) for name, entry in document["styles"].items()}
    options = document.get("options", {})
    if not isinstance(options, dict):
        raise ProfileError(f"{path}: damaged profile, its options are no table")
    return CameraProfile(
        camera=str(document["camera"]),
        matrix=np.array(document["matrix"], dtype=np.float64),
        white_balances=balances,
        styles=styles,
        shots=tuple(str(shot) for shot in document.get("shots", [])),
        options=options,
        notes=tuple(str(note) for note in document.get("notes", [])),
        raw_camera=str(document.get("raw_camera", "")),
    )


def _triple(values: list[float]) -> tuple[float, float, float]:
    r, g, b = (float(value) for value in values)
    return (r, g, b)


def _style_from_json(entry: Mapping[str, Any], arrays: _Arrays, path: Path) -> PictureStyle:
    lattices: dict[str, Lattice] = {}
    coverage: dict[str, Array] = {}
    for direction in DIRECTIONS:
        if direction in entry:
            stored = entry[direction]
            plain = _lattice_from_json(stored["plain"], arrays, path) if "plain" in stored else None
            lattices[direction] = _lattice_from_json(stored, arrays, path, plain)
            if "coverage" in stored:
                coverage[direction] = arrays[stored["coverage"]]
    physical = []
    for model in entry.get("physical", []):
        base = model["arrays"]
        maps = [
            GamutMap(
                arrays[f"{base}_{side}_centres"],
                arrays[f"{base}_{side}_coefficients"],
                arrays[f"{base}_{side}_polynomial"],
                float(offset),
            )
            for side, offset in zip(("gamut_map", "inverse_gamut_map"), model.get("offsets", (0.0, 0.0)), strict=True)
        ]
        physical.append(
            PhysicalModel(
                tuple(model["white_balances"]),
                np.array(model["matrix"], dtype=np.float64),
                Response(arrays[f"{base}_response"]),
                maps[0],
                maps[1],
            )
        )
    errors = {str(name): float(value) for name, value in entry.get("errors", {}).items()}
    return PictureStyle(lattices.get("render"), lattices.get("linearize"), tuple(physical), errors, coverage)


def _lattice_from_json(stored: Mapping[str, Any], arrays: _Arrays, path: Path, plain: Lattice | None = None) -> Lattice:
    if stored["interpolation"] not in INTERPOLATIONS:
        raise ProfileError(f"{path}: unknown interpolation {stored['interpolation']!r}")
    r, g, b = (arrays[name] for name in stored["levels"])
    if stored.get("domain", [0.0, 1.0]) != [0.0, 1.0] or any(axis[0] != 0 or axis[-1] != 1 for axis in (r, g, b)):
        raise ProfileError(f"{path}: damaged profile, the node levels of a lattice do not run from 0 to 1")
    response = arrays[stored["response"]] if "response" in stored else None
    return Lattice((r, g, b), arrays[stored["values"]], stored["interpolation"], response, plain)
