"""Finds shifted rows of a table: the RAW value of one sample beside the JPEG value of another."""

import numpy as np
from numpy.typing import NDArray

from lutforge.arrays import Array
from lutforge.calibration.plausibility.colour_chain import CODE, ColourChain
from lutforge.model.diagnosis import Diagnosis


def shifted_rows(
    chain: ColourChain, raw: Array, multipliers: Array, encoded: Array, shot: NDArray[np.str_]
) -> Diagnosis | None:
    """Diagnose shots whose JPEG values (n, 3) fit RAW (n, 3) a few rows up or down far better than their own."""
    rendered = chain.encoded(chain.predicted(raw * multipliers, multipliers))
    slipped, farthest = [], 8  # the largest shift that is tried
    for name in np.unique(shot):
        rows = np.flatnonzero(shot == name)
        if len(rows) < 2 * farthest:
            continue
        errors = {step: _error(rendered[rows], encoded[rows], step) for step in range(-farthest, farthest + 1)}
        best = min(errors, key=lambda step: errors[step])
        if best and errors[0] > 2 * CODE and errors[best] < 0.85 * errors[0]:
            slipped.append((str(name), best))
    if not slipped:
        return None
    listed = ", ".join(f"{name} (by {step:+d})" for name, step in slipped[:4])
    return Diagnosis(
        f"the rows of {len(slipped)} of {len(np.unique(shot))} shots are shifted",
        f"JPEG values fit the RAW of other rows: {listed}",
        "pair the columns anew",
    )


def _error(rendered: Array, encoded: Array, step: int) -> float:
    """The mean distance, each limited to 32 codes, when JPEG values are taken from `step` rows further down."""
    first, last = max(-step, 0), len(rendered) - max(step, 0)
    distance = np.linalg.norm(rendered[first:last] - encoded[first + step : last + step], axis=1)
    return float(np.minimum(distance, 32 * CODE).mean())
