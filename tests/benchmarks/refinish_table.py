"""How near a refinish comes to what the camera would have made, for every pair of settings of the simulated camera.

    python tests/benchmarks/refinish_table.py [FOLDER]

Two styles, six white balances, twelve calibration shots of each setting, 8-bit JPEGs of quality 95; scenes that were
held out, on the means of 8 × 8 pixels of which none is clipped, and on single pixels, where noise and JPEG compression
remain. About ten minutes.
"""

import sys
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import lutforge as lf
from lutforge.images.read import read_image
from lutforge.simulate.camera import nikon_d5100
from lutforge.simulate.photograph import CameraSettings, develop_again, photograph
from lutforge.simulate.scenes import SCENES

STYLES = ("standard", "vivid")
PLAN = (
    (1.0, None, "wall"), (0.3, None, "wall"), (0.8, "tungsten", "still-life"), (0.7, "shade", "still-life"),
    (0.5, "daylight", "wall"), (0.6, "fluorescent", "wall"), (1.3, "cloudy", "still-life"), (0.25, "tungsten", "wall"),
    (1.4, "tungsten", "wall"), (1.3, "shade", "wall"), (0.9, None, "still-life"), (0.4, "shade", "chart"),
)  # fmt: skip
"""Relative exposure, light (None: the one that the white balance is made for) and scene of a setting's shots."""
HELD_OUT = (("still-life", 7, "daylight", 0.6), ("wall", 77, "daylight", 0.7), ("still-life", 8, "tungsten", 0.7))
SIDE = 8

Pixels = NDArray[np.float64]


def calibrated(folder: Path) -> lf.CameraProfile:
    camera = nikon_d5100()
    for style in STYLES:
        for number, balance in enumerate(camera.white_balances):
            for index, (exposure, light, scene) in enumerate(PLAN):
                seed = 200 + 80 * STYLES.index(style) + len(PLAN) * number + index
                settings = CameraSettings(style, balance, camera.nominal_exposure_s * exposure)
                name = f"{style}-{balance}-{index}"
                photograph(camera, SCENES[scene](616, 920, seed), settings, folder, name, light=light)
    return lf.calibrate(lf.sample([folder]))


def held_out(folder: Path) -> list[dict[tuple[str, str], Pixels]]:
    camera, scenes = nikon_d5100(), []
    for number, (scene, seed, light, exposure) in enumerate(HELD_OUT):
        settings = CameraSettings("standard", light, camera.nominal_exposure_s * exposure)
        shot = photograph(camera, SCENES[scene](404, 608, seed), settings, folder / str(number), "shot", light=light)
        pictures = {}
        for style in STYLES:
            for balance in camera.white_balances:
                path = folder / str(number) / f"{style}-{balance}.jpg"
                develop_again(camera, shot, CameraSettings(style, balance, settings.exposure_s), path)
                pictures[style, balance] = read_image(path).pixels.astype(np.float64)
        scenes.append(pictures)
    return scenes


def tiles(picture: Pixels) -> Pixels:
    height, width = (length // SIDE for length in picture.shape[:2])
    cut = picture[: height * SIDE, : width * SIDE]
    return cut.reshape(height, SIDE, width, SIDE, 3).swapaxes(1, 2)


def errors(refinish: lf.CameraProfile, source: tuple[str, str], target: tuple[str, str],
           scenes: list[dict[tuple[str, str], Pixels]]) -> tuple[float, float]:  # fmt: skip
    """RMSE of the means of tiles, and of single pixels."""
    transform = refinish.refinish("/".join(source), "/".join(target))
    of_tiles, of_pixels = [], []
    for pictures in scenes:
        before, wanted = tiles(pictures[source]), tiles(pictures[target])
        usable = ((before > 0.002) & (before < 0.998) & (wanted > 0.002) & (wanted < 0.998)).all(axis=(2, 3, 4))
        difference = transform(before[usable]) - wanted[usable]
        of_tiles.append((difference.mean(axis=(1, 2)) ** 2).mean(axis=-1))
        of_pixels.append((difference**2).mean(axis=-1).ravel())
    tile, pixel = (float(np.sqrt(np.concatenate(part).mean())) for part in (of_tiles, of_pixels))
    return tile, pixel


def main() -> None:
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else "refinish_table")
    profile, scenes = calibrated(folder / "shots"), held_out(folder / "held-out")
    settings = list(scenes[0])
    found = {(a, b): errors(profile, a, b, scenes) for a in settings for b in settings if a != b}
    of_tiles, of_pixels = (np.array([pair[part] for pair in found.values()]) for part in (0, 1))
    for name, values in (("tiles of 8 × 8", of_tiles), ("pixels", of_pixels)):
        print(
            f"{name}: RMSE median {np.median(values):.4f}, max {values.max():.4f}; "
            f"{(values <= 0.012).sum()} of {len(values)} pairs within 0.012"
        )
    for (source, target), (tile, pixel) in sorted(found.items(), key=lambda entry: -entry[1][0])[:5]:
        print(f"  {'/'.join(source)} to {'/'.join(target)}: tiles {tile:.4f}, pixels {pixel:.4f}")


if __name__ == "__main__":
    main()
