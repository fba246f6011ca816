"""Provenance of a profile: what its samples' linear values were.

Each kind has a `space`: the name of the RGB space in which they were encoded, or "raw" for those of a sensor. Where one
kind needs another treatment than the others, the code asks for the type; `str()` names it in messages.
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from lutforge.arrays import Array
from lutforge.colour.rgb_spaces import rgb_space
from lutforge.errors import ProfileError, SettingsError

LONGEST_NAME = 200
"""Characters of a name of a camera, style, white balance, program or chart."""


@dataclass(frozen=True)
class OwnRaw:
    """The camera's own RAW."""

    space: ClassVar[str] = "raw"

    def __str__(self) -> str:
        return "RAW files"


@dataclass(frozen=True, eq=False)
class ReferenceRaw:
    """The RAW of another camera, of one without RAW (4.9). transfer: Tc (3, 3), from that camera's RAW to this one's.

    Raises ProfileError where the name is none, or the matrix cannot be inverted.
    """

    camera: str
    transfer: Array

    space: ClassVar[str] = "raw"

    def __post_init__(self) -> None:
        require_name(self.camera)
        if not is_invertible(self.transfer):
            raise ProfileError("the matrix from the reference camera's RAW cannot be inverted")

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, ReferenceRaw):
            return NotImplemented
        return self.camera == other.camera and np.array_equal(self.transfer, other.transfer)

    def __hash__(self) -> int:
        return hash((self.camera, self.transfer.tobytes()))

    def __repr__(self) -> str:
        rows = ("[" + ", ".join(f"{value:.4g}" for value in row) + "]" for row in self.transfer)
        return f"ReferenceRaw({self.camera!r}, [{', '.join(rows)}])"

    def __str__(self) -> str:
        return f"RAW files of {self.camera}"


@dataclass(frozen=True)
class Developed:
    """Pictures that a program developed, balanced, encoded in an RGB space. Raises ProfileError: unknown space."""

    program: str
    space: str

    def __post_init__(self) -> None:
        require_name(self.program)
        require_space(self.space)

    def __str__(self) -> str:
        return self.program


@dataclass(frozen=True)
class Chart:
    """The known colours of a chart under a light, of a camera without RAW. Raises ProfileError: unknown space."""

    name: str
    light: str
    space: str

    def __post_init__(self) -> None:
        require_name(self.name)
        require_name(self.light)
        require_space(self.space)

    @property
    def lit(self) -> str:
        """The chart and its light."""
        return f"{self.name} under {self.light}"

    def __str__(self) -> str:
        return f"chart {self.lit}"


@dataclass(frozen=True)
class ResponseOnly:
    """No linear values: the response alone is known, and linear values are those of the JPEG in its own primaries."""

    space: ClassVar[str] = "raw"

    def __str__(self) -> str:
        return "an exposure bracket"


Pictures = Developed | Chart
"""The kinds whose linear values are colours of an RGB space, white-balanced already, and not a sensor's."""

Provenance = OwnRaw | ReferenceRaw | Developed | Chart | ResponseOnly


def require_name(name: str) -> None:
    """Raise ProfileError where a name cannot be that of a file or of a colour space."""
    if len(name) > LONGEST_NAME or not name.isprintable():
        raise ProfileError(
            f"{name[:LONGEST_NAME]!r} is no name of a camera, style, white balance, program or chart: one line of at "
            f"most {LONGEST_NAME} printable characters"
        )


def require_space(name: str) -> None:
    """Raise ProfileError where an RGB space is unknown."""
    try:
        rgb_space(name)
    except SettingsError:
        raise ProfileError(f"the samples are of no known colour space, but of {name[:60]!r}") from None


def is_invertible(matrix: Array) -> bool:
    """True of a 3 × 3 matrix of finite numbers whose condition number is below a million."""
    return matrix.shape == (3, 3) and bool(np.all(np.isfinite(matrix))) and bool(np.linalg.cond(matrix) < 1e6)
