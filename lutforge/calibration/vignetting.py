"""The vignetting that a camera corrects in its JPEGs only, fitted to samples whose places in the picture are known.

A fixed rendering takes each scene colour to one JPEG colour I, so that y = log₂ Σ Tw E is a smooth function λ of I. The
JPEG of a corner is brighter than the RAW says: y = λ(I) − vignetting(place) + ε, a partially linear model (Robinson
1988, https://doi.org/10.2307/1912705). λ is a Gaussian process for each style, with the kernel of the gamut map,
spanned by its values at a few of the colours. It is projected out of y and of every linear term, whose coefficients are
fitted to the residuals, which gives those of the joint fit (Frisch & Waugh 1933, https://doi.org/10.2307/1907330). So
the gamut map need not be known. The vignetting of each lens setting is monotone in the squared distance from a centre
that is free within some per cent; it is fitted together with λ by damped Gauss–Newton steps and robust weights.

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
from scipy.linalg import block_diag, cho_factor, cho_solve
from scipy.special import stdtr

from lutforge.arrays import Array, Mask
from lutforge.model.gamut_map import kriging_covariance
from lutforge.model.vignetting import NO_SHADING, VIGNETTING_DEGREE, Vignetting, vignetting_basis, vignetting_of
from lutforge.samples.sample_set import SampleSet
from lutforge.solvers.farthest_points import farthest_points
from lutforge.solvers.gauss_newton import gauss_newton
from lutforge.solvers.robust_weights import RobustWeights, cauchy
from lutforge.threads import one_blas_thread

SAMPLE_NOISE = 0.03
"""Standard deviation of y, in stops, of bright samples; that of darker ones is larger, because codes are rounded."""
VIGNETTING_SPREAD = 10.0
"""Standard deviation of λ, in stops, from black to white."""
OF_SHOT = 0.1
"""That of the offset of a shot, in stops."""
SIGNIFICANCE = 0.005
"""Largest p-value, one-sided, of a vignetting that is taken out."""
LEAST_EV = 0.03
"""Least difference between corners and centre, in stops; it moves a bright colour by a code."""
FARTHEST_CENTRE, CENTRE_SPREAD = 0.15, 0.04
"""Bounds of the centre in each direction; standard deviation of its prior around the middle of the picture."""
VIGNETTING_WEIGHTS = RobustWeights(cauchy, multiple=2.5, least=0.02)
SAME_FOCAL_LENGTH = 0.03
"""Focal lengths within so much are one, as zooms report them in steps."""
LITTLE_INFORMATION = 0.05
"""Quarters of a shot with less information than this share of the median quarter are left out."""
TYPICAL_POWER, LEAST_ROUNDED_VALUE = 2.2, 0.02
"""Rounding of codes is that of a response of this power, and of values of this at least."""


@dataclass(frozen=True, eq=False)
class _PartialModel:
    """The samples of a partially linear model.

    rows: (n,) their places in the sample set; channels: log₂ of balanced RAW, (n, 3); y: of its sum, (n,); precision:
    (n,) by their noise;
    parts: by style its places among them (k,), the functions of λ there (k, p), and their penalty (p, p).
    """

    rows: NDArray[np.intp]
    channels: Array
    y: Array
    precision: Array
    parts: Sequence[tuple[slice, Array, Array]]

    def residual(self, columns: Array, weight: Array) -> Array:
        """Fit a function of colour to columns (n, k) with weights (n,), and return the residuals (n, k)."""
        residuals = np.empty_like(columns)
        for of_style, design, bending in self.parts:
            weighted = design * weight[of_style, None]
            normal = weighted.T @ design + bending
            coefficients = cho_solve(cho_factor(normal), weighted.T @ columns[of_style])
            residuals[of_style] = columns[of_style] - design @ coefficients
        return residuals

    def reweighted(self, residual: Array) -> Array:
        """Weights (n,) of the next round of a robust fit, from the residuals (n,) of this one."""
        return np.asarray(self.precision * VIGNETTING_WEIGHTS(np.abs(residual)))


def _partial_model(samples: SampleSet, multipliers: Array, usable: Mask) -> _PartialModel | None:
    """State the model of the usable samples (n,), at most 4,000 of a style; None where colours cannot tell λ.

    multipliers: (n, 3), what makes RAW white-balanced. Each shot has an offset of its own with a prior of a tenth of a
    stop around 0, so that no exposure that is off is taken for something else.
    """
    rng, rows, parts, count = np.random.default_rng(0), [], [], 0
    for name in np.unique(samples.style[usable]):
        of_style = np.flatnonzero(usable & (samples.style == name))
        of_style = np.sort(rng.permutation(of_style)[:4000])
        encoded = np.ascontiguousarray(samples.srgb[of_style])
        shots, member = np.unique(samples.shot[of_style], return_inverse=True)
        centres = encoded[farthest_points(encoded, min(150, len(of_style) // 8))]
        covariance = np.tril(kriging_covariance(centres))
        covariance += np.tril(covariance, -1).T + 1e-9 * np.eye(len(centres))
        design = np.hstack([kriging_covariance(encoded, centres), np.eye(len(shots))[member]])
        bending = block_diag(
            (SAMPLE_NOISE / VIGNETTING_SPREAD) ** 2 * covariance, (SAMPLE_NOISE / OF_SHOT) ** 2 * np.eye(len(shots))
        )
        parts.append((slice(count, count + len(of_style)), design, bending))
        rows.append(of_style)
        count += len(of_style)
    if not parts:
        return None
    places = np.concatenate(rows)
    balanced = samples.raw[places] * multipliers[places]
    rounding = (
        TYPICAL_POWER / np.log(2.0) * (0.5 / 255) / np.maximum(samples.srgb[places].mean(axis=1), LEAST_ROUNDED_VALUE)
    )
    precision = SAMPLE_NOISE**2 / (SAMPLE_NOISE**2 + rounding**2)
    return _PartialModel(places, np.log2(balanced), np.log2(balanced.sum(axis=1)), precision, parts)


@dataclass(frozen=True, eq=False)
class _Setting:
    """One lens setting; member: (n,) the samples of the model that are of it."""

    lens: str
    focal_mm: float
    aperture: float
    member: Mask


@one_blas_thread
def fit_vignettings(samples: SampleSet, multipliers: Array, usable: Mask) -> tuple[Vignetting, ...]:
    """The vignettings of the lens settings where they are significant.

    multipliers: (n, 3), what makes RAW white-balanced; usable: (n,) unclipped samples. Samples without a place say
    nothing.
    """
    usable = usable & np.all(np.isfinite(samples.position), axis=1)
    model = _partial_model(samples, multipliers, usable) if usable.any() else None
    if model is None:
        return ()
    settings = list(_settings(samples.select(model.rows)))
    places, shot = samples.position[model.rows], samples.shot[model.rows]
    bright = _significant(model, places, shot, settings)
    stops = np.zeros((len(places), 3))
    for setting, vignetting in bright:
        stops[setting.member] = vignetting.stops(places[setting.member])

    vignettings = []
    of_brightness = {id(setting): vignetting for setting, vignetting in bright}
    for setting in settings:
        vignetting = of_brightness.get(id(setting)) or Vignetting(
            (0.0, 0.0, 0.0), (0.0, 0.0), setting.lens, setting.focal_mm, setting.aperture
        )
        shading = _shading(model, stops, places, shot, setting, vignetting.centre)
        if id(setting) in of_brightness or shading != NO_SHADING:
            vignettings.append(replace(vignetting, shading=shading))
    return tuple(vignettings)


def _significant(
    model: _PartialModel, places: Array, shot: NDArray[np.str_], settings: Sequence[_Setting]
) -> list[tuple[_Setting, Vignetting]]:
    """The settings whose vignetting of brightness is significant, with these vignettings."""
    while settings:
        vignettings = _fit(model, places, settings)
        stops = np.zeros(len(places))
        for setting, vignetting in zip(settings, vignettings, strict=True):
            stops[setting.member] = vignetting.stops(places[setting.member])[:, 1]
        kept = []
        for setting, vignetting in zip(settings, vignettings, strict=True):
            without = model.y + np.where(setting.member, 0.0, stops)
            statistic, freedom = _strength(model, without, places, shot, setting.member)
            if vignetting.corner_ev > LEAST_EV and stdtr(freedom, -statistic) < SIGNIFICANCE:
                kept.append(setting)
        if len(kept) == len(settings):
            return list(zip(settings, vignettings, strict=True))
        settings = kept  # an insignificant vignetting may not affect the fit of the others
    return []


def _shading(
    model: _PartialModel,
    stops: Array,
    places: Array,
    shot: NDArray[np.str_],
    setting: _Setting,
    centre: tuple[float, float],
) -> tuple[tuple[float, ...], ...]:
    """The coefficients (3, VIGNETTING_DEGREE) by which channels are brightened beyond the vignetting of brightness.

    stops: (n, 3), that vignetting at the samples. The prior of a coefficient is a stop around 0. The coefficients are
    all 0 where no channel differs significantly from the mean of the three, or only by little.
    """
    channels = model.channels + stops
    ratios = channels - channels.mean(axis=1, keepdims=True)
    tests = [_strength(model, ratios[:, channel], places, shot, setting.member) for channel in range(3)]
    if min(2.0 * stdtr(freedom, -abs(statistic)) for statistic, freedom in tests) > SIGNIFICANCE / 3:
        return NO_SHADING

    basis = vignetting_basis(np.sum((places - centre) ** 2, axis=1)) * setting.member[:, None]
    shading = []
    for channel in range(3):
        weight = model.precision
        for _ in range(4):
            residual = model.residual(np.column_stack([basis, channels[:, channel]]), weight)
            columns, values = residual[:, :-1], residual[:, -1]
            weighted = columns * weight[:, None]
            coefficients = -np.linalg.solve(
                weighted.T @ columns + SAMPLE_NOISE**2 * np.eye(VIGNETTING_DEGREE), weighted.T @ values
            )
            weight = model.reweighted(values + columns @ coefficients)
        shading.append(tuple(coefficients.tolist()))
    corners = np.sum(shading, axis=1)
    return tuple(shading) if np.abs(corners - corners.mean()).max() > LEAST_EV else NO_SHADING


def at_the_centre(samples: SampleSet, vignettings: Sequence[Vignetting]) -> SampleSet:
    """Return the samples with RAW corrected for the vignettings, so that one rendering holds for all places."""
    stops = np.zeros((len(samples), 3))
    for setting in _settings(samples) if vignettings else ():
        vignetting = vignetting_of(vignettings, setting.lens, setting.focal_mm, setting.aperture)
        if vignetting is not None:
            stops[setting.member] = vignetting.stops(samples.position[setting.member])
    return replace(samples, raw=samples.raw * 2.0**stops)


def _settings(samples: SampleSet) -> Iterable[_Setting]:
    """The lens settings of samples."""
    focal = np.round(np.log(samples.focal_mm) / SAME_FOCAL_LENGTH)
    keys = np.rec.fromarrays(
        [samples.lens, np.nan_to_num(focal, nan=-(10**9)), np.nan_to_num(samples.aperture, nan=-1.0)]
    )
    for key in np.unique(keys):
        member = keys == key
        first = int(np.argmax(member))
        yield _Setting(str(samples.lens[first]), float(samples.focal_mm[first]), float(samples.aperture[first]), member)


def _fit(model: _PartialModel, places: Array, settings: Sequence[_Setting]) -> list[Vignetting]:
    """The vignettings of all settings together, as least squares.

    Unknowns are, of each setting, the coefficients and the two coordinates of the centre. The prior of a coefficient is
    a stop around 0, which a handful of samples outweighs.
    """
    unknown_count, step, weight = VIGNETTING_DEGREE + 2, 1e-4, model.precision
    prior = SAMPLE_NOISE / np.tile([1.0] * VIGNETTING_DEGREE + [CENTRE_SPREAD] * 2, len(settings))

    def terms(unknowns: Array) -> tuple[Array, Array]:
        """The vignetting at each sample (n,), and its slopes (n, unknowns)."""
        stops, slopes = np.zeros(len(places)), np.zeros((len(places), len(unknowns)))
        for place, setting in enumerate(settings):
            of_setting = slice(unknown_count * place, unknown_count * (place + 1))
            coefficients, centre = unknowns[of_setting][:VIGNETTING_DEGREE], unknowns[of_setting][VIGNETTING_DEGREE:]
            offset = places[setting.member] - centre
            basis, right, down = (
                vignetting_basis(np.sum((offset - d) ** 2, axis=1)) for d in ((0, 0), (step, 0), (0, step))
            )
            stops[setting.member] = basis @ coefficients
            moved = np.stack([(right - basis) @ coefficients, (down - basis) @ coefficients], axis=1) / step
            slopes[setting.member, of_setting] = np.hstack([basis, moved])
        return stops, slopes

    def linearize(unknowns: Array, _: NDArray[np.intp]) -> tuple[Array, Array]:
        stops, slopes = terms(unknowns[0])
        residuals = model.residual(np.column_stack([model.y + stops, slopes]), weight) * np.sqrt(weight)[:, None]
        residual = np.concatenate([residuals[:, 0], prior * unknowns[0]])
        return residual[None], np.vstack([residuals[:, 1:], np.diag(prior)])[None]

    lower = np.tile([0.0] * VIGNETTING_DEGREE + [-FARTHEST_CENTRE] * 2, len(settings))
    upper = np.tile([4] * VIGNETTING_DEGREE + [FARTHEST_CENTRE] * 2, len(settings))
    value = np.tile([0.1] * VIGNETTING_DEGREE + [0.0] * 2, len(settings))
    for _ in range(6):
        value = gauss_newton(linearize, value[None], lower=lower, upper=upper, most=20).value[0]
        weight = model.reweighted(model.residual((model.y + terms(value)[0])[:, None], weight)[:, 0])
    vignettings = []
    for setting, (a, b, c, x, y) in zip(settings, value.reshape(-1, unknown_count).tolist(), strict=True):
        vignettings.append(Vignetting((a, b, c), (x, y), setting.lens, setting.focal_mm, setting.aperture))
    return vignettings


def _strength(model: _PartialModel, y: Array, places: Array, shot: NDArray[np.str_], member: Mask) -> tuple[float, int]:
    """Student's t of the strength of a vignetting r², estimated in each quarter of each shot, and its freedom.

    y: (n,), without the vignettings of the other settings; member: (n,) the samples of this one. Weights are those of a
    fit without its vignetting, which do not favour samples that agree with it.
    """
    weight = model.precision
    for _ in range(3):
        weight = model.reweighted(model.residual(y[:, None], weight)[:, 0])
    residual = model.residual(np.column_stack([np.where(member, np.sum(places**2, axis=1), 0.0), -y]), weight)
    quarter = 2 * (places[:, 0] > 0) + (places[:, 1] > 0)
    strengths, information = [], []
    for name in np.unique(shot[member]):
        for place in range(4):
            block = member & (shot == name) & (quarter == place)
            information.append(float(weight[block] @ residual[block, 0] ** 2))
            strengths.append(
                float(weight[block] @ (residual[block, 0] * residual[block, 1])) / max(information[-1], 1e-300)
            )
    enough = np.array(information) > LITTLE_INFORMATION * np.median(information)
    if np.count_nonzero(enough) < 3:
        return 0.0, 1
    estimates = np.array(strengths)[enough]
    error_of_mean = max(float(estimates.std(ddof=1)), 1e-300) / np.sqrt(len(estimates))
    return float(estimates.mean() / error_of_mean), len(estimates) - 1
