"""The ΔE00 that remains after an edit of exposure or white balance, for values recovered from JPEGs and true ones.

In the root mean square error of RAW, an error has the same weight in dark and in bright colours. An edit changes that:
at two stops more, every error of the shadows is seen. Therefore the recovered and the true linear values get the same
edit, the model of the profile renders both, and the pictures are compared.
"""

from collections.abc import Iterator

import numpy as np

from lutforge.colour.srgb import delta_e_2000
from lutforge.evaluation.methods import CAMERA_MODEL, LATTICE
from lutforge.evaluation.predictions import Predictions
from lutforge.evaluation.raw_errors import MethodError

EDITS = {
    "−2 EV": (0.25, 0.25, 0.25),
    "−1 EV": (0.5, 0.5, 0.5),
    "+1 EV": (2.0, 2.0, 2.0),
    "+2 EV": (4.0, 4.0, 4.0),
    "warmer": (1.25, 1.0, 0.8),
    "cooler": (0.8, 1.0, 1.25),
}
"""Gains of white-balanced RAW, by name. "warmer" and "cooler" are about 1000 K away from daylight."""


def edited_errors(style: str, predictions: Predictions) -> Iterator[MethodError]:
    """The mean ΔE00 of each of EDITS over a style's samples, by method; none where no model of the profile renders."""
    model = next((name for name in (CAMERA_MODEL, LATTICE) if name in predictions.methods), None)
    if model is None:
        return
    data = predictions.data
    is_rendered = np.isfinite(predictions.predicted.render[model]).all(axis=1)
    from_raw = {
        name: predictions.render(model, np.clip(data.balanced * gain, 0.0, 1.0), np.arange(len(data.balanced)))
        for name, gain in EDITS.items()
    }
    for method, recovered in predictions.predicted.linearize.items():
        rows = np.flatnonzero(is_rendered & np.isfinite(recovered).all(axis=1))
        differences = {}
        for name, gain in EDITS.items() if len(rows) else ():
            from_jpeg = predictions.render(model, np.clip(recovered[rows] * gain, 0.0, 1.0), rows)
            differences[name] = float(delta_e_2000(from_jpeg, from_raw[name][rows]).mean())
        if differences:
            yield MethodError(style, method, bool(np.all(predictions.held_out[rows])), len(rows), differences)
