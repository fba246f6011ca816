"""The expected error at any colour, from held-out samples.

It is a linear model of two distances. The first is the distance of the colour to the nearest sample. The second is the
disagreement between the model and matrix and response alone: near samples it is the gamut map, which is known; far from
them it is the extrapolation of the gamut map. Held-out samples give e = a + b · distance + c · disagreement by
non-negative least squares, for each direction. All three are norms of encoded RGB; linearized light is compared after
matrix and response have rendered it.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.optimize import nnls
from scipy.spatial import cKDTree

from lutforge.arrays import Array
from lutforge.calibration.physical.matrix_and_response import MatrixAndResponse, with_matrix_of_all
from lutforge.evaluation.held_out import Predictions
from lutforge.evaluation.methods import MATRIX_AND_RESPONSE, Predictor
from lutforge.model.directions import Both, Direction
from lutforge.model.lattice import grid
from lutforge.model.profile_data import PictureStyle


@dataclass(frozen=True, eq=False)
class HeldOut:
    """The distances and errors of the held-out samples of one direction, each (n,).

    distance: to the nearest sample of the fit that predicts it; disagreement: with matrix and response alone; error: of
    the prediction.
    """

    distance: Array
    disagreement: Array
    error: Array

    def coefficients(self) -> Array:
        """Return the coefficients a, b and c of the expected error, (3,), by nonnegative least squares."""
        found, _ = nnls(np.column_stack([np.ones_like(self.distance), self.distance, self.disagreement]), self.error)
        return np.asarray(found)


def held_out_errors(found: Predictions, own: str, base: MatrixAndResponse) -> dict[Direction, HeldOut]:
    """Measure held-out samples by direction; empty where there are too few. own: the method that the profile has."""
    data, rows = found.data, found.held_out.copy()
    for method in (own, MATRIX_AND_RESPONSE):
        for values in found.predicted:
            rows &= np.isfinite(values[method]).all(axis=1) if method in values else False
    if rows.sum() < 24 or data.monochrome:
        return {}
    distance = np.zeros(len(rows))
    for fold in np.unique(found.fold[rows]):
        inside = rows & (found.fold == fold)
        distance[inside] = cKDTree(data.encoded[~(found.fold == fold)]).query(data.encoded[inside])[0]
    encoders = Both[Predictor](lambda rendered: np.clip(rendered, 0.0, 1.0), base.render)
    told: dict[Direction, HeldOut] = {}
    for direction, values in found.predicted.items():
        measured = (values[own], values[MATRIX_AND_RESPONSE], data.both[direction][1])
        model, plain, wanted = (encoders[direction](each[rows]) for each in measured)
        told[direction] = HeldOut(
            distance[rows], np.linalg.norm(model - plain, axis=1), np.linalg.norm(model - wanted, axis=1)
        )
    return told


def expected_errors(
    style: PictureStyle, held_out: Mapping[Direction, HeldOut], base: MatrixAndResponse, balanced: Array, encoded: Array
) -> dict[Direction, Array]:
    """The expected error at the nodes of a style's lattices, by direction, (N_r, N_g, N_b).

    base: matrix and response of the style's samples, balanced and encoded (n, 3).
    """
    plain, known = with_matrix_of_all(base, balanced, encoded), cKDTree(encoded)
    result = {}
    for direction, told in held_out.items():
        lattice = style.lattices.get(direction)
        if lattice is None:
            continue
        nodes = grid(lattice.levels)
        if direction == "render":
            places = np.clip(lattice(nodes), 0.0, 1.0)
            disagreement = np.linalg.norm(places - plain.render(nodes), axis=-1)
        else:
            places = nodes
            disagreement = np.linalg.norm(plain.render(lattice(nodes)) - nodes, axis=-1)
        distance = known.query(places.reshape(-1, 3))[0].reshape(disagreement.shape)
        at_sample, by_distance, by_disagreement = told.coefficients()
        result[direction] = at_sample + by_distance * distance + by_disagreement * disagreement
    return result


def by_distance(held_out: Mapping[Direction, HeldOut]) -> list[tuple[float, dict[Direction, float]]]:
    """The mean error by direction in four groups of like distance, each with its mean distance, in codes of 255."""
    rows: list[tuple[float, dict[Direction, float]]] = []
    for told in list(held_out.values())[:1]:
        for group in np.array_split(np.argsort(told.distance), 4):
            errors = {direction: float(values.error[group].mean()) for direction, values in held_out.items()}
            rows.append((255 * float(told.distance[group].mean()), errors))
    return rows
