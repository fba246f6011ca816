"""One camera's RAW → another's: the matrix Tc (thesis 6.2)."""

import json
from dataclasses import dataclass, replace
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
RAW_TRANSFER_VERSION = 3


@dataclass(frozen=True, eq=False)
class RawTransfer:
    """RAW of `source` → RAW of `target`, both before white balance.

    matrix: Tc (3, 3). neutral: (3,) the source's RAW of a white under the light of the fit. error: root mean square of
    the pairs that the fit had not seen, relative to their norm.
    """

    source: str
    target: str
    matrix: Array
    neutral: Array
    error: float | None = None

    def __post_init__(self) -> None:
        named, neutral = f"RAW transfer {self.source} to {self.target}", self.neutral
        if not is_invertible(self.matrix):
            raise ProfileError(f"{named}: the matrix is not invertible")
        if not (neutral.shape == (3,) and np.all(np.isfinite(neutral)) and np.all(neutral > 0)):
            raise ProfileError(f"{named}: its white is not three positive numbers")

    def __call__(self, raw: ArrayLike) -> Array:
        """RAW (…, 3) → RAW (…, 3). Raises ImageError on another shape or on integers."""
        return checked_colours(raw) @ self.matrix.T

    def under(self, source: Array, target: Array | None) -> "RawTransfer":
        """The transfer under another illuminant than that of the fit, of which both multipliers (3,) are given.

        White-balanced colours change little with the illuminant, RAW ones much: the matrix between balanced ones stays.
        """
        if target is None:
            return self
        white = self(self.neutral)
        balance = source * self.neutral
        unbalance = white[1] / white / target
        return replace(self, matrix=unbalance[:, None] * self.matrix * balance, neutral=self.neutral / balance)

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
        matrix, neutral = (np.array(document[name], dtype=np.float64) for name in ("matrix", "neutral"))
        error = None if document["error"] is None else float(document["error"])
        return RawTransfer(str(document["source"]), str(document["target"]), matrix, neutral, error)
