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

import sys
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import numpy as np
from scipy.stats import qmc

import lutforge as lf
from lutforge.calibration.options import CalibrationOptions
from lutforge.images.read import read_image
from lutforge.inverse.linearization import BakedRender, preimages
from lutforge.inverse.round_trip import MAX_GOAL, MEAN_GOAL, as_8_bit
from lutforge.inverse.round_trip import raw_colours as spread
from lutforge.model.camera_profile import CameraProfile
from lutforge.ocio.cameras import name_cameras
from lutforge.ocio.renderings import Rendering, baked, compact, renderings
from lutforge.simulate.camera import nikon_d5100, sigma_sd_merrill
from tests.benchmarks import common
from tests.benchmarks.bake_table import nikon_d40
from tests.benchmarks.common import Array, heading
from tests.cases.cameras import (
    UnseenCamera,
    filmic_compressed,
    one_style,
    overlapping_filters,
    photographed,
    unseen_camera,
)

Made = Callable[[], CameraProfile]

COUNT = 1 << 15


def raw_colours() -> Array:
    """RAW under white balance, (6 COUNT, 3)."""
    pushed = np.minimum(qmc.Sobol(3, rng=21).random(COUNT) * (2.1, 1.0, 1.5), 1.0)  # beyond saturation
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
    """Name of each camera, what makes its profile, and its JPEGs; nothing was made on the last ones."""
    if data is not None:
        yield "D40, published", partial(nikon_d40, data), []
        jpegs = sorted((data / "canon_powershot_s40").glob("IMG_*.JPG"))
        yield "S40, its shots", lambda: lf.calibrate(common.s40(data, folder)), jpegs
    yield "demo", lambda: common.demo(folder, 33)[1], sorted((folder / "demo").glob("*.JPG"))
    styles = ((sigma_sd_merrill(), "vivid"), (sigma_sd_merrill(), "landscape"), (nikon_d5100(), "landscape"))
    hard = [*(one_style(base, style, 140) for base, style in styles), overlapping_filters(), filmic_compressed()]
    made = [(camera.model, camera, CalibrationOptions(size=33)) for camera in hard]
    for options in (CalibrationOptions(model="rbf"), CalibrationOptions(size=9)):
        vivid = one_style(sigma_sd_merrill(), "vivid", 24)
        made.append((f"{vivid.model}, 24 patches, {options.model} {options.size}", vivid, options))
    for seed in range(unseen):
        camera = unseen_camera(seed)
        options = CalibrationOptions(size=(17, 33, 25)[seed % 3], model="rbf" if seed % 5 == 4 else "lattice")
        name = f"unseen {seed}, {options.model} {options.size}, {camera.patches} patches"
        made.append((name, camera, options))
    for name, camera, options in made:
        yield name, partial(calibrated, camera, options), []


def calibrated(camera: UnseenCamera, options: CalibrationOptions) -> CameraProfile:
    """A profile of photographs of the camera's chart."""
    return lf.calibrate(photographed(camera, True, 0), options)


def round_trip(rendering: Rendering, jpegs: list[Path]) -> tuple[float, float, list[str]]:
    """Mean and largest of the round trip, and the cells of one line of the table."""
    assert rendering.render is not None
    began = time.perf_counter()
    luts, errors = baked(rendering)
    seconds = time.perf_counter() - began
    render, linearize = luts[rendering.file("render")], luts[rendering.file("linearize")]
    raw = raw_colours()
    by_model = np.clip(rendering.render(raw), 0.0, 1.0)
    by_file = np.clip(render(raw), 0.0, 1.0)
    colours = [by_model, by_file, as_8_bit(by_model), as_8_bit(by_file)]
    shots = [shot for shot in jpegs if rendering.style in shot.name or "IMG" in shot.name]
    if shots:
        colours.append(made(photographs(shots), rendering))
    trips = [np.linalg.norm(np.clip(render(linearize(jpeg)), 0.0, 1.0) - jpeg, axis=1) for jpeg in colours]
    mean, largest = (max(float(of(trip)) for trip in trips) for of in (np.mean, np.max))
    change = np.linalg.norm(by_file - by_model, axis=1)
    beyond = " !" if mean > MEAN_GOAL or largest > MAX_GOAL else ""
    cells = [f"{render.size}, {linearize.size}", f"{mean:.5f}", f"{largest:.4f}{beyond}", f"{change.mean():.5f}"]
    return mean, largest, [*cells, f"{change.max():.4f}", errors[0].split("max ")[1], f"{seconds:.1f}"]


def main() -> None:
    """Print the table."""
    words = sys.argv[1:]
    count = next((int(word) for word in words if word.isdigit()), 3)
    names = [word for word in words if not word.isdigit()]
    heading("camera", "nodes", "mean", "largest", "change: mean", "largest", "as stated", "seconds")
    worst = []
    with common.kept(None) as folder:
        for name, make, jpegs in cameras(count, common.real_data(), folder):
            if common.chosen(name, names):
                for rendering in renderings(name_cameras([make()])):
                    mean, largest, cells = round_trip(rendering, jpegs)
                    worst.append((mean, largest))
                    common.row(f"{name}: {rendering.style}", *cells)
    common.row("worst", "", *(f"{value:.5f}" for value in np.max(worst, axis=0)))


if __name__ == "__main__":
    main()
