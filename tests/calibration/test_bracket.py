"""The response from JPEGs alone: real brackets, without RAW."""

from pathlib import Path

import numpy as np
import pytest

from lutforge.calibration.bracket import BracketFit, fit_bracket
from lutforge.calibration.pairs_of_bracket import pairs_of_bracket
from lutforge.calibration.response_verdict import judge
from lutforge.errors import CalibrationError
from lutforge.model.response import Response
from lutforge.pipeline.response import response
from tests.cases.brackets import CURVES, adapted, bracket, compressed, errors_of
from tests.cases.pictures import write_picture


@pytest.fixture(scope="module")
def window(shared_data: Path) -> BracketFit:
    """Eight of the twelve exposures of a Nikon E995, with its fixed white balance for sunlight."""
    return response(sorted((shared_data / "brackets" / "nikon_e995_window").glob("*.jpg"))[2:10]).fit


def _next_stop(response: Response, codes: np.ndarray) -> np.ndarray:
    """f(2 f⁻¹(I)), which does not depend on the scale of f⁻¹."""
    return response.encode(2.0 * response.linearize(np.stack([codes] * 3, axis=1)))


@pytest.mark.slow
def test_a_real_bracket(window: BracketFit) -> None:
    """Its curve predicts the next shot better than plain ones; EMoR and the spline say the same of it."""
    assert np.all(np.diff(window.response.inverse, axis=0) >= 0)
    np.testing.assert_allclose(window.white, 251 / 255, atol=1e-6)  # what this camera clips to
    assert all(0.9 < ratio < 1.1 for ratio in window.exposure_error.values())
    median = {curve.name.split()[0]: curve.median for curve in window.curves}
    assert median["EMoR"] < 2.2 and median["monotone"] < 3.0
    assert window.held_out < 1.6
    assert window.verdict.fixed
    assert median["EMoR"] < 0.25 * median["gamma"] < 0.25 * median["sRGB"]
    codes = np.linspace(0.1, 0.6, 50)
    emor, spline = (_next_stop(curve.response, codes) for curve in window.curves[:2])
    assert np.abs(emor - spline).max() < 0.03
    assert np.abs(emor - emor.mean(axis=1, keepdims=True)).max() < 0.02  # and its three channels


@pytest.mark.slow
def test_film_with_a_fog_and_no_neutrals(shared_data: Path) -> None:
    folder = shared_data / "brackets" / "debevec_memorial"
    lines = [line.split() for line in (folder / "image_list.txt").read_text().splitlines() if line[0] not in "#\n"]
    paths, times = [folder / words[0] for words in lines], [float(words[1]) for words in lines]
    with pytest.raises(CalibrationError, match="unsaturated colours"):
        response(paths, exposure_s=times)
    fit = response(paths, exposure_s=times, all_colours=True).fit
    assert np.all((fit.black > 10 / 255) & (fit.black < 20 / 255))
    median = [curve.median for curve in fit.curves]
    assert median[0] < 1.35 and median[1] < 2.0 and min(median[2:]) > 5.0


def test_a_simulated_bracket_gives_all_four_curves() -> None:
    rng = np.random.default_rng(1)
    scene = np.kron(np.exp(rng.uniform(-4.5, 1.0, (40, 40, 1))) * rng.uniform(0.85, 1, (40, 40, 3)), np.ones((8, 8, 1)))
    scene[:16] = 0.0
    times = [2.0**stop for stop in range(-3, 4)]
    images = [np.rint(245 * np.clip(scene * time, 0, 1) ** (1 / 1.8) + 6) / 255 for time in times]  # 6 … 251
    fit = fit_bracket(pairs_of_bracket([f"{time:g}" for time in times], images, times))
    np.testing.assert_allclose([255 * fit.black[0], 255 * fit.white[0]], [6, 251], atol=1.01)
    codes = np.linspace(0.15, 0.6, 50)
    expected = (2.0 * ((codes * 255 - 6) / 245) ** 1.8) ** (1 / 1.8) * 245 / 255 + 6 / 255
    for curve in fit.curves[:3]:
        np.testing.assert_allclose(_next_stop(curve.response, codes), np.stack([expected] * 3, axis=1), atol=0.012)
    assert fit.curves[2].name.startswith("gamma 1.8")


@pytest.mark.parametrize(
    "name", [name if name == "filmic" else pytest.param(name, marks=pytest.mark.slow) for name in CURVES]
)
def test_eight_responses_with_noise_clipping_and_an_inexact_shutter(name: str) -> None:
    curve = CURVES[name]
    times, errors, images = bracket(curve)
    fit = fit_bracket(pairs_of_bracket([f"{time:g}" for time in times], images, times))
    white, dark, shutter = errors_of(fit, curve, times, errors)
    assert max(white, dark) < 0.1
    assert shutter < 0.01
    assert fit.held_out < 0.5
    assert fit.verdict.fixed


def test_a_camera_that_adapts_to_the_scene_is_told() -> None:
    times, errors, images = bracket(CURVES["vivid"], cells=28)
    for kind in (None, "shadows", "highlights", "contrast"):
        seen = images if kind is None else adapted(kind, 0.1, images)
        verdict = judge(pairs_of_bracket([f"{time:g}" for time in times], seen, list(np.multiply(times, errors))))
        assert verdict.fixed == (kind is None)


@pytest.mark.parametrize(
    ("name", "shots", "spacing", "stated_off"),
    [("vivid", 7, 2.0, 0.0), ("vivid", 3, 1.0, 0.0), pytest.param("sRGB", 5, 2.0, 0.5, marks=pytest.mark.slow)],
)
def test_neighbouring_frames_agree(name: str, shots: int, spacing: float, stated_off: float) -> None:
    """Frames from JPEG files, of which the middle one may state a time that is off, in stops."""
    curve = CURVES[name]
    times, errors, images = bracket(curve, shots=shots, cells=28, spacing=spacing)
    stated = [time * 2.0 ** (stated_off * (place == shots // 2)) for place, time in enumerate(times)]
    images = [compressed(image) for image in images]
    fit = fit_bracket(pairs_of_bracket([f"{time:g}" for time in times], images, stated))
    light, codes = np.linspace(0, 1, 10_001), np.linspace(0.15, 0.6, 20)
    true = np.interp(codes, curve(light), light)
    for ratio in np.diff(np.log2(np.multiply(times, errors))):
        inside = true * 2**ratio < 0.85
        pair = codes[inside], curve(true[inside] * 2**ratio)
        first, second = (fit.response.linearize(np.stack([side] * 3, axis=1)) for side in pair)
        assert np.abs(np.median(np.log2(second / first), axis=0) - ratio).max(initial=0.0) < 0.15


@pytest.mark.parametrize("kind", ["a stop off", pytest.param("reversed", marks=pytest.mark.slow), "automatic exposure"])
def test_a_bracket_that_no_response_explains_is_refused(kind: str) -> None:
    times, _, images = bracket(CURVES["standard"], cells=16)
    if kind == "a stop off":
        times[3] *= 2.0
    elif kind == "reversed":
        times = times[::-1]
    else:
        images = [images[3]] * len(images)
    with pytest.raises(CalibrationError, match="check the exposure times"):
        fit_bracket(pairs_of_bracket([str(place) for place in range(len(times))], images, times))


def test_a_grey_image_is_refused(tmp_path: Path) -> None:
    grey = tmp_path / "grey.png"
    write_picture(grey, (64, 64), channels=1)
    with pytest.raises(CalibrationError, match="grey image"):
        response([grey, grey], exposure_s=[1.0, 2.0])
