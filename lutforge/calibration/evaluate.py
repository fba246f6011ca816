"""Error tables of a profile on samples, held out by shot, beside plain baselines (thesis, chapters 4 and 5)."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.polynomial import Polynomial
from numpy.typing import NDArray

from lutforge.calibration.calibrate import (
    LEAST_SAMPLES,
    Progress,
    StyleData,
    _silent,
    fit_style,
    style_data,
)
from lutforge.calibration.errors_table import ErrorFigures, error_figures
from lutforge.calibration.lattice import folds
from lutforge.calibration.matrix_and_response import fit_matrix_and_response
from lutforge.calibration.options import options_from_json
from lutforge.calibration.white_balance import complete_multipliers
from lutforge.errors import CalibrationError
from lutforge.model.camera_profile import CameraProfile, PictureStyle
from lutforge.samples.sample_set import SampleSet

Array = NDArray[np.float64]
Predictor = Callable[[Array], Array]

MOST_FOLDS = 20
"""Shots are left out one at a time up to this many; more shots are left out in this many groups."""
POLYNOMIAL_ORDER = 6


@dataclass(frozen=True)
class EvaluationRow:
    """One line of the table.

    direction: "render" or "linearize"; shot: a name, or "all"; method: what predicted; held_out: whether its fit had
    not seen the shot.
    """

    direction: str
    style: str
    shot: str
    method: str
    held_out: bool
    figures: ErrorFigures

    def as_json(self) -> dict[str, object]:
        """Plain values by name."""
        head = {"direction": self.direction, "style": self.style, "shot": self.shot, "method": self.method}
        return {**head, "held_out": self.held_out, **self.figures.as_json()}


@dataclass(frozen=True)
class Evaluation:
    """The rows, and what was left out and why."""

    rows: tuple[EvaluationRow, ...]
    notes: tuple[str, ...]


@dataclass(eq=False)
class _Predictions:
    """What each method says of every sample of a style, per direction; held_out: per sample."""

    by_method: dict[tuple[str, str], Array]
    held_out: NDArray[np.bool_]

    def store(self, direction: str, method: str, rows: NDArray[np.bool_], values: Array) -> None:
        target = self.by_method.setdefault((direction, method), np.full((len(rows), 3), np.nan))
        target[rows] = values


def evaluate(profile: CameraProfile, samples: SampleSet, progress: Progress = _silent) -> Evaluation:
    """Errors of both directions, per shot and over all shots, for the profile's model and the baselines.

    A shot that the profile was calibrated from is predicted by a refit without it, any other by the profile as it is.
    Raises CalibrationError where the samples hold none of the profile's styles.
    """
    multipliers, notes = complete_multipliers(samples)
    known = np.isin(samples.style, list(profile.styles))
    if not known.any():
        raise CalibrationError(
            f"the samples' styles ({', '.join(np.unique(samples.style))}) are not in the profile "
            f"({', '.join(profile.styles)})"
        )
    data, clipped = style_data(samples.select(known), multipliers[known])
    if clipped:
        notes = (*notes, f"{clipped} of {known.sum()} samples are clipped and are not counted")
    rows: list[EvaluationRow] = []
    for index, (name, style) in enumerate(data.items()):
        progress(f"{name}: leaving shots out", index / len(data))
        predictions, weak = _predict(profile, name, style)
        notes = (*notes, *weak)
        rows.extend(_rows(name, style, predictions))
    progress("done", 1.0)
    return Evaluation(tuple(rows), notes)


def _predict(profile: CameraProfile, name: str, data: StyleData) -> tuple[_Predictions, tuple[str, ...]]:
    fitted = profile.styles[name]
    predictions = _Predictions({}, np.zeros(len(data.shot), dtype=np.bool_))
    seen = np.isin(data.shot, profile.shots)
    if fitted.render is None or fitted.linearize is None:
        _predict_physical(fitted, data, predictions)
        return predictions, ()
    if (~seen).any():
        predictions.held_out |= ~seen
        unseen = data.select(~seen)
        predictions.store("render", "lattice", ~seen, np.clip(fitted.render(unseen.balanced), 0, 1))
        predictions.store("linearize", "lattice", ~seen, np.clip(fitted.linearize(unseen.encoded), 0, 1))
    if not seen.any():
        return predictions, ()
    if len(np.unique(data.shot[seen])) < 2:
        predictions.store("render", "lattice", seen, np.clip(fitted.render(data.balanced[seen]), 0, 1))
        predictions.store("linearize", "lattice", seen, np.clip(fitted.linearize(data.encoded[seen]), 0, 1))
        return predictions, (f"{name}: one shot only; its error is on the samples that it was fitted to",)
    _leave_out(profile, data, seen, predictions)
    return predictions, ()


def _leave_out(profile: CameraProfile, data: StyleData, seen: NDArray[np.bool_], predictions: _Predictions) -> None:
    """Refit without each shot that the profile has seen, and predict that shot, by the lattice and the baselines."""
    options = options_from_json(profile.options)
    uniform = replace(options, nonuniform=False)
    inside = data.select(seen)
    smoothness: tuple[float, float] | None = None
    for mask in folds(inside.shot, MOST_FOLDS):
        train, test = inside.select(~mask), inside.select(mask)
        if len(train.shot) < LEAST_SAMPLES:
            raise CalibrationError("too few samples to leave a shot out: add shots")
        rows = np.zeros(len(seen), dtype=np.bool_)
        rows[np.flatnonzero(seen)[mask]] = True
        fit = fit_style(train, options, smoothness)
        smoothness = (fit.render.smoothness, fit.linearize.smoothness)
        plain = fit_style(train, uniform, smoothness)
        base = fit_matrix_and_response(train.balanced, train.encoded)
        methods: dict[str, tuple[Predictor, Predictor]] = {
            "lattice": (fit.render.lattice, fit.linearize.lattice),
            "uniform lattice": (plain.render.lattice, plain.linearize.lattice),
            "matrix and response": (base.render, base.linearize),
            "polynomial per channel": (
                _polynomials(train.balanced, train.encoded),
                _polynomials(train.encoded, train.balanced),
            ),
        }
        predictions.held_out |= rows
        for method, (render, linearize) in methods.items():
            predictions.store("render", method, rows, np.clip(render(test.balanced), 0, 1))
            predictions.store("linearize", method, rows, np.clip(linearize(test.encoded), 0, 1))


def _polynomials(x: Array, y: Array) -> Predictor:
    """One 6th-order polynomial per channel (the first baseline of thesis Fig. 4.5)."""
    fits = [Polynomial.fit(x[:, c], y[:, c], POLYNOMIAL_ORDER) for c in range(3)]
    ranges = [(x[:, c].min(), x[:, c].max()) for c in range(3)]

    def predict(values: Array) -> Array:
        columns = [fits[c](np.clip(values[:, c], *ranges[c])) for c in range(3)]
        return np.stack(columns, axis=1)

    return predict


def _predict_physical(style: PictureStyle, data: StyleData, predictions: _Predictions) -> None:
    model = style.physical[0]
    rows = np.ones(len(data.shot), dtype=np.bool_)
    rendered = model.response.encode(model.gamut_map(data.balanced @ model.matrix.T))
    linear = model.inverse_gamut_map(model.response.linearize(data.encoded))
    predictions.store("render", "rbf", rows, rendered)
    predictions.store("linearize", "rbf", rows, linear @ np.linalg.inv(model.matrix).T)
    predictions.held_out |= rows


def _rows(style: str, data: StyleData, predictions: _Predictions) -> Iterator[EvaluationRow]:
    """Per direction and method: all shots together, then (for the profile's own model) each shot."""
    for (direction, method), values in predictions.by_method.items():
        measured = data.encoded if direction == "render" else data.balanced
        counted = np.all(np.isfinite(values), axis=1)

        def row(
            shot: str,
            rows: NDArray[np.bool_],
            direction: str = direction,
            method: str = method,
            values: Array = values,
            measured: Array = measured,
        ) -> EvaluationRow:
            figures = error_figures(values[rows], measured[rows], display=direction == "render")
            held_out = bool(np.all(predictions.held_out[rows]))
            return EvaluationRow(direction, style, shot, method, held_out, figures)

        yield row("all", counted)
        if method in ("lattice", "rbf"):
            for shot in np.unique(data.shot[counted]):
                yield row(str(shot), counted & (data.shot == shot))
