"""How well a JPEG is linearized, as an editor sees it: ΔE00 after the recovered light is exposed and balanced anew.

The RMSE of RAW counts dark and bright errors alike, which an edit does not: two stops more show every error of the
shadows. So the light that a method finds in a JPEG, and the light that was there, are both rendered by the profile's
own model with the same edit, and compared as pictures.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lutforge.arrays import Array
from lutforge.colour.colour_difference import delta_e_2000
from lutforge.evaluation.held_out import Predictions
from lutforge.evaluation.methods import LATTICE, RBF
from lutforge.solvers.gauss_newton import gauss_newton

EDITS = {
    "−2 EV": (0.25, 0.25, 0.25),
    "−1 EV": (0.5, 0.5, 0.5),
    "+1 EV": (2.0, 2.0, 2.0),
    "+2 EV": (4.0, 4.0, 4.0),
    "warmer": (1.25, 1.0, 0.8),
    "cooler": (0.8, 1.0, 1.25),
}
"""Gains of white-balanced RAW. The two white balances are about 1000 K away from daylight, to either side."""
INVERTED = "render inverted"
"""The method that searches for the light which the profile's own model renders as the JPEG."""


@dataclass(frozen=True)
class EditedError:
    """One line of the table: mean ΔE00 of each of EDITS, in their order."""

    style: str
    method: str
    held_out: bool
    count: int
    de00: tuple[float, ...]


def edited_errors(style: str, predictions: Predictions) -> tuple[EditedError, ...]:
    """Measure the edits of a style's samples by method; empty where the profile holds no model that renders."""
    model = next((name for name in (LATTICE, RBF) if name in predictions.methods), None)
    if model is None:
        return ()
    data, light = predictions.data, dict(predictions.predicted.linearize)
    rendered = np.isfinite(predictions.predicted.render[model]).all(axis=1)
    rows = np.flatnonzero(rendered)
    start = np.where(np.isfinite(light[model][rows]), light[model][rows], data.balanced[rows])
    light[INVERTED] = np.full_like(data.balanced, np.nan)
    light[INVERTED][rows] = _inverted(predictions, model, data.encoded[rows], np.clip(start, 0.0, 1.0), rows)
    wanted = {
        name: predictions.render(model, np.clip(data.balanced * gain, 0.0, 1.0), np.arange(len(data.balanced)))
        for name, gain in EDITS.items()
    }
    result = []
    for method, found in light.items():
        rows = np.flatnonzero(rendered & np.isfinite(found).all(axis=1))
        if not len(rows):
            continue
        differences = []
        for name, gain in EDITS.items():
            shown = predictions.render(model, np.clip(found[rows] * gain, 0.0, 1.0), rows)
            differences.append(float(delta_e_2000(shown, wanted[name][rows]).mean()))
        held_out = bool(np.all(predictions.held_out[rows]))
        result.append(EditedError(style, method, held_out, len(rows), tuple(differences)))
    return tuple(result)


def _inverted(predictions: Predictions, model: str, encoded: Array, start: Array, rows: NDArray[np.intp]) -> Array:
    """White-balanced RAW (m, 3) that the model renders as the colours (m, 3), or as near as it can."""
    step = 1e-4

    def linearize(balanced: Array, which: NDArray[np.intp]) -> tuple[Array, Array]:
        residual = predictions.render(model, balanced, rows[which]) - encoded[which]
        slopes = []
        for channel in range(3):
            inward = np.where(balanced[:, channel] > 0.5, -step, step)
            moved = balanced.copy()
            moved[:, channel] += inward
            slope = predictions.render(model, moved, rows[which]) - encoded[which] - residual
            slopes.append(slope / inward[:, None])
        return residual, np.ascontiguousarray(np.stack(slopes, axis=-1))

    return gauss_newton(linearize, start, lower=0.0, upper=1.0).value
