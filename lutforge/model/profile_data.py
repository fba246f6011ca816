"""What is stored of a calibrated camera: its white balances, its matrix, and per picture style its models.

What goes both ways, RAW → JPEG and back, is one `Both`. A `Diagnosis` is of implausible samples.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Generic, Literal, TypeVar, get_args

import numpy as np

from lutforge.arrays import Array
from lutforge.colour.rgb_spaces import rgb_space
from lutforge.errors import ProfileError
from lutforge.model.falloff import Falloff
from lutforge.model.gamut_map import GamutMap
from lutforge.model.lattice import Lattice
from lutforge.model.response import Response
from lutforge.model.white_balance import WhiteBalance

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


def _is_invertible(matrix: Array) -> bool:
    """True of 3 × 3 finite numbers whose inverse is no nonsense."""
    return matrix.shape == (3, 3) and bool(np.all(np.isfinite(matrix))) and bool(np.linalg.cond(matrix) < 1e6)


@dataclass(frozen=True, eq=False)
class PhysicalModel:
    """I = f(h(Ts Tw E)) for some white balances of a style (4.1). matrix: Ts (3, 3), for multipliers with green = 1.

    Raises ProfileError where the matrix cannot be inverted.
    """

    white_balances: tuple[str, ...]
    matrix: Array
    response: Response
    gamut_map: GamutMap
    inverse_gamut_map: GamutMap

    def __post_init__(self) -> None:
        if not _is_invertible(self.matrix):
            raise ProfileError("a physical model's matrix is not 3 × 3 numbers that can be inverted")

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
    physical: tuple[PhysicalModel, ...] = ()
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

    @property
    def lattices(self) -> dict[Direction, Lattice]:
        """The lattices that there are, by direction."""
        both = Both(self.render, self.linearize).items()
        return {direction: lattice for direction, lattice in both if lattice is not None}

    def tones(self, linear: Array) -> Array:
        """f at linear values (n,), per channel (n, 3).

        A style without a physical model has the grey axis of its lattice, which is f where h leaves grey alone; one
        without either has NaN.
        """
        grey = np.repeat(linear[:, None], 3, axis=1)
        if self.physical:
            return self.physical[0].response.encode(grey)
        return np.full_like(grey, np.nan) if self.render is None else self.render(grey)


@dataclass(frozen=True, eq=False)
class ProfileData:
    """A camera. matrix: Ts (3, 3), white-balanced camera RGB → linear sRGB, rows sum to 1.

    shots: the names that it was calibrated from; options: how, as plain JSON values. raw_camera: the reference camera
    whose RAW stood in for a camera without RAW (4.9), else ""; raw_transfer: Tc (3, 3), which takes that camera's RAW
    to this camera's, as far as it can be known. falloffs: what JPEGs are brighter towards the corners than the
    middle, for which the styles stand, by lens setting. diagnoses: what in the samples no camera makes.
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
    falloffs: tuple[Falloff, ...] = ()
    diagnoses: tuple[Diagnosis, ...] = ()
    raw_transfer: Array | None = None

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
        if not self.styles or not self.white_balances:
            raise ProfileError(f"{self.camera}: a profile needs at least one picture style and one white balance")
        for name in (self.camera, self.raw_camera, *self.styles, *self.white_balances):
            if len(name) > 200 or not name.isprintable():  # they become names of files and of colour spaces
                raise ProfileError(
                    f"{name[:200]!r} is no name of a camera, style or white balance: one line of at most "
                    "200 printable characters"
                )
        if self.matrix.shape != (3, 3) or not np.all(np.isfinite(self.matrix)):
            raise ProfileError(f"{self.camera}: the matrix is not 3 × 3 finite numbers")
        if np.linalg.cond(self.matrix) > 1e6:
            raise ProfileError(f"{self.camera}: the matrix cannot be inverted")
        transfer = self.raw_transfer
        if (transfer is None) != (self.raw_camera == ""):
            raise ProfileError(f"{self.camera}: a reference camera and the matrix from its RAW belong together")
        if transfer is not None and not _is_invertible(transfer):
            raise ProfileError(f"{self.camera}: the matrix from the reference camera's RAW cannot be inverted")
