"""The models of one style: both lattices, and the physical model on other samples of it."""

from dataclasses import dataclass, replace

import numpy as np

from lutforge.calibration.continuation import continuation, with_clearer_matrix
from lutforge.calibration.lattice import TOLERANCE, fit_samples
from lutforge.calibration.lattice_result import LatticeResult, result
from lutforge.calibration.matrix_and_response import MatrixAndResponse, fit_matrix_and_response
from lutforge.calibration.monochrome import inverse_of_greys
from lutforge.calibration.options import CalibrationOptions
from lutforge.calibration.output_curve import output_curve
from lutforge.calibration.physical import GamutMaps, fit_gamut_maps, fit_stages
from lutforge.calibration.plain_lattice import fit_plain
from lutforge.calibration.style_data import StyleData
from lutforge.model.lattice import Lattice


@dataclass(frozen=True, eq=False)
class StyleFit:
    """base: the matrix and response that render continues; render: Tw E → I; linearize: I → Tw E."""

    base: MatrixAndResponse
    render: LatticeResult
    linearize: LatticeResult


def fit_style(
    data: StyleData,
    options: CalibrationOptions,
    smoothness: tuple[float, float] | None = None,
    base: MatrixAndResponse | None = None,
    tolerance: float = TOLERANCE,
) -> StyleFit:
    """Both lattices of a style; smoothness: λ_S of (render, linearize), and base, where known already."""
    base = base or fit_matrix_and_response(data.balanced, data.encoded)
    chosen = smoothness or (None, None)
    render = fit_direction(data, options, base, inverse=False, smoothness=chosen[0], tolerance=tolerance)
    if data.monochrome:
        return StyleFit(base, render, _linearize_greys(data, options, render))
    linearize = fit_direction(data, options, base, inverse=True, smoothness=chosen[1], tolerance=tolerance)
    return StyleFit(with_clearer_matrix(base, data.balanced, data.encoded), render, linearize)


def fit_direction(
    data: StyleData,
    options: CalibrationOptions,
    base: MatrixAndResponse,
    *,
    inverse: bool,
    smoothness: float | None = None,
    tolerance: float = TOLERANCE,
) -> LatticeResult:
    """One lattice of a style: inverse is linearize, else render, with a response behind where the options have it.

    Of a black-and-white style linearize is the inverse of render's greys, with the smoothness of that.
    """
    if inverse and data.monochrome:
        render = fit_direction(data, options, base, inverse=False, smoothness=smoothness, tolerance=tolerance)
        return _linearize_greys(data, options, render)
    x, y = (data.encoded, data.balanced) if inverse else (data.balanced, data.encoded)
    curve = None if inverse else output_curve(base.response)
    guess = continuation(base, x, y, inverse=inverse, size=options.size, curve=curve)
    return fit_samples(
        x, y, data.shot, guess, options, clips=not inverse, curve=curve, smoothness=smoothness, tolerance=tolerance
    )


def _linearize_greys(data: StyleData, options: CalibrationOptions, render: LatticeResult) -> LatticeResult:
    """What linearizes a black-and-white style whose rendering is fitted."""
    return result(inverse_of_greys(render.lattice, options), data.encoded, data.balanced, render.smoothness)


def render_with_plain(data: StyleData, fit: StyleFit, options: CalibrationOptions) -> Lattice:
    """The lattice that renders; where it has a response, with its form for files that can hold none."""
    if fit.render.lattice.response is None:
        return fit.render.lattice
    curved, smoothness = fit.render.lattice, fit.render.smoothness
    return replace(curved, plain=fit_plain(data.balanced, data.encoded, curved, options, smoothness).lattice)


def refit_physical(
    data: StyleData,
    options: CalibrationOptions,
    white_balances: tuple[str, ...],
    nuggets: tuple[float | None, float | None] = (None, None),
) -> GamutMaps:
    """The physical model of one style on other samples; nuggets: the smoothness of h and h⁻¹ where it was chosen."""
    known = np.ones(len(data.shot), dtype=np.bool_)
    stages = fit_stages(data.samples, data.balanced / data.samples.raw, known, options.preset)
    response = next(iter(stages.styles.values())).response
    return fit_gamut_maps(
        data.balanced, data.encoded, data.shot, stages.matrix, response, white_balances, nuggets, options.preset
    )
