"""One camera's RAW → another's: the matrix Tc (thesis 6.2), with the roots of a root polynomial where they pay.

A root polynomial of degree 2 adds √rg, √gb and √rb to r, g and b (Finlayson, Mackiewicz and Hurlbert, "Color correction
using root-polynomial regression", IEEE Transactions on Image Processing 24, 2015,
https://doi.org/10.1109/TIP.2015.2405336). Like the matrix it keeps the scale: twice the light is twice the answer.
"""

import json
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from lutforge import __version__
from lutforge.arrays import Array
from lutforge.atomic_write import atomic_path
from lutforge.boundary import path_of, reading, require_file
from lutforge.colour.srgb import checked_colours
from lutforge.errors import ProfileError
from lutforge.model.provenance import is_invertible

RAW_TRANSFER_FORMAT = "lutforge-raw-transfer"
RAW_TRANSFER_VERSION = 4
_ROOTS_AT_WHITE = np.array([[0.5, 0.5, 0.0], [0.0, 0.5, 0.5], [0.5, 0.0, 0.5]])
"""The derivatives of √rg, √gb and √rb by r, g and b at (1, 1, 1)."""


def root_terms(balanced: Array) -> Array:
    """√rg, √gb and √rb (…, 3) of balanced RAW (…, 3); those of negative values, which noise makes, are 0."""
    root = np.sqrt(np.maximum(balanced, 0.0))
    return np.asarray(root * np.roll(root, -1, axis=-1))


@dataclass(frozen=True, eq=False)
class RawTransfer:
    """RAW of `source` → RAW of `target`, both before white balance.

    matrix: Tc (3, 3). neutral: (3,) the source's RAW of a white under the light of the fit. error: root mean square of
    the pairs that the fit had not seen, relative to their norm. roots: (3, 3), of `root_terms` of RAW over neutral.
    """

    source: str
    target: str
    matrix: Array
    neutral: Array
    error: float | None = None
    roots: Array = field(default_factory=lambda: np.zeros((3, 3)))

    def __post_init__(self) -> None:
        named, neutral = f"RAW transfer {self.source} to {self.target}", self.neutral
        if self.roots.shape != (3, 3) or not np.all(np.isfinite(self.roots)):
            raise ProfileError(f"{named}: the coefficients of its roots are not 3 × 3 numbers")
        if not (neutral.shape == (3,) and np.all(np.isfinite(neutral)) and np.all(neutral > 0)):
            raise ProfileError(f"{named}: its white is not three positive numbers")
        if not (self.matrix.shape == (3, 3) and is_invertible(self.at_white)):
            raise ProfileError(f"{named}: the matrix is not invertible")

    def __call__(self, raw: ArrayLike) -> Array:
        """RAW (…, 3) → RAW (…, 3). Raises ImageError on another shape or on integers."""
        x = checked_colours(raw)
        return np.asarray(x @ self.matrix.T + root_terms(x / self.neutral) @ self.roots.T)

    @property
    def at_white(self) -> Array:
        """The matrix (3, 3) that does the same near greys, and exactly the same to white."""
        return np.asarray(self.matrix + self.roots @ _ROOTS_AT_WHITE / self.neutral)

    def under(self, source: Array, target: Array | None) -> "RawTransfer":
        """The transfer under another illuminant than that of the fit, of which both multipliers (3,) are given.

        White-balanced colours change little with the illuminant, RAW ones much: the matrix between balanced ones stays.
        """
        if target is None:
            return self
        white = self(self.neutral)
        balance = source * self.neutral
        unbalance = white[1] / white / target
        matrix, roots = unbalance[:, None] * self.matrix * balance, unbalance[:, None] * self.roots
        return replace(self, matrix=matrix, neutral=self.neutral / balance, roots=roots)

    def save(self, path: str | Path) -> None:
        """Write the transfer (.json), atomically; `load_transfer` reads it."""
        document = {
            "format": RAW_TRANSFER_FORMAT,
            "version": RAW_TRANSFER_VERSION,
            "software": f"LutForge {__version__}",
            "source": self.source,
            "target": self.target,
            "matrix": self.matrix.tolist(),
            "neutral": self.neutral.tolist(),
            "roots": self.roots.tolist(),
            "error": self.error,
        }
        with atomic_path(path) as temporary:
            temporary.write_text(json.dumps(document, indent=1, allow_nan=False) + "\n", encoding="utf-8")


def load_transfer(path: str | Path) -> RawTransfer:
    """Read a transfer from one camera's RAW to another's.

    Args:
        path: of a file that `lutforge transfer` wrote (.json).

    Returns:
        The transfer, a function of RAW (…, 3) under any white balance.

    Raises:
        ProfileError: it is none, in one line.
    """
    path = path_of(path, "a RAW transfer")
    with reading(path, "a RAW transfer", ProfileError):
        require_file(path, "a RAW transfer", ProfileError, most=1 << 20)
        document = json.loads(path.read_text(encoding="utf-8"))
        if not isinstance(document, dict) or document.get("format") != RAW_TRANSFER_FORMAT:
            raise ProfileError(f"{path}: not a RAW transfer; make one with `lutforge transfer`")
        if document["version"] != RAW_TRANSFER_VERSION:
            raise ProfileError(f"{path}: of another version of LutForge; make it anew with `lutforge transfer`")
        names = ("matrix", "neutral", "roots")
        matrix, neutral, roots = (np.array(document[name], dtype=np.float64) for name in names)
        error = None if document["error"] is None else float(document["error"])
        return RawTransfer(str(document["source"]), str(document["target"]), matrix, neutral, error, roots)
