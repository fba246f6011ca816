"""The lattice fit on the Nikon D40's published pairs: 70 % fitted, 30 % held out, split by seeds 1 … 5; medians.

Wanted figures: a plain implementation of the thesis reaches 0.0162, 0.0103, 0.0079 with uniform and 0.0074, 0.0054,
0.0044 with nonuniform lattices of 13³, 17³, 24³ (mean norm of the RGB difference), camera-match 0.2.0 0.0081, 0.0071,
0.0088, radial basis functions on the gamut map 0.0034.
"""

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.interpolate import RBFInterpolator

from lutforge.calibration.lattice.continuation import continuation
from lutforge.calibration.lattice.fit import fit_samples
from lutforge.calibration.lattice.output_curve import output_curve
from lutforge.calibration.lattice.result import LatticeResult
from lutforge.calibration.options import CalibrationOptions
from lutforge.calibration.physical.matrix_and_response import fit_matrix_and_response
from lutforge.luts.processor import evaluate, file_processor
from lutforge.luts.sequence import Lut
from lutforge.luts.shaper import lattice_ops
from tests.real_data import PublishedPairs

Array = NDArray[np.float64]

SEEDS = (1, 2, 3, 4, 5)


def split(d40_pairs: PublishedPairs, seed: int) -> tuple[Array, Array, Array, Array]:
    """x and y to fit, x and y held out."""
    x, y = d40_pairs.balanced, d40_pairs.encoded
    order = np.random.default_rng(seed).permutation(len(x))
    fitted, held = order[: int(0.7 * len(x))], order[int(0.7 * len(x)) :]
    return x[fitted], y[fitted], x[held], y[held]


def fit(x: Array, y: Array, options: CalibrationOptions) -> LatticeResult:
    """Ten shots of mixed colours each."""
    shots = np.array([f"shot {row % 10}" for row in range(len(x))])
    base = fit_matrix_and_response(x, y)
    guess = continuation(base, x, y, inverse=False)
    curve = output_curve(base.response)
    return fit_samples(x, y, shots, guess, options, clips=True, curve=curve)


def errors(d40_pairs: PublishedPairs, options: CalibrationOptions, seed: int) -> Array:
    x, y, held_x, held_y = split(d40_pairs, seed)
    predicted = np.clip(fit(x, y, options).lattice(held_x), 0.0, 1.0)
    return np.asarray(np.linalg.norm(predicted - held_y, axis=1))


def median_of_means(d40_pairs: PublishedPairs, options: CalibrationOptions, seeds: tuple[int, ...] = SEEDS) -> float:
    return float(np.median([errors(d40_pairs, options, seed).mean() for seed in seeds]))


@pytest.mark.parametrize(
    ("size", "uniform", "nonuniform"), [(13, 0.0162, 0.0076), (17, 0.0103, 0.0056), (24, 0.0079, 0.0046)]
)
def test_thesis(d40_pairs: PublishedPairs, size: int, uniform: float, nonuniform: float) -> None:
    plain = median_of_means(d40_pairs, CalibrationOptions(preset="thesis", size=size, nonuniform=False), (1, 2, 3))
    assert plain == pytest.approx(uniform, rel=0.06)
    assert median_of_means(d40_pairs, CalibrationOptions(preset="thesis", size=size), (1, 2, 3)) <= nonuniform


@pytest.fixture(scope="module")
def rbf_maxima(d40_pairs: PublishedPairs) -> dict[int, float]:
    """By seed: φ(r) = r on the gamut map, with the published matrix and response (thesis 4.2.3)."""
    maxima = {}
    matrix, response = d40_pairs.matrix, d40_pairs.response
    for seed in SEEDS:
        x, y, held_x, held_y = split(d40_pairs, seed)
        h = RBFInterpolator(x @ matrix.T, response.linearize(y), kernel="linear", degree=1)
        error = np.linalg.norm(response.encode(h(held_x @ matrix.T)) - held_y, axis=1)
        maxima[seed] = float(error.max())
    return maxima


def middle_error(
    d40_pairs: PublishedPairs, rbf_maxima: dict[int, float], options: CalibrationOptions
) -> tuple[float, float]:
    """The mean error, and the maximum over that of radial basis functions on the same split: medians over the seeds."""
    rows = []
    for seed in SEEDS:
        error = errors(d40_pairs, options, seed)
        rows.append((error.mean(), error.max() / rbf_maxima[seed]))
    middle, ratio = np.median(rows, axis=0)
    return float(middle), float(ratio)


@pytest.mark.parametrize(("size", "mean"), [(9, 0.0056), (17, 0.0034), (24, 0.0032), (33, 0.0031)])
def test_with_a_curve_behind(d40_pairs: PublishedPairs, rbf_maxima: dict[int, float], size: int, mean: float) -> None:
    """The worst errors are no larger than those of radial basis functions, which take as many terms as samples."""
    middle, ratio = middle_error(d40_pairs, rbf_maxima, CalibrationOptions(size=size))
    assert middle <= mean
    assert ratio <= 1.2


@pytest.mark.parametrize(("size", "mean"), [(17, 0.0043), (24, 0.0037), (33, 0.0031)])
def test_plain(d40_pairs: PublishedPairs, rbf_maxima: dict[int, float], size: int, mean: float) -> None:
    middle, ratio = middle_error(d40_pairs, rbf_maxima, CalibrationOptions(size=size, output_curve=False))
    assert middle <= mean
    assert ratio <= 1.2


@pytest.mark.parametrize(
    ("where", "mean", "most"), [("chroma", 0.0085, 0.055), ("hue", 0.0060, 0.030), ("bright", 0.0105, 0.050)]
)
def test_farther_out_than_any_sample(d40_pairs: PublishedPairs, where: str, mean: float, most: float) -> None:
    """Held out: the most saturated tenth of the pairs, the outer 40 % of each sixth of hues, or the brightest tenth."""
    x, y = d40_pairs.balanced, d40_pairs.encoded
    share = x / x.sum(axis=1, keepdims=True)
    plane = (share - np.median(share, axis=0)) @ np.linalg.svd(np.ones((1, 3)))[2][1:].T
    radius, sixth = np.hypot(*plane.T), np.floor(np.arctan2(*plane.T[::-1]) / (np.pi / 3))
    if where == "chroma":
        masks = [radius > np.quantile(radius, 0.9)]
    elif where == "bright":
        masks = [x.max(axis=1) > np.quantile(x.max(axis=1), 0.9)]
    else:
        masks = [(sixth == one) & (radius > np.quantile(radius[sixth == one], 0.6)) for one in range(-3, 3)]
    found = []
    for held in masks:
        predicted = np.clip(fit(x[~held], y[~held], CalibrationOptions(size=17)).lattice(x[held]), 0.0, 1.0)
        error = np.linalg.norm(predicted - y[held], axis=1)
        found.append((error.mean(), error.max()))
    assert tuple(np.mean(found, axis=0) <= (mean, most)) == (True, True), np.mean(found, axis=0)


def test_plain_nodes_are_colours(d40_pairs: PublishedPairs) -> None:
    x, y, _, _ = split(d40_pairs, 1)
    values = fit(x, y, CalibrationOptions(size=24, output_curve=False)).lattice.values
    assert values.min() >= 0.0 and values.max() <= 1.0


def test_tetrahedral_is_as_good(d40_pairs: PublishedPairs) -> None:
    options = CalibrationOptions(size=17, interpolation="tetrahedral")
    assert median_of_means(d40_pairs, options, (1, 2)) <= 0.0036


@pytest.mark.parametrize(
    ("options", "wanted"),
    [
        (CalibrationOptions(preset="thesis", size=17, output_curve=False), 0.0056),
        (CalibrationOptions(size=17, output_curve=False), 0.0050),
        (CalibrationOptions(size=17), 0.0038),
    ],
)
def test_through_the_file(
    d40_pairs: PublishedPairs, options: CalibrationOptions, wanted: float, tmp_path: Path
) -> None:
    """The CLF, read back and evaluated by OpenColorIO, makes the same errors on held-out colours."""
    x, y, held_x, held_y = split(d40_pairs, 1)
    lattice = fit(x, y, options).lattice
    path = tmp_path / "d40.clf"
    Lut(lattice_ops(lattice)).write(path)
    read = evaluate(file_processor(path, "trilinear"), held_x)
    np.testing.assert_allclose(read, lattice(held_x), atol=1e-5)
    assert np.linalg.norm(np.clip(read, 0, 1) - held_y, axis=1).mean() <= wanted
