"""JPEGs that the camera straightened: errors beside those of the same shots as the lens drew them.

    python -m tests.benchmarks.geometry [--only WORD …] [--data FOLDER]

Simulated: the shots of the demo with a bent lens. S40: its five photographs, their previews resampled by r (1 + k r²),
r = 1 in the corner, and scaled to fill the frame. Columns: errors by those of the unbent shots of the same frame, of
colours nobody photographed against the camera's truth and as held out (mean RGB; of the S40 mean ΔE00), render and
linearize; by how many stops the falloff in the corners is off; shots of which a note complains; the distortion told.
Half a minute a row.
FOLDER (or LUTFORGE_TEST_DATA) has the shots of the Canon S40.
"""

import argparse
import math
import os
import shutil
import tempfile
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import numpy as np
from PIL import Image
from scipy.ndimage import map_coordinates

import lutforge as lf
from lutforge.arrays import Array, Codes
from lutforge.model.falloff import Falloff
from lutforge.pipeline.sampling import sample_shots
from lutforge.shots.geometry import Distortion
from lutforge.shots.read import read_shot
from lutforge.simulate.camera import nikon_d5100
from lutforge.simulate.demo import SHOTS
from lutforge.simulate.photograph import CameraSettings, photograph
from lutforge.simulate.scene import SCENES, Scene, palette

SHAPE = (808, 1216)
RADIUS = math.hypot(*SHAPE) / 2
FALLOFF = Falloff((0.3, 0.3, 0.2))
LENSES = {
    "none": (0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
    "k = -0.02": (-0.02, 0.0, 0.0, 0.0, 0.0, 0.0),
    "k = +0.02": (0.02, 0.0, 0.0, 0.0, 0.0, 0.0),
    "k = -0.06": (-0.06, 0.0, 0.0, 0.0, 0.0, 0.0),
    "k = +0.06": (0.06, 0.0, 0.0, 0.0, 0.0, 0.0),
    "k = -0.10": (-0.10, 0.0, 0.0, 0.0, 0.0, 0.0),
    "k = -0.15": (-0.15, 0.0, 0.0, 0.0, 0.0, 0.0),
    "moustache": (-0.08, 0.07, 0.0, 0.0, 0.0, 0.0),
    "centre off by 3 %": (-0.06, 0.0, 0.03, -0.02, 0.0, 0.0),
    "fringes of 0.2 %": (0.0, 0.0, 0.0, 0.0, 0.002, -0.001),
}
"""k1, k2, the centre off the middle by shares of half the diagonal, red and blue."""
CROPS = {
    "16:9": (slice(62, 737), slice(0, 1200)),
    "1:1": (slice(0, 800), slice(200, 1000)),
    "off centre": (slice(0, 640), slice(240, 1200)),
}


@cache
def scene(name: str, seed: int) -> Scene:
    """A scene of the demo."""
    return SCENES[name](*SHAPE, seed)


def take(folder: Path, lens: str, falloff: Falloff | None, crop: str = "") -> None:
    """The demo's shots through a lens, each with a JPEG beside it."""
    camera, (k1, k2, x, y, red, blue) = nikon_d5100(), LENSES[lens]
    bent = Distortion(SHAPE[1] / 2 + RADIUS * x, SHAPE[0] / 2 + RADIUS * y, RADIUS, k1, k2, red, blue)
    for number, shot in enumerate(SHOTS):
        exposure = camera.nominal_exposure_s * shot.exposure
        settings = CameraSettings(
            shot.style, shot.white_balance, exposure, falloff=falloff, distortion=None if lens == "none" else bent
        )
        name = f"{number:02d}-{shot.style}-{shot.white_balance}"
        jpeg = photograph(camera, scene(shot.scene, shot.seed), settings, folder, name, light=shot.light).jpeg
        if crop and jpeg is not None:
            with Image.open(jpeg) as picture:
                pixels = np.asarray(picture)[CROPS[crop]]
                Image.fromarray(pixels).save(jpeg, quality=95, subsampling=1, exif=picture.getexif())


def figures(folder: Path, falloff: Falloff | None) -> tuple[Array, float, int, str]:
    """The errors (4,), by how much the falloff is off, the shots complained of, and what is told of the first shot."""
    camera, shots = nikon_d5100(), sorted(folder.glob("*.dng"))
    sampled = sample_shots(shots)
    profile = lf.calibrate(sampled.samples)
    held = {
        row.direction: row.figures.mean
        for row in lf.evaluate(profile, sampled.samples).rows
        if row.shot == "all" and row.method == "lattice"
    }
    errors = []
    for style in ("standard", "vivid"):
        exposed = camera.expose(palette(400, np.random.default_rng(9)), "daylight")
        raw = np.concatenate([exposed, exposed / 2, exposed / 4])
        jpeg = camera.render(raw, style, "daylight")
        inside = ((jpeg > 0.02) & (jpeg < 0.98)).all(axis=1) & (raw < 0.98).all(axis=1)
        render, linearize = profile.render(f"{style}/daylight"), profile.linearize(f"{style}/daylight")
        pairs = ((render(raw), jpeg), (linearize(jpeg), raw))
        errors.append([np.linalg.norm(got - true, axis=1)[inside].mean() for got, true in pairs])
    corner = max((each.corner_ev for each in profile.falloffs), default=0.0)
    true = 0.0 if falloff is None else falloff.corner_ev
    names = {str(name) for name in np.unique(sampled.samples.shot)}
    accused = sum(name in note for name in names for note in profile.notes if "one shot only" not in note)
    means = np.array([*np.mean(errors, axis=0), held["render"], held["linearize"]])
    return means, corner - true, accused + len(sampled.left_out), read_shot(shots[1]).lens_note


def simulated(only: list[str]) -> Iterator[tuple[str, Array, float, int, str]]:
    """The demo's shots through each lens, without and with falloff, and cropped."""
    for falloff in (None, FALLOFF):
        references: dict[str, Array] = {}
        cases = [(lens, "") for lens in LENSES]
        if falloff is None:
            cases += [(lens, crop) for crop in CROPS for lens in ("none", "k = -0.06")]
        for lens, crop in cases:
            name = ", ".join(filter(None, ["simulated", lens, crop, "falloff" if falloff else ""]))
            if only and lens != "none" and not any(word in name for word in only):
                continue
            with tempfile.TemporaryDirectory() as folder:
                take(Path(folder), lens, falloff, crop)
                errors, stops, accused, told = figures(Path(folder), falloff)
            reference = references.setdefault(crop, errors)
            yield name, errors / reference, stops, accused, told


def s40(data: Path) -> Iterator[tuple[str, Array, float, int, str]]:
    """The S40's previews, resampled."""
    reference: Array | None = None
    for k in (None, 0.0, -0.02, 0.02, -0.06, 0.06, -0.10):
        with tempfile.TemporaryDirectory() as folder:
            for raw in sorted((data / "canon_powershot_s40").glob("*.CRW")):
                shutil.copy(raw, folder)
                if k is not None:
                    pixels = straightened(read_shot(raw).jpeg, k)
                    Image.fromarray(pixels).save(Path(folder, raw.stem + ".JPG"), quality=98, subsampling=0)
            shots = sorted(Path(folder).glob("*.CRW"))
            sampled = sample_shots(shots)
            profile = lf.calibrate(sampled.samples)
            rows = lf.evaluate(profile, sampled.samples).rows
            whole = {row.direction: row.figures for row in rows if row.shot == "all" and row.method == "lattice"}
            told = [read_shot(shot).lens_note for shot in shots]
        delta = whole["render"].de00_mean
        errors = np.array([np.nan, np.nan, np.nan if delta is None else delta, whole["linearize"].mean])
        reference = errors if k in (None, 0.0) else reference
        falloff = max((each.corner_ev for each in profile.falloffs), default=0.0)
        name = "S40, as it is" if k is None else f"S40, k = {k:+.2f}"
        assert reference is not None
        yield name, errors / reference, falloff, len(sampled.left_out), f"{sum(map(bool, told))} told; {told[0]}"


def straightened(picture: Codes, k: float) -> Codes:
    """A picture (h, w, 3), resampled at r (1 + k r²) and scaled to fill its frame."""
    height, width = picture.shape[:2]
    middle, half = np.array([width, height]) / 2, math.hypot(height, width) / 2
    away = np.stack(np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5), axis=-1) - middle
    bent = 1 + k * np.square(away / half).sum(axis=-1, keepdims=True)
    x, y = np.moveaxis(away * bent / (bent.max() if k > 0 else bent[0, width // 2]) + middle - 0.5, -1, 0)
    planes = [map_coordinates(picture[..., channel].astype(np.float64), [y, x], mode="nearest") for channel in range(3)]
    return np.rint(np.clip(np.stack(planes, axis=-1), 0, 255)).astype(np.uint8) if k else picture


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--only", nargs="+", default=[], metavar="WORD", help="the rows whose names hold a word")
    parser.add_argument("--data", type=Path, default=os.environ.get("LUTFORGE_TEST_DATA"))
    arguments = parser.parse_args()
    print(f"{'':42s}{'truth':>15s}{'held out':>15s}{'falloff EV':>12s}{'accused':>9s}  told")
    wants_s40 = not arguments.only or any("S40".startswith(word) for word in arguments.only)
    sources = [s40(Path(arguments.data))] if arguments.data and wants_s40 else []
    if arguments.only != ["S40"]:
        sources.append(simulated(arguments.only))
    for rows in sources:
        for name, ratios, stops, accused, told in rows:
            columns = "".join(f"{pair[0]:8.3f}{pair[1]:7.3f}" for pair in ratios.reshape(2, 2))
            print(f"{name:42s}{columns}{stops:12.3f}{accused:9d}  {told}", flush=True)


if __name__ == "__main__":
    main()
