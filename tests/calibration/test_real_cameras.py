"""The lattice fit on the Nikon D40's published pairs: 70 % fitted, 30 % held out, split by seeds 1 … 5; medians.

Wanted figures: a plain implementation of the thesis reaches 0.0162, 0.0103, 0.0079 with uniform and 0.0074, 0.0054,
0.0044 with nonuniform lattices of 13³, 17³, 24³ (mean norm of the RGB difference), camera-match 0.2.0 0.0081, 0.0071,
0.0088, radial basis functions on the gamut map 0.0034.
"""

import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.interpolate import RBFInterpolator

from lutforge.arrays import Array
from lutforge.calibration.options import CalibrationOptions
from lutforge.calibration.style import fit_lattices
from lutforge.model.lattice import Lattice
from lutforge.pipeline.calibration import calibrate
from lutforge.samples.sample_set import SampleSet
from lutforge.thesis.calibrate import fit_lattices as fit_thesis_lattices
from lutforge.thesis.options import Options, ThesisOptions
from tests.cases.real_data import PublishedPairs, middlebury_table, radial_basis_functions, split
from tests.cases.samples import style_of

SEEDS = (1, 2, 3, 4, 5)


def errors(pairs: PublishedPairs, fit: Callable[[Array, Array], Callable[[Array], Array]], seed: int) -> Array:
    x, y = pairs.balanced, pairs.encoded
    fitted, held_out = split(len(x), seed)
    return np.asarray(np.linalg.norm(np.clip(fit(x[fitted], y[fitted])(x[held_out]), 0.0, 1.0) - y[held_out], axis=1))


def lattice(options: Options) -> Callable[[Array, Array], Lattice]:
    """A fit from ten shots of mixed colours each."""
    if isinstance(options, ThesisOptions):
        return lambda x, y: fit_thesis_lattices(style_of(x, y), options).render
    return lambda x, y: fit_lattices(style_of(x, y), options).render


def median_of_means(d40_pairs: PublishedPairs, options: Options, seeds: tuple[int, ...]) -> float:
    return float(np.median([errors(d40_pairs, lattice(options), seed).mean() for seed in seeds]))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("size", "uniform", "nonuniform"), [(13, 0.0162, 0.0076), (17, 0.0103, 0.0056), (24, 0.0079, 0.0046)]
)
def test_thesis(d40_pairs: PublishedPairs, size: int, uniform: float, nonuniform: float) -> None:
    plain = median_of_means(d40_pairs, ThesisOptions(size=size, nonuniform=False), (1, 2, 3))
    assert plain == pytest.approx(uniform, rel=0.06)
    assert median_of_means(d40_pairs, ThesisOptions(size=size), (1, 2, 3)) <= nonuniform


@pytest.fixture(scope="module")
def rbf_maxima(d40_pairs: PublishedPairs) -> dict[int, float]:
    """By seed: φ(r) = r on the gamut map, with the published matrix and response (thesis 4.2.3)."""
    return {seed: float(errors(d40_pairs, radial_basis_functions, seed).max()) for seed in SEEDS}


@pytest.mark.slow
@pytest.mark.parametrize(("size", "mean"), [(17, 0.0034), (24, 0.0032), (33, 0.0031)])
def test_with_a_curve_behind(d40_pairs: PublishedPairs, rbf_maxima: dict[int, float], size: int, mean: float) -> None:
    """The worst errors are no larger than those of radial basis functions, which take as many terms as samples."""
    of_seeds = [errors(d40_pairs, lattice(CalibrationOptions(size=size)), seed) for seed in SEEDS]
    middle = np.median([error.mean() for error in of_seeds])
    ratio = np.median([error.max() / rbf_maxima[seed] for error, seed in zip(of_seeds, SEEDS, strict=True)])
    assert middle <= mean and ratio <= 1.2


@pytest.mark.slow
@pytest.mark.parametrize("where", ["chroma", "hue", "bright"])
def test_farther_out_than_any_sample(d40_pairs: PublishedPairs, where: str) -> None:
    """Held out: the most saturated tenth of the pairs, the outer 40 % of each sixth of hues, or the brightest tenth.

    There the model goes on better than the thesis's radial basis functions around the same response and matrix do.
    """
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
    means = []
    for held_out in masks:
        style = style_of(x[~held_out], y[~held_out])
        matrix, response = style.base.matrix, style.base.response
        linear = RBFInterpolator(x[~held_out] @ matrix.T, response.linearize(y[~held_out]), kernel="linear", degree=1)
        rendered = style.model.render(x[held_out]), response.encode(linear(x[held_out] @ matrix.T))
        means.append([np.linalg.norm(each - y[held_out], axis=1).mean() for each in rendered])
    ours, thesis = np.mean(means, axis=0)
    assert ours < thesis, (ours, thesis)


def test_warm_highlights_beyond_the_samples_do_not_turn_yellow(d40_pairs: PublishedPairs) -> None:
    """Fitted to colours up to code 217: at most half as much blue is lost as matrix and response lose."""
    x, y = d40_pairs.balanced, d40_pairs.encoded
    bright = y.max(axis=1) > 0.85
    warm = bright & (y[:, 0] >= y[:, 1]) & (y[:, 1] >= y[:, 2])
    style = style_of(x[~bright], y[~bright])
    by_model = style.model.render(x[warm])
    by_base = style.base.response.encode(x[warm] @ style.base.matrix.T)
    lost = y[warm, 2] - np.clip(by_model[:, 2], 0.0, 1.0)
    lost_by_base = y[warm, 2] - np.clip(by_base[:, 2], 0.0, 1.0)
    assert lost.max() <= 0.5 * lost_by_base.max()
    assert np.maximum(lost, 0.0).mean() <= 0.5 * np.maximum(lost_by_base, 0.0).mean()


def test_tetrahedral_is_as_good(d40_pairs: PublishedPairs) -> None:
    options = CalibrationOptions(size=17, interpolation="tetrahedral")
    assert median_of_means(d40_pairs, options, (1, 2)) <= 0.0036


EXAMPLES = Path(__file__).resolve().parents[2] / "examples"


@pytest.mark.slow
def test_the_full_model_beats_the_baselines_on_nine_of_ten_either_way() -> None:
    module = middlebury_table()
    stored = (EXAMPLES / "middlebury_table.md").read_text()
    parts = stored.split("## Trained on ")[1:]
    for light, part in zip(("light1", "light2"), parts, strict=True):
        rows = module.table(light)
        assert len(rows) == 10
        best = module.won(rows)
        assert len(best) >= 9, f"only {best}"
        assert f"for {len(best)} of 10 cameras" in part
        # What is printed in the repository is what the program says (8-bit data: the third decimal).
        for row in rows:
            line = next(line for line in part.splitlines() if line.startswith(f"| {row.camera} |"))
            last = float(line.split("|")[-2].strip(" *"))
            assert last == pytest.approx(row.rmse["full model"], abs=0.002)


@pytest.mark.slow
def test_the_transfer_functions_are_what_is_printed(tmp_path: Path) -> None:
    command = [sys.executable, str(EXAMPLES / "middlebury_transfer_functions.py"), str(tmp_path)]
    run = subprocess.run(command, capture_output=True, text=True, timeout=300)
    assert run.returncode == 0, run.stderr
    stored = (EXAMPLES / "middlebury_transfer_functions.md").read_text()
    for first, second in zip(run.stdout.splitlines(), stored.splitlines(), strict=True):
        cells = first.split("|")
        stored_cells = second.split("|")
        if len(cells) > 9 and cells[1].strip() not in ("camera", "---"):
            assert cells[1] == stored_cells[1] and cells[-2] == stored_cells[-2]
            assert float(cells[7]) == pytest.approx(float(stored_cells[7]), abs=0.3)
    assert len(list(tmp_path.glob("*.png"))) == 10


def test_a_camera_by_another_ones_raw_is_predicted_where_least_squares_run_wild(chart_samples: SampleSet) -> None:
    """A Panasonic LX3 by a Nikon D200's RAW, second light: once with errors of 969 %."""
    second = chart_samples.select(np.char.startswith(chart_samples.shot, "light2"))
    jpegs, raw = (second.select(second.camera == name) for name in ("PanasonicDMCLX3", "NikonD200"))
    place = {(shot, patch): row for row, (shot, patch) in enumerate(zip(raw.shot, raw.patch, strict=True))}
    rows = [place[key] for key in zip(jpegs.shot, jpegs.patch, strict=True)]
    through = replace(jpegs, raw=raw.raw[rows], raw_camera=raw.camera[rows], wb=np.full_like(jpegs.wb, np.nan))
    errors = calibrate(through, CalibrationOptions(size=9)).styles["standard"].errors
    assert errors["render_mean"] < 0.025 and errors["linearize_mean"] < 0.015  # 0.017 and 0.009
