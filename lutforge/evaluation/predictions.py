"""Predictions of a style's samples by fits that have not seen their shots.

A shot that the profile was calibrated from is left out and predicted by refits to the others: one shot at a time, or
one of five groups of shots where they are more. Any other shot is predicted by the profile's own models, and by
baselines fitted to the shots that the profile has seen. Whatever is printed as a held-out error, in a profile, on the
console or in a report, results from these predictions.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lutforge.arrays import Array, Mask
from lutforge.calibration.matrix_and_response import LEAST_SAMPLES
from lutforge.calibration.style import StyleData
from lutforge.errors import CalibrationError
from lutforge.evaluation.methods import Fit, Fitter, compared_fits, fit_baselines, fits_of_profile
from lutforge.model.profile import ByDirection, CameraModel, Direction, PictureStyle
from lutforge.thesis.options import Options
from lutforge.threads import each, one_blas_thread


@dataclass(frozen=True, eq=False)
class Predictions:
    """Predictions of the samples of one style.

    fold: (n,) the index in `fits` (by method) of the fit that predicts a sample; held_out: (n,) that fit has not seen
    its shot. predicted: by method (n, 3), NaN without a prediction. notes: on fits that failed, and why.
    """

    data: StyleData
    fold: NDArray[np.intp]
    fits: tuple[Mapping[str, Fit], ...]
    held_out: Mask
    notes: tuple[str, ...]
    predicted: ByDirection[Mapping[str, Array]]

    @property
    def methods(self) -> tuple[str, ...]:
        """The methods in order of first appearance."""
        return tuple(self.predicted.render)

    def render(self, method: str, balanced: Array, rows: NDArray[np.intp]) -> Array:
        """Return Tw E (m, 3) → I by the fits that predict the samples `rows` (m,); NaN where there is none."""
        return _by_fold(self.fits, self.fold[rows], method, "render", balanced)

    def linearize(self, method: str, encoded: Array, rows: NDArray[np.intp]) -> Array:
        """Return I (m, 3) → Tw E by the fits that predict the samples `rows` (m,); NaN where there is none."""
        return _by_fold(self.fits, self.fold[rows], method, "linearize", encoded)


def _by_fold(
    fits: Sequence[Mapping[str, Fit]], fold: NDArray[np.intp], method: str, direction: Direction, values: Array
) -> Array:
    """Predict values (n, 3) by a method, each by the fit of its fold (n,); NaN where the fit lacks the method."""
    result = np.full(values.shape, np.nan)
    for index, fitted in enumerate(fits):
        rows = fold == index
        if method in fitted and rows.any():
            result[rows] = fitted[method][direction](values[rows])
    return result


@one_blas_thread
def predict(
    style: PictureStyle,
    name: str,
    data: StyleData,
    seen_shots: tuple[str, ...],
    options: Options,
    *,
    sizes: Sequence[int] = (),
    progress: Callable[[float], None] = lambda share: None,
) -> Predictions:
    """Predict all samples of a style by all methods.

    seen_shots: those that the profile was calibrated from; sizes: of lattices, for all methods of the thesis's tables;
    without them held-out shots are predicted by the model of the options and the baselines. Raises CalibrationError
    where a part of the shots holds too few samples for a fit.
    """
    seen = np.isin(data.shot, seen_shots)
    fold = np.full(len(seen), -1)
    held_out = ~seen
    fits: list[dict[str, Fit]] = []
    notes: list[str] = []
    has_folds = len(np.unique(data.shot[seen])) > 1
    by_profile = ~seen if has_folds else np.ones_like(seen)
    if seen.any() and not has_folds:
        notes.append(f"{name}: one shot only; its error is on the samples that it was fitted to")
    seen_data = data if seen.all() else data.select(seen)
    fitter = Fitter(name, options, notes, sizes)

    # Shots that the profile has not seen are predicted by the profile itself.
    if by_profile.any():
        fitted: dict[str, Fit] = {}
        if has_folds and seen.sum() >= LEAST_SAMPLES:
            fitted = fitter.fit(seen_data) if sizes else fit_baselines(seen_data)
        for rows, model in _by_model(style.models, data, by_profile):
            fold[rows] = len(fits)
            fits.append({**fitted, **fits_of_profile(style, model)})

    # Shots that it has seen are predicted by refits without them.
    if has_folds:
        masks, trains = zip(*seen_data.folds, strict=True)
        if any(len(train.shot) < LEAST_SAMPLES for train in trains):
            raise CalibrationError("too few samples to leave a shot out: add shots")
        progress(0.0)
        for number, (mask, refitted) in enumerate(zip(masks, each(fitter.fit, trains), strict=True), 1):
            rows = np.flatnonzero(seen)[mask]
            fold[rows] = len(fits)
            held_out[rows] = True
            fits.append(refitted)
            progress(number / len(trains))

    methods = tuple(dict.fromkeys(method for fitted in fits for method in fitted))
    predicted = ByDirection[Mapping[str, Array]](
        {method: _by_fold(fits, fold, method, "render", data.balanced) for method in methods},
        {method: _by_fold(fits, fold, method, "linearize", data.encoded) for method in methods},
    )
    return Predictions(data, fold, tuple(fits), held_out, tuple(dict.fromkeys(notes)), predicted)


def with_compared(predictions: Predictions, shot: str, seen_shots: tuple[str, ...], options: Options) -> Predictions:
    """Add the methods that a report compares to the fits that predict a shot, fitted to the same samples.

    They are for `render` and `linearize`; the predictions of samples do not change. With too few samples nothing is
    added.
    """
    data = predictions.data
    of_shot = data.shot == shot
    index = int(predictions.fold[of_shot][0])
    train = np.isin(data.shot, seen_shots)
    if shot in seen_shots and predictions.held_out[of_shot].all():
        train &= predictions.fold != index
    if train.sum() < LEAST_SAMPLES:
        return predictions
    compared = compared_fits(data.select(train), options)
    fits = tuple({**compared, **fits} if place == index else fits for place, fits in enumerate(predictions.fits))
    return replace(predictions, fits=fits)


def _by_model(
    models: tuple[CameraModel, ...], data: StyleData, rows: Mask
) -> Iterator[tuple[Mask, CameraModel | None]]:
    """Parts of `rows`, and the camera model for each: the one of their white balance, else the first."""
    if len(models) < 2:
        yield rows, models[0] if models else None
        return
    remaining = rows.copy()
    for model in (*models[1:], models[0]):
        of_model = np.isin(data.samples.white_balance, model.white_balances)
        part = remaining if model is models[0] else remaining & of_model
        remaining = remaining & ~part
        if part.any():
            yield part, model
