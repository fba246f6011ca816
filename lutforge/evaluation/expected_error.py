"""The expected error at any colour: the standard deviation of the fitted process, in units that held-out shots set.

Held-out samples give e = a + b · σ by nonnegative least squares, for each direction. σ is the posterior standard
deviation of the gamut map (`calibration.physical.kriging`), which is small near samples and grows away from them, times
the slope of the encoding. Errors are norms of encoded RGB; linearized light is compared after matrix and response have
rendered it.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from scipy.optimize import nnls
from scipy.spatial import cKDTree

from lutforge.arrays import Array
from lutforge.calibration.physical.kriging import OFFSET, posterior_deviation
from lutforge.calibration.physical.matrix_and_response import MatrixAndResponse, encoding_slope
from lutforge.evaluation.held_out import Predictions
from lutforge.evaluation.methods import Predictor
from lutforge.interpolation import Levels, interpolate
from lutforge.model.directions import Both, Direction
from lutforge.model.gamut_map import even_slope
from lutforge.model.lattice import grid
from lutforge.model.profile_data import PictureStyle


@dataclass(frozen=True, eq=False)
class HeldOut:
    """The distances and errors of the held-out samples of one direction, each (n,).

    distance: to the nearest sample of the fit that predicts it; deviation: σ given the samples of that fit; error: of
    the prediction.
    """

    distance: Array
    deviation: Array
    error: Array

    def coefficients(self) -> Array:
        """Return the coefficients a and b of the expected error, (2,), by nonnegative least squares."""
        coefficients, _ = nnls(np.column_stack([np.ones_like(self.deviation), self.deviation]), self.error)
        return np.asarray(coefficients)


def held_out_errors(predictions: Predictions, method: str, base: MatrixAndResponse) -> dict[Direction, HeldOut]:
    """Measure held-out samples by direction; empty where there are too few. method: the one that the profile has."""
    data, rows = predictions.data, predictions.held_out.copy()
    for values in predictions.predicted:
        rows &= np.isfinite(values[method]).all(axis=1) if method in values else False
    if rows.sum() < 24 or data.monochrome:
        return {}
    distance, deviation = np.zeros(len(rows)), Both(np.zeros(len(rows)), np.zeros(len(rows)))
    for fold in np.unique(predictions.fold[rows]):
        inside, train = rows & (predictions.fold == fold), predictions.fold != fold
        distance[inside] = cKDTree(data.encoded[train]).query(data.encoded[inside])[0]
        of_codes = deviations(base, data.balanced[train], data.encoded[train])
        for direction, of_fold in of_codes.items():
            deviation[direction][inside] = of_fold(data.both[direction][0][inside], data.encoded[inside])
    encoders = Both[Predictor](lambda rendered: np.clip(rendered, 0.0, 1.0), base.render)
    errors: dict[Direction, HeldOut] = {}
    for direction, values in predictions.predicted.items():
        encode = encoders[direction]
        residual = encode(values[method][rows]) - encode(data.both[direction][1][rows])
        errors[direction] = HeldOut(distance[rows], deviation[direction][rows], np.linalg.norm(residual, axis=1))
    return errors


def deviations(base: MatrixAndResponse, balanced: Array, encoded: Array) -> Both[Callable[[Array, Array], Array]]:
    """σ by direction, given samples Tw E → I, both (n, 3): of colours (…, 3) that it takes, and their JPEG codes."""
    of_light = posterior_deviation(balanced @ base.matrix.T)
    of_codes = posterior_deviation(base.response.linearize(encoded))

    def slope(codes: Array) -> Array:
        flat = codes.reshape(-1, 3)
        slopes = encoding_slope(base.response, flat) / even_slope(base.response.linearize(flat), OFFSET)
        return np.asarray(slopes.mean(axis=1).reshape(codes.shape[:-1]))

    return Both(
        lambda light, codes: of_light(light @ base.matrix.T) * slope(codes),
        lambda _, codes: of_codes(base.response.linearize(codes)) * slope(codes),
    )


def expected_errors(
    style: PictureStyle, held_out: Mapping[Direction, HeldOut], base: MatrixAndResponse, balanced: Array, encoded: Array
) -> dict[Direction, Array]:
    """The expected error at the nodes of a style's lattices, by direction, (N_r, N_g, N_b).

    base: matrix and response of the style's samples, balanced and encoded (n, 3). It is computed at every second node,
    which is as closely as it varies.
    """
    deviation, result = deviations(base, balanced, encoded), {}
    for direction, errors in held_out.items():
        lattice = style.lattices.get(direction)
        if lattice is None:
            continue
        red, green, blue = (np.unique(np.append(level[::2], level[-1])) for level in lattice.levels)
        every_second: Levels = (red, green, blue)
        coarse = grid(every_second)
        codes = np.clip(lattice(coarse), 0.0, 1.0) if direction == "render" else coarse
        at_sample, by_deviation = errors.coefficients()
        expected = at_sample + by_deviation * deviation[direction](coarse, codes)
        nodes = grid(lattice.levels)
        result[direction] = interpolate(nodes, every_second, expected[..., None].repeat(3, axis=-1), "trilinear")[
            ..., 0
        ]
    return result


def by_distance(held_out: Mapping[Direction, HeldOut]) -> list[tuple[float, dict[Direction, float]]]:
    """The mean error by direction in four groups of like distance, each with its mean distance, in codes of 255."""
    rows: list[tuple[float, dict[Direction, float]]] = []
    for first in list(held_out.values())[:1]:
        for group in np.array_split(np.argsort(first.distance), 4):
            errors = {direction: float(values.error[group].mean()) for direction, values in held_out.items()}
            rows.append((255 * float(first.distance[group].mean()), errors))
    return rows
