"""The linearization error δ over exposure pairs, with and without the gamut map (thesis 4.3.1, equation 4.11)."""

from collections.abc import Iterator

import numpy as np

from lutforge.arrays import Array, Mask
from lutforge.calibration.exposure_pairs import ExposurePairs
from lutforge.calibration.options import BETA
from lutforge.calibration.pairs_of_samples import pairs_of_samples
from lutforge.calibration.response_from_exposures import fit_response_by_least_squares, fit_response_to_exposures
from lutforge.colour.saturation import saturation
from lutforge.errors import CalibrationError
from lutforge.evaluation.predictions import Predictions
from lutforge.evaluation.raw_errors import MethodError


def delta(first: Array, second: Array, ratio: Array) -> tuple[float, float, float]:
    """(4.11): root mean square of k' f⁻¹(i) − f⁻¹(i') per channel; first, second linear (n, 3); ratio k' (n,)."""
    r, g, b = (float(value) for value in np.sqrt(np.mean((ratio[:, None] * first - second) ** 2, axis=0)))
    return (r, g, b)


def linearization_errors(style: str, predictions: Predictions, matrix: Array) -> Iterator[MethodError]:
    """δ over all exposure pairs of a style, by method; each shot is linearized by a fit that has not seen it.

    matrix: Ts (3, 3), which takes a method's prediction of Tw E to linear sRGB. It is the same for all methods: with
    the full model the result is h⁻¹(f⁻¹(I)), without h it is f⁻¹(I). An error is held out where no fit had seen the
    shots of its pairs. Without exposure pairs there are no errors.
    """
    try:
        pairs = pairs_of_samples(predictions.data.samples)
    except CalibrationError:
        return
    ratio = np.exp(pairs.log_ratio)
    for method in predictions.methods:
        linear = predictions.predicted.linearize[method] @ matrix.T
        first = linear[pairs.first_row]
        second = linear[pairs.second_row]
        finite = np.all(np.isfinite(first) & np.isfinite(second), axis=1)
        if finite.any():
            rows = np.concatenate([pairs.first_row[finite], pairs.second_row[finite]])
            held_out = bool(np.all(predictions.held_out[rows]))
            error = dict(zip("RGB", delta(first[finite], second[finite], ratio[finite]), strict=True))
            yield MethodError(style, method, held_out, int(finite.sum()), error)

    scene = (predictions.data.balanced @ matrix.T)[pairs.first_row]
    for name, channels in response_deltas(pairs, scene).items():
        error = dict(zip("RGB", channels, strict=True))
        yield MethodError(style, f"f of exposures, {name}", False, int(_unsaturated(pairs).sum()), error)


def response_deltas(pairs: ExposurePairs, scene: Array | None = None) -> dict[str, tuple[float, float, float]]:
    """δ (r, g, b) of f⁻¹ alone, by the colours that f was fitted to (thesis, Fig. 4.2).

    The keys are "outliers removed" and "all colours". δ is measured on unsaturated colours, which the gamut map does
    not change: for saturated colours f⁻¹ alone is not linear in the scene. scene: linear values (n, 3) of the first
    colour of each pair. Exposures do not determine the scale of f⁻¹, so each f⁻¹ gets the scale of these values, or by
    default that of the first f⁻¹. The result is empty where the pairs do not determine a response.
    """
    try:
        fits = {
            "outliers removed": fit_response_to_exposures(pairs),
            "all colours": fit_response_by_least_squares(pairs, np.inf),
        }
    except CalibrationError:
        return {}
    unsaturated = pairs.select(_unsaturated(pairs))
    deltas = dict[str, tuple[float, float, float]]()
    scale = None if scene is None else scene[_unsaturated(pairs)].sum(axis=0)
    for name, fit in fits.items():
        first = fit.response.linearize(unsaturated.first)
        second = fit.response.linearize(unsaturated.second)
        scale = first.sum(axis=0) if scale is None else scale
        factor = scale / first.sum(axis=0)
        ratio = np.exp(unsaturated.corrected(fit.shot_error).log_ratio)
        deltas[name] = delta(factor * first, factor * second, ratio)
    return deltas


def _unsaturated(pairs: ExposurePairs) -> Mask:
    """Mask (n,) of pairs of unsaturated colours."""
    return np.asarray(np.maximum(saturation(pairs.first), saturation(pairs.second)) < BETA)
