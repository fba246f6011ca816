"""Errors beside those of the two directions: of RAW, over exposure pairs, after edits, and of refinishing.

Each table is of one style's predictions, or of all styles', by method; no shot is judged by a fit that has seen it.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from lutforge.arrays import Array, Mask
from lutforge.calibration.exposure_pairs import ExposurePairs, pairs_of_samples
from lutforge.calibration.matrix_and_response import saturation
from lutforge.calibration.options import BETA
from lutforge.calibration.response_from_exposures import fit_response_by_least_squares, fit_response_to_exposures
from lutforge.colour.srgb import delta_e_2000
from lutforge.errors import CalibrationError
from lutforge.evaluation.figures import ErrorFigures, error_figures
from lutforge.evaluation.methods import LATTICE, MODEL, NO_GAMUT_MAP
from lutforge.evaluation.predictions import Predictions


@dataclass(frozen=True)
class MethodError:
    """An error of one method in a style. count: of samples, or of pairs; values: by the titles of their columns."""

    style: str
    method: str
    held_out: bool
    count: int
    values: dict[str, float]


def raw_errors(style: str, predictions: Predictions) -> Iterator[MethodError]:
    """JPEG → RAW before white balance, as the sensor gives it, by method: root mean square, 1 = full scale."""
    data = predictions.data
    gain = data.balanced / data.samples.raw
    for method in predictions.methods:
        error = np.clip(predictions.predicted.linearize[method], 0.0, 1.0) / gain - data.samples.raw
        known = np.all(np.isfinite(error), axis=1)
        squares = error[known] ** 2
        rms = np.sqrt([np.mean(squares), *np.mean(squares, axis=0)]).tolist()
        held_out = bool(np.all(predictions.held_out[known]))
        values = dict(zip(("RMSE", *"RGB"), rms, strict=True))
        yield MethodError(style, method, held_out, int(known.sum()), values)


# --- Over exposure pairs: the linearization error δ (thesis 4.3.1, equation 4.11), with and without the gamut map -----


def delta(first: Array, second: Array, ratio: Array) -> tuple[float, float, float]:
    """(4.11): root mean square of k' f⁻¹(i) − f⁻¹(i') per channel; first, second linear (n, 3); ratio k' (n,)."""
    r, g, b = (float(value) for value in np.sqrt(np.mean((ratio[:, None] * first - second) ** 2, axis=0)))
    return (r, g, b)


def linearization_errors(style: str, predictions: Predictions, matrix: Array) -> Iterator[MethodError]:
    """δ of all exposure pairs of a style by method, each shot linearized by the fit that has not seen it.

    matrix: Ts (3, 3), the same for all methods, takes what a method says of Tw E to linear sRGB: with the full model
    that is h⁻¹(f⁻¹(I)), without h it is f⁻¹(I). A point is held out where no fit had seen its shots. There are none
    without exposure pairs.
    """
    try:
        pairs = pairs_of_samples(predictions.data.samples)
    except CalibrationError:
        return
    ratio = np.exp(pairs.log_ratio)
    for method in predictions.methods:
        linear = predictions.predicted.linearize[method] @ matrix.T
        first, second = linear[pairs.first_row], linear[pairs.second_row]
        known = np.all(np.isfinite(first) & np.isfinite(second), axis=1)
        if known.any():
            used = np.concatenate([pairs.first_row[known], pairs.second_row[known]])
            held_out = bool(np.all(predictions.held_out[used]))
            error = dict(zip("RGB", delta(first[known], second[known], ratio[known]), strict=True))
            yield MethodError(style, method, held_out, int(known.sum()), error)
    light = (predictions.data.balanced @ matrix.T)[pairs.first_row]
    for name, channels in response_deltas(pairs, light).items():
        error = dict(zip("RGB", channels, strict=True))
        yield MethodError(style, f"f of exposures, {name}", False, int(_plain(pairs).sum()), error)


def response_deltas(pairs: ExposurePairs, light: Array | None = None) -> dict[str, tuple[float, float, float]]:
    """δ (r, g, b) of f⁻¹ alone, by what f was fitted to: "outliers removed", and "all colours" (thesis, Fig. 4.2).

    It is of unsaturated colours, which the gamut map leaves alone: of others f⁻¹ alone is not the light. light: linear
    light (n, 3) of the first of each pair, to whose scale f⁻¹ is brought, because exposures do not tell it; without it,
    that of the first f. Empty where the pairs do not determine a response.
    """
    try:
        fits = {
            "outliers removed": fit_response_to_exposures(pairs),
            "all colours": fit_response_by_least_squares(pairs, np.inf),
        }
    except CalibrationError:
        return {}
    plain, deltas = pairs.select(_plain(pairs)), dict[str, tuple[float, float, float]]()
    scale = None if light is None else light[_plain(pairs)].sum(axis=0)
    for name, fit in fits.items():
        first, second = fit.response.linearize(plain.first), fit.response.linearize(plain.second)
        scale = first.sum(axis=0) if scale is None else scale
        factor = scale / first.sum(axis=0)
        deltas[name] = delta(factor * first, factor * second, np.exp(plain.corrected(fit.shot_error).log_ratio))
    return deltas


def _plain(pairs: ExposurePairs) -> Mask:
    """(n,): pairs of unsaturated colours."""
    return np.asarray(np.maximum(saturation(pairs.first), saturation(pairs.second)) < BETA)


# --- How well a JPEG is linearized, as an editor sees it: ΔE00 after edits of the recovered light --------------------
# The RMSE of RAW counts dark and bright errors alike, which an edit does not: two stops more show every error of the
# shadows. So the light that a method finds in a JPEG, and the light that was there, are both rendered by the profile's
# own model with the same edit, and compared as pictures.


EDITS = {
    "−2 EV": (0.25, 0.25, 0.25),
    "−1 EV": (0.5, 0.5, 0.5),
    "+1 EV": (2.0, 2.0, 2.0),
    "+2 EV": (4.0, 4.0, 4.0),
    "warmer": (1.25, 1.0, 0.8),
    "cooler": (0.8, 1.0, 1.25),
}
"""Gains of white-balanced RAW. The two white balances are about 1000 K away from daylight, to either side."""


def edited_errors(style: str, predictions: Predictions) -> Iterator[MethodError]:
    """The mean ΔE00 of each of EDITS over a style's samples, by method; none where no model of the profile renders."""
    model = next((name for name in (MODEL, LATTICE) if name in predictions.methods), None)
    if model is None:
        return
    data, light = predictions.data, predictions.predicted.linearize
    rendered = np.isfinite(predictions.predicted.render[model]).all(axis=1)
    wanted = {
        name: predictions.render(model, np.clip(data.balanced * gain, 0.0, 1.0), np.arange(len(data.balanced)))
        for name, gain in EDITS.items()
    }
    for method, recovered in light.items():
        rows = np.flatnonzero(rendered & np.isfinite(recovered).all(axis=1))
        differences = {}
        for name, gain in EDITS.items() if len(rows) else ():
            shown = predictions.render(model, np.clip(recovered[rows] * gain, 0.0, 1.0), rows)
            differences[name] = float(delta_e_2000(shown, wanted[name][rows]).mean())
        if differences:
            yield MethodError(style, method, bool(np.all(predictions.held_out[rows])), len(rows), differences)


# --- Refinishing (thesis, Fig. 6.2): a JPEG under one setting → the JPEG of the same scene under another -------------
# What a camera renders depends on the RAW values and the settings only. So two samples whose RAW values are in one
# ratio k in all three channels are a true pair, and the second JPEG value is what refinishing the first by k should
# give.


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
        for method in (MODEL, NO_GAMUT_MAP, LATTICE):
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
