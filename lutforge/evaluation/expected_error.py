"""The expected error of a colour, from the errors of held-out samples.

The held-out samples give e = a + b · σ, by nonnegative least squares in each direction. σ is the standard deviation of
the gamut map's posterior (`calibration.gamut_map`) times the slope of the encoding. Errors are norms of encoded RGB:
linearized values are compared after the matrix and the response have rendered them.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from scipy.optimize import nnls

from lutforge.arrays import Array
from lutforge.calibration.gamut_map import posterior_deviation
from lutforge.calibration.matrix_and_response import encoding_slope
from lutforge.calibration.style import StyleData
from lutforge.evaluation.polynomials import Predictor
from lutforge.evaluation.predictions import Predictions
from lutforge.interpolation import interpolate
from lutforge.model.gamut_map import CORRECTION_OFFSET, even_slope
from lutforge.model.lattice import grid
from lutforge.model.profile import ByDirection, Direction, PictureStyle


@dataclass(frozen=True, eq=False)
class HeldOut:
    """The held-out samples of one direction. error: of their prediction (n,); deviation: σ there (n,).

    σ is conditional on the samples of the fit that predicts a sample.
    """

    deviation: Array
    error: Array

    def coefficients(self) -> Array:
        """Return the coefficients a and b of the expected error, (2,), by nonnegative least squares."""
        coefficients, _ = nnls(np.column_stack([np.ones_like(self.deviation), self.deviation]), self.error)
        return np.asarray(coefficients)


def held_out_errors(predictions: Predictions, method: str) -> dict[Direction, HeldOut]:
    """The held-out samples of a style by direction. method: of the profile's model.

    It is empty where the samples are too few, or one fit predicts them all, so that the samples of other fits are not
    known.
    """
    data = predictions.data
    rows = predictions.held_out.copy()
    for values in predictions.predicted:
        rows &= np.isfinite(values[method]).all(axis=1) if method in values else False
    if rows.sum() < 24 or data.monochrome or len(np.unique(predictions.fold)) < 2:
        return {}

    base = data.base
    deviation = ByDirection(np.zeros(len(rows)), np.zeros(len(rows)))
    for fold in np.unique(predictions.fold[rows]):
        inside = rows & (predictions.fold == fold)
        train = predictions.fold != fold
        for direction, sigma in deviations(data, data.balanced[train], data.encoded[train]).items():
            deviation[direction][inside] = sigma(data.both[direction][0][inside], data.encoded[inside])

    encoders = ByDirection[Predictor](lambda rendered: np.clip(rendered, 0.0, 1.0), base.render)
    errors: dict[Direction, HeldOut] = {}
    for direction, values in predictions.predicted.items():
        encode = encoders[direction]
        residual = encode(values[method][rows]) - encode(data.both[direction][1][rows])
        errors[direction] = HeldOut(deviation[direction][rows], np.linalg.norm(residual, axis=1))
    return errors


def deviations(data: StyleData, balanced: Array, encoded: Array) -> ByDirection[Callable[[Array, Array], Array]]:
    """σ by direction, given some of a style's samples Tw E → I, both (n, 3).

    They are functions of the direction's inputs and the JPEG values; both arguments are (…, 3), the result is (…).
    """
    base = data.base
    of_linear = posterior_deviation(balanced @ base.matrix.T)
    of_codes = posterior_deviation(base.response.linearize(encoded))

    def slope(codes: Array) -> Array:
        flat = codes.reshape(-1, 3)
        slopes = encoding_slope(base.response, flat) / even_slope(base.response.linearize(flat), CORRECTION_OFFSET)
        return np.asarray(slopes.mean(axis=1).reshape(codes.shape[:-1]))

    return ByDirection(
        lambda raw, codes: of_linear(raw @ base.matrix.T) * slope(codes),
        lambda _, codes: of_codes(base.response.linearize(codes)) * slope(codes),
    )


def expected_errors(
    style: PictureStyle, held_out: Mapping[Direction, HeldOut], data: StyleData
) -> dict[Direction, Array]:
    """The expected error at the nodes of a style's lattices, by direction, (N_r, N_g, N_b).

    It is computed at every second node and interpolated, since it varies slowly.
    """
    deviation = deviations(data, data.balanced, data.encoded)
    result = {}
    for direction, errors in held_out.items():
        lattice = style.lattices.get(direction)
        if lattice is None:
            continue
        red, green, blue = (np.unique(np.append(level[::2], level[-1])) for level in lattice.levels)
        coarse = lattice.from_axes(grid((red, green, blue)))
        codes = np.clip(lattice(coarse), 0.0, 1.0) if direction == "render" else coarse
        at_sample, by_deviation = errors.coefficients()
        expected = at_sample + by_deviation * deviation[direction](coarse, codes)
        values = expected[..., None].repeat(3, axis=-1)
        result[direction] = interpolate(grid(lattice.levels), (red, green, blue), values, "trilinear")[..., 0]
    return result
