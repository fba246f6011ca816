"""What each part of the estimator is worth: it is switched off, and colours that no fit has seen are predicted.

    LUTFORGE_TEST_DATA=DIR python -m tests.benchmarks.ablation [--only WORD …]

Sources: the Canon S40's photographs, each left out in turn; two splits of the published pairs of the Nikon D40; rigs,
which are RAW of measured sensitivities, reflectances and lights, rendered by the D40's published models; styles of
simulated cameras; and both halves of the fleet (`--only of_the_fleet`, which takes by far the longest). A rig's test
colours are other reflectances and mixtures at other exposures, those that clip too, no farther than 0.03 from colours
that the published model was measured at.

Figures are ΔE00 of the rendering (mean, 99.9 %, largest; mean of colours with a clipped channel) and RMSE of the
linearization. The baseline is plain universal kriging of encoded residuals around matrix and response, in sixty lines.
"""

import argparse
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from unittest.mock import patch

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.spatial import cKDTree
from scipy.spatial.distance import cdist

from lutforge.arrays import Array
from lutforge.calibration import gamut_map as kriging
from lutforge.calibration import inverse_gamut_map, matrix_and_response
from lutforge.calibration.curve_basis import CurveBasis
from lutforge.calibration.matrix_and_response import fit_matrix_and_response
from lutforge.calibration.options import CalibrationOptions
from lutforge.calibration.style import ClippedColours, StyleData, fit_lattices, unclipped
from lutforge.colour.spectra import light
from lutforge.colour.srgb import delta_e_2000
from lutforge.model import gamut_map
from lutforge.model.gamut_map import from_even, to_even
from lutforge.model.published_model import read_published_model
from lutforge.simulate.camera import nikon_d5100, sigma_sd_merrill
from tests.benchmarks import common
from tests.benchmarks.common import HALF_CODE, heading, row
from tests.benchmarks.fleet_cameras import STYLES, fleet
from tests.benchmarks.fleet_figures import whole
from tests.cases.real_data import read_published_pairs, sensors, spectral_data, split
from tests.cases.samples import style_of

Predictor = Callable[[Array], Array]
Fit = Callable[[StyleData], tuple[Predictor, Predictor]]


@dataclass(frozen=True, eq=False)
class Source:
    """Samples to fit, and balanced RAW and JPEG colours (n, 3) to predict."""

    style: StyleData
    balanced: Array
    encoded: Array


def s40(data: Path) -> Iterator[tuple[str, Source]]:
    """Each of the five photographs left out."""
    with common.kept(None) as keep:
        samples = common.s40(data, keep)
    for _, rest, own in common.left_out(samples.select(unclipped(samples, samples.wb))):
        style = StyleData(rest.raw * rest.wb, rest.srgb, rest.shot, rest)
        yield "S40, each shot left out", Source(style, own.raw * own.wb, own.srgb)


def d40(_: Path) -> Iterator[tuple[str, Source]]:
    """70 % of the published pairs are fitted."""
    pairs = read_published_pairs()
    x, y = pairs.balanced, pairs.encoded
    for seed in (1, 2):
        seen, unseen = split(len(x), seed)
        yield "D40, 30 % left out", Source(style_of(x[seen], y[seen]), x[unseen], y[unseen])


def rigs(data: Path) -> Iterator[tuple[str, Source]]:
    """Two cameras under five lights: 150 reflectances at ten exposures are fitted, forty others and mixtures tested."""
    measured = sensors(data)
    surfaces = data / "spectra" / "rawtoaces-data" / "training" / "training_spectral.json"
    reflectances = spectral_data(surfaces)[1]
    for camera, model in (("Nikon_D7000", "fluorescent"), ("Sony_ILCE-7M3", "other_white_balances")):
        published = read_published_model(data / "nus_nikon_d40" / model)
        matrix, near = published.model.matrix, cKDTree(published.linear)
        rng = np.random.default_rng(0)
        order = rng.permutation(reflectances.shape[1])
        parts: tuple[list[Array], list[Array]] = ([], [])
        for temperature in ("A", 4300, 5200, 6000, 7500):
            seen = measured[camera] * light(temperature)[:, None]
            raw = reflectances.T @ (seen / seen.sum(axis=0))
            parts[0].append((np.geomspace(0.04, 1.8, 10)[:, None, None] * raw[order[:150]]).reshape(-1, 3))
            first, second = raw[rng.choice(order[150:], 1000)], raw[rng.choice(order, 1000)]
            share = rng.random((1000, 1))
            parts[1].append((share * first + (1 - share) * second) * np.exp(rng.uniform(-3.5, 0.6, (1000, 1))))
        fitted, tested = (np.concatenate(part) for part in parts)
        fitted, tested = (x[np.all(x < 1, axis=1) & (near.query(x @ matrix.T)[0] < 0.03)] for x in (fitted, tested))
        encoded = np.rint(255 * published.model.render(fitted)) / 255
        whole = np.all((encoded > 0) & (encoded < 1), axis=1)
        style = style_of(fitted[whole], encoded[whole])
        clipped = ClippedColours(fitted[~whole], encoded[~whole], np.full(int((~whole).sum()), "shot 0"))
        yield f"rig {camera}", Source(replace(style, clipped=clipped), tested, published.model.render(tested))


def of_the_fleet(data: Path) -> Iterator[tuple[str, Source]]:
    """Both styles of each camera of the fleet; the cameras of a half are one source."""
    for camera in fleet(data):
        samples = camera.samples()
        for style in STYLES:
            mine = samples.select(samples.style == style)
            balanced = mine.raw * np.array([camera.balances[str(name)] for name in mine.white_balance])
            rows = whole(mine.srgb) & np.all(balanced < 1.0, axis=1)
            clipped = ClippedColours(balanced[~rows], mine.srgb[~rows], mine.shot[~rows])
            seen = StyleData(balanced[rows], mine.srgb[rows], mine.shot[rows], mine.select(rows), clipped=clipped)
            rng, tested, encoded = np.random.default_rng(9), [], []
            for name in np.unique(mine.white_balance):
                raw = camera.unseen(rng, 500, str(name))
                raw = raw[camera.known(raw, style, str(name))]
                tested.append(np.minimum(raw * camera.balances[str(name)], 1.0))
                encoded.append(camera.render(raw, style, str(name)))
            yield f"fleet, to {camera.half}", Source(seen, np.concatenate(tested), np.concatenate(encoded))


def simulated(_: Path) -> Iterator[tuple[str, Source]]:
    """Styles of simulated cameras on colours that are even in RAW."""
    for camera, style in ((nikon_d5100(), "standard"), (nikon_d5100(), "vivid"), (sigma_sd_merrill(), "standard")):
        (x, y), unseen = (common.unseen_colours(camera, style, seed, 3_000) for seed in (1, 2))
        yield f"{camera.name}, {style}", Source(style_of(x, np.rint(255 * y) / 255), *unseen)


def baseline(style: StyleData) -> tuple[Predictor, Predictor]:
    """Universal kriging: 0.2 Matérn ½ of length 3.2 and 0.8 Matérn 3/2 of length 0.8 on the even scale, noise 1e-3."""
    fit = fit_matrix_and_response(style.balanced, style.encoded)
    matrix, response, offset = fit.matrix, fit.response, 0.005

    def covariance(first: Array, second: Array) -> Array:
        distance = cdist(first, second)
        smooth = np.sqrt(3) * distance / 0.8
        return np.asarray(0.2 * np.exp(-distance / 3.2) + 0.8 * (1 + smooth) * np.exp(-smooth))

    def trend(z: Array) -> Array:
        return np.column_stack([np.ones(len(z)), z])

    def kriged(z: Array, values: Array) -> Predictor:
        factor = cho_factor(covariance(z, z) + 1e-3 * np.eye(len(z)))
        of_trend = cho_solve(factor, trend(z))
        slope = np.linalg.solve(trend(z).T @ of_trend, of_trend.T @ values)
        rest = cho_solve(factor, values - trend(z) @ slope)
        return lambda q: np.asarray(covariance(q, z) @ rest + trend(q) @ slope)

    linear = style.balanced @ matrix.T
    z, back = to_even(linear, offset), to_even(response.linearize(style.encoded), offset)
    residual = kriged(z, style.encoded - response.encode(linear))
    inverse = kriged(back, z - back)

    def render(x: Array) -> Array:
        return response.encode(x @ matrix.T) + residual(to_even(x @ matrix.T, offset))

    def linearize(encoded: Array) -> Array:
        even = to_even(response.linearize(encoded), offset)
        return np.asarray(from_even(even + inverse(even), offset) @ np.linalg.inv(matrix).T)

    return render, linearize


def model(style: StyleData, **changes: object) -> tuple[Predictor, Predictor]:
    """The camera model as it is fitted, of the style or of one that differs in some fields."""
    changed = replace(style, **changes)  # type: ignore[arg-type]  # fields by name
    return changed.model.render, changed.model.linearize


def lattices(size: int) -> Fit:
    """The lattices that the model is baked to."""

    def fit(style: StyleData) -> tuple[Predictor, Predictor]:
        both = fit_lattices(style, CalibrationOptions(size=size))
        return both.render, both.linearize

    return fit


def around_unsaturated(style: StyleData) -> tuple[Predictor, Predictor]:
    """The model around the matrix of unsaturated colours alone."""
    return model(style, given=fit_matrix_and_response(style.balanced, style.encoded))


def without(module: object, **values: float | Callable[..., object]) -> Fit:
    """The model with names of a module set to values that switch a part off, in the fit and where it is evaluated."""

    def switched(function: Callable[..., Array]) -> Callable[..., Array]:
        def call(*arguments: object) -> Array:
            with ExitStack() as stack:
                for name, value in values.items():
                    stack.enter_context(patch.object(module, name, value))
                return function(*arguments)

        return call

    def fit(style: StyleData) -> tuple[Predictor, Predictor]:
        return (switched(lambda x: style.model.render(x)), switched(lambda encoded: style.model.linearize(encoded)))

    return fit


PARTS: dict[str, Fit] = {
    "lattices of 33 nodes (default)": lattices(33),
    "lattices of 17 nodes": lattices(17),
    "the camera model itself": model,
    "baseline of sixty lines": baseline,
    "matrix of unsaturated colours": around_unsaturated,
    "channels that bend apart": without(matrix_and_response, BENDS_ALIKE=0.0),
    "without white at saturation": without(CurveBasis, with_white_by_one=lambda basis: basis),
    "without outlier weights": without(kriging, cauchy=np.ones_like),
    "without clipped samples": partial(model, clipped=None),
    "inverse without likely scenes": without(inverse_gamut_map, HOLD=1e9),
    "distances along grey count fully": without(gamut_map, ALONG_GREY=1.0),
    "one perceptual scale": without(kriging, CORRECTION_OFFSET=gamut_map.OFFSET),
    "at most 1,000 centres": partial(model, options=CalibrationOptions(centres=1_000)),
    "noise × 10": without(kriging, NOISE=10 * kriging.NOISE),
    "noise / 10": without(kriging, NOISE=kriging.NOISE / 10),
}


def main() -> None:
    """Print a table for each source."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", nargs="*", default=[], help="sources whose names hold one of these words")
    only, data = parser.parse_args().only, common.real_data()
    if data is None:
        return
    rows: dict[str, dict[str, list[tuple[float, ...]]]] = {}
    for sources in (s40, d40, rigs, simulated, of_the_fleet):
        if common.chosen(sources.__name__, only):
            for name, source in sources(data):
                for part, fit in PARTS.items():
                    rows.setdefault(name, {}).setdefault(part, []).append(_figures(source, fit))
    for name, parts in rows.items():
        heading(name, "mean", "99.9 %", "largest", "clipped", "JPEG → RAW", "seconds")
        for part, entries in parts.items():
            mean, far, most, clipped, error, seconds = np.nanmean(entries, axis=0)
            row(part, f"{mean:.3f}", f"{far:.2f}", f"{most:.1f}", clipped, f"{error:.5f}", seconds, places=3)


def _figures(source: Source, fit: Fit) -> tuple[float, ...]:
    start = time.process_time()
    render, linearize = fit(replace(source.style))
    for predict, first in ((render, source.balanced), (linearize, source.encoded)):
        predict(first[:1])  # a model is fitted when it is first asked for
    seconds = time.process_time() - start
    difference = delta_e_2000(np.clip(render(source.balanced), 0, 1), source.encoded)
    whole = np.all((source.encoded > HALF_CODE) & (source.encoded < 1 - HALF_CODE), axis=1)
    error = linearize(source.encoded[whole]) - source.balanced[whole]
    clipped = np.nan if whole.all() else float(difference[~whole].mean())
    quantile, most = float(np.quantile(difference, 0.999)), float(difference.max())
    return float(difference.mean()), quantile, most, clipped, float(np.sqrt(np.mean(error**2))), seconds


if __name__ == "__main__":
    main()
