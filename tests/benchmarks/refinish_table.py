"""How near a refinish comes to what the camera would have made, for every pair of settings of a simulated camera.

    python -m tests.benchmarks.refinish_table FOLDER [--sensor sd-merrill] [--repeat 2] [--draw 1]

Two styles, six white balances, twelve calibration shots of each setting (with --repeat more, of other scenes; --draw
takes other scenes from the start), 8-bit JPEGs of quality 95. Scenes that were held out are compared on the means of
8 × 8 pixels of which none is clipped, and on single pixels, where noise and JPEG compression remain. The floor beside
each figure is what the camera's own functions make of the same JPEG. Shots and samples are kept in FOLDER and used
again: about four minutes the first time on two cores, one after that.
"""

import argparse
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from itertools import product
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import lutforge as lf
from lutforge.images.read import read_image
from lutforge.luts.bake import grading_steps
from lutforge.model.camera_profile import raw_to_balanced
from lutforge.model.transform import through_stages
from lutforge.samples.sample_set import concatenate
from lutforge.samples.table import write_samples
from lutforge.simulate.camera import SimulatedCamera, nikon_d5100, sigma_sd_merrill
from lutforge.simulate.photograph import CameraSettings, Photograph, develop_again, photograph
from lutforge.simulate.scene import SCENES
from tests.benchmarks.common import Array, heading, row

SENSORS: Mapping[str, Callable[[], SimulatedCamera]] = {"d5100": nikon_d5100, "sd-merrill": sigma_sd_merrill}
STYLES = ("standard", "vivid")
PLAN = (
    (1.0, None, "wall"), (0.3, None, "wall"), (0.8, "tungsten", "still-life"), (0.7, "shade", "still-life"),
    (0.5, "daylight", "wall"), (0.6, "fluorescent", "wall"), (1.3, "cloudy", "still-life"), (0.25, "tungsten", "wall"),
    (1.4, "tungsten", "wall"), (1.3, "shade", "wall"), (0.9, None, "still-life"), (0.4, "shade", "chart"),
)  # fmt: skip
"""Relative exposure, light (None: the one that the white balance is made for) and scene of a setting's shots."""
HELD_OUT = (("still-life", 7, "daylight", 0.6), ("wall", 77, "daylight", 0.7), ("still-life", 8, "tungsten", 0.7))
SIDE = 8
LIMIT = 0.012
CLIPPED = 0.002

Setting = tuple[str, str]
"""Style and white balance."""


@dataclass(frozen=True, eq=False)
class Scene:
    """The tiles of the held-out scenes under one setting. encoded: (tiles, 64, 3); usable: (tiles,), nothing clipped;
    raw: what the profile makes of them, true_raw: what the camera's own functions do.
    """

    encoded: Array
    usable: NDArray[np.bool_]
    raw: Array
    true_raw: Array


def calibrated(camera: SimulatedCamera, folder: Path, repeat: int, draw: int) -> lf.CameraProfile:
    """A profile from shots of all settings; samples of an earlier run are used again. draw: the first of its scenes."""
    numbers = range(draw, draw + repeat)
    tables = [folder / f"samples-{number}.csv" for number in numbers]
    for number, table in zip(numbers, tables, strict=True):
        if not table.exists():
            shoot(camera, folder / f"shots-{number}", 1000 * number)
            write_samples(table, lf.sample([folder / f"shots-{number}"]))
    return lf.calibrate(concatenate([lf.read_samples(table) for table in tables]))


def shoot(camera: SimulatedCamera, folder: Path, first_seed: int) -> None:
    """The plan's shots of every setting."""
    for style in STYLES:
        for number, balance in enumerate(camera.white_balances):
            for index, (exposure, light, scene) in enumerate(PLAN):
                seed = first_seed + 200 + 80 * STYLES.index(style) + len(PLAN) * number + index
                settings = CameraSettings(style, balance, camera.nominal_exposure_s * exposure)
                name = f"{style}-{balance}-{first_seed + index}"
                photograph(camera, SCENES[scene](616, 920, seed), settings, folder, name, light=light)


def held_out(camera: SimulatedCamera, profile: lf.CameraProfile, folder: Path) -> dict[Setting, Scene]:
    """The scenes under all settings, each linearized once."""
    pictures: dict[Setting, list[Array]] = {setting: [] for setting in product(STYLES, camera.white_balances)}
    for number, (scene, seed, light, exposure) in enumerate(HELD_OUT):
        place, exposure_s = folder / "held-out" / str(number), camera.nominal_exposure_s * exposure
        shot = Photograph(place / "shot.dng", None)
        if not shot.dng.exists():
            settings = CameraSettings("standard", light, exposure_s)
            photograph(camera, SCENES[scene](404, 608, seed), settings, place, "shot", light=light)
        for (style, balance), parts in pictures.items():
            path = place / f"{style}-{balance}.jpg"
            if not path.exists():
                develop_again(camera, shot, CameraSettings(style, balance, exposure_s), path)
            parts.append(tiles(read_image(path).pixels))
    return {setting: linearized(camera, profile, setting, np.concatenate(parts)) for setting, parts in pictures.items()}


def tiles(picture: NDArray[np.float32]) -> Array:
    """(h, w, 3) → (tiles, 64, 3)."""
    height, width = (length // SIDE for length in picture.shape[:2])
    cut = picture[: height * SIDE, : width * SIDE].reshape(height, SIDE, width, SIDE, 3)
    return cut.swapaxes(1, 2).reshape(height * width, SIDE * SIDE, 3).astype(np.float64)


def linearized(camera: SimulatedCamera, profile: lf.CameraProfile, setting: Setting, encoded: Array) -> Scene:
    usable: NDArray[np.bool_] = np.all((encoded > CLIPPED) & (encoded < 1 - CLIPPED), axis=(1, 2))
    true_raw = np.zeros_like(encoded)
    # Most colours of a JPEG occur more than once, and the true inverse is found by bisection.
    colours, place = np.unique(encoded[usable].reshape(-1, 3), axis=0, return_inverse=True)
    true_raw[usable] = camera.linearize(colours, *setting)[place.ravel()].reshape(-1, SIDE * SIDE, 3)
    return Scene(encoded, usable, profile.linearize("/".join(setting))(encoded), true_raw)


def rmse(made: Array, wanted: Array) -> tuple[float, float]:
    """Of the means of tiles, and of single pixels."""
    difference = made - wanted
    return float(np.sqrt(np.mean(difference.mean(axis=1) ** 2))), float(np.sqrt(np.mean(difference**2)))


def errors(
    camera: SimulatedCamera, folder: Path, repeat: int = 1, draw: int = 0
) -> dict[tuple[Setting, Setting], tuple[float, float, float, float]]:
    """By source and target: tiles, their floor, pixels, their floor. Shots and samples are kept in the folder."""
    profile, pairs = calibrated(camera, folder, repeat, draw), {}
    scenes = held_out(camera, profile, folder)
    for target, after in scenes.items():
        true_render = partial(camera.render, style=target[0], white_balance=target[1])
        for source, before in scenes.items():
            if source == target:
                continue
            selectors = profile.selector("/".join(source)), profile.selector("/".join(target))
            exposed = raw_to_balanced(profile, selectors[0], profile, selectors[1])
            _, _, highlights, render = grading_steps(profile.refinish(*selectors))
            usable = before.usable & after.usable
            wanted = after.encoded[usable]
            balanced = through_stages(exposed, before.raw[usable])
            tile, pixel = rmse(render(highlights(balanced)), wanted)
            tile_floor, pixel_floor = rmse(true_render(before.true_raw[usable]), wanted)
            pairs[source, target] = tile, tile_floor, pixel, pixel_floor
    return pairs


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("folder", type=Path, help="where shots and samples are kept between runs")
    parser.add_argument("--sensor", choices=SENSORS, default="d5100")
    parser.add_argument("--repeat", type=int, default=1, help="how many times the plan is photographed")
    parser.add_argument("--draw", type=int, default=0, help="which scenes are photographed, from 0 on")
    arguments = parser.parse_args()
    camera, folder = SENSORS[arguments.sensor](), arguments.folder / arguments.sensor
    pairs = errors(camera, folder, arguments.repeat, arguments.draw)
    columns = ("tiles", "their floor", "pixels", "their floor")
    print(f"{camera.name}: RMSE of refinishing, worst first; the floor is what the camera's own functions leave")
    heading("from, to", *columns)
    for (source, target), figures in sorted(pairs.items(), key=lambda entry: -entry[1][0]):
        row(f"{'/'.join(source)} to {'/'.join(target)}", *figures)
    for name, values in zip(columns, np.array(list(pairs.values())).T, strict=True):
        within = f"{(values <= LIMIT).sum()} of {len(values)} pairs within {LIMIT}"
        print(f"{name}: median {np.median(values):.4f}, max {values.max():.4f}; {within}")


if __name__ == "__main__":
    main()
