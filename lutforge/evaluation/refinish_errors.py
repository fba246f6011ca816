"""Errors of refinishing a JPEG from one setting to another, without a picture taken for it (thesis, Fig. 6.2).

A rendering depends on RAW values and settings only. Two samples whose RAW values have the same ratio k in all channels
are therefore a pair of source and target for which the true result is known.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from lutforge.arrays import Array
from lutforge.evaluation.figures import ErrorFigures, error_figures
from lutforge.evaluation.methods import CAMERA_MODEL, LATTICE, NO_GAMUT_MAP
from lutforge.evaluation.predictions import Predictions

UNCHANGED = "unchanged"
"""The method that leaves the JPEG unchanged: its error is the difference of the two settings."""


@dataclass(frozen=True)
class RefinishError:
    """One row of the table of refinishing.

    source, target: STYLE/WB; method: of the refinish, or "unchanged"; shots: the number of pairs of shots; held_out: no
    fit had seen the shot that it was applied to.
    """

    source: str
    target: str
    method: str
    held_out: bool
    shots: int
    figures: ErrorFigures


def refinish_errors(styles: Mapping[str, Predictions]) -> tuple[RefinishError, ...]:
    """The errors of refinishing by method, for each ordered pair of settings whose shots show the same surfaces."""
    errors = []
    for (style_a, balance_a, style_b, balance_b), pairs in _pairs_of_settings(styles).items():
        before = styles[style_a]
        after = styles[style_b]
        a, b, k = (np.concatenate(column) for column in zip(*pairs, strict=True))
        held_out = bool(before.held_out[a].all() and after.held_out[b].all())
        gain_before = before.data.balanced[a] / before.data.samples.raw[a]
        gain_after = after.data.balanced[b] / after.data.samples.raw[b]
        refinished = {UNCHANGED: before.data.encoded[a]}
        for method in (CAMERA_MODEL, NO_GAMUT_MAP, LATTICE):
            if method in before.methods and method in after.methods:
                # (6.1); the camera clips RAW after white balance
                balanced = before.predicted.linearize[method][a] / gain_before * k * gain_after
                refinished[method] = np.clip(after.render(method, np.clip(balanced, 0.0, 1.0), b), 0.0, 1.0)
        for method, values in refinished.items():
            finite = np.all(np.isfinite(values), axis=1)
            if finite.any():
                figures = error_figures(values[finite], after.data.encoded[b][finite], display=True)
                source, target = f"{style_a}/{balance_a}", f"{style_b}/{balance_b}"
                errors.append(RefinishError(source, target, method, held_out, len(pairs), figures))
    return tuple(errors)


def _pairs_of_settings(
    styles: Mapping[str, Predictions],
) -> dict[tuple[str, str, str, str], list[tuple[NDArray[np.intp], NDArray[np.intp], Array]]]:
    """Pairs of shots that show the same surfaces, by their settings.

    A key is (style, white balance, style, white balance) of the first and the second shot. A value has for each pair of
    shots the rows of the common surfaces in the samples of the two styles, and the ratio k (n, 1) of RAW.
    """
    shots = []
    for name, predictions in styles.items():
        for shot in np.unique(predictions.data.shot):
            rows = np.flatnonzero(predictions.data.shot == shot)
            shots.append((name, str(predictions.data.samples.white_balance[rows[0]]), rows))

    groups: dict[tuple[str, str, str, str], list[tuple[NDArray[np.intp], NDArray[np.intp], Array]]] = {}
    for (style_a, balance_a, rows_a), (style_b, balance_b, rows_b) in product(shots, shots):
        if (style_a, balance_a) == (style_b, balance_b):
            continue
        samples_a = styles[style_a].data.samples
        samples_b = styles[style_b].data.samples
        _, a, b = np.intersect1d(samples_a.patch[rows_a], samples_b.patch[rows_b], return_indices=True)
        if len(a) < 6:  # fewer surfaces may agree by chance
            continue
        a = rows_a[a]
        b = rows_b[b]
        ratio = float(np.exp(np.median(np.log(samples_b.raw[b] / samples_a.raw[a]))))
        expected = ratio * samples_a.raw[a]
        # Equal within 2 % and the noise of dark values. In two shots of one scene at least half of the surfaces are.
        equal = np.all(np.abs(samples_b.raw[b] - expected) < 0.02 * expected + 5e-4, axis=1)
        if equal.sum() >= max(6, 0.5 * len(a)) and abs(np.log2(ratio)) <= 3.0:
            pair = a[equal], b[equal], np.full((equal.sum(), 1), ratio)
            groups.setdefault((style_a, balance_a, style_b, balance_b), []).append(pair)
    return groups
