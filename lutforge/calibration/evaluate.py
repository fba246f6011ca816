"""Error tables of a profile on samples, held out by shot, beside plain baselines (thesis, chapters 4 and 5)."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lutforge.calibration.baselines import channel_polynomials, colour_polynomial, mixed_channel_polynomials
from lutforge.calibration.calibrate import (
    LEAST_SAMPLES,
    Progress,
    StyleData,
    _silent,
    fit_style,
    refit_physical,
    style_data,
)
from lutforge.calibration.errors_table import ErrorFigures, error_figures
from lutforge.calibration.lattice import folds
from lutforge.calibration.linearisation import LinearisationError, linearisation_errors
from lutforge.calibration.matrix_and_response import fit_matrix_and_response
from lutforge.calibration.options import options_from_json
from lutforge.calibration.physical import GamutMaps, conventional, linearize, render
from lutforge.calibration.white_balance import complete_multipliers
from lutforge.errors import CalibrationError
from lutforge.model.camera_profile import CameraProfile, PhysicalModel
from lutforge.samples.sample_set import SampleSet
from lutforge.settings import Selector

Array = NDArray[np.float64]
Predictor = Callable[[Array], Array]

MOST_FOLDS = 20
"""Shots are left out one at a time up to this many; more shots are left out in this many groups."""


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
    """The rows, what was left out and why, and where there are exposure pairs their linearisation error δ (4.11)."""

    rows: tuple[EvaluationRow, ...]
    notes: tuple[str, ...]
    linearisation: tuple[LinearisationError, ...] = ()


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
    others = [str(name) for name in np.unique(samples.camera) if name != profile.camera]
    if others:
        notes = (*notes, f"the profile is of {profile.camera}, the samples are of {', '.join(others)}")
    known = np.isin(samples.style, list(profile.styles))
    if not known.any():
        raise CalibrationError(
            f"the samples' styles ({', '.join(np.unique(samples.style))}) are not in the profile "
            f"({', '.join(profile.styles)})"
        )
    if profile.raw_camera:
        return _evaluate_by_reference(profile, samples.select(known))
    data, clipped = style_data(samples.select(known), multipliers[known])
    if clipped:
        notes = (*notes, f"{clipped} of {known.sum()} samples are clipped and are not counted")
    rows: list[EvaluationRow] = []
    deltas: list[LinearisationError] = []
    for index, (name, style) in enumerate(data.items()):
        progress(f"{name}: leaving shots out", index / len(data))
        predictions, weak = _predict(profile, name, style)
        notes = (*notes, *weak)
        rows.extend(_rows(name, style, predictions))
        deltas.extend(linearisation_errors(name, style.samples, profile.styles[name].physical))
    progress("done", 1.0)
    return Evaluation(tuple(rows), notes, tuple(deltas))


def _predict(profile: CameraProfile, name: str, data: StyleData) -> tuple[_Predictions, tuple[str, ...]]:
    predictions = _Predictions({}, np.zeros(len(data.shot), dtype=np.bool_))
    seen = np.isin(data.shot, profile.shots)
    if (~seen).any():
        predictions.held_out |= ~seen
        _predict_as_is(profile, name, data, ~seen, predictions)
    if not seen.any():
        return predictions, ()
    if len(np.unique(data.shot[seen])) < 2:
        _predict_as_is(profile, name, data, seen, predictions)
        return predictions, (f"{name}: one shot only; its error is on the samples that it was fitted to",)
    return predictions, _leave_out(profile, name, data, seen, predictions)


def _predict_as_is(
    profile: CameraProfile, name: str, data: StyleData, rows: NDArray[np.bool_], predictions: _Predictions
) -> None:
    """Predict samples by the profile's own models."""
    style, part = profile.styles[name], data.select(rows)
    if style.render is not None:
        predictions.store("render", "lattice", rows, np.clip(style.render(part.balanced), 0, 1))
    if style.linearize is not None:
        predictions.store("linearize", "lattice", rows, np.clip(style.linearize(part.encoded), 0, 1))
    if not style.physical:
        return
    for label, by_setting in (("rbf", False), ("response and matrix, no h", True)):
        rendered, linearized = np.zeros_like(part.encoded), np.zeros_like(part.balanced)
        for setting in np.unique(part.samples.white_balance):
            inside = part.samples.white_balance == setting
            named = [model for model in style.physical if setting in model.white_balances]
            model = (named or list(style.physical))[0]
            model = conventional(model) if by_setting else model
            rendered[inside] = render(model, part.balanced[inside])
            linearized[inside] = linearize(model, part.encoded[inside])
        predictions.store("render", label, rows, rendered)
        predictions.store("linearize", label, rows, np.clip(linearized, 0, 1))


def _leave_out(
    profile: CameraProfile, name: str, data: StyleData, seen: NDArray[np.bool_], predictions: _Predictions
) -> tuple[str, ...]:
    """Refit without each shot that the profile has seen, and predict that shot, by the models and the baselines."""
    options = options_from_json(profile.options)
    style = profile.styles[name]
    uniform = replace(options, nonuniform=False)
    inside = data.select(seen)
    smoothness: tuple[float, float] | None = None
    nuggets: tuple[float | None, float | None] = (None, None)
    notes: list[str] = []
    for mask in folds(inside.shot, MOST_FOLDS):
        train, test = inside.select(~mask), inside.select(mask)
        if len(train.shot) < LEAST_SAMPLES:
            raise CalibrationError("too few samples to leave a shot out: add shots")
        rows = np.zeros(len(seen), dtype=np.bool_)
        rows[np.flatnonzero(seen)[mask]] = True
        base = fit_matrix_and_response(train.balanced, train.encoded)
        methods: dict[str, tuple[Predictor, Predictor]] = {}
        if style.render is not None:
            fit = fit_style(train, options, smoothness, base)
            smoothness = (fit.render.smoothness, fit.linearize.smoothness)
            plain = fit_style(train, uniform, smoothness, base)
            methods["lattice"] = (fit.render.lattice, fit.linearize.lattice)
            methods["uniform lattice"] = (plain.render.lattice, plain.linearize.lattice)
        if style.physical:
            try:
                maps = refit_physical(train, GamutMaps(style.physical[0], *nuggets), options)
            except CalibrationError as error:
                notes = [f"{name}: the physical model cannot be refitted without one of its shots ({error})"]
            else:
                nuggets = (maps.nugget, maps.inverse_nugget)
                methods["rbf"] = _predictors(maps.model)
                methods["response and matrix, no h"] = _predictors(conventional(maps.model))
        methods["matrix and response"] = (base.render, base.linearize)
        methods["polynomial per channel"] = (
            channel_polynomials(train.balanced, train.encoded),
            mixed_channel_polynomials(train.encoded, train.balanced),
        )
        methods["polynomial of all channels"] = (
            colour_polynomial(train.balanced, train.encoded),
            colour_polynomial(train.encoded, train.balanced),
        )
        predictions.held_out |= rows
        for method, (forward, back) in methods.items():
            predictions.store("render", method, rows, np.clip(forward(test.balanced), 0, 1))
            predictions.store("linearize", method, rows, np.clip(back(test.encoded), 0, 1))
    return tuple(notes)


def _predictors(model: PhysicalModel) -> tuple[Predictor, Predictor]:
    return (lambda x: render(model, x), lambda x: linearize(model, x))


def _evaluate_by_reference(profile: CameraProfile, samples: SampleSet) -> Evaluation:
    """Rendering only: there is no own RAW to compare a linearized JPEG with."""
    rows: list[EvaluationRow] = []
    usable = np.all((samples.srgb > 0.5 / 255) & (samples.srgb < 1 - 0.5 / 255) & (samples.raw > 0), axis=1)
    for name in np.unique(samples.style[usable]):
        for setting in np.unique(samples.white_balance[usable & (samples.style == name)]):
            if setting not in profile.white_balances:
                continue
            part = usable & (samples.style == name) & (samples.white_balance == setting)
            rendered = profile.render(Selector(str(name), str(setting)))(samples.raw[part])
            held_out = not bool(np.isin(samples.shot[part], profile.shots).any())
            figures = error_figures(rendered, samples.srgb[part], display=True)
            rows.append(EvaluationRow("render", str(name), f"all {setting}", "rbf", held_out, figures))
    note = f"{profile.camera} has no RAW of its own ({profile.raw_camera} stands in): only rendering can be measured"
    return Evaluation(tuple(rows), (note,))


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
