"""What is stored of a calibrated camera, and its file: white balances, a matrix, and per picture style its models.

What goes both ways, RAW → JPEG and back, is one `Both`. A `Diagnosis` is of implausible samples. The file is a NumPy
zip of `profile.json` and the arrays that it names, and is read without unpickling.
"""

import json
import math
import zipfile
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Generic, Literal, Self, TypeVar, get_args

import numpy as np
from numpy.lib import format as npy

from lutforge import __version__
from lutforge.arrays import Array
from lutforge.atomic_write import atomic_path
from lutforge.boundary import reading
from lutforge.colour.rgb_spaces import rgb_space
from lutforge.errors import ProfileError, SettingsError, alternatives
from lutforge.interpolation import INTERPOLATIONS
from lutforge.model.gamut_map import GamutMap
from lutforge.model.inverse_gamut_map import SolvedInverse
from lutforge.model.lattice import Lattice
from lutforge.model.response import Response
from lutforge.model.vignetting import NO_SHADING, Vignetting
from lutforge.model.white_balance import WhiteBalance

FORMAT_VERSION = 8
"""The one version that is read: profiles are quickly calibrated again."""

MOST_VALUES = {1: 1 << 16, 2: 3 << 16, 3: 129**3, 4: 3 * 129**3}
"""Numbers of an array by its dimensions: a level axis; a table or centres, 65,536 rows; coverage and values of 129³."""
MOST_CENTRES = 20_000
"""Centres of a gamut map: a fit takes 4,000, and each costs time at every node that is baked."""
MOST_ENTRIES = {
    "white_balances": 200, "styles": 100, "shots": 20_000, "notes": 2_000, "vignettings": 2_000, "diagnoses": 100,
    "options": 200,
}  # fmt: skip
"""Entries of a part of `profile.json`; the largest profiles have a tenth of that."""
MOST_MODELS = 100
"""Physical models of a style: one for each of its white balances."""
LONGEST_TEXT = 2_000
"""Characters of a text in `profile.json`."""
MOST_JSON = 4 << 20
"""Bytes of `profile.json`, of which Python makes up to forty times as much."""
LEAST_BYTES, MOST_RATIO = 64 << 20, 16
"""Bytes that any file may unpack to, and how many more for each byte of it: fitted numbers pack 1.1 to 4 fold."""
MAP_ARRAYS = ("centres", "coefficients", "polynomial")
"""The arrays of a gamut map."""

Direction = Literal["render", "linearize"]
DIRECTIONS: tuple[Direction, ...] = get_args(Direction)
Value = TypeVar("Value")


@dataclass(frozen=True, eq=False)
class Both(Generic[Value]):
    """One thing of each direction. render: white-balanced RAW → JPEG; linearize: JPEG → white-balanced RAW."""

    render: Value
    linearize: Value

    def __getitem__(self, direction: Direction) -> Value:
        return self.render if direction == "render" else self.linearize

    def __iter__(self) -> Iterator[Value]:
        return iter((self.render, self.linearize))

    def items(self) -> tuple[tuple[Direction, Value], ...]:
        """Each with its direction."""
        return (("render", self.render), ("linearize", self.linearize))


@dataclass(frozen=True)
class Diagnosis:
    """A likely cause of samples that no camera makes; it concerns all shots, so that none can be blamed."""

    cause: str
    evidence: str
    advice: str

    def __str__(self) -> str:
        """All three in one line."""
        return f"{self.cause}: {self.evidence}; {self.advice}"


def is_invertible(matrix: Array) -> bool:
    """True of 3 × 3 finite numbers whose inverse is no nonsense."""
    return matrix.shape == (3, 3) and bool(np.all(np.isfinite(matrix))) and bool(np.linalg.cond(matrix) < 1e6)


@dataclass(frozen=True, eq=False)
class CameraModel:
    """I = f(h(Ts Tw E)) for some white balances of a style (4.1). matrix: Ts (3, 3), for multipliers with green = 1.

    Raises ProfileError where the matrix cannot be inverted.
    """

    white_balances: tuple[str, ...]
    matrix: Array
    response: Response
    gamut_map: GamutMap
    inverse_gamut_map: GamutMap | SolvedInverse

    def __post_init__(self) -> None:
        if not is_invertible(self.matrix):
            raise ProfileError("a camera model's matrix is not 3 × 3 numbers that can be inverted")

    def render(self, balanced: Array) -> Array:
        """Tw E (…, 3) → I (…, 3) in [0, 1]."""
        return self.response.encode(self.gamut_map(balanced @ self.matrix.T))

    def linearize(self, encoded: Array) -> Array:
        """I (…, 3) → Tw E (…, 3), not clipped."""
        return self.inverse_gamut_map(self.response.linearize(encoded)) @ np.linalg.inv(self.matrix).T


@dataclass(frozen=True, eq=False)
class PictureStyle:
    """What is known of one picture style.

    render: Tw E → I; linearize: I → Tw E; errors: held-out figures by name; coverage: per direction the summed weight
    of the samples at each node of its lattice, (N_r, N_g, N_b); expected: the error to expect there, in encoded RGB.

    The errors are norms of RGB differences, 1 = full scale: "render_mean", "render_max", "linearize_mean",
    "linearize_max", and "render_de00_mean" (ΔE00). The expected error of a render is "render_at_sample", plus
    "render_per_deviation" times the standard deviation of the fitted process there; that of linearize likewise.
    """

    render: Lattice | None = None
    linearize: Lattice | None = None
    models: tuple[CameraModel, ...] = ()
    errors: Mapping[str, float] = field(default_factory=dict)
    coverage: Mapping[Direction, Array] = field(default_factory=dict)
    expected: Mapping[Direction, Array] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Raise ProfileError where a coverage or an expected error is not that of its lattice."""
        told = [("coverage", *each) for each in self.coverage.items()]
        for what, direction, values in (*told, *(("expected error", *each) for each in self.expected.items())):
            lattice = self.lattices.get(direction)
            if lattice is None or values.shape != lattice.size:
                shape = "no lattice" if lattice is None else f"a lattice of {lattice.size} nodes"
                raise ProfileError(f"{what} of shape {values.shape} for {shape} ({direction})")
            if not np.all(np.isfinite(values)) or values.min() < 0:
                raise ProfileError(f"the {what} ({direction}) holds a value that is negative or not finite")

    def __repr__(self) -> str:
        parts = [f"{direction} lattice of {'×'.join(map(str, one.size))}" for direction, one in self.lattices.items()]
        if self.models:
            parts.append("camera model" if len(self.models) == 1 else f"{len(self.models)} camera models")
        parts += [f"{name} {value:.4g}" for name, value in self.errors.items() if name.endswith("_mean")]
        return f"PictureStyle({', '.join(parts)})"

    @property
    def lattices(self) -> dict[Direction, Lattice]:
        """The lattices that there are, by direction."""
        both = Both(self.render, self.linearize).items()
        return {direction: lattice for direction, lattice in both if lattice is not None}

    def tones(self, linear: Array) -> Array:
        """f at linear values (n,), per channel (n, 3).

        A style without a camera model has the grey axis of its lattice, which is f where h leaves grey alone; one
        without either has NaN.
        """
        grey = np.repeat(linear[:, None], 3, axis=1)
        if self.models:
            return self.models[0].response.encode(grey)
        return np.full_like(grey, np.nan) if self.render is None else self.render(grey)


class StylesByName(dict[str, PictureStyle]):
    """Picture styles by name. Raises SettingsError, which lists the names, where a style is not known."""

    def __missing__(self, name: str) -> PictureStyle:
        raise SettingsError(f"picture style {name!r} is not in the profile; {alternatives(str(name), self)}")


@dataclass(frozen=True, eq=False)
class ProfileData:
    """A camera. matrix: Ts (3, 3), white-balanced camera RGB → linear sRGB, rows sum to 1.

    shots: the names that it was calibrated from; options: how, as plain JSON values. raw_camera: the reference camera
    whose RAW stood in for a camera without RAW (4.9), else ""; raw_transfer: Tc (3, 3), which takes that camera's RAW
    to this camera's, as far as it can be known. vignettings: what JPEGs are brighter towards the corners than the
    middle, for which the styles stand, by lens setting. diagnoses: what in the samples no camera makes.
    from_xyz: (3, 3) XYZ → RAW of any scale, as LibRaw or a DNG file has it, for temperatures; None where unknown.
    Raises ProfileError where there is no style or no white balance, a name is not one line of text, or the matrix is
    singular.
    """

    camera: str
    matrix: Array
    white_balances: Mapping[str, WhiteBalance]
    styles: Mapping[str, PictureStyle]
    shots: tuple[str, ...] = ()
    options: Mapping[str, object] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    raw_camera: str = ""
    vignettings: tuple[Vignetting, ...] = ()
    diagnoses: tuple[Diagnosis, ...] = ()
    raw_transfer: Array | None = None
    from_xyz: Array | None = None

    @property
    def developer(self) -> str:
        """The program and version, or the pictures, that stood in the place of RAW; "" for RAW."""
        return str(self.options.get("developer") or "")

    @property
    def raw_space(self) -> str:
        """The linear space of the pictures in the place of RAW; "raw" for RAW."""
        space = str(self.options.get("raw_space") or "raw")
        return space if space == "raw" else rgb_space(space).linear.name

    @property
    def fed_to(self) -> str:
        """What a render takes: "raw", or the space in which pictures in the place of RAW are encoded."""
        space = str(self.options.get("raw_space") or "raw")
        return "raw" if space == self.raw_space else space

    def __post_init__(self) -> None:
        object.__setattr__(self, "styles", StylesByName(self.styles))
        if not self.styles or not self.white_balances:
            raise ProfileError(f"{self.camera}: a profile needs at least one picture style and one white balance")
        for name in (self.camera, self.raw_camera, *self.styles, *self.white_balances):
            if len(name) > 200 or not name.isprintable():  # they become names of files and of colour spaces
                raise ProfileError(
                    f"{name[:200]!r} is no name of a camera, style or white balance: one line of at most "
                    "200 printable characters"
                )
        if not is_invertible(self.matrix):
            raise ProfileError(f"{self.camera}: the matrix is not 3 × 3 finite numbers that can be inverted")
        transfer = self.raw_transfer
        if (transfer is None) != (self.raw_camera == ""):
            raise ProfileError(f"{self.camera}: a reference camera and the matrix from its RAW belong together")
        if transfer is not None and not is_invertible(transfer):
            raise ProfileError(f"{self.camera}: the matrix from the reference camera's RAW cannot be inverted")
        if self.from_xyz is not None and not is_invertible(self.from_xyz):
            raise ProfileError(f"{self.camera}: the matrix from XYZ to RAW cannot be inverted")

    def save(self, path: str | Path) -> None:
        """Write the profile to a file (.npz), atomically; `lutforge.load_profile` reads it."""
        arrays: dict[str, Array] = {}
        document = {
            "format": "lutforge-profile",
            "version": FORMAT_VERSION,
            "software": f"LutForge {__version__}",
            "camera": self.camera,
            "raw_camera": self.raw_camera,
            "raw_transfer": None if self.raw_transfer is None else self.raw_transfer.tolist(),
            "matrix": self.matrix.tolist(),
            "from_xyz": None if self.from_xyz is None else self.from_xyz.tolist(),
            "white_balances": {name: asdict(balance) for name, balance in self.white_balances.items()},
            "styles": {
                name: _style_to_json(style, f"style{index}", arrays)
                for index, (name, style) in enumerate(self.styles.items())
            },
            "shots": list(self.shots),
            "options": dict(self.options),
            "notes": list(self.notes),
            "vignettings": [  # JSON has no NaN: what is not known is null
                {name: value if value == value else None for name, value in asdict(vignetting).items()}
                for vignetting in self.vignettings
            ],
            "diagnoses": [asdict(diagnosis) for diagnosis in self.diagnoses],
        }
        with atomic_path(path) as temporary, zipfile.ZipFile(temporary, "w", zipfile.ZIP_DEFLATED) as archive:
            text = json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False)
            archive.writestr(zipfile.ZipInfo("profile.json"), text, zipfile.ZIP_DEFLATED)
            for name, array in arrays.items():
                # A ZipInfo made by hand carries no clock time: equal profiles are equal files.
                with archive.open(zipfile.ZipInfo(f"{name}.npy"), "w", force_zip64=True) as stream:
                    npy.write_array(stream, np.ascontiguousarray(array), allow_pickle=False)

    @classmethod
    def read(cls, path: Path) -> Self:
        """Read what a profile file holds. Raises ProfileError, in one line, on anything that is not one."""
        if path.suffix.lower() == ".csv":
            raise ProfileError(
                f"{path}: not a LutForge profile but a table of samples; run `lutforge calibrate {path} -o camera.npz`"
            )
        if not path.is_file():
            raise ProfileError(f"{path}: no such profile; make one with `lutforge calibrate … -o {path}`")
        if not zipfile.is_zipfile(path):
            raise ProfileError(f"{path}: not a LutForge profile, which is a zip file")
        with reading(path, "a LutForge profile", ProfileError), zipfile.ZipFile(path) as archive:
            document = _read_document(archive, path.stat().st_size)
            arrays = _Arrays(archive)
            balances = {}
            for name, entry in document["white_balances"].items():
                r, g, b = map(float, entry["multipliers"])
                spread, gain = float(entry["spread"]), float(entry["gain"])
                balances[str(name)] = WhiteBalance((r, g, b), entry["kelvin"], spread, gain)
            vignettings = []
            for entry in document["vignettings"]:
                one, two, three = map(float, entry["coefficients"])
                x, y = map(float, entry["centre"])
                focal_mm, aperture = (
                    math.nan if entry[name] is None else float(entry[name]) for name in ("focal_mm", "aperture")
                )
                shading = tuple(tuple(map(float, channel)) for channel in entry.get("shading", NO_SHADING))
                lens = str(entry["lens"])
                vignettings.append(Vignetting((one, two, three), (x, y), lens, focal_mm, aperture, shading))
            transfer, from_xyz = document["raw_transfer"], document.get("from_xyz")
            return cls(
                camera=str(document["camera"]),
                matrix=np.array(document["matrix"], dtype=np.float64),
                white_balances=balances,
                styles={str(name): _style_from_json(entry, arrays.read) for name, entry in document["styles"].items()},
                shots=tuple(map(str, document["shots"])),
                options=document["options"],
                notes=tuple(map(str, document["notes"])),
                raw_camera=str(document["raw_camera"]),
                raw_transfer=None if transfer is None else np.array(transfer, dtype=np.float64),
                from_xyz=None if from_xyz is None else np.array(from_xyz, dtype=np.float64),
                vignettings=tuple(vignettings),
                diagnoses=tuple(
                    Diagnosis(str(entry["cause"]), str(entry["evidence"]), str(entry["advice"]))
                    for entry in document["diagnoses"]
                ),
            )


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
        expected = style.expected.get(direction)
        for part, array in (
            ("response", lattice.output_curve),
            ("coverage", style.coverage.get(direction)),
            ("expected", None if expected is None else expected.round(5)),
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
    return {"offset": gamut_map.offset, "kernel": gamut_map.kernel}


def _map_from_json(entry: Mapping[str, Any], base: str, array: Callable[[str], Array]) -> GamutMap:
    centres, weights, trend = (array(f"{base}_{part}") for part in MAP_ARRAYS)
    return GamutMap(centres, weights, trend, float(entry["offset"]), entry["kernel"])


def _style_from_json(entry: Mapping[str, Any], array: Callable[[str], Array]) -> PictureStyle:
    lattices: dict[Direction, Lattice] = {}
    beside: dict[str, dict[Direction, Array]] = {"response": {}, "coverage": {}, "expected": {}}
    for direction in DIRECTIONS:
        if direction not in entry:
            continue
        stored = entry[direction]
        if stored["interpolation"] not in INTERPOLATIONS:
            raise ProfileError(f"unknown interpolation {stored['interpolation']!r}")
        r, g, b = (array(name) for name in stored["levels"])
        if stored["domain"] != [0.0, 1.0] or any(axis[0] != 0 or axis[-1] != 1 for axis in (r, g, b)):
            raise ProfileError("damaged profile, the node levels of a lattice do not run from 0 to 1")
        for part, arrays in beside.items():
            if part in stored:
                arrays[direction] = array(stored[part])
        curve = beside["response"].get(direction)
        lattices[direction] = Lattice((r, g, b), array(stored["values"]), stored["interpolation"], curve)
    models = []
    if len(entry["models"]) > MOST_MODELS:
        raise ProfileError(f"refused, a style has {len(entry['models'])} models, more than any profile's")
    for model in entry["models"]:
        base = model["arrays"]
        gamut_map = _map_from_json(model["gamut_map"], f"{base}_gamut_map", array)
        described = model["inverse_gamut_map"]
        inverse: GamutMap | SolvedInverse
        if "top" in described:
            inverse = SolvedInverse(gamut_map, array(f"{base}_likely"), float(described["top"]))
        else:
            inverse = _map_from_json(described, f"{base}_inverse_gamut_map", array)
        matrix = np.array(model["matrix"], dtype=np.float64)
        response = Response(array(f"{base}_response"))
        balances = tuple(map(str, model["white_balances"]))
        models.append(CameraModel(balances, matrix, response, gamut_map, inverse))
    errors = {str(name): float(value) for name, value in entry["errors"].items()}
    both = lattices.get("render"), lattices.get("linearize")
    return PictureStyle(*both, tuple(models), errors, beside["coverage"], beside["expected"])


def _read_document(archive: zipfile.ZipFile, size: int) -> dict[str, Any]:
    """What `profile.json` says, judged before anything is unpacked. size: of the file in bytes. Raises ProfileError."""
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
    if any(entry.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED) for entry in archive.infolist()):
        raise ProfileError("refused, it is packed as no profile is")
    document = json.loads(archive.read("profile.json"))
    if not isinstance(document, dict) or document.get("format") != "lutforge-profile":
        raise ProfileError("profile.json is not a LutForge profile")
    version = document.get("version")
    if not isinstance(version, int) or isinstance(version, bool) or version < 1:
        raise ProfileError(f"damaged profile, its version is {version!r:.60}; calibrate again, or find a good copy")
    if version != FORMAT_VERSION:
        advice = "update it" if version > FORMAT_VERSION else "calibrate again"
        raise ProfileError(f"profile version {version}; this LutForge reads version {FORMAT_VERSION}: {advice}")
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
        rows = MOST_CENTRES if name.endswith("_centres") else MOST_VALUES[1]
        if math.prod(shape) > MOST_VALUES.get(len(shape), 0) or (len(shape) == 2 and shape[0] > rows):
            raise ProfileError(f"refused, the array {name} of shape {shape} is larger than any profile's")
    with archive.open(entry) as stream:
        return np.asarray(npy.read_array(stream, allow_pickle=False))
