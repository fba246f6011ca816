"""How near a shaper and a cube of codes can come to a camera: the least error of cubes that know the answer.

    python -m tests.benchmarks.plain_floor [SIZE…]

LUTFORGE_TEST_DATA names the real data. On the Nikon D40's published pairs, a lattice with a curve behind it, fitted to
all of them, stands for the camera. Cubes are fitted to it at 60,000 points around all pairs, those to be predicted
included: node levels by rounds of equidistribution that see these points, node values with and without the bounds
[0, 1], in the norms p = 2, 3 and 4, by hundreds of sweeps. No method that has seen 70 % of the pairs only can be
expected to do better. Beside them what LutForge does from the 70 %, and from all of it the maximum that radial basis
functions make on the same 30 %. Medians over five splits; minutes in all.
"""

import os
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import RBFInterpolator
from scipy.spatial import cKDTree

from lutforge.calibration.lattice.continuation import continuation
from lutforge.calibration.lattice.lattice_fit import fit_samples
from lutforge.calibration.lattice.lattice_problem import GREY_WEIGHTS, LatticeProblem
from lutforge.calibration.lattice.output_curve import output_curve
from lutforge.calibration.lattice.plain_lattice import KINKED, BoundedProblem
from lutforge.calibration.options import CalibrationOptions
from lutforge.calibration.physical.matrix_and_response import fit_matrix_and_response
from lutforge.interpolation import Levels, interpolate
from lutforge.model.lattice import Lattice
from lutforge.model.published_model import PublishedModel, read_published_model
from lutforge.solvers.node_levels import equidistributed_levels, resized_levels

Array = NDArray[np.float64]

SEEDS = (1, 2, 3, 4, 5)
SIZES = (9, 13, 17, 24, 33)
POINTS, SWEEPS, LEVEL_SWEEPS, LEVEL_ROUNDS, TRUTH_SIZE = 60_000, 300, 24, 4, 49
BOUNDS = {"in [0, 1]": (0.0, 1.0), "free": (-10.0, 10.0)}
NORMS = (2, 3, 4)
FOLLOWED = 4
"""Rounds in which weights follow errors, for norms above 2."""
LEAST_SMOOTHNESS = 1e-5


def split(published: PublishedModel, seed: int) -> tuple[Array, Array, Array, Array]:
    """x and y to fit, x and y held out."""
    x, y = published.balanced, published.encoded
    order = np.random.default_rng(seed).permutation(len(x))
    fitted, held = order[: int(0.7 * len(x))], order[int(0.7 * len(x)) :]
    return x[fitted], y[fitted], x[held], y[held]


def fitted(x: Array, y: Array, options: CalibrationOptions) -> Lattice:
    """LutForge's, of ten shots of mixed colours each."""
    shots = np.array([f"shot {row % 10}" for row in range(len(x))])
    base = fit_matrix_and_response(x, y)
    guess = continuation(base, x, y, inverse=False)
    return fit_samples(x, y, shots, guess, options, clips=True, curve=output_curve(base.response)).lattice


def around(x: Array) -> Array:
    """Points around samples (n, 3), half as far as to their fourth neighbour, on the square root of linear light."""
    rng, roots = np.random.default_rng(0), np.sqrt(x)
    reach = cKDTree(roots).query(roots, [5])[0]
    chosen = rng.integers(0, len(x), POINTS)
    return np.asarray(np.clip(roots[chosen] + 0.5 * reach[chosen] * rng.normal(size=(POINTS, 3)), 0.0, 1.0) ** 2)


def even_error(problem: LatticeProblem, size: int, bounds: tuple[float, float]) -> Levels:
    """Node levels that share the squared error of their lattice out evenly, found in rounds; the best round's."""
    assert isinstance(problem.guess, Lattice)
    levels = resized_levels(problem.guess.levels, size)
    best = (np.inf, levels)
    for _ in range(LEVEL_ROUNDS):
        placed = BoundedProblem.at(problem, levels, bounds, LEVEL_SWEEPS)
        squares = problem.weight * placed.error(placed.search_fit()) ** 2
        best = min(best, (float(squares.mean()), levels), key=lambda entry: entry[0])
        levels = equidistributed_levels(problem.x, squares, levels, KINKED)
    return best[1]


def cubes(problem: LatticeProblem, size: int, bounds: tuple[float, float]) -> list[Lattice]:
    """One for each of NORMS, at node levels found with the answer."""
    levels = even_error(problem, size, bounds)
    placed = BoundedProblem.at(problem, levels, bounds, SWEEPS)
    result = []
    for norm in NORMS:
        weight, values = np.ones(len(problem.x)), placed.prior.values
        for _ in range(1 if norm == 2 else FOLLOWED):
            equations = placed.with_grey(placed.equations(weight), problem.grey, 0.0 * GREY_WEIGHTS)
            fit = placed.solve(equations, placed.prior, problem.smoothness, values, 0.0)
            values, error = fit.values, placed.error(fit)
            follow = np.minimum(0.05 + error / error.mean(), 20.0) ** (norm - 2)
            weight = np.sqrt(weight * follow / follow.mean())  # half way, which keeps the rounds from swinging
        result.append(Lattice(levels, values))
    return result


def figures(predict: Lattice, published: PublishedModel, seed: int) -> tuple[float, float]:
    """Mean and maximum of what is held out."""
    _, _, x, y = split(published, seed)
    predicted = np.clip(interpolate(x, predict.levels, predict.values), 0.0, 1.0)
    error = np.linalg.norm(predicted - y, axis=1)
    return float(error.mean()), float(error.max())


def rbf_maximum(published: PublishedModel, seed: int) -> float:
    """φ(r) = r on the gamut map, with the published matrix and response (thesis 4.2.3)."""
    x, y, held_x, held_y = split(published, seed)
    matrix, response = published.model.matrix, published.model.response
    h = RBFInterpolator(x @ matrix.T, response.linearize(y), kernel="linear", degree=1)
    return float(np.linalg.norm(response.encode(h(held_x @ matrix.T)) - held_y, axis=1).max())


def main(sizes: tuple[int, ...]) -> None:
    published = read_published_model(Path(os.environ["LUTFORGE_TEST_DATA"]) / "nus_nikon_d40" / "other_white_balances")
    maxima = np.array([rbf_maximum(published, seed) for seed in SEEDS])
    x, y = published.balanced, published.encoded
    truth = fitted(x, y, CalibrationOptions(size=TRUTH_SIZE))
    points = np.concatenate([x, around(x)])
    codes, weight = truth(points), np.ones(len(points))
    weight[len(x) :] = len(x) / POINTS
    plain = CalibrationOptions(response=False)
    problem = LatticeProblem(points, codes, codes, weight, truth, plain, True, LEAST_SMOOTHNESS, None)

    def row(size: int, what: str, lattices: list[Lattice]) -> None:
        """lattices: one for each seed."""
        found = np.array([figures(one, published, seed) for one, seed in zip(lattices, SEEDS, strict=True)])
        ratio = found[:, 1] / maxima
        least, most = min(one.values.min() for one in lattices), max(one.values.max() for one in lattices)
        texts = [f"{value:.4f}" for value in np.median(found, axis=0)]
        texts += [f"{np.median(ratio):.2f}", f"{least:.2f} … {most:.2f}"]
        print("| " + " | ".join([f"{size}³", what, *texts]) + " |", flush=True)

    print("| size | cube | mean | max | max / RBF's | nodes |\n" + "|---" * 6 + "|")
    for size in sizes:
        for name, bounds in BOUNDS.items():
            for norm, cube in zip(NORMS, cubes(problem, size, bounds), strict=True):
                row(size, f"floor, {name}, p = {norm}", [cube] * len(SEEDS))
        options = replace(plain, size=size)
        row(size, "LutForge, plain", [fitted(*split(published, seed)[:2], options) for seed in SEEDS])


if __name__ == "__main__":
    main(tuple(int(size) for size in sys.argv[1:]) or SIZES)
