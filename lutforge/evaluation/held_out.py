"""What models of a style say of shots that they have not seen, by method: fits without each shot in turn.

A shot that the profile was calibrated from is left out and predicted by refits to the others; any other shot is
predicted by the profile's own models, and by baselines fitted to the shots that the profile has seen.
"""

import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lutforge.calibration.lattice.lattice_fit import MEASURING_TOLERANCE
from lutforge.calibration.options import CalibrationOptions
from lutforge.calibration.physical.matrix_and_response import (
    MatrixAndResponse,
    fit_matrix_and_response,
    with_matrix_of_all,
)
from lutforge.calibration.physical.physical_model import conventional, linearize, render
from lutforge.calibration.style_data import LEAST_SAMPLES, StyleData
from lutforge.calibration.style_fit import fit_direction, refit_physical
from lutforge.errors import CalibrationError
from lutforge.evaluation.baselines import channel_polynomials, colour_polynomial, mixed_channel_polynomials
from lutforge.model.camera_profile import PhysicalModel, PictureStyle
from lutforge.solvers.cross_validation import leave_groups_out

Array = NDArray[np.float64]
Predictor = Callable[[Array], Array]

LATTICE, RBF, NO_GAMUT_MAP = "lattice", "rbf", "f and T, no h"
MATRIX_AND_RESPONSE = "matrix and response"
CHANNEL_POLYNOMIALS, COLOUR_POLYNOMIAL = "polynomial per channel", "polynomial of all channels"
TABLE_SIZES = (13, 17, 24)
"""Lattices of chapter 5's tables."""


def sized(size: int, *, nonuniform: bool) -> str:
    """The method's name of a lattice of the pixel-error table."""
    return f"{'nonuniform' if nonuniform else 'uniform'} lattice {size}"


@dataclass(frozen=True, eq=False)
class Fit:
    """One method, fitted once. render: Tw E (n, 3) → I; linearize: I → Tw E, not clipped.

    render_seconds, linearize_seconds: what the fits took; None where they were not made here.
    """

    render: Predictor
    linearize: Predictor
    render_seconds: float | None = None
    linearize_seconds: float | None = None


@dataclass(frozen=True, eq=False)
class Predictions:
    """Of one style. fold: (n,) which of `fits` (by method) predicts a sample; held_out: (n,) whether that is unseen.

    rendered, linearized: by method (n, 3), NaN where the method says nothing. notes: what could not be done, and why.
    """

    data: StyleData
    fold: NDArray[np.intp]
    fits: tuple[Mapping[str, Fit], ...]
    held_out: NDArray[np.bool_]
    notes: tuple[str, ...]
    rendered: Mapping[str, Array]
    linearized: Mapping[str, Array]

    @property
    def methods(self) -> tuple[str, ...]:
        """In order of first appearance."""
        return tuple(dict.fromkeys(name for fits in self.fits for name in fits))

    def render(self, method: str, balanced: Array, rows: NDArray[np.intp]) -> Array:
        """Tw E (m, 3) → I by the fits that predict the samples `rows` (m,); NaN where there is none."""
        return _by_fold(self.fits, self.fold[rows], method, "render", balanced)


def _by_fold(
    fits: tuple[Mapping[str, Fit], ...], fold: NDArray[np.intp], method: str, direction: str, values: Array
) -> Array:
    result = np.full(values.shape, np.nan)
    for index, fitted in enumerate(fits):
        rows = fold == index
        if method in fitted and rows.any():
            predict: Predictor = getattr(fitted[method], direction)
            result[rows] = predict(values[rows])
    return result


def predict(
    style: PictureStyle,
    name: str,
    data: StyleData,
    seen_shots: tuple[str, ...],
    options: CalibrationOptions,
    *,
    tables: bool,
    most_folds: int,
    progress: Callable[[float], None],
) -> Predictions:
    """All samples of a style by all methods. tables: those of the thesis's tables too, whatever the profile holds.

    Shots are left out one at a time, or in `most_folds` groups where they are more. Raises CalibrationError where a
    part of the shots holds too few samples for a fit.
    """
    seen = np.isin(data.shot, seen_shots)
    fold, held_out = np.full(len(seen), -1), ~seen
    fits: list[dict[str, Fit]] = []
    notes: list[str] = []
    left_out = len(np.unique(data.shot[seen])) > 1
    as_is = ~seen if left_out else np.ones_like(seen)
    if seen.any() and not left_out:
        notes.append(f"{name}: one shot only; its error is on the samples that it was fitted to")
    fitter = _Fitter(name, style, options, tables, tuple(str(s) for s in np.unique(data.samples.white_balance)), notes)
    if as_is.any():
        others: dict[str, Fit] = {}
        if left_out and seen.sum() >= LEAST_SAMPLES:
            others = fitter.fit(data.select(seen)) if tables else fitter.baselines(data.select(seen))
        for rows, model in _by_model(style.physical, data, as_is):
            fold[rows] = len(fits)
            fits.append({**others, **_of_profile(style, model)})
    masks = leave_groups_out(data.shot[seen], most_folds) if left_out else []
    inside = data.select(seen)
    for index, mask in enumerate(masks):
        progress(index / len(masks))
        if (~mask).sum() < LEAST_SAMPLES:
            raise CalibrationError("too few samples to leave a shot out: add shots")
        places = np.flatnonzero(seen)[mask]
        fold[places], held_out[places] = len(fits), True
        fits.append(fitter.fit(inside.select(~mask)))
    made = tuple(fits)
    methods = tuple(dict.fromkeys(method for fitted in made for method in fitted))
    return Predictions(
        data,
        fold,
        made,
        held_out,
        tuple(dict.fromkeys(notes)),
        {method: _by_fold(made, fold, method, "render", data.balanced) for method in methods},
        {method: _by_fold(made, fold, method, "linearize", data.encoded) for method in methods},
    )


def _by_model(
    models: tuple[PhysicalModel, ...], data: StyleData, rows: NDArray[np.bool_]
) -> Iterator[tuple[NDArray[np.bool_], PhysicalModel | None]]:
    """Parts of `rows` and the physical model of their white balance: the one that names it, else the first."""
    if len(models) < 2:
        yield rows, models[0] if models else None
        return
    rest = rows.copy()
    for model in (*models[1:], models[0]):
        part = rest if model is models[0] else rest & np.isin(data.samples.white_balance, model.white_balances)
        rest = rest & ~part
        if part.any():
            yield part, model


def _of_profile(style: PictureStyle, model: PhysicalModel | None) -> dict[str, Fit]:
    """The profile's own models, as they are."""
    fits = {}
    if style.render is not None and style.linearize is not None:
        fits[LATTICE] = Fit(style.render, style.linearize)
    if model is not None:
        fits |= _physical_fits(model)
    return fits


def _physical_fits(model: PhysicalModel, seconds: float | None = None) -> dict[str, Fit]:
    plain = conventional(model)
    return {
        RBF: Fit(lambda x: render(model, x), lambda x: linearize(model, x), seconds, seconds),
        NO_GAMUT_MAP: Fit(lambda x: render(plain, x), lambda x: linearize(plain, x)),
    }


class _Fitter:
    """Fits all methods to one part of the shots after the other; what h chose in smoothness first serves the rest."""

    def __init__(
        self,
        name: str,
        style: PictureStyle,
        options: CalibrationOptions,
        tables: bool,
        white_balances: tuple[str, ...],
        notes: list[str],
    ) -> None:
        self.name, self.options, self.white_balances, self.notes = name, options, white_balances, notes
        self.lattices = {LATTICE: options} if style.render is not None or tables else {}
        if tables:
            for size in TABLE_SIZES:
                for nonuniform in (False, True):
                    sizes = replace(options, size=size, nonuniform=nonuniform)
                    self.lattices[sized(size, nonuniform=nonuniform)] = sizes
        self.own_physical = bool(style.physical)
        self.physical = self.own_physical or tables
        self.nuggets: tuple[float | None, float | None] = (None, None)

    def fit(self, train: StyleData) -> dict[str, Fit]:
        """All methods on these shots."""
        base = fit_matrix_and_response(train.balanced, train.encoded)
        fits = {method: self._lattice(train, options, base) for method, options in self.lattices.items()}
        return {**fits, **self._physical(train), **self.baselines(train, base)}

    def _lattice(self, train: StyleData, options: CalibrationOptions, base: MatrixAndResponse) -> Fit:
        results, seconds = [], []
        for inverse in (False, True):
            start = time.perf_counter()
            result = fit_direction(train, options, base, inverse=inverse, tolerance=MEASURING_TOLERANCE)
            seconds.append(time.perf_counter() - start)
            results.append(result)
        return Fit(results[0].lattice, results[1].lattice, seconds[0], seconds[1])

    def _physical(self, train: StyleData) -> dict[str, Fit]:
        if not self.physical:
            return {}
        start = time.perf_counter()
        try:
            maps = refit_physical(train, self.options, self.white_balances, self.nuggets)
        except CalibrationError as error:
            if not self.own_physical and self.options.preset == "thesis":
                self.notes.append(f"{self.name}: the physical model takes f from RAW/JPEG pairs ({error})")
                self.options = replace(self.options, preset="lutforge")
                return self._physical(train)
            self.notes.append(f"{self.name}: the physical model cannot be refitted without one of its shots ({error})")
            return {}
        self.nuggets = (maps.nugget, maps.inverse_nugget)
        return _physical_fits(maps.model, time.perf_counter() - start)

    def baselines(self, train: StyleData, base: MatrixAndResponse | None = None) -> dict[str, Fit]:
        """The plain methods."""
        x, y = train.balanced, train.encoded
        base = with_matrix_of_all(base or fit_matrix_and_response(x, y), x, y)
        return {
            MATRIX_AND_RESPONSE: Fit(base.render, base.linearize),
            CHANNEL_POLYNOMIALS: Fit(channel_polynomials(x, y), mixed_channel_polynomials(y, x)),
            COLOUR_POLYNOMIAL: Fit(colour_polynomial(x, y), colour_polynomial(y, x)),
        }
