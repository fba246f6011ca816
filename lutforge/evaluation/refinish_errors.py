"""The error of refinishing (thesis, Fig. 6.2): a JPEG under one setting → the JPEG of the same scene under another.

What a camera renders depends on the RAW values and the settings only. So two samples whose RAW values are in one ratio
k in all three channels are a true pair, and the second JPEG value is what refinishing the first by k should give.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from lutforge.arrays import Array
from lutforge.evaluation.errors_table import ErrorFigures, error_figures
from lutforge.evaluation.held_out import Predictions
from lutforge.evaluation.methods import LATTICE, NO_GAMUT_MAP, RBF

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


@dataclass(frozen=True, eq=False)
class SettingPair:
    """Two shots of one scene under two settings. source_row, target_row: (m,) samples of their styles; ratio: k."""

    source: tuple[str, str]
    target: tuple[str, str]
    source_row: NDArray[np.intp]
    target_row: NDArray[np.intp]
    ratio: float


def setting_pairs(styles: Mapping[str, Predictions]) -> Iterator[SettingPair]:
    """All ordered pairs of shots that show the same surfaces, told by their RAW values, under different settings."""
    shots = []
    for name, predictions in styles.items():
        for shot in np.unique(predictions.data.shot):
            rows = np.flatnonzero(predictions.data.shot == shot)
            shots.append((name, str(predictions.data.samples.white_balance[rows[0]]), rows))
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
            yield SettingPair((style_a, balance_a), (style_b, balance_b), a[same], b[same], ratio)


def refinish_errors(styles: Mapping[str, Predictions]) -> tuple[RefinishError, ...]:
    """Measure every pair of settings that shots of one scene show, by method; empty where there are none.

    Each of the two steps of (6.1) is made by the fit that has not seen the shot it is applied to.
    """
    groups: dict[tuple[str, str], list[SettingPair]] = {}
    for pair in setting_pairs(styles):
        groups.setdefault(("/".join(pair.source), "/".join(pair.target)), []).append(pair)
    rows = []
    for (source, target), pairs in groups.items():
        before, after = styles[pairs[0].source[0]], styles[pairs[0].target[0]]
        held_out = all(before.held_out[p.source_row].all() and after.held_out[p.target_row].all() for p in pairs)
        wanted = np.concatenate([after.data.encoded[pair.target_row] for pair in pairs])
        given = np.concatenate([before.data.encoded[pair.source_row] for pair in pairs])
        refinished = {UNCHANGED: given}
        for method in (RBF, NO_GAMUT_MAP, LATTICE):
            if method in before.methods and method in after.methods:
                refinished[method] = np.concatenate([_refinish(before, after, pair, method) for pair in pairs])
        for method, values in refinished.items():
            made = np.all(np.isfinite(values), axis=1)
            if made.any():
                figures = error_figures(values[made], wanted[made], display=True)
                rows.append(RefinishError(source, target, method, held_out, len(pairs), figures))
    return tuple(rows)


def _refinish(before: Predictions, after: Predictions, pair: SettingPair, method: str) -> Array:
    """(6.1) on the pair's JPEG values (m, 3); the camera clips RAW after white balance."""
    gain_before = before.data.balanced[pair.source_row] / before.data.samples.raw[pair.source_row]
    gain_after = after.data.balanced[pair.target_row] / after.data.samples.raw[pair.target_row]
    balanced = before.predicted.linearize[method][pair.source_row] / gain_before * pair.ratio * gain_after
    return np.clip(after.render(method, np.clip(balanced, 0.0, 1.0), pair.target_row), 0.0, 1.0)
