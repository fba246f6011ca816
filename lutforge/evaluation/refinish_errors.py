"""The error of refinishing (thesis, Fig. 6.2): a JPEG under one setting → the JPEG of the same scene under another.

What a camera renders depends on the RAW values and the settings only. So two samples whose RAW values are in one ratio
k in all three channels are a true pair, and the second JPEG value is what refinishing the first by k should give.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from lutforge.arrays import Array
from lutforge.evaluation.errors_table import ErrorFigures, error_figures
from lutforge.evaluation.methods import LATTICE, NO_GAMUT_MAP, RBF, Predictions

UNCHANGED = "unchanged"
"""The method that leaves the JPEG as it is: how far apart the two settings are."""


@dataclass(frozen=True)
class RefinishError:
    """One line of the table.

    source, target: STYLE/WB; method: what refinished, or "unchanged"; shots: pairs of shots; held_out: whether no fit
    had seen the shot that it was applied to.
    """

    source: str
    target: str
    method: str
    held_out: bool
    shots: int
    figures: ErrorFigures


def refinish_errors(styles: Mapping[str, Predictions]) -> tuple[RefinishError, ...]:
    """Measure every ordered pair of settings under which shots show the same surfaces, by method."""
    shots = []
    for name, predictions in styles.items():
        for shot in np.unique(predictions.data.shot):
            rows = np.flatnonzero(predictions.data.shot == shot)
            shots.append((name, str(predictions.data.samples.white_balance[rows[0]]), rows))
    # By the two settings, of each pair of shots: the rows of their styles' samples that are one surface, and the k of
    # each row.
    groups: dict[tuple[str, str, str, str], list[tuple[NDArray[np.intp], NDArray[np.intp], Array]]] = {}
    for (style_a, balance_a, rows_a), (style_b, balance_b, rows_b) in product(shots, shots):
        if (style_a, balance_a) == (style_b, balance_b):
            continue
        one, other = styles[style_a].data.samples, styles[style_b].data.samples
        _, a, b = np.intersect1d(one.patch[rows_a], other.patch[rows_b], return_indices=True)
        if len(a) < 6:  # fewer surfaces may agree by chance
            continue
        a, b = rows_a[a], rows_b[b]
        ratio = float(np.exp(np.median(np.log(other.raw[b] / one.raw[a]))))
        expected = ratio * one.raw[a]
        # Equal within 2 % and the noise of dark values; of one scene under one light half the surfaces are.
        same = np.all(np.abs(other.raw[b] - expected) < 0.02 * expected + 5e-4, axis=1)
        if same.sum() >= max(6, 0.5 * len(a)) and abs(np.log2(ratio)) <= 3.0:
            pair = a[same], b[same], np.full((same.sum(), 1), ratio)
            groups.setdefault((style_a, balance_a, style_b, balance_b), []).append(pair)
    errors = []
    for (style_a, balance_a, style_b, balance_b), pairs in groups.items():
        before, after = styles[style_a], styles[style_b]
        a, b, k = (np.concatenate(column) for column in zip(*pairs, strict=True))
        held_out = bool(before.held_out[a].all() and after.held_out[b].all())
        gain_before = before.data.balanced[a] / before.data.samples.raw[a]
        gain_after = after.data.balanced[b] / after.data.samples.raw[b]
        refinished = {UNCHANGED: before.data.encoded[a]}
        for method in (RBF, NO_GAMUT_MAP, LATTICE):
            if method in before.methods and method in after.methods:
                # (6.1); the camera clips RAW after white balance
                balanced = before.predicted.linearize[method][a] / gain_before * k * gain_after
                refinished[method] = np.clip(after.render(method, np.clip(balanced, 0.0, 1.0), b), 0.0, 1.0)
        for method, values in refinished.items():
            made = np.all(np.isfinite(values), axis=1)
            if made.any():
                figures = error_figures(values[made], after.data.encoded[b][made], display=True)
                source, target = f"{style_a}/{balance_a}", f"{style_b}/{balance_b}"
                errors.append(RefinishError(source, target, method, held_out, len(pairs), figures))
    return tuple(errors)
