"""The methods that are compared: the profile's own models, those of the thesis's tables, and plain baselines."""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from lutforge.arrays import Array
from lutforge.calibration.lattice.shrinkage import MOST_SHOTS, Shrinkable, shrinkable
from lutforge.calibration.options import MEASURING_TOLERANCE, CalibrationOptions
from lutforge.calibration.physical.matrix_and_response import MatrixAndResponse, with_matrix_of_all
from lutforge.calibration.style_data import StyleData
from lutforge.calibration.style_fit import StyleFit, fit_linearize, fit_render, refit_physical
from lutforge.calibration.thesis.lattice import fit_uniform
from lutforge.errors import CalibrationError
from lutforge.evaluation.baselines import channel_polynomials, colour_polynomial, mixed_channel_polynomials
from lutforge.model.directions import Both
from lutforge.model.profile_data import PhysicalModel, PictureStyle

Predictor = Callable[[Array], Array]

LATTICE, RBF, NO_GAMUT_MAP = "lattice", "rbf", "f and T, no h"
MATRIX_AND_RESPONSE = "matrix and response"
CHANNEL_POLYNOMIALS, COLOUR_POLYNOMIAL = "polynomial per channel", "polynomial of all channels"
BASELINES = (MATRIX_AND_RESPONSE, CHANNEL_POLYNOMIALS, COLOUR_POLYNOMIAL)


def lattice_name(size: int, *, nonuniform: bool) -> str:
    """The name of the method that fits lattices of `size` nodes per axis."""
    return f"{'nonuniform' if nonuniform else 'uniform'} lattice {size}"


@dataclass(frozen=True, eq=False)
class Fit(Both[Predictor]):
    """One method, fitted once. render: Tw E (n, 3) → I; linearize: I → Tw E, not clipped.

    seconds: what the fits took, with all that is searched; None where that was not made here.
    """

    seconds: Both[float | None] = field(default_factory=lambda: Both(None, None))


@dataclass(frozen=True, eq=False)
class Fits:
    """All methods, fitted to the same shots. own: the lattices of LATTICE, if they may shrink."""

    by_method: dict[str, Fit]
    own: Both[Shrinkable] | None = None

    def shrunk(self, weights: Both[Array]) -> "Fits":
        """Return the fits with shrunk lattices; weights: of REACHES."""
        if self.own is None:
            return self
        render, linearize = (one.averaged(each) for one, each in zip(self.own, weights, strict=True))
        return Fits({**self.by_method, LATTICE: replace(self.by_method[LATTICE], render=render, linearize=linearize)})


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


class Fitter:
    """Fits all methods to parts of a style's shots.

    What is searched in a fit serves all parts: λ_S and the node levels of a fit to all the shots, and the smoothness of
    the gamut map that the first part chose. Searched anew for each part, levels and λ_S give mean errors on left-out
    shots that differ by 0 % in the median (S40, D40 and ten cameras' charts; -5 % to +5 %), in twice the time. notes:
    is told what could not be done.
    """

    def __init__(
        self,
        name: str,
        style: PictureStyle,
        data: StyleData,
        options: CalibrationOptions,
        notes: list[str],
        *,
        sizes: Sequence[int] = (),
        own: bool = False,
        fitted: StyleFit | None = None,
    ) -> None:
        """Plan the methods of a style.

        data: of all its shots; sizes: of the lattices of the thesis's tables, with its other methods; own: no model but
        the one asked for; fitted: the fit by these options to all the shots, where that was made.
        """
        self.name, self.data, self.options, self.notes = name, data, options, notes
        self._fitted = {} if fitted is None else {LATTICE: _TimedFit(fitted)}
        self.sizes = tuple(sizes)
        has_lattice = style.render is not None and not (own and options.model == "rbf")
        self.lattices = {LATTICE: options} if has_lattice or sizes else {}
        for size in sizes:
            for nonuniform in (False, True):
                method = lattice_name(size, nonuniform=nonuniform)
                self.lattices[method] = replace(options, size=size, nonuniform=nonuniform)
        self.own_physical = bool(style.physical)
        self.physical = self.own_physical or bool(sizes)
        nugget = options.physical.nugget
        self.nuggets: tuple[float | None, float | None] = (nugget, nugget)

    def fit(self, train: StyleData) -> Fits:
        """Return all methods, fitted to these samples."""
        self.search()
        fits, own = {}, None
        for method, options in self.lattices.items():
            fits[method], pair = _lattices(train, options, self._fitted[method], len(np.unique(self.data.shot)))
            own = pair if method == LATTICE else own
        fits |= {f"lattice by (5.3) {size}": _plain_regression(train, self.options, size) for size in self.sizes}
        return Fits({**fits, **self._physical(train), **fit_baselines(train)}, own)

    def compared(self, train: StyleData) -> dict[str, Fit]:
        """Return what the thesis's error maps show beside its own model: a uniform lattice, and the model by RBFs."""
        even = _timed_fit(train, replace(self.options, nonuniform=False)).fit
        lattice = Fit(even.render.lattice, even.linearize.lattice)
        return {lattice_name(self.options.size, nonuniform=False): lattice, **self._physical(train)}

    def search(self) -> None:
        """Fit each lattice to all the shots, once, for what is searched in it."""
        for method, options in self.lattices.items():
            if method not in self._fitted:
                self._fitted[method] = _timed_fit(self.data, options)

    @property
    def independent(self) -> bool:
        """Whether parts can be fitted beside each other: none takes from another what that chose."""
        return not self.physical

    def _physical(self, train: StyleData) -> dict[str, Fit]:
        if not self.physical:
            return {}
        start = time.perf_counter()
        balances = tuple(str(name) for name in np.unique(train.samples.white_balance))
        try:
            maps = refit_physical(train, self.options, balances, self.nuggets)
        except CalibrationError as error:
            if not self.own_physical and self.options.preset == "thesis":
                self.notes.append(f"{self.name}: the physical model takes f from RAW/JPEG pairs ({error})")
                self.options = replace(self.options, preset="lutforge")
                return self._physical(train)
            self.notes.append(f"{self.name}: the physical model cannot be refitted without one of its shots ({error})")
            return {}
        self.nuggets = (maps.nugget, maps.inverse_nugget)
        return _physical_fits(maps.model, time.perf_counter() - start)


@dataclass(frozen=True, eq=False)
class _TimedFit:
    """Both lattices of a style, fitted to all its shots. seconds: what each took; None where not known."""

    fit: StyleFit
    seconds: Both[float | None] = field(default_factory=lambda: Both(None, None))


def _timed_fit(data: StyleData, options: CalibrationOptions) -> _TimedFit:
    """Fit both lattices, with what they search and the time that takes."""
    start = time.perf_counter()
    render = fit_render(data, options)
    middle = time.perf_counter()
    linearize = fit_linearize(data, options, render)
    return _TimedFit(StyleFit(render, linearize, data.base), Both(middle - start, time.perf_counter() - middle))


def _lattices(
    train: StyleData, options: CalibrationOptions, like: _TimedFit, shots: int
) -> tuple[Fit, Both[Shrinkable] | None]:
    """Lattices of both directions, and what they can be shrunk to, where options and the number of all shots shrink."""
    forth = fit_render(train, options, like=like.fit.render, tolerance=MEASURING_TOLERANCE)
    back = fit_linearize(train, options, forth, like=like.fit.linearize, tolerance=MEASURING_TOLERANCE)
    render, linearize = forth.lattice, back.lattice
    fit = Fit(render, linearize, like.seconds)
    if not shrinks(train, options) or shots > MOST_SHOTS:
        return fit, None
    samples = (train.balanced, train.encoded)
    return fit, Both(
        shrinkable(render, train.base, *samples, inverse=False),
        shrinkable(linearize, train.base, *samples, inverse=True),
    )


def _plain_regression(train: StyleData, options: CalibrationOptions, size: int) -> Fit:
    """The lattice regression that the thesis compares itself with: evenly spaced nodes, no smoothness but λ_K."""
    options = replace(options, size=size)
    x, y = train.balanced, train.encoded
    start = time.perf_counter()
    render = fit_uniform(x, y, options).lattice
    middle = time.perf_counter()
    linearize = fit_uniform(y, x, options).lattice
    return Fit(render, linearize, Both(middle - start, time.perf_counter() - middle))


def shrinks(data: StyleData, options: CalibrationOptions) -> bool:
    """Whether the lattices of a style are shrunk: not those that follow the thesis, or stand beside its model."""
    return options.preset == "lutforge" and options.model == "lattice" and not data.monochrome
