"""One camera's RAW → another's: Tc (thesis 6.2), its piecewise-linear form (7.2), or a root polynomial.

The piecewise-linear form cuts RAW space into wedges between the neutral axis and neighbouring hues, each with a matrix
of its own, continuous where they meet (Andersen and Hardeberg, "Camera characterization of hue-planes", CIC 13, 2005).
The root polynomial adds √rg, √gb and √rb to r, g and b (Finlayson, Mackiewicz and Hurlbert, "Color correction using
root-polynomial regression", IEEE TIP 24, 2015). All keep the scale: twice the light is twice the answer.
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

OPPONENT = np.array([[1.0, -0.5, -0.5], [0.0, np.sqrt(0.75), -np.sqrt(0.75)]])
"""The plane of hues, seen along the neutral axis."""


@dataclass(frozen=True, eq=False)
class HueWedges:
    """Wedges around the neutral axis.

    neutral: (3,) source RAW of a white; hues: (K,) angles in radians, increasing within one turn, of the edges between
    wedges, after white balance by `neutral`; images: (K + 1, 3) the target RAW of the neutral, then of a unit step
    along each edge.

    Raises ProfileError where a wedge is wider than half a turn.
    """

    neutral: Array
    hues: Array
    images: Array

    def __post_init__(self) -> None:
        count = len(self.hues)
        if not 3 <= count <= 64 or self.images.shape != (count + 1, 3) or self.neutral.shape != (3,):
            raise ProfileError(f"RAW transfer: {count} hues and {self.images.shape} images do not make wedges")
        if not all(np.all(np.isfinite(part)) for part in (self.hues, self.images, self.neutral)):
            raise ProfileError("RAW transfer: a number is not finite")
        gaps = np.diff(np.concatenate([self.hues, self.hues[:1] + 2 * np.pi]))
        if np.any(gaps <= 0) or np.any(gaps >= np.pi) or np.any(self.neutral <= 0):
            raise ProfileError("RAW transfer: hues increase within one turn, by less than half a turn each")

    def coordinates(self, raw: Array) -> Array:
        """(n, K + 1) weights of the images for RAW (n, 3): the share of neutral, then of the two edges of its wedge."""
        balanced = raw / self.neutral
        plane = balanced @ OPPONENT.T
        angle = np.mod(np.arctan2(plane[:, 1], plane[:, 0]) - self.hues[0], 2 * np.pi) + self.hues[0]
        first = np.clip(np.searchsorted(self.hues, angle, side="right") - 1, 0, len(self.hues) - 1)
        second = (first + 1) % len(self.hues)
        edge = np.stack([np.cos(self.hues), np.sin(self.hues)], axis=1)
        a, b = edge[first], edge[second]
        area = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
        rows = np.arange(len(raw))
        weights = np.zeros((len(raw), len(self.hues) + 1))
        weights[:, 0] = balanced.mean(axis=1)
        weights[rows, first + 1] += (plane[:, 0] * b[:, 1] - plane[:, 1] * b[:, 0]) / area
        weights[rows, second + 1] += (a[:, 0] * plane[:, 1] - a[:, 1] * plane[:, 0]) / area
        return weights


def root_terms(balanced: Array) -> Array:
    """Return r, g, b, √rg, √gb and √rb (n, 6) of white-balanced RAW (n, 3).

    The roots of negative values, which noise makes, are 0.
    """
    r, g, b = np.sqrt(np.maximum(balanced, 0.0)).T
    return np.column_stack([balanced, r * g, g * b, r * b])


@dataclass(frozen=True, eq=False)
class RawTransfer:
    """RAW of `source` → RAW of `target`, both before white balance.

    matrix: Tc (3, 3); wedges, or roots (6, 3) of `root_terms`: instead, where fitted.
    neutral: (3,) the source's RAW of a white under the light of the fit, where known. error: root mean square of the
    pairs that the fit had not seen, relative to their norm.
    """

    source: str
    target: str
    matrix: Array
    neutral: Array | None = None
    wedges: HueWedges | None = None
    error: float | None = None
    roots: Array | None = None

    def __post_init__(self) -> None:
        named, neutral, roots = f"RAW transfer {self.source} to {self.target}", self.neutral, self.roots
        if not is_invertible(self.matrix):
            raise ProfileError(f"{named}: the matrix is not invertible")
        if neutral is not None and not (neutral.shape == (3,) and np.all(np.isfinite(neutral)) and np.all(neutral > 0)):
            raise ProfileError(f"{named}: its white is not three positive numbers")
        if roots is not None and (neutral is None or roots.shape != (6, 3) or not np.all(np.isfinite(roots))):
            raise ProfileError(f"{named}: its root polynomial is not 6 × 3 numbers")

    @property
    def is_linear(self) -> bool:
        """True where it is one matrix."""
        return self.wedges is None and self.roots is None

    def __call__(self, raw: ArrayLike) -> Array:
        """RAW (…, 3) → RAW (…, 3). Raises ImageError on another shape or on integers."""
        x = checked_colours(raw)
        flat = x.reshape(-1, 3)
        if self.wedges is not None:
            return (self.wedges.coordinates(flat) @ self.wedges.images).reshape(x.shape)
        if self.roots is not None and self.neutral is not None:
            return (root_terms(flat / self.neutral) @ self.roots).reshape(x.shape)
        return x @ self.matrix.T

    def under(self, source: Array, target: Array | None) -> "RawTransfer":
        """The transfer under another light than that of the fit, whose multipliers (3,) are known for both cameras.

        White-balanced colours change little with the light, RAW ones much: the fit is carried over between them.
        """
        if self.neutral is None or target is None:
            return self
        white, wedges, roots = self(self.neutral), self.wedges, self.roots
        before, behind = source * self.neutral, white[1] / white / target
        return replace(
            self,
            matrix=behind[:, None] * self.matrix * before,
            neutral=self.neutral / before,
            wedges=None if wedges is None else HueWedges(wedges.neutral / before, wedges.hues, wedges.images * behind),
            roots=None if roots is None else roots * behind,
        )

    def save(self, path: str | Path) -> None:
        """Write the transfer (.json), atomically; `load_transfer` reads it."""
        wedges = self.wedges
        document = {
            "format": FORMAT,
            "version": FORMAT_VERSION,
            "software": f"LutForge {__version__}",
            "source": self.source,
            "target": self.target,
            "matrix": self.matrix.tolist(),
            "neutral": None if self.neutral is None else self.neutral.tolist(),
            "wedges": None if wedges is None else {"hues": wedges.hues.tolist(), "images": wedges.images.tolist()},
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
        if document["version"] != FORMAT_VERSION:
            raise ProfileError(f"{path}: version {document['version']}; this LutForge reads version {FORMAT_VERSION}")

        def array(name: str) -> Array | None:
            return None if document[name] is None else np.array(document[name], dtype=np.float64)

        neutral, matrix, stored = array("neutral"), np.array(document["matrix"], dtype=np.float64), document["wedges"]
        wedges = None
        if stored is not None and neutral is not None:
            wedges = HueWedges(neutral, *(np.array(stored[name], dtype=np.float64) for name in ("hues", "images")))
        error = None if document["error"] is None else float(document["error"])
        names = str(document["source"]), str(document["target"])
        return RawTransfer(*names, matrix, neutral, wedges, error, array("roots"))


def chained(transfers: list[RawTransfer]) -> RawTransfer:
    """One transfer through a reference camera: Tc(1→3) = Tc(2→3) Tc(1→2). Other forms are kept by their matrices.

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
