"""JPEGs that the camera straightened: errors beside those of the same shots as the lens drew them.

    python -m tests.benchmarks.geometry [--only WORD …]

Simulated: the shots of the demo with a bent lens. S40: its five photographs, their previews resampled by r (1 + k r²),
r = 1 in the corner, and scaled to fill the frame. Columns: errors by those of the unbent shots of the same frame, of
colours nobody photographed against the camera's truth and as held out (mean RGB; of the S40 mean ΔE00), render and
linearize; by how many stops the falloff in the corners is off; shots of which a note complains; the distortion told.
Half a minute a row.
LUTFORGE_TEST_DATA has the shots of the Canon S40.
"""

import argparse
import math
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
from lutforge.evaluation.errors_table import ErrorFigures
from lutforge.model.falloff import Falloff
from lutforge.pipeline.sampling import SampledShots, sample_shots
from lutforge.shots.geometry import Distortion
from lutforge.shots.read import read_shot
from lutforge.simulate.camera import nikon_d5100
from lutforge.simulate.demo import SHOTS
from lutforge.simulate.photograph import CameraSettings, photograph
from lutforge.simulate.scene import SCENES, Scene, palette
from tests.benchmarks.common import chosen, heading, real_data, row

SHAPE = (808, 1216)
RADIUS = math.hypot(*SHAPE) / 2
FALLOFF = Falloff((0.3, 0.3, 0.2))
LENSES = {
    "none": (0.0,) * 6,
    **{f"k = {k:+.2f}": (k, *(0.0,) * 5) for k in (-0.02, 0.02, -0.06, 0.06, -0.10, -0.15)},
    "moustache": (-0.08, 0.07, 0.0, 0.0, 0.0, 0.0),
    "centre off by 3 %": (-0.06, 0.0, 0.03, -0.02, 0.0, 0.0),
    "fringes of 0.2 %": (0.0, 0.0, 0.0, 0.0, 0.002, -0.001),
}
"""k1, k2, the centre off the middle by shares of half the diagonal, red and blue."""
CROPS = {
    "16:9": (slice(62, 737), slice(0, 1200)),
    "3:2": (slice(4, 804), slice(8, 1208)),
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


def held_out(shots: list[Path]) -> tuple[SampledShots, lf.CameraProfile, dict[str, ErrorFigures]]:
    """Samples of shots, the profile of these, and its held-out errors by direction."""
    sampled = sample_shots(shots)
    profile = lf.calibrate(sampled.samples)
    rows = lf.evaluate(profile, sampled.samples).rows
    whole = {str(row.direction): row.figures for row in rows if row.shot == "all" and row.method == "lattice"}
    return sampled, profile, whole


def corner(profile: lf.CameraProfile) -> float:
    """The falloff in the corners, in stops."""
    return max((each.corner_ev for each in profile.falloffs), default=0.0)


def figures(folder: Path, falloff: Falloff | None) -> tuple[Array, float, int, str]:
    """The errors (4,), by how much the falloff is off, the shots complained of, and what is told of the first shot."""
    camera, shots = nikon_d5100(), sorted(folder.glob("*.dng"))
    sampled, profile, whole = held_out(shots)
    errors = []
    for style in ("standard", "vivid"):
        exposed = camera.expose(palette(400, np.random.default_rng(9)), "daylight")
        raw = np.concatenate([exposed, exposed / 2, exposed / 4])
        jpeg = camera.render(raw, style, "daylight")
        inside = ((jpeg > 0.02) & (jpeg < 0.98)).all(axis=1) & (raw < 0.98).all(axis=1)
        render, linearize = profile.render(f"{style}/daylight"), profile.linearize(f"{style}/daylight")
        pairs = ((render(raw), jpeg), (linearize(jpeg), raw))
        errors.append([np.linalg.norm(got - true, axis=1)[inside].mean() for got, true in pairs])
    off = corner(profile) - (0.0 if falloff is None else falloff.corner_ev)
    names = {str(name) for name in np.unique(sampled.samples.shot)}
    accused = sum(name in note for name in names for note in profile.notes if "one shot only" not in note)
    means = np.array([*np.mean(errors, axis=0), whole["render"].mean, whole["linearize"].mean])
    return means, off, accused + len(sampled.left_out), read_shot(shots[1]).lens_note


def simulated(only: list[str]) -> Iterator[tuple[str, Array, float, int, str]]:
    """The demo's shots through each lens, without and with falloff, and cropped."""
    cases = [(lens, "", falloff) for falloff in (None, FALLOFF) for lens in LENSES]
    cases += [(lens, crop, None) for crop in CROPS for lens in ("none", "k = -0.06")]
    references: dict[object, Array] = {}
    for lens, crop, falloff in cases:
        name = ", ".join(filter(None, ["simulated", lens, crop, "falloff" if falloff else ""]))
        if lens == "none" or chosen(name, only):
            with tempfile.TemporaryDirectory() as folder:
                take(Path(folder), lens, falloff, crop)
                errors, stops, accused, note = figures(Path(folder), falloff)
            yield name, errors / references.setdefault((crop, falloff), errors), stops, accused, note


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
            sampled, profile, whole = held_out(shots)
            notes = [read_shot(shot).lens_note for shot in shots]
        delta = whole["render"].de00_mean
        errors = np.array([np.nan, np.nan, np.nan if delta is None else delta, whole["linearize"].mean])
        reference = errors if k in (None, 0.0) else reference
        name = "S40, as it is" if k is None else f"S40, k = {k:+.2f}"
        assert reference is not None
        told = f"{sum(map(bool, notes))} told; {notes[0]}"
        yield name, errors / reference, corner(profile), len(sampled.left_out), told


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
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", nargs="+", default=[], metavar="WORD", help="the rows whose names hold a word")
    only, data = parser.parse_args().only, real_data()
    heading("lens", "truth", "held out", "falloff off by, EV", "accused", "told")
    for rows in (s40(data) if data and chosen("S40", only) else (), () if only == ["S40"] else simulated(only)):
        for name, ratios, stops, accused, note in rows:
            truth, held = (f"{first:.3f}, {second:.3f}" for first, second in ratios.reshape(2, 2))
            row(name, truth, held, stops, str(accused), note, places=3)


if __name__ == "__main__":
    main()
