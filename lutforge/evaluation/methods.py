"""Predictions by the methods that are compared: the profile's own models, the thesis's tables', plain baselines.

Their error figures are those of the thesis (chapter 5), with ΔE00 beside them.
"""

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations_with_replacement

import numpy as np
from numpy.polynomial import Polynomial
from numpy.typing import NDArray

from lutforge.arrays import Array, Mask
from lutforge.calibration.lattice.node_levels import fit_uniform
from lutforge.calibration.matrix_and_response import MatrixAndResponse, with_matrix_of_all
from lutforge.calibration.options import CalibrationOptions
from lutforge.calibration.style import LEAST_SAMPLES, StyleData, fit_lattices, fit_physical
from lutforge.colour.srgb import delta_e_2000
from lutforge.errors import CalibrationError
from lutforge.interpolation import Levels
from lutforge.model.profile_data import Both, Direction, PhysicalModel, PictureStyle
from lutforge.threads import each, one_blas_thread

Predictor = Callable[[Array], Array]

LATTICE, RBF, NO_GAMUT_MAP = "lattice", "rbf", "f and T, no h"
MATRIX_AND_RESPONSE = "matrix and response"
CHANNEL_POLYNOMIALS, COLOUR_POLYNOMIAL = "polynomial per channel", "polynomial of all channels"
BASELINES = (MATRIX_AND_RESPONSE, CHANNEL_POLYNOMIALS, COLOUR_POLYNOMIAL)
FIGURES = ("n", "mean", "max", "Q1", "median", "Q3", "RMSE", "ΔE00", "max ΔE00")


@dataclass(frozen=True)
class ErrorFigures:
    """Pixel error: the Euclidean norm of the RGB difference, 1 = full scale. rmse: per channel, root mean square.

    de00_mean, de00_max: ΔE00 between encoded sRGB colours; None where the values are not display colours.
    """

    count: int
    mean: float
    maximum: float
    q1: float
    median: float
    q3: float
    rmse: float
    de00_mean: float | None = None
    de00_max: float | None = None

    @property
    def cells(self) -> tuple[str, ...]:
        """The figures as cells of a table, whose columns FIGURES names."""
        numbers = (self.mean, self.maximum, self.q1, self.median, self.q3, self.rmse)
        differences = ("–" if value is None else f"{value:.2f}" for value in (self.de00_mean, self.de00_max))
        return (str(self.count), *(f"{value:.4f}" for value in numbers), *differences)


def error_figures(predicted: Array, measured: Array, *, display: bool) -> ErrorFigures:
    """Figures of predicted (n, 3) against measured (n, 3); display: both are encoded sRGB."""
    distance, rmse = np.linalg.norm(predicted - measured, axis=1), np.sqrt(np.mean((predicted - measured) ** 2))
    figures = [distance.mean(), distance.max(), *np.percentile(distance, [25, 50, 75]), rmse]
    if display:
        difference = delta_e_2000(predicted, measured)
        figures += [difference.mean(), difference.max()]
    return ErrorFigures(len(distance), *map(float, figures))


def lattice_name(size: int, *, nonuniform: bool) -> str:
    """The name of the method that fits lattices of `size` nodes per axis."""
    return f"{'nonuniform' if nonuniform else 'uniform'} lattice {size}"


@dataclass(frozen=True, eq=False)
class Fit(Both[Predictor]):
    """One method, fitted once. render: Tw E (n, 3) → I; linearize: I → Tw E, not clipped.

    seconds: what the fits took, with all that is searched; None where that was not made here.
    """

    seconds: Both[float | None] = field(default_factory=lambda: Both(None, None))


def fits_of_profile(style: PictureStyle, model: PhysicalModel | None) -> dict[str, Fit]:
    """Return the profile's own models of a style, as they are."""
    fits = {}
    if style.render is not None and style.linearize is not None:
        fits[LATTICE] = Fit(style.render, style.linearize)
    return fits if model is None else fits | _physical_fits(model)


def fit_baselines(train: StyleData) -> dict[str, Fit]:
    """Return the plain methods, fitted to samples."""
    x, y = train.balanced, train.encoded
    base = with_matrix_of_all(train.base, x, y)
    return {
        MATRIX_AND_RESPONSE: Fit(base.render, base.linearize),
        CHANNEL_POLYNOMIALS: Fit(channel_polynomials(x, y), mixed_channel_polynomials(y, x)),
        COLOUR_POLYNOMIAL: Fit(colour_polynomial(x, y), colour_polynomial(y, x)),
    }


def _physical_fits(model: PhysicalModel, seconds: float | None = None) -> dict[str, Fit]:
    plain = MatrixAndResponse(model.matrix, model.response)
    return {
        RBF: Fit(model.render, model.linearize, Both(seconds, seconds)),
        NO_GAMUT_MAP: Fit(plain.render, plain.linearize),
    }


@dataclass(frozen=True)
class Fitter:
    """Fits all methods to parts of a style's shots.

    The model is fitted again to each part, and baked to lattices whose node levels are those of the profile's lattices.
    notes: is told what could not be done; sizes: of the lattices of the thesis's tables, with its other methods; own:
    no model but the one that the options ask for.
    """

    name: str
    style: PictureStyle
    options: CalibrationOptions
    notes: list[str]
    sizes: Sequence[int] = ()
    own: bool = False

    def fit(self, train: StyleData, asked: Both[Array] | None = None) -> dict[str, Fit]:
        """All methods by name, fitted to these samples. asked: as of `fit_lattices`, for the profile's own lattices."""
        fits, render, linearize = dict[str, Fit](), self.style.render, self.style.linearize
        if render is not None and linearize is not None and not (self.own and self.options.model == "rbf"):
            fits[LATTICE] = _timed_lattices(train, self.options, Both(render.levels, linearize.levels), asked)
        for size in self.sizes:
            for nonuniform in (False, True):
                options = replace(self.options, size=size, nonuniform=nonuniform)
                fits[lattice_name(size, nonuniform=nonuniform)] = _timed_lattices(train, options)
            # What the thesis compares itself with: evenly spaced nodes, no smoothness but λ_K.
            options, start = replace(self.options, size=size), time.perf_counter()
            even_render = fit_uniform(train.balanced, train.encoded, options)
            middle = time.perf_counter()
            even_linearize = fit_uniform(train.encoded, train.balanced, options)
            seconds = Both[float | None](middle - start, time.perf_counter() - middle)
            fits[f"lattice by (5.3) {size}"] = Fit(even_render, even_linearize, seconds)
        return {**fits, **self.physical(train), **fit_baselines(train)}

    def physical(self, train: StyleData) -> dict[str, Fit]:
        """The model of the thesis's chapter 4, where it is asked for or the profile has it."""
        if not (self.sizes or (self.style.physical and not (self.own and self.options.model == "lattice"))):
            return {}
        start = time.perf_counter()
        try:
            model = fit_physical(train, self.options)
        except CalibrationError as error:
            if not self.style.physical and self.options.preset == "thesis":
                self.notes.append(f"{self.name}: the physical model takes f from RAW/JPEG pairs ({error})")
                return _physical_fits(train.model)
            self.notes.append(f"{self.name}: the physical model cannot be refitted without one of its shots ({error})")
            return {}
        return _physical_fits(model, time.perf_counter() - start)


def _timed_lattices(
    train: StyleData, options: CalibrationOptions, levels: Both[Levels] | None = None, asked: Both[Array] | None = None
) -> Fit:
    """Lattices fitted to samples, and half of the seconds that both took for each."""
    start = time.perf_counter()
    fitted = fit_lattices(train, options, levels, asked)
    seconds = (time.perf_counter() - start) / 2.0
    return Fit(fitted.render, fitted.linearize, Both(seconds, seconds))


# --- Predictions of a style's shots by models that have not seen them ------------------------------------------------
# A shot that the profile was calibrated from is left out and predicted by refits to the others: one shot at a time, or
# one of five groups of shots where they are more. Any other shot is predicted by the profile's own models, and by
# baselines fitted to the shots that the profile has seen. Whatever is printed as a held-out error, in a profile, on the
# console or in a report, is made of these predictions.


@dataclass(frozen=True, eq=False)
class Predictions:
    """Predictions of the samples of one style.

    fold: (n,) which of `fits` (by method) predicts a sample; held_out: (n,) whether that fit has not seen its shot.
    predicted: by method (n, 3), NaN where the method says nothing. notes: what could not be done, and why.
    """

    data: StyleData
    fold: NDArray[np.intp]
    fits: tuple[Mapping[str, Fit], ...]
    held_out: Mask
    notes: tuple[str, ...]
    predicted: Both[Mapping[str, Array]]

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
    options: CalibrationOptions,
    *,
    sizes: Sequence[int] = (),
    own_only: bool = False,
    progress: Callable[[float], None] = lambda share: None,
) -> Predictions:
    """Predict all samples of a style by all methods.

    sizes: of lattices, for all methods of the thesis's tables, whatever the profile holds; own_only: beside the
    baselines, no model but the one that the options ask for. Raises CalibrationError where a part of the shots holds
    too few samples for a fit.
    """
    seen = np.isin(data.shot, seen_shots)
    fold, held_out = np.full(len(seen), -1), ~seen
    fits: list[dict[str, Fit]] = []
    notes: list[str] = []
    left_out = len(np.unique(data.shot[seen])) > 1
    as_is = ~seen if left_out else np.ones_like(seen)
    if seen.any() and not left_out:
        notes.append(f"{name}: one shot only; its error is on the samples that it was fitted to")
    inside = data if seen.all() else data.select(seen)
    fitter = Fitter(name, style, options, notes, sizes, own_only)
    if as_is.any():
        others: dict[str, Fit] = {}
        if left_out and seen.sum() >= LEAST_SAMPLES:
            others = fitter.fit(inside) if sizes else fit_baselines(inside)
        for rows, model in _by_model(style.physical, data, as_is):
            fold[rows] = len(fits)
            fits.append({**others, **fits_of_profile(style, model)})
    if left_out:
        masks, trains = zip(*inside.folds, strict=True)
        if any(len(train.shot) < LEAST_SAMPLES for train in trains):
            raise CalibrationError("too few samples to leave a shot out: add shots")
        progress(0.0)

        def refit(part: tuple[Mask, StyleData]) -> dict[str, Fit]:
            mask, train = part
            left_out_shots = inside.select(mask)
            return fitter.fit(train, Both(left_out_shots.balanced, left_out_shots.encoded) if own_only else None)

        for number, (mask, refitted) in enumerate(zip(masks, each(refit, inside.folds), strict=True), 1):
            places = np.flatnonzero(seen)[mask]
            fold[places], held_out[places] = len(fits), True
            fits.append(refitted)
            progress(number / len(trains))
    methods = tuple(dict.fromkeys(method for fitted in fits for method in fitted))
    predicted = Both[Mapping[str, Array]](
        {method: _by_fold(fits, fold, method, "render", data.balanced) for method in methods},
        {method: _by_fold(fits, fold, method, "linearize", data.encoded) for method in methods},
    )
    return Predictions(data, fold, tuple(fits), held_out, tuple(dict.fromkeys(notes)), predicted)


def with_compared(
    predictions: Predictions, shot: str, style: PictureStyle, seen_shots: tuple[str, ...], options: CalibrationOptions
) -> Predictions:
    """Add a uniform lattice and the model by RBFs to the fits that predict a shot, fitted to the same samples.

    They are for `render` and `linearize`: what is predicted of samples stays as it is. Where the samples are too few,
    nothing is added.
    """
    data = predictions.data
    of_shot = data.shot == shot
    index, train = int(predictions.fold[of_shot][0]), np.isin(data.shot, seen_shots)
    if shot in seen_shots and predictions.held_out[of_shot].all():
        train &= predictions.fold != index
    if train.sum() < LEAST_SAMPLES:
        return predictions
    inside = data.select(train)
    even = fit_lattices(inside, replace(options, nonuniform=False))
    more = {lattice_name(options.size, nonuniform=False): Fit(even.render, even.linearize)}
    more |= Fitter("", style, options, [], (options.size,)).physical(inside)
    fits = tuple({**more, **fits} if place == index else fits for place, fits in enumerate(predictions.fits))
    return replace(predictions, fits=fits)


def _by_model(
    models: tuple[PhysicalModel, ...], data: StyleData, rows: Mask
) -> Iterator[tuple[Mask, PhysicalModel | None]]:
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


# --- The polynomial baselines that the thesis compares with (Fig. 4.5) -----------------------------------------------


ORDER = 6
"""The degree of the polynomial of each channel, as in the thesis."""
RIDGE = 1e-9
"""Weight of the squared coefficients beside a sample: what colours cannot tell stays small."""


def channel_polynomials(x: Array, y: Array) -> Predictor:
    """Fit one polynomial per channel, x (n, 3) → y (n, 3); clamped to the range of x."""
    # Few tones leave coefficients open, of which `full` takes the smallest; without it NumPy warns.
    fits = [Polynomial.fit(x[:, c], y[:, c], ORDER, full=True)[0] for c in range(3)]
    low, high = x.min(axis=0), x.max(axis=0)

    def predict(values: Array) -> Array:
        inside = np.clip(values, low, high)
        return np.stack([np.asarray(fits[c](inside[:, c])) for c in range(3)], axis=1)

    return predict


def mixed_channel_polynomials(encoded: Array, raw: Array) -> Predictor:
    """Fit JPEG → RAW, E = M p(I): one polynomial per channel, then a 3 × 3 matrix (Chakrabarti et al. 2009).

    Alternating least squares from the best sum of one-channel terms, the coefficients (3, ORDER) of each term cut to
    rank one. All systems are sums over the products of the terms, so that the samples are gone through once.
    """
    powers = np.arange(1, ORDER + 1)
    terms = encoded[:, :, None] ** powers  # (n, 3, ORDER)
    design = terms.reshape(len(encoded), -1)
    products, right_sides = design.T @ design, (design.T @ raw).reshape(3, ORDER, 3)
    ridge = RIDGE * len(encoded) * np.eye(len(products))
    additive = np.linalg.solve(products + ridge, right_sides.reshape(-1, 3)).reshape(3, ORDER, 3)
    blocks = products.reshape(3, ORDER, 3, ORDER)
    left, strength, right = np.linalg.svd(additive)
    curves = left[:, :, 0] * strength[:, :1]  # (3, ORDER)
    matrix = right[:, 0, :].T  # (3, 3): column k takes channel k's curve
    for _ in range(30):
        joint = np.einsum("kplq,kl->kplq", blocks, matrix.T @ matrix).reshape(products.shape)
        right_side = np.einsum("kpc,ck->kp", right_sides, matrix).reshape(-1)
        curves = np.linalg.solve(joint + ridge, right_side).reshape(3, ORDER)
        normal = np.einsum("kp,kplq,lq->kl", curves, blocks, curves)
        matrix = np.linalg.lstsq(normal, np.einsum("kp,kpc->kc", curves, right_sides), rcond=None)[0].T
    low, high = encoded.min(axis=0), encoded.max(axis=0)

    def predict(values: Array) -> Array:
        inside = np.clip(values, low, high)[:, :, None] ** powers
        return np.asarray(np.einsum("nkp,kp->nk", inside, curves) @ matrix.T)

    return predict


def colour_polynomial(x: Array, y: Array) -> Predictor:
    """Fit one polynomial of all three channels: degree 4 (35 terms), less where there are not four samples a term."""
    degree = 4
    while degree > 1 and len(x) < 4 * len(_terms(degree)):
        degree -= 1
    terms = _terms(degree)
    low, high = x.min(axis=0), x.max(axis=0)
    span = np.maximum(high - low, 1e-6)

    def design(values: Array) -> Array:
        unit = 2.0 * (np.clip(values, low, high) - low) / span - 1.0
        return np.stack([np.prod(unit[:, list(term)], axis=1) for term in terms], axis=1)

    matrix = design(x)
    normal = matrix.T @ matrix + RIDGE * len(x) * np.eye(len(terms))
    coefficients = np.asarray(np.linalg.solve(normal, matrix.T @ y), dtype=np.float64)
    return lambda values: np.asarray(design(values) @ coefficients)


def _terms(degree: int) -> list[tuple[int, ...]]:
    """Channel indices of every monomial up to a degree; () is the constant."""
    return [term for order in range(degree + 1) for term in combinations_with_replacement(range(3), order)]
