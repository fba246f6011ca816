"""The methods that an evaluation compares: the profile's models, those of the thesis's tables, plain baselines."""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

from lutforge.calibration.matrix_and_response import MatrixAndResponse, with_matrix_of_all
from lutforge.calibration.method import CalibrationMethod
from lutforge.calibration.style import StyleData
from lutforge.errors import CalibrationError
from lutforge.evaluation.polynomials import (
    Predictor,
    channel_polynomials,
    colour_polynomial,
    mixed_channel_polynomials,
)
from lutforge.model.profile import ByDirection, CameraModel, PictureStyle
from lutforge.thesis.lattice import fit_uniform
from lutforge.thesis.method import ThesisMethod, method_of, thesis_method_beside
from lutforge.thesis.options import Options, ThesisOptions

LATTICE = "lattice"
CAMERA_MODEL = "camera model"
THESIS_MODEL = "thesis's camera model"
NO_GAMUT_MAP = "f and T, no h"
MATRIX_AND_RESPONSE = "matrix and response"
CHANNEL_POLYNOMIALS = "polynomial per channel"
COLOUR_POLYNOMIAL = "polynomial of all channels"
BASELINES = (MATRIX_AND_RESPONSE, CHANNEL_POLYNOMIALS, COLOUR_POLYNOMIAL)


def lattice_name(size: int, *, nonuniform: bool) -> str:
    """The name of the method with lattices of `size` nodes per axis."""
    return f"{'nonuniform' if nonuniform else 'uniform'} lattice {size}"


@dataclass(frozen=True, eq=False)
class Fit(ByDirection[Predictor]):
    """A method fitted to samples. render: Tw E (n, 3) → I; linearize: I → Tw E, not clipped.

    seconds: the duration of the fits, with searches of parameters; None where it was not measured.
    """

    seconds: ByDirection[float | None] = field(default_factory=lambda: ByDirection(None, None))


def fits_of_profile(style: PictureStyle, model: CameraModel | None) -> dict[str, Fit]:
    """The models of a style in the profile, without a new fit."""
    fits = {}
    if style.render is not None and style.linearize is not None:
        fits[LATTICE] = Fit(style.render, style.linearize)
    if model is not None:
        fits |= {CAMERA_MODEL: Fit(model.render, model.linearize), NO_GAMUT_MAP: _without_gamut_map(model)}
    return fits


def fit_baselines(train: StyleData) -> dict[str, Fit]:
    """The plain methods, fitted to samples."""
    x, y = train.balanced, train.encoded
    base = with_matrix_of_all(train.base, x, y)
    return {
        MATRIX_AND_RESPONSE: Fit(base.render, base.linearize),
        CHANNEL_POLYNOMIALS: Fit(channel_polynomials(x, y), mixed_channel_polynomials(y, x)),
        COLOUR_POLYNOMIAL: Fit(colour_polynomial(x, y), colour_polynomial(y, x)),
    }


@dataclass(frozen=True)
class Fitter:
    """A function that fits all methods to a part of a style's shots.

    name: of the style; options: of the profile's calibration; notes: a list to which notes on failed fits are added;
    sizes: of the lattices of the thesis's tables, empty without these tables.
    """

    name: str
    options: Options
    notes: list[str]
    sizes: Sequence[int] = ()

    def fit(self, train: StyleData) -> dict[str, Fit]:
        """All methods by name, fitted to these samples."""
        fits = {**self._methods_of_profile(train), **fit_baselines(train)}
        if not self.sizes:
            return fits

        own = method_of(self.options)
        thesis = thesis_method_beside(own)
        for size in self.sizes:
            fits |= _thesis_lattices(train, replace(thesis.options, size=size))
        if thesis != own:
            models = self._camera_model(train, thesis)
            fits |= {THESIS_MODEL: models[CAMERA_MODEL]} if models else {}
        return fits

    def _methods_of_profile(self, train: StyleData) -> dict[str, Fit]:
        """The methods of the profile's calibration.

        A camera model that lattices are baked from is measured without these: the error that they add is known without
        another fit.
        """
        method = method_of(self.options)
        if not method.bakes_camera_model:
            return {LATTICE: _lattices(train, method), **self._camera_model(train, method)}
        return {LATTICE: _lattices(train, method)} if train.monochrome else _of_camera_model(train, method)

    def _camera_model(self, train: StyleData, method: CalibrationMethod) -> dict[str, Fit]:
        """The camera model beside lattices that need none, with and without its gamut map; none where it fails."""
        try:
            return _of_camera_model(train, method)
        except CalibrationError as error:
            self.notes.append(
                f"{self.name}: no camera model by {method.options.method} without one of the shots ({error})"
            )
            return {}


def compared_fits(train: StyleData, options: Options) -> dict[str, Fit]:
    """The methods that a report compares with the profile's model: a lattice of even nodes, and the camera model."""
    even = method_of(replace(options, nonuniform=False))
    fits = {lattice_name(options.size, nonuniform=False): _lattices(train, even)}
    return {**fits, **_of_camera_model(train, even)} if even.bakes_camera_model else fits


def _lattices(train: StyleData, method: CalibrationMethod) -> Fit:
    """The lattices of a method, fitted to samples."""

    def fit() -> Fit:
        lattices = method.fit_lattices(train)
        return Fit(lattices.render, lattices.linearize)

    return _timed(fit)


def _of_camera_model(train: StyleData, method: CalibrationMethod) -> dict[str, Fit]:
    """The camera model of a method, with and without its gamut map. Raises CalibrationError."""
    start = time.perf_counter()
    model = method.fit_camera_model(train)
    half = 0.5 * (time.perf_counter() - start)
    return {
        CAMERA_MODEL: Fit(model.render, model.linearize, ByDirection(half, half)),
        NO_GAMUT_MAP: _without_gamut_map(model),
    }


def _thesis_lattices(train: StyleData, options: ThesisOptions) -> dict[str, Fit]:
    """The lattices of one size in the thesis's tables, and its baseline, whose only smoothness term is λ_K (5.3)."""
    fits = {}
    for nonuniform in (False, True):
        method = ThesisMethod(replace(options, nonuniform=nonuniform))
        fits[lattice_name(options.size, nonuniform=nonuniform)] = _lattices(train, method)
    fits[f"lattice by (5.3) {options.size}"] = _timed(
        lambda: Fit(
            fit_uniform(train.balanced, train.encoded, options), fit_uniform(train.encoded, train.balanced, options)
        )
    )
    return fits


def _timed(fit: Callable[[], Fit]) -> Fit:
    """A fit of both directions, with half of its duration as the time of each."""
    start = time.perf_counter()
    fitted = fit()
    half = 0.5 * (time.perf_counter() - start)
    return replace(fitted, seconds=ByDirection(half, half))


def _without_gamut_map(model: CameraModel) -> Fit:
    """The matrix and response of a camera model as a method."""
    plain = MatrixAndResponse(model.matrix, model.response)
    return Fit(plain.render, plain.linearize)
