"""Fit the models of one style: both lattices, and the physical model again on a part of its samples."""

from dataclasses import dataclass, replace

import numpy as np

from lutforge.arrays import Array
from lutforge.calibration.lattice.fit import fit_samples
from lutforge.calibration.lattice.likely_scenes import rendered_scenes
from lutforge.calibration.lattice.monochrome import inverse_of_greys
from lutforge.calibration.lattice.node_levels import error_histogram
from lutforge.calibration.lattice.plain import fit_plain
from lutforge.calibration.lattice.result import LatticeResult, result
from lutforge.calibration.options import MEASURING_TOLERANCE, CalibrationOptions
from lutforge.calibration.physical.matrix_and_response import MatrixAndResponse
from lutforge.calibration.physical.physical_model import GamutMaps, fit_gamut_maps, fit_stages
from lutforge.calibration.style_data import StyleData
from lutforge.model.directions import Both, Direction
from lutforge.model.lattice import Lattice
from lutforge.solvers.blas import one_blas_thread


@dataclass(frozen=True, eq=False)
class StyleFit(Both[LatticeResult]):
    """The fitted lattices of one style. base: the matrix and response that they follow where there are no samples."""

    base: MatrixAndResponse


@one_blas_thread
def fit_style(data: StyleData, options: CalibrationOptions) -> StyleFit:
    """Fit both lattices of a style."""
    render = fit_render(data, options)
    linearize = fit_linearize(data, options, render)
    return StyleFit(render, linearize, data.prior_mean(options.size, "render").base)


def fit_render(
    data: StyleData,
    options: CalibrationOptions,
    *,
    smoothness: float | None = None,
    like: LatticeResult | None = None,
    tolerance: float | None = None,
) -> LatticeResult:
    """Fit the lattice of a style that renders.

    smoothness: λ_S; like: a fit of the style, whose λ_S and node levels are taken; without either they are searched.
    """
    prior_mean = data.prior_mean(options.size, "render")
    return fit_samples(
        data.balanced, data.encoded, data.shot, prior_mean, options, clips=True, curve=prior_mean.curve,
        smoothness=smoothness, like=like, tolerance=tolerance,
    )  # fmt: skip


def fit_linearize(
    data: StyleData,
    options: CalibrationOptions,
    render: LatticeResult,
    *,
    like: LatticeResult | None = None,
    tolerance: float | None = None,
) -> LatticeResult:
    """Fit the lattice of a style that linearizes; render: the fitted lattice that renders the same data.

    A black-and-white style is linearized by the inverse of the greys of its rendering. Other arguments are those of
    `fit_render`.
    """
    if data.monochrome:
        return result(inverse_of_greys(render.lattice, options), data.encoded, render.smoothness)
    points = None
    if options.preset != "thesis":
        points = rendered_scenes(render.lattice, data.balanced, min(4 * options.size**3, 20_000))
        options = replace(options, lattice=replace(options.lattice, grey_weight=0.0))  # these hold the grey axis, too
    return fit_samples(
        data.encoded, data.balanced, data.shot, data.prior_mean(options.size, "linearize"), options, clips=False,
        points=points, like=like, tolerance=tolerance,
    )  # fmt: skip


def render_with_plain(data: StyleData, fit: StyleFit, options: CalibrationOptions) -> Lattice:
    """Return the lattice that renders; one with an output curve also gets its plain form, for files without curves."""
    if fit.render.lattice.output_curve is None:
        return fit.render.lattice
    curved, smoothness = fit.render.lattice, fit.render.smoothness
    return replace(curved, plain=fit_plain(data.balanced, data.encoded, curved, options, smoothness).lattice)


def uniform_lattice_errors(
    data: StyleData, options: CalibrationOptions, direction: Direction
) -> tuple[Array, Array, Array]:
    """Per axis the histogram, which node levels follow, of the squared error that a uniform lattice makes (5.6)."""
    uniform = replace(options, nonuniform=False)
    fitted = fit_render(data, uniform, tolerance=MEASURING_TOLERANCE)
    if direction == "linearize":
        fitted = fit_linearize(data, uniform, fitted, tolerance=MEASURING_TOLERANCE)
    lattice = fitted.lattice
    x, y = data.both[direction]
    return error_histogram(x, np.sum((lattice(x) - y) ** 2, axis=1))


def refit_physical(
    data: StyleData,
    options: CalibrationOptions,
    white_balances: tuple[str, ...],
    nuggets: tuple[float | None, float | None] = (None, None),
) -> GamutMaps:
    """Fit the physical model of one style to these samples, around matrix and response where these are given.

    nuggets: smoothness of h and h⁻¹; None chooses it.
    """
    if data.given is not None:
        matrix, response = data.given.matrix, data.given.response
    else:
        known = np.ones(len(data.shot), dtype=np.bool_)
        stages = fit_stages(
            data.samples, data.balanced / data.samples.raw, known, options.preset, options.physical
        )  # fmt: skip
        matrix, response = stages.matrix, next(iter(stages.responses.values()))
    return fit_gamut_maps(
        data.balanced, data.encoded, data.shot, matrix, response, white_balances, nuggets, options.preset,
        options.physical.centres,
    )  # fmt: skip
