"""Fit one camera's RAW → another's from common scenes: a matrix (thesis 6.2), and a root polynomial where it is better.

Between the cameras of a fleet, of reflectances that were not fitted, a root polynomial errs by a fifth less than a
matrix under the light of the fit, and by 5 % less under others (medians of each half of the fleet). Of a chart of 24
patches it is better for nine pairs of cameras in ten: held-out colours decide.
"""

from dataclasses import replace

import numpy as np

from lutforge.arrays import Array
from lutforge.errors import CalibrationError
from lutforge.model.raw_transfer import RawTransfer, root_terms
from lutforge.samples.clipping import SATURATED
from lutforge.samples.sample_set import SampleSet
from lutforge.solvers.cross_validation import leave_samples_out, predict_held_out

LEAST_COMMON_COLOURS = 12
"""Colours that both cameras photographed and that a transfer needs at least."""
ALL_ALIKE = 1e-4
"""Colours whose RAW spreads by less than this share in any direction do not determine a matrix."""
NOISE_FLOOR = 0.05
"""Colours darker than this share of the brightest count by their absolute error, not by their relative one."""


def pair_samples(source: SampleSet, target: SampleSet) -> tuple[Array, Array, Array]:
    """Aligned RAW (n, 3) of both cameras and the source's RAW of white (3,), of the same patches in the same shots.

    Patches go together by name. Shots do by name too, or, where the cameras named them differently, in their order, if
    both have as many. Clipped colours are left out. Raises CalibrationError where too few are common.
    """
    names = [list(dict.fromkeys(samples.shot.tolist())) for samples in (source, target)]
    if not set(names[0]) & set(names[1]) and len(names[0]) == len(names[1]):
        renamed = dict(zip(names[1], names[0], strict=True))
        target = replace(target, shot=np.array([renamed[shot] for shot in target.shot.tolist()], dtype=np.str_))
    place = {key: row for row, key in enumerate(zip(target.shot.tolist(), target.patch.tolist(), strict=True))}
    rows = [
        (row, place[key])
        for row, key in enumerate(zip(source.shot.tolist(), source.patch.tolist(), strict=True))
        if key in place
    ]
    first, second = (np.array([pair[side] for pair in rows], dtype=np.intp) for side in (0, 1))
    x, y = source.raw[first], target.raw[second]
    usable = np.all((x > 0) & (x < SATURATED) & (y > 0) & (y < SATURATED), axis=1)
    if usable.sum() < LEAST_COMMON_COLOURS:
        raise CalibrationError(
            f"{int(usable.sum())} colours are common to both cameras, at least {LEAST_COMMON_COLOURS} are needed: "
            "photograph the same charts with both, and name the shots alike or give as many of each, in the same order"
        )
    multipliers = source.wb[first][usable]
    known = np.all(np.isfinite(multipliers), axis=1)
    if known.any():
        neutral = 1 / np.median(multipliers[known], axis=0)
    else:
        neutral = np.median(x[usable] / x[usable].mean(axis=1, keepdims=True), axis=0)
    return x[usable], y[usable], np.asarray(neutral)


def fit_raw_transfer(source: str, target: str, x: Array, y: Array, neutral: Array) -> RawTransfer:
    """Fit RAW of one camera → another's, x (n, 3) → y (n, 3), aligned, both before white balance.

    neutral: (3,) the source's RAW of a white, which lets the transfer serve under other lights. Colours count by their
    relative error; the error of the transfer is that of pairs left out of the fit, in five parts. Raises
    CalibrationError where the colours do not determine it.
    """
    if x.shape != y.shape or x.ndim != 2 or x.shape[1] != 3 or len(x) < LEAST_COMMON_COLOURS:
        raise CalibrationError(
            f"aligned RAW of shapes {x.shape} and {y.shape}; at least {LEAST_COMMON_COLOURS} pairs are needed"
        )
    if np.linalg.matrix_rank(x, tol=ALL_ALIKE * np.linalg.norm(x)) < 3:
        raise CalibrationError("the common colours are all alike: photograph a colour chart with both cameras")
    level = np.linalg.norm(y, axis=1)
    weight = 1 / np.maximum(level, NOISE_FLOOR * level.max())
    without_roots = _fitted(x, y, weight)
    with_roots = _fitted(np.hstack([x, root_terms(x / neutral)]), y, weight)
    coefficients, error = min(without_roots, with_roots, key=lambda fit: fit[1])
    roots = coefficients[:, 3:] if coefficients.shape[1] > 3 else np.zeros((3, 3))
    return RawTransfer(source, target, coefficients[:, :3], neutral, error, roots)


def _fitted(terms: Array, y: Array, weight: Array) -> tuple[Array, float]:
    """The coefficients (3, k) of terms (n, k), and the relative error of pairs that are left out of the fit."""
    predicted = predict_held_out(
        leave_samples_out(len(terms)),
        lambda train, test: terms[test] @ _least_squares(terms[train], y[train], weight[train]).T,
    )
    error = float(np.sqrt(np.mean(np.sum(((predicted - y) * weight[:, None]) ** 2, axis=1))))
    return _least_squares(terms, y, weight), error


def _least_squares(x: Array, y: Array, weight: Array) -> Array:
    """The matrix T (3, k) that minimizes Σ w² ‖y − T x‖²."""
    return np.asarray(np.linalg.lstsq(x * weight[:, None], y * weight[:, None])[0].T)
