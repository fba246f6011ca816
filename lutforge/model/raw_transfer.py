"""One camera's RAW → another's: Tc (thesis 6.2), or a root polynomial.

The root polynomial adds √rg, √gb and √rb to r, g and b (Finlayson, Mackiewicz and Hurlbert, "Color correction using
root-polynomial regression", IEEE TIP 24, 2015). Both keep the scale: twice the light is twice the answer.
"""

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
from lutforge.model.profile_data import is_invertible

FORMAT = "lutforge-raw-transfer"
FORMAT_VERSION = 2


def root_terms(balanced: Array) -> Array:
    """Return r, g, b, √rg, √gb and √rb (n, 6) of white-balanced RAW (n, 3).

    The roots of negative values, which noise makes, are 0.
    """
    r, g, b = np.sqrt(np.maximum(balanced, 0.0)).T
    return np.column_stack([balanced, r * g, g * b, r * b])


@dataclass(frozen=True, eq=False)
class RawTransfer:
    """RAW of `source` → RAW of `target`, both before white balance.

    matrix: Tc (3, 3); roots (6, 3) of `root_terms`: instead, where fitted. neutral: (3,) the source's RAW of a white
    under the light of the fit. error: root mean square of the pairs that the fit had not seen, relative to their norm.
    """

    source: str
    target: str
    matrix: Array
    neutral: Array
    roots: Array | None = None
    error: float | None = None

    def __post_init__(self) -> None:
        named, neutral, roots = f"RAW transfer {self.source} to {self.target}", self.neutral, self.roots
        if not is_invertible(self.matrix):
            raise ProfileError(f"{named}: the matrix is not invertible")
        if not (neutral.shape == (3,) and np.all(np.isfinite(neutral)) and np.all(neutral > 0)):
            raise ProfileError(f"{named}: its white is not three positive numbers")
        if roots is not None and (roots.shape != (6, 3) or not np.all(np.isfinite(roots))):
            raise ProfileError(f"{named}: its root polynomial is not 6 × 3 numbers")

    def __call__(self, raw: ArrayLike) -> Array:
        """RAW (…, 3) → RAW (…, 3). Raises ImageError on another shape or on integers."""
        x = checked_colours(raw)
        if self.roots is None:
            return x @ self.matrix.T
        return (root_terms(x.reshape(-1, 3) / self.neutral) @ self.roots).reshape(x.shape)

    def under(self, source: Array, target: Array | None) -> "RawTransfer":
        """The transfer under another light than that of the fit, whose multipliers (3,) are known for both cameras.

        White-balanced colours change little with the light, RAW ones much: the fit is carried over between them.
        """
        if target is None:
            return self
        white = self(self.neutral)
        before, behind = source * self.neutral, white[1] / white / target
        return replace(
            self,
            matrix=behind[:, None] * self.matrix * before,
            neutral=self.neutral / before,
            roots=None if self.roots is None else self.roots * behind,
        )

    def save(self, path: str | Path) -> None:
        """Write the transfer (.json), atomically; `load_transfer` reads it."""
        document = {
            "format": FORMAT,
            "version": FORMAT_VERSION,
            "software": f"LutForge {__version__}",
            "source": self.source,
            "target": self.target,
            "matrix": self.matrix.tolist(),
            "neutral": self.neutral.tolist(),
            "error": self.error,
            "roots": None if self.roots is None else self.roots.tolist(),
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
        if not isinstance(document, dict) or document.get("format") != FORMAT:
            raise ProfileError(f"{path}: not a RAW transfer; make one with `lutforge transfer`")
        if document["version"] != FORMAT_VERSION or document.get("wedges") is not None:
            raise ProfileError(f"{path}: of another version of LutForge; make it anew with `lutforge transfer`")
        matrix, neutral = (np.array(document[name], dtype=np.float64) for name in ("matrix", "neutral"))
        roots = None if document["roots"] is None else np.array(document["roots"], dtype=np.float64)
        error = None if document["error"] is None else float(document["error"])
        return RawTransfer(str(document["source"]), str(document["target"]), matrix, neutral, roots, error)


def chained(transfers: list[RawTransfer]) -> RawTransfer:
    """One transfer through a reference camera: Tc(1→3) = Tc(2→3) Tc(1→2), of their matrices.

    Raises ProfileError where one does not begin at the camera at which the one before ends.
    """
    first, *rest = transfers
    for other in rest:
        if other.source != first.target:
            raise ProfileError(
                f"the RAW transfer {first.source} to {first.target} cannot be followed by "
                f"{other.source} to {other.target}"
            )
        first = RawTransfer(first.source, other.target, other.matrix @ first.matrix, first.neutral)
    return first
