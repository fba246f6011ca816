"""The methods that are compared: the profile's own models, those of the thesis's tables, and plain baselines."""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

from lutforge.arrays import Array
from lutforge.calibration.options import CalibrationOptions
from lutforge.calibration.physical.matrix_and_response import MatrixAndResponse, with_matrix_of_all
from lutforge.calibration.style_data import StyleData
from lutforge.calibration.style_fit import fit_lattices, fit_physical
from lutforge.calibration.thesis.lattice import fit_uniform
from lutforge.errors import CalibrationError
from lutforge.evaluation.baselines import channel_polynomials, colour_polynomial, mixed_channel_polynomials
from lutforge.model.directions import Both
from lutforge.model.lattice import Lattice
from lutforge.model.profile_data import PhysicalModel, PictureStyle

Predictor = Callable[[Array], Array]

LATTICE, RBF, NO_GAMUT_MAP = "lattice", "rbf", "f and T, no h"
MATRIX_AND_RESPONSE = "matrix and response"
CHANNEL_POLYNOMIALS, COLOUR_POLYNOMIAL = "polynomial per channel", "polynomial of all channels"
REFIT_CENTRES = 2_500
"""The most centres of a model that is fitted again without a shot."""
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

    The model is fitted again to each part. What a lattice of the profile differs from the profile's own model is the
    error of its nodes, which is added to the model of each part: nothing that a shot left out has told takes part.
    """

    def __init__(
        self,
        name: str,
        style: PictureStyle,
        options: CalibrationOptions,
        notes: list[str],
        *,
        sizes: Sequence[int] = (),
        own: bool = False,
    ) -> None:
        """Plan the methods of a style.

        sizes: of the lattices of the thesis's tables, with its other methods; own: no model but the one asked for;
        notes: is told what could not be done.
        """
        self.name, self.style, self.options, self.notes, self.sizes = name, style, options, notes, tuple(sizes)
        self.lattice = style.render is not None and not (own and options.model == "rbf")
        self.physical = bool(sizes) or (bool(style.physical) and not (own and options.model == "lattice"))

    def fit(self, train: StyleData) -> dict[str, Fit]:
        """All methods by name, fitted to these samples."""
        fits = {LATTICE: self._profile_lattices(train)} if self.lattice else {}
        for size in self.sizes:
            for nonuniform in (False, True):
                options = replace(self.options, size=size, nonuniform=nonuniform)
                fits[lattice_name(size, nonuniform=nonuniform)] = _timed_lattices(train, options)
            fits[f"lattice by (5.3) {size}"] = _plain_regression(train, self.options, size)
        return {**fits, **self._physical(train), **fit_baselines(train)}

    def compared(self, train: StyleData) -> dict[str, Fit]:
        """Return what the thesis's error maps show beside its own model: a uniform lattice, and the model by RBFs."""
        even = fit_lattices(train, replace(self.options, nonuniform=False))
        lattice = Fit(even.render, even.linearize)
        return {lattice_name(self.options.size, nonuniform=False): lattice, **self._physical(train)}

    def _profile_lattices(self, train: StyleData) -> Fit:
        render, linearize = self.style.render, self.style.linearize
        whole = self.style.physical[0] if self.style.physical else None
        if whole is None or self.options.preset == "thesis" or train.monochrome or render is None or linearize is None:
            return _timed_lattices(train, self.options)
        model = train.fit_model(min(REFIT_CENTRES, train.most_centres))
        return Fit(
            _with_error_of_nodes(model.render, render, whole.render),
            _with_error_of_nodes(model.linearize, linearize, whole.linearize),
        )

    def _physical(self, train: StyleData) -> dict[str, Fit]:
        if not self.physical:
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


def _with_error_of_nodes(model: Predictor, lattice: Lattice, whole: Predictor) -> Predictor:
    """A model, and the difference that the nodes of a lattice make to the model that it was baked from."""
    return lambda x: model(x) + (lattice(x) - whole(x))


def _timed_lattices(train: StyleData, options: CalibrationOptions) -> Fit:
    """Lattices fitted to samples, and half of the seconds that both took for each."""
    start = time.perf_counter()
    fitted = fit_lattices(train, options)
    seconds = (time.perf_counter() - start) / 2.0
    return Fit(fitted.render, fitted.linearize, Both(seconds, seconds))


def _plain_regression(train: StyleData, options: CalibrationOptions, size: int) -> Fit:
    """The lattice regression that the thesis compares itself with: evenly spaced nodes, no smoothness but λ_K."""
    options = replace(options, size=size)
    x, y = train.balanced, train.encoded
    start = time.perf_counter()
    render = fit_uniform(x, y, options)
    middle = time.perf_counter()
    linearize = fit_uniform(y, x, options)
    return Fit(render, linearize, Both(middle - start, time.perf_counter() - middle))
