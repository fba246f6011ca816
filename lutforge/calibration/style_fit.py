"""The lattices of one style: baked from its fitted model, or regressed as the thesis has it."""

from dataclasses import replace

import numpy as np

from lutforge.arrays import Array
from lutforge.calibration.lattice.bake import bake_lattice, squares
from lutforge.calibration.lattice.monochrome import inverse_of_greys
from lutforge.calibration.lattice.node_levels import error_histogram
from lutforge.calibration.lattice.output_curve import output_curve
from lutforge.calibration.options import CalibrationOptions
from lutforge.calibration.physical.physical_model import fit_gamut_maps, fit_stages
from lutforge.calibration.style_data import StyleData
from lutforge.calibration.thesis.lattice import fit_thesis
from lutforge.model.lattice import Lattice
from lutforge.model.profile_data import Both, Direction, PhysicalModel
from lutforge.solvers.blas import one_blas_thread


@one_blas_thread
def fit_lattices(data: StyleData, options: CalibrationOptions) -> Both[Lattice]:
    """The lattices of both directions of a style. Raises CalibrationError.

    A black-and-white style is linearized by the inverse of the greys of its rendering.
    """
    thesis, x, y = options.preset == "thesis", data.balanced, data.encoded
    render = fit_thesis(x, y, options, clips=True) if thesis else _baked_render(data, options)
    if data.monochrome:
        return Both(render, inverse_of_greys(render, options))
    linearize = fit_thesis(y, x, options, clips=False) if thesis else bake_lattice(data.model.linearize, y, options)
    return Both(render, linearize)


def _baked_render(data: StyleData, options: CalibrationOptions) -> Lattice:
    """The lattice that renders, with a curve behind it."""
    model = data.model
    curve = output_curve(model.response)

    def in_front_of_the_curve(balanced: Array) -> Array:
        return curve.continued(model.gamut_map(balanced @ model.matrix.T))

    return bake_lattice(in_front_of_the_curve, data.balanced, options, curve)


def fit_physical(data: StyleData, options: CalibrationOptions) -> PhysicalModel:
    """The model of chapter 4 of one style, of its samples alone. Raises CalibrationError."""
    if options.preset != "thesis":
        return data.model
    if data.given is not None:
        matrix, response = data.given.matrix, data.given.response
    else:
        known = np.ones(len(data.shot), dtype=np.bool_)
        stages = fit_stages(data.samples, data.balanced / data.samples.raw, known, options.preset, options.physical)
        matrix, response = stages.matrix, next(iter(stages.responses.values()))
    balances, nugget = tuple(str(name) for name in np.unique(data.samples.white_balance)), options.physical.nugget
    return fit_gamut_maps(
        data.balanced, data.encoded, data.shot, matrix, response, balances, (nugget, nugget), options.preset,
        options.physical.centres,
    ).model  # fmt: skip


def uniform_lattice_errors(
    data: StyleData, options: CalibrationOptions, direction: Direction
) -> tuple[Array, Array, Array]:
    """Per axis the histogram, which node levels follow, of the squared error that a uniform lattice makes (5.6)."""
    lattice = fit_lattices(data, replace(options, nonuniform=False))[direction]
    x, y = data.both[direction]
    return error_histogram(x, squares(lattice(x) - y))
