"""What a config loses from JPEG to the reference and back, and what that costs its render, for cameras of all kinds.

    LUTFORGE_TEST_DATA=… python -m tests.benchmarks.config_round_trips [number of unseen cameras] [name of a camera …]

Printed per rendering: nodes per axis of both LUTs; the round trip's mean and largest RGB norm, encoded, over at least
300,000 colours: what the Python model makes of RAW colours (the whole range, its faces, edges and darks, RAW that white
balance pushes beyond saturation, near neutrals), what the render's own file makes of the same, the 8-bit codes nearest
to both, and those of the camera's photographs, where there are such, that the model makes (compression makes others);
the change of the render from the model, on all of these, and its largest as the config states it; seconds. The
published D40 and the S40's shots need LUTFORGE_TEST_DATA and are left out without. A "!" stands beside what is beyond
the goals: mean 0.001, largest 0.02.
"""

import os
import sys
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

import lutforge as lf
from lutforge.calibration.options import CalibrationOptions
from lutforge.colour.spectra import WAVELENGTHS
from lutforge.images.read import read_image
from lutforge.inverse.linearization import BakedRender, preimages
from lutforge.inverse.round_trip import MAX_GOAL, MEAN_GOAL, as_8_bit
from lutforge.inverse.round_trip import raw_colours as spread
from lutforge.model.camera_profile import CameraProfile
from lutforge.ocio.cameras import name_cameras
from lutforge.ocio.renderings import Rendering, baked, compact, renderings
from lutforge.simulate.camera import nikon_d5100, sigma_sd_merrill
from lutforge.simulate.demo import demo_shots
from tests.cases.cameras import Logarithm, UnseenCamera, camera_of, one_style, photographed, unseen_camera

Array = NDArray[np.float64]

Made = Callable[[], CameraProfile]

COUNT = 1 << 15
PUSHED = (2.1, 1.0, 1.5)
"""White balance that takes RAW beyond saturation."""


def raw_colours() -> Array:
    """RAW under white balance, (6 COUNT, 3)."""
    pushed = np.minimum(qmc.Sobol(3, rng=21).random(COUNT) * PUSHED, 1.0)
    return np.concatenate([spread(COUNT, seed=31), pushed])


def photographs(shots: list[Path]) -> Array:
    """The different 8-bit codes of JPEGs, (n, 3) in [0, 1]."""
    codes = [np.rint(read_image(shot).pixels[..., :3].reshape(-1, 3) * 255).astype(np.uint8) for shot in shots]
    return np.unique(np.concatenate(codes), axis=0) / 255.0


def made(jpeg: Array, rendering: Rendering) -> Array:
    """Those of the colours (n, 3) that the model's own render makes, searched from its own linearization."""
    assert rendering.render is not None
    assert rendering.linearize is not None
    render = BakedRender.of(compact(lf.bake(rendering.render)))
    return np.asarray(jpeg[preimages(render, jpeg, rendering.linearize(jpeg))[1] <= 1e-3])


def cameras(unseen: int, data: Path | None, folder: Path) -> Iterator[tuple[str, Made, list[Path]]]:
    """Name of each camera, what makes its profile, and its JPEGs."""
    if data is not None:
        models = [data / "nus_nikon_d40" / name for name in ("other_white_balances", "fluorescent")]
        yield "D40, published", partial(lf.import_published, models, "Nikon D40"), []
        shots = sorted((data / "canon_powershot_s40").glob("CRW_*.CRW"))
        yield "S40, its shots", lambda: lf.calibrate(lf.sample(shots)), sorted(shots[0].parent.glob("IMG_*.JPG"))
    shots_of_demo = demo_shots(folder)
    yield (
        "demo",
        lambda: lf.calibrate(lf.sample(shots_of_demo.calibration), CalibrationOptions(size=33)),
        sorted(folder.glob("*.JPG")),
    )
    for name, made in unseen_ones(unseen):
        yield name, made, []


def unseen_ones(unseen: int) -> Iterator[tuple[str, Made]]:
    """Cameras that nothing was made on."""

    def profile_of(camera: UnseenCamera, options: CalibrationOptions) -> Made:
        return lambda: lf.calibrate(photographed(camera, True, 0), options)

    for base, style in ((sigma_sd_merrill(), "vivid"), (sigma_sd_merrill(), "landscape"), (nikon_d5100(), "landscape")):
        camera = one_style(base, style, 140)
        yield camera.model, profile_of(camera, CalibrationOptions(size=33))
    overlapping, vivid = overlapping_filters(), one_style(sigma_sd_merrill(), "vivid", 24)
    for hard in (overlapping, filmic_compressed()):
        yield hard.model, profile_of(hard, CalibrationOptions(size=33))
    weak = (CalibrationOptions(model="rbf"), CalibrationOptions(size=9))
    for options in weak:
        yield f"{vivid.model}, 24 patches, {options.model} {options.size}", profile_of(vivid, options)
    for seed in range(unseen):
        camera = unseen_camera(seed)
        size = (17, 33, 25)[seed % 3]
        model: Literal["lattice", "rbf"] = "rbf" if seed % 5 == 4 else "lattice"
        options = CalibrationOptions(size=size, model=model)
        yield f"unseen {seed}, {model} {size}, {camera.patches} patches", profile_of(camera, options)


def bell(centre: float, width: float) -> Array:
    """A Gaussian over the wavelengths."""
    return np.asarray(np.exp(-0.5 * ((WAVELENGTHS - centre) / width) ** 2))


def overlapping_filters() -> UnseenCamera:
    """A hard case: filters that overlap, so that the matrix amplifies sixfold, no gamut map, a logarithm that clips."""
    filters = np.stack([0.9 * bell(590, 45), bell(545, 48) + 0.05 * bell(650, 30), 0.6 * bell(470, 40)], axis=1)
    lights = {"daylight": "5200K", "tungsten": "A", "shade": "7500K"}
    name = "Overlapping filters, log, clipped"
    return camera_of(name, filters, lights, np.asarray, Logarithm(30.0), patches=280)


def filmic_compressed() -> UnseenCamera:
    """Another: a steep filmic curve behind a vivid gamut that is compressed (as in ACES), so that what no
    sample showed is continued badly, and folds."""

    def compressed(x: Array) -> Array:
        y = x @ [0.2126, 0.7152, 0.0722]
        vivid = y[..., None] + 1.25 * (x - y[..., None])
        most = np.maximum(vivid.max(axis=-1, keepdims=True), 1e-9)
        distance, threshold, power = 1 - vivid / most, 0.55, 1.2
        scale = 1.05 / (((1 - threshold) / 1.05) ** -power - 1) ** (1 / power)
        over = np.maximum(distance - threshold, 0.0)
        less = threshold + over / (1 + (over / scale) ** power) ** (1 / power)
        return np.asarray(most * (1 - np.where(distance < threshold, distance, less)))

    def filmic(x: Array) -> Array:
        y = 1.6 * np.maximum(x, 0.0)
        tone = y * (2.51 * y + 0.03) / (y * (2.43 * y + 0.59) + 0.14)
        return np.asarray(np.clip(tone / 0.8957, 0.0, 1.0) ** 0.5)

    filters = np.stack([0.75 * (bell(595, 40) + 0.06 * bell(445, 25)), bell(545, 42), 0.65 * bell(465, 32)], axis=1)
    lights = {"daylight": "5200K", "shade": "7500K"}
    return camera_of("Filmic, compressed gamut", filters, lights, compressed, filmic, patches=280)


def row(name: str, rendering: Rendering, jpegs: list[Path]) -> tuple[str, float, float]:
    """One line of the table, and the round trip's mean and maximum."""
    assert rendering.render is not None
    began = time.perf_counter()
    luts, errors = baked(rendering)
    seconds = time.perf_counter() - began
    render, linearize = luts[rendering.render_file], luts[rendering.linearize_file]
    raw = raw_colours()
    by_model = np.clip(rendering.render(raw), 0.0, 1.0)
    by_file = np.clip(render(raw), 0.0, 1.0)
    mean = largest = 0.0
    own = [shot for shot in jpegs if rendering.style in shot.name or "IMG" in shot.name]
    codes = (as_8_bit(by_model), as_8_bit(by_file))
    for jpeg in (by_model, by_file, *codes, *([made(photographs(own), rendering)] if own else [])):
        error = np.linalg.norm(np.clip(render(linearize(jpeg)), 0.0, 1.0) - jpeg, axis=1)
        mean, largest = max(mean, float(error.mean())), max(largest, float(error.max()))
    change = np.linalg.norm(by_file - by_model, axis=1)
    beyond = "!" if mean > MEAN_GOAL or largest > MAX_GOAL else " "
    stated = errors[0].split("max ")[1]
    return (
        (
            f"{name:42s}{render.size:4d}{linearize.size:4d}{mean:10.5f}{largest:8.4f} {beyond}"
            f"{change.mean():10.5f}{change.max():8.4f}{stated:>8s}{seconds:7.1f}"
        ),
        mean,
        largest,
    )


def main() -> None:
    """Print the table."""
    words = sys.argv[1:]
    count = next((int(word) for word in words if word.isdigit()), 3)
    wanted = [word for word in words if not word.isdigit()]
    place = os.environ.get("LUTFORGE_TEST_DATA")
    print(f"{'':42s}{'nodes':>8s}{'mean':>10s}{'max':>8s}  {'change':>10s}{'max':>8s}{'stated':>8s}{'s':>7s}")
    worst = [0.0, 0.0]
    with TemporaryDirectory() as folder:
        for name, made_profile, jpegs in cameras(count, Path(place) if place else None, Path(folder)):
            if wanted and not any(word in name for word in wanted):
                continue
            for rendering in renderings(name_cameras([made_profile()])):
                text, mean, largest = row(f"{name}: {rendering.style}", rendering, jpegs)
                worst = [max(worst[0], mean), max(worst[1], largest)]
                print(text, flush=True)
    print(f"{'worst':42s}{'':8s}{worst[0]:10.5f}{worst[1]:8.4f}")


if __name__ == "__main__":
    main()
