"""Records of a calibrated camera: white balances, a matrix, and per picture style the models of its rendering.

A pair of things for the two directions, RAW → JPEG and back, is a `ByDirection`. A `Diagnosis` explains implausible
samples. `profile_file` reads and writes the records; `camera_profile` has the transforms that they offer.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Generic, Literal, TypeVar, get_args

import numpy as np

from lutforge.arrays import Array
from lutforge.colour.rgb_spaces import rgb_space
from lutforge.errors import ProfileError, SettingsError, alternatives
from lutforge.model.gamut_map import GamutMap, identity_gamut_map
from lutforge.model.inverse_gamut_map import SolvedInverse
from lutforge.model.lattice import Lattice
from lutforge.model.provenance import OwnRaw, Provenance, is_invertible, require_name
from lutforge.model.response import Response
from lutforge.model.vignetting import Vignetting
from lutforge.model.white_balance import WhiteBalance

Direction = Literal["render", "linearize"]
DIRECTIONS: tuple[Direction, ...] = get_args(Direction)
Value = TypeVar("Value")


@dataclass(frozen=True, eq=False)
class ByDirection(Generic[Value]):
    """A pair of things. render: for white-balanced RAW → JPEG; linearize: for JPEG → white-balanced RAW."""

    render: Value
    linearize: Value

    def __getitem__(self, direction: Direction) -> Value:
        return self.render if direction == "render" else self.linearize

    def __iter__(self) -> Iterator[Value]:
        return iter((self.render, self.linearize))

    def items(self) -> tuple[tuple[Direction, Value], ...]:
        """Each of the two with its direction."""
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

    @classmethod
    def without_gamut_map(cls, white_balances: tuple[str, ...], matrix: Array, response: Response) -> "CameraModel":
        """A model whose h and h⁻¹ change nothing: response and matrix alone."""
        unchanged = identity_gamut_map()
        return cls(white_balances, matrix, response, unchanged, unchanged)

    def render(self, balanced: Array) -> Array:
        """Tw E (…, 3) → I (…, 3) in [0, 1]."""
        return self.response.encode(self.gamut_map(balanced @ self.matrix.T))

    def linearize(self, encoded: Array) -> Array:
        """I (…, 3) → Tw E (…, 3), not clipped."""
        return self.inverse_gamut_map(self.response.linearize(encoded)) @ np.linalg.inv(self.matrix).T


@dataclass(frozen=True, eq=False)
class PictureStyle:
    """A picture style: its lattices, its camera models, and their errors.

    render: Tw E → I; linearize: I → Tw E; errors: held-out figures by name; coverage: per direction the summed weight
    of the samples at each node of its lattice, (N_r, N_g, N_b).

    The errors are norms of RGB differences, 1 = full scale: "render_mean", "render_max", "linearize_mean",
    "linearize_max", and "render_de00_mean" (ΔE00).
    """

    render: Lattice | None = None
    linearize: Lattice | None = None
    models: tuple[CameraModel, ...] = ()
    errors: Mapping[str, float] = field(default_factory=dict)
    coverage: Mapping[Direction, Array] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Raise ProfileError where a coverage is not that of its lattice."""
        for direction, values in self.coverage.items():
            lattice = self.lattices.get(direction)
            if lattice is None or values.shape != lattice.size:
                shape = "no lattice" if lattice is None else f"a lattice of {lattice.size} nodes"
                raise ProfileError(f"coverage of shape {values.shape} for {shape} ({direction})")
            if not np.all(np.isfinite(values)) or values.min() < 0:
                raise ProfileError(f"the coverage ({direction}) holds a value that is negative or not finite")

    def __repr__(self) -> str:
        parts = [
            f"{direction} lattice of {'×'.join(map(str, lattice.size))}" for direction, lattice in self.lattices.items()
        ]
        if self.models:
            parts.append("camera model" if len(self.models) == 1 else f"{len(self.models)} camera models")
        parts += [f"{name} {value:.4g}" for name, value in self.errors.items() if name.endswith("_mean")]
        return f"PictureStyle({', '.join(parts)})"

    @property
    def lattices(self) -> dict[Direction, Lattice]:
        """The lattices that there are, by direction."""
        sides = ByDirection(self.render, self.linearize).items()
        return {direction: lattice for direction, lattice in sides if lattice is not None}

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

    shots: the names of those that it was calibrated from; options: those of the calibration, as plain JSON values;
    provenance: the origin of the samples' linear values. vignettings: by lens setting, how much brighter JPEGs are
    towards the corners than in the middle, for which the styles hold. diagnoses: of samples that no camera makes.
    dng_camera: the UniqueCameraModel of its DNG files, by which developers match camera profiles; "" where unknown.
    from_xyz: (3, 3) XYZ → RAW of any scale, as LibRaw or a DNG file has it, for temperatures; None where unknown.
    Raises ProfileError where there is no style or no white balance, a name is not one line of text, or a matrix is
    singular.
    """

    camera: str
    matrix: Array
    white_balances: Mapping[str, WhiteBalance]
    styles: Mapping[str, PictureStyle]
    shots: tuple[str, ...] = ()
    options: Mapping[str, object] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    provenance: Provenance = field(default_factory=OwnRaw)
    vignettings: tuple[Vignetting, ...] = ()
    diagnoses: tuple[Diagnosis, ...] = ()
    dng_camera: str = ""
    from_xyz: Array | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "styles", StylesByName(self.styles))
        if not self.styles or not self.white_balances:
            raise ProfileError(f"{self.camera}: a profile needs at least one picture style and one white balance")
        for name in (self.camera, self.dng_camera, *self.styles, *self.white_balances):
            require_name(name)
        if not is_invertible(self.matrix):
            raise ProfileError(f"{self.camera}: the matrix is not 3 × 3 finite numbers that can be inverted")
        if self.from_xyz is not None and not is_invertible(self.from_xyz):
            raise ProfileError(f"{self.camera}: the matrix from XYZ to RAW cannot be inverted")

    @property
    def raw_space(self) -> str:
        """The linear space of the samples, or "raw" for a sensor's."""
        space = self.provenance.space
        return space if space == "raw" else rgb_space(space).linear.name

    @property
    def fed_to(self) -> str:
        """The input of a render: "raw", or the space in which the pictures that replace RAW are encoded."""
        return "raw" if self.provenance.space == self.raw_space else self.provenance.space
