"""The vignetting that a camera corrects in its JPEGs only, fitted to samples whose places in the picture are known.

A fixed rendering takes each scene colour to one JPEG colour I, so that y = log₂ Σ Tw E is a smooth function λ of I. The
JPEG of a corner is brighter than the RAW implies: y = λ(I) − vignetting(place) + ε, a partially linear model
(`partially_linear_model`), so that the gamut map need not be known. The vignetting of each lens setting is monotone in
the squared distance from a centre that is free within some per cent; it is fitted together with λ by damped
Gauss–Newton steps and robust weights.

Channels may be shaded by different amounts, as by a sensor that slanting light reaches less. So what log₂ of each
channel of Tw E keeps of a vignetting, once the brightness is corrected, is fitted by linear least squares.

A vignetting is kept if it is significant, and the shading of channels if one differs from their mean. Its strength is
estimated separately in each quarter of each shot, with the shape r², and the mean of these estimates is compared with 0
by a t-test. This test is valid for few groups of different variance, with correlated errors within a group (Ibragimov &
Müller 2010, https://doi.org/10.1198/jbes.2009.08046). A vignetting shows in all four quarters of a picture; light or
colours that change across the picture do not.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtr

from lutforge.arrays import Array, Mask
from lutforge.calibration.partially_linear_model import (
    SAMPLE_NOISE,
    PartiallyLinearModel,
    Projection,
    partially_linear_model,
)
from lutforge.model.vignetting import NO_SHADING, VIGNETTING_DEGREE, Vignetting, vignetting_basis, vignetting_of
from lutforge.samples.sample_set import SampleSet
from lutforge.solvers.gauss_newton import gauss_newton
from lutforge.threads import one_blas_thread

SIGNIFICANCE = 0.005
"""Largest p-value, one-sided, of a vignetting that is taken out."""
LEAST_EV = 0.03
"""Least difference between corners and centre, in stops; it moves a bright colour by a code."""
LITTLE_INFORMATION = 0.05
"""Quarters of a shot with less information than this share of the median quarter are left out."""
LEAST_QUARTERS = 3
"""Fewer estimates have no scatter to compare their mean with."""
TINIEST = 1e-300
"""Divisors of 0 are raised to this."""

SAME_FOCAL_LENGTH = 0.03
"""Focal lengths within so much are one, as zooms report them in steps."""
UNKNOWN_FOCAL_LENGTH, UNKNOWN_APERTURE = -1e9, -1.0
"""Stand for NaN where settings are compared: no rounded logarithm of a focal length, and no f-number."""

START, LARGEST_COEFFICIENT = 0.1, 4.0
"""First value of the coefficients of a vignetting, and the largest, in stops."""
FARTHEST_CENTRE, CENTRE_SPREAD = 0.15, 0.04
"""Bounds of the centre in each direction; standard deviation of its prior around the middle of the picture."""
UNKNOWNS = VIGNETTING_DEGREE + 2
"""Coefficients and the two coordinates of the centre, of each lens setting."""
CENTRE_STEP = 1e-4
"""Step of the numerical derivative by the centre."""
MOST_VIGNETTING_STEPS = 20
"""Gauss–Newton steps with the same weights, at most."""
VIGNETTING_ROUNDS, SHADING_ROUNDS, STRENGTH_ROUNDS = 6, 4, 3
"""Rounds of reweighting of the vignettings, of the shading of a channel, and of the fit without a vignetting."""


@dataclass(frozen=True, eq=False)
class _LensSetting:
    """One lens setting; member: (n,) the samples that are of it."""

    lens: str
    focal_mm: float
    aperture: float
    member: Mask

    def vignetting(self, coefficients: Sequence[float], centre: Sequence[float]) -> Vignetting:
        """The vignetting of this setting with three coefficients and the two coordinates of its centre."""
        a, b, c = coefficients
        x, y = centre
        return Vignetting((a, b, c), (x, y), self.lens, self.focal_mm, self.aperture)


def _lens_settings(samples: SampleSet) -> Iterable[_LensSetting]:
    """The lens settings of samples."""
    focal = np.round(np.log(samples.focal_mm) / SAME_FOCAL_LENGTH)
    keys = np.rec.fromarrays(
        [
            samples.lens,
            np.nan_to_num(focal, nan=UNKNOWN_FOCAL_LENGTH),
            np.nan_to_num(samples.aperture, nan=UNKNOWN_APERTURE),
        ]
    )
    for key in np.unique(keys):
        member = keys == key
        first = int(np.argmax(member))
        yield _LensSetting(
            str(samples.lens[first]), float(samples.focal_mm[first]), float(samples.aperture[first]), member
        )


def at_the_centre(samples: SampleSet, vignettings: Sequence[Vignetting]) -> SampleSet:
    """Return the samples with RAW corrected for the vignettings, so that one rendering holds for all places."""
    stops = np.zeros((len(samples), 3))
    for setting in _lens_settings(samples) if vignettings else ():
        vignetting = vignetting_of(vignettings, setting.lens, setting.focal_mm, setting.aperture)
        if vignetting is not None:
            stops[setting.member] = vignetting.stops(samples.position[setting.member])
    return replace(samples, raw=samples.raw * 2.0**stops)


@one_blas_thread
def fit_vignettings(samples: SampleSet, multipliers: Array, usable: Mask) -> tuple[Vignetting, ...]:
    """The vignettings of the lens settings where they are significant.

    multipliers: (n, 3), what makes RAW white-balanced; usable: (n,) unclipped samples. Samples without a place are
    not used.
    """
    located = usable & np.all(np.isfinite(samples.position), axis=1)
    model = partially_linear_model(samples, multipliers, located)
    if model is None:
        return ()

    settings = list(_lens_settings(model.samples))
    of_brightness = _significant_vignettings(model, settings)
    places = model.samples.position
    stops = np.zeros((len(places), 3))
    for setting, vignetting in of_brightness.items():
        stops[setting.member] = vignetting.stops(places[setting.member])

    vignettings = []
    for setting in settings:
        vignetting = of_brightness.get(setting, setting.vignetting((0.0, 0.0, 0.0), (0.0, 0.0)))
        shading = _fit_shading(model, stops, setting, vignetting.centre)
        if setting in of_brightness or shading != NO_SHADING:
            vignettings.append(replace(vignetting, shading=shading))
    return tuple(vignettings)


def _significant_vignettings(
    model: PartiallyLinearModel, settings: Sequence[_LensSetting]
) -> dict[_LensSetting, Vignetting]:
    """The vignettings of brightness that are significant.

    Settings with an insignificant one are left out of a further fit, because it may not affect that of the others.
    """
    places = model.samples.position
    while settings:
        vignettings = _fit_together(model, settings)
        stops = np.zeros(len(places))
        for setting, vignetting in vignettings.items():
            stops[setting.member] = vignetting.stops(places[setting.member])[:, 1]

        significant = {}
        for setting, vignetting in vignettings.items():
            without_others = model.y + np.where(setting.member, 0.0, stops)
            statistic, freedom = _strength(model, without_others, setting)
            if vignetting.corner_ev > LEAST_EV and stdtr(freedom, -statistic) < SIGNIFICANCE:
                significant[setting] = vignetting
        if len(significant) == len(settings):
            return significant
        settings = list(significant)
    return {}


@dataclass(frozen=True, eq=False)
class _VignettingTerms:
    """The vignettings at places (n, 2), as a function of the unknowns of all settings."""

    places: Array
    settings: Sequence[_LensSetting]

    def stops_and_slopes(self, unknowns: Array) -> tuple[Array, Array]:
        """The vignetting at each place (n,), and its slopes (n, u), of unknowns (u,)."""
        stops = np.zeros(len(self.places))
        slopes = np.zeros((len(self.places), len(unknowns)))
        for place, setting in enumerate(self.settings):
            of_setting = slice(UNKNOWNS * place, UNKNOWNS * (place + 1))
            coefficients, centre = np.split(unknowns[of_setting], [VIGNETTING_DEGREE])
            offset = self.places[setting.member] - centre
            basis, right, down = (
                vignetting_basis(np.sum((offset - step) ** 2, axis=1))
                for step in ((0, 0), (CENTRE_STEP, 0), (0, CENTRE_STEP))
            )
            stops[setting.member] = basis @ coefficients
            by_centre = np.stack([(right - basis) @ coefficients, (down - basis) @ coefficients], axis=1)
            slopes[setting.member, of_setting] = np.hstack([basis, by_centre / CENTRE_STEP])
        return stops, slopes


def _fit_together(model: PartiallyLinearModel, settings: Sequence[_LensSetting]) -> dict[_LensSetting, Vignetting]:
    """The vignettings of all settings together, as least squares.

    Unknowns are, of each setting, the coefficients and the two coordinates of the centre. The prior of a coefficient is
    a stop around 0, which a handful of samples outweighs.
    """
    count = len(settings)
    prior = SAMPLE_NOISE / np.tile([1.0] * VIGNETTING_DEGREE + [CENTRE_SPREAD] * 2, count)
    lower = np.tile([0.0] * VIGNETTING_DEGREE + [-FARTHEST_CENTRE] * 2, count)
    upper = np.tile([LARGEST_COEFFICIENT] * VIGNETTING_DEGREE + [FARTHEST_CENTRE] * 2, count)
    terms = _VignettingTerms(model.samples.position, settings)

    def least_squares(start: Array, projection: Projection) -> Array:
        """The unknowns of least squares, as Gauss–Newton steps from other ones find them."""
        root = np.sqrt(projection.weight)[:, None]

        def linearize(unknowns: Array, _: NDArray[np.intp]) -> tuple[Array, Array]:
            stops, slopes = terms.stops_and_slopes(unknowns[0])
            residuals = projection.residual(np.column_stack([model.y + stops, slopes])) * root
            residual = np.concatenate([residuals[:, 0], prior * unknowns[0]])
            return residual[None], np.vstack([residuals[:, 1:], np.diag(prior)])[None]

        minima = gauss_newton(linearize, start[None], lower=lower, upper=upper, most=MOST_VIGNETTING_STEPS)
        return np.asarray(minima.value[0])

    unknowns = np.tile([START] * VIGNETTING_DEGREE + [0.0] * 2, count)
    projection = model.by_noise
    for _ in range(VIGNETTING_ROUNDS):
        unknowns = least_squares(unknowns, projection)
        stops, _ = terms.stops_and_slopes(unknowns)
        projection = model.reweighted(projection.residual((model.y + stops)[:, None])[:, 0])

    by_setting = zip(settings, unknowns.reshape(-1, UNKNOWNS).tolist(), strict=True)
    return {
        setting: setting.vignetting(values[:VIGNETTING_DEGREE], values[VIGNETTING_DEGREE:])
        for setting, values in by_setting
    }


def _fit_shading(
    model: PartiallyLinearModel, stops: Array, setting: _LensSetting, centre: tuple[float, float]
) -> tuple[tuple[float, ...], ...]:
    """The coefficients (3, VIGNETTING_DEGREE) by which channels are brightened beyond the vignetting of brightness.

    stops: (n, 3), that vignetting at the samples. The prior of a coefficient is a stop around 0. The coefficients are
    all 0 where no channel differs significantly from the mean of the three, or only by little.
    """
    channels = model.channels + stops
    ratios = channels - channels.mean(axis=1, keepdims=True)
    tests = [_strength(model, ratios[:, channel], setting) for channel in range(3)]
    if min(2.0 * stdtr(freedom, -abs(statistic)) for statistic, freedom in tests) > SIGNIFICANCE / 3:
        return NO_SHADING

    squared_distance = np.sum((model.samples.position - centre) ** 2, axis=1)
    basis = vignetting_basis(squared_distance) * setting.member[:, None]
    shading = tuple(_channel_shading(model, basis, channels[:, channel]) for channel in range(3))
    corners = np.sum(shading, axis=1)
    return shading if np.abs(corners - corners.mean()).max() > LEAST_EV else NO_SHADING


def _channel_shading(model: PartiallyLinearModel, basis: Array, channel: Array) -> tuple[float, ...]:
    """The coefficients of a basis (n, VIGNETTING_DEGREE) by which a channel (n,) is brightened."""
    prior = SAMPLE_NOISE**2 * np.eye(VIGNETTING_DEGREE)
    projection = model.by_noise
    for _ in range(SHADING_ROUNDS):
        residual = projection.residual(np.column_stack([basis, channel]))
        columns, values = residual[:, :-1], residual[:, -1]
        weighted = columns * projection.weight[:, None]
        coefficients = -np.linalg.solve(weighted.T @ columns + prior, weighted.T @ values)
        projection = model.reweighted(values + columns @ coefficients)
    return tuple(coefficients.tolist())


def _strength(model: PartiallyLinearModel, y: Array, setting: _LensSetting) -> tuple[float, int]:
    """Student's t of the strength of a vignetting r², estimated in each quarter of each shot, and its freedom.

    y: (n,), without the vignettings of the settings other than this one. Weights are those of a fit without its
    vignetting, which do not favour samples that agree with it.
    """
    projection = model.by_noise
    for _ in range(STRENGTH_ROUNDS):
        projection = model.reweighted(projection.residual(y[:, None])[:, 0])

    places, shot = model.samples.position, model.samples.shot
    squared_radius = np.where(setting.member, np.sum(places**2, axis=1), 0.0)
    residual = projection.residual(np.column_stack([squared_radius, -y]))
    quarter = 2 * (places[:, 0] > 0) + (places[:, 1] > 0)
    strengths, information = [], []
    for name in np.unique(shot[setting.member]):
        for place in range(4):
            block = setting.member & (shot == name) & (quarter == place)
            weight, (term, value) = projection.weight[block], residual[block].T
            information.append(float(weight @ term**2))
            strengths.append(float(weight @ (term * value)) / max(information[-1], TINIEST))

    enough = np.array(information) > LITTLE_INFORMATION * np.median(information)
    if np.count_nonzero(enough) < LEAST_QUARTERS:
        return 0.0, 1
    estimates = np.array(strengths)[enough]
    error_of_mean = max(float(estimates.std(ddof=1)), TINIEST) / np.sqrt(len(estimates))
    return float(estimates.mean() / error_of_mean), len(estimates) - 1
