"""How often a picture's pixels tell its camera, style and white balance, and how often strangers are told from them.

    python -m tests.benchmarks.identify [pictures] [--folder DIR] [--calibrate] [--learn]

Pictures of two simulated sensors with four styles and six white balances, of scenes that no profile was calibrated
from, JPEG quality 85 to 95, any chroma subsampling, under the light that their white balance is made for; then pictures
by made-up cameras that no profile is of; then, where LUTFORGE_TEST_DATA is, the JPEGs of a Canon S40, each against a
profile of its other shots. Profiles are calibrated as users do, from RAW files and their previews. DIR keeps all files
for the next run (default: lutforge-identify in the folder for temporary files). --calibrate fits what each kind of
evidence is worth, and --learn the density of scene colours, both on made-up cameras that are not in the table.
"""

import argparse
import os
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType

import numpy as np
import rawpy
import scipy

import lutforge as lf
from lutforge.arrays import Array
from lutforge.identification.evidence import Explained, explain, read_evidence
from lutforge.identification.judgement import DEPARTURES, JudgementOptions, departed, judge
from lutforge.identification.scene_colours import palette, scene_coordinates
from lutforge.images.read import read_image
from lutforge.model.profile_file import save_profile
from lutforge.model.published_model import import_published
from lutforge.pipeline.identification import known_cameras
from lutforge.simulate.camera import (
    SimulatedCamera,
    SimulatedStyle,
    _build,
    nikon_d5100,
    sigma_sd_merrill,
)
from lutforge.simulate.gamut_map import SimulatedGamutMap, ToneResponse
from lutforge.simulate.photograph import CameraSettings, ExposureTags, Subsampling, develop, encode_jpeg, photograph
from lutforge.simulate.scenes import SCENES
from lutforge.simulate.sensor import capture
from tests.benchmarks.unseen_cameras import _sensor, unseen_camera

STYLES = ("standard", "vivid", "landscape", "portrait")
SHOTS = (
    ("wall", "daylight", "daylight", 1.3),
    ("wall", "daylight", "daylight", 0.35),
    ("wall", "tungsten", "tungsten", 1.0),
    ("still-life", "tungsten", "daylight", 0.7),
    ("wall", "shade", "shade", 1.2),
    ("still-life", "cloudy", "cloudy", 1.3),
    ("wall", "fluorescent", "fluorescent", 0.8),
    ("wall", "flash", "tungsten", 0.8),
    ("still-life", "flash", "flash", 1.0),
)
"""Calibration shots of each style: scene, dial, light, exposure."""


SUBSAMPLINGS: tuple[Subsampling, ...] = ("4:2:0", "4:2:2", "4:4:4")


@dataclass(frozen=True)
class Picture:
    """What was photographed: path, camera, style and white balance."""

    path: Path
    camera: str
    style: str
    white_balance: str


def with_portrait(camera: SimulatedCamera, warmth: float) -> SimulatedCamera:
    """The camera with a fourth style, soft and pale."""
    signal = camera.styles["standard"].gamut_map.signal
    soft = SimulatedGamutMap(signal, knee=0.62, onset=0.45, boost=0.25, turn=warmth - 0.1, bend=0.08)
    portrait = SimulatedStyle("portrait", soft, ToneResponse((0.29,) * 3, (0.92,) * 3))
    return replace(camera, styles=MappingProxyType({**camera.styles, "portrait": portrait}))


def made_up(seed: int) -> SimulatedCamera:
    """A camera with a sensor and four styles of its own."""
    rng = np.random.default_rng([seed, 909])
    camera = _build(f"Made-up {seed}", _sensor(rng))
    signal = camera.styles["standard"].gamut_map.signal
    styles = {}
    for name in STYLES:
        toe, shoulder = rng.uniform(0.17, 0.31), rng.uniform(0.88, 0.97)
        knee, onset, boost = rng.uniform(0.58, 0.72), rng.uniform(0.4, 0.5), rng.uniform(0, 0.9)
        turned = SimulatedGamutMap(signal, knee, onset, boost, rng.normal(0, 0.07), rng.uniform(-0.15, 0.15))
        styles[name] = SimulatedStyle(name, turned, ToneResponse((toe,) * 3, (shoulder,) * 3))
    return replace(camera, styles=MappingProxyType(styles))


def pictures(cameras: Sequence[SimulatedCamera], count: int, seed: int, folder: Path) -> list[Picture]:
    """Photograph scenes with cameras in turn, each with its styles in turn, white balance and exposure at random."""
    folder.mkdir(parents=True, exist_ok=True)
    made = []
    for number in range(count):
        rng = np.random.default_rng([seed, number])
        camera = cameras[number % len(cameras)]
        style = list(camera.styles)[number // len(cameras) % len(camera.styles)]
        balance = list(camera.white_balances)[int(rng.integers(len(camera.white_balances)))]
        kind = str(rng.choice(["wall", "still-life", "chart"], p=[0.45, 0.45, 0.1]))
        exposure, quality = float(2 ** rng.uniform(-1.0, 0.5)), int(rng.integers(85, 96))
        sampling = SUBSAMPLINGS[int(rng.choice(3, p=[0.5, 0.4, 0.1]))]
        path = folder / f"{number:03d}.jpg"
        made.append(Picture(path, camera.name, style, balance))
        if path.exists():
            continue
        scene = SCENES[kind](604, 916, 1000 * seed + number)
        time_s = camera.nominal_exposure_s * exposure
        mosaic = capture(camera, scene.irradiance(camera, balance, time_s), rng)
        developed = develop(camera, mosaic, CameraSettings(style, balance, time_s))
        tags = ExposureTags("", "", "", "", time_s, 100, 8.0, 0, 0)
        path.write_bytes(encode_jpeg(developed, tags, quality, sampling))
    return made


def profile_of(camera: SimulatedCamera, folder: Path) -> Path:
    """Calibrate a camera from shots of other scenes than the pictures'."""
    path = folder / f"{camera.model}.npz"
    if path.exists():
        return path
    with tempfile.TemporaryDirectory() as shots:
        files = [
            photograph(
                camera,
                SCENES[scene](608, 912, 500 + number),
                CameraSettings(style, dial, camera.nominal_exposure_s * exposure, preview_scale=1.0),
                shots,
                f"{style}{number}",
                jpeg_beside=False,
                light=light,
            ).dng
            for style in camera.styles
            for number, (scene, dial, light, exposure) in enumerate(SHOTS)
        ]
        lf.calibrate(lf.sample(files)).save(path)
    return path


def cameras_of_table() -> tuple[SimulatedCamera, SimulatedCamera]:
    """The two sensors of the table."""
    return with_portrait(nikon_d5100(), 0.0), with_portrait(sigma_sd_merrill(), 0.03)


def print_table(count: int, folder: Path) -> None:
    """The figures, with the limits that are wanted beside them."""
    cameras = cameras_of_table()
    known = known_cameras([profile_of(camera, folder) for camera in cameras])
    right = answered = right_answered = balance_right = 0
    began = time.process_time()
    made = pictures(cameras, count, 1, folder / "known")
    for picture in made:
        judgement = judge(read_evidence(picture.path), known.renderings)
        first = judgement.candidates[0]
        good = (first.camera, first.style) == (picture.camera, picture.style)
        own = next(c for c in judgement.candidates if (c.camera, c.style) == (picture.camera, picture.style))
        right += good
        answered += judgement.answer is not None
        right_answered += good and judgement.answer is not None
        balance_right += max(own.white_balances, key=lambda name: own.white_balances[name]) == picture.white_balance
    seconds = (time.process_time() - began) / len(made)
    strangers = [unseen_camera(200 + seed) for seed in range(max(count // 4, 1))]
    refused = sum(
        judge(read_evidence(picture.path), known.renderings).answer is None
        for picture in pictures(strangers, len(strangers), 2, folder / "strangers")
    )
    rows = [
        ("camera and style right, forced to answer", f"{right / len(made):.0%}", "95 %"),
        ("  answered", f"{answered / len(made):.0%}", ""),
        ("  right of those answered", f"{right_answered / answered:.0%}" if answered else "–", ""),
        ("white balance right, its camera and style given", f"{balance_right / len(made):.0%}", "85 %"),
        ("strangers told as cannot tell", f"{refused / len(strangers):.0%}", "90 %"),
        ("processor seconds a picture, two profiles", f"{seconds:.2f}", "0.4"),
    ]
    for name, value, limit in rows:
        print(f"{name:50s}{value:>8s}{limit:>8s}")
    print_s40(folder)


def print_s40(folder: Path) -> None:
    """The JPEGs inside the S40's RAW files, each against a profile of its other shots and four other cameras."""
    data = Path(os.environ.get("LUTFORGE_TEST_DATA", ""))
    shots = sorted((data / "canon_powershot_s40").glob("*.CRW"))
    if not shots:
        print("LUTFORGE_TEST_DATA names no folder with the Canon S40's files: left out")
        return
    others = [profile_of(camera, folder) for camera in (*cameras_of_table(), made_up(1))]
    published = folder / "d40.npz"
    if not published.exists():
        folders = sorted((data / "nus_nikon_d40").iterdir())
        save_profile(import_published(folders, "Nikon D40", "standard"), published)
    for shot in shots:
        own = folder / f"s40 without {shot.stem}.npz"
        if not own.exists():
            lf.calibrate(lf.sample([other for other in shots if other != shot])).save(own)
        with rawpy.imread(str(shot)) as raw:
            (folder / f"{shot.stem}.jpg").write_bytes(bytes(raw.extract_thumb().data))
        judgement = judge(
            read_evidence(folder / f"{shot.stem}.jpg"), known_cameras([own, published, *others]).renderings
        )
        print(f"{shot.name}: {judgement.lines()[0]}")


def explained_pictures(made: Sequence[Picture], profiles: Sequence[Path]) -> list[tuple[int, list[Explained]]]:
    """Of each picture the place of its true rendering, after the last where it has none, and what renderings explain.

    The last of these are those that stand for strangers, near the likeliest.
    """
    known = known_cameras(list(profiles)).renderings
    names = [(rendering.camera, rendering.style) for rendering in known]
    found, options = [], JudgementOptions()
    for picture in made:
        evidence = read_evidence(picture.path)
        told = [explain(evidence, rendering) for rendering in known]
        best = known[int(np.argmax([_score(each, _weights(options)) for each in told]))]
        told += [explain(evidence, departed(best, **departure)) for departure in DEPARTURES]
        truth = (picture.camera, picture.style)
        found.append((names.index(truth) if truth in names else len(names), told))
    return found


def _weights(options: JudgementOptions) -> Array:
    return np.array([options.noise, options.scene, options.reach])


def _score(told: Explained, weights: Array) -> float:
    noise = float(scipy.special.logsumexp(weights[0] * told.noise)) - np.log(len(told.noise))
    return float(noise + weights[1] * told.scene + weights[2] * told.reach)


def calibrate_options(folder: Path) -> None:
    """Print the factors of the evidence that make the truth likeliest, and what refuses nine strangers in ten."""
    cameras = [made_up(seed) for seed in (1, 2)]
    profiles = [profile_of(camera, folder) for camera in cameras]
    strangers = [unseen_camera(500 + seed) for seed in range(48)]
    own = explained_pictures(pictures(cameras, 64, 7, folder / "calibration"), profiles)
    other = explained_pictures(pictures(strangers, 48, 5, folder / "calibration strangers"), profiles)

    def surprise(logs: Array) -> float:
        shares = [
            scipy.special.log_softmax([_score(each, np.exp(logs)) for each in told[: -len(DEPARTURES)]])[truth]
            for truth, told in own
        ]
        return -float(np.mean(shares))

    found = scipy.optimize.minimize(surprise, [-2.5, 1.0, 1.0], method="Nelder-Mead", options={"maxiter": 200})
    noise, scene, reach = np.exp(found.x)
    # A picture is answered where the best profile outweighs all others and the strangers together.
    margins = []
    for _, told in other:
        scores = np.array([_score(each, _weights(JudgementOptions())) for each in told])
        scores -= scores.max()
        known, near = np.exp(np.sort(scores[: -len(DEPARTURES)])), np.exp(scores[-len(DEPARTURES) :]).sum()
        margins.append(np.log(max(known[-1] - known[:-1].sum(), 1e-12) / near))
    print(
        f"noise = {noise:.3f}, scene = {scene:.2f}, reach = {reach:.2f}; "
        f"with those in use strangers = {np.quantile(margins, 0.9):.2f}"
    )


def learn_scene_colours(folder: Path, output: Path) -> None:
    """Write the density of scene colours that pictures by made-up cameras show behind their true rendering."""
    made = [unseen_camera(500 + seed) for seed in range(120)]
    cameras = [camera for camera in made if hasattr(camera.styles["standard"].gamut_map, "inverse")]
    stops, share = np.linspace(-9.0, 1.0, 41), np.linspace(-1.2, 1.2, 97)
    density = np.zeros((40, 96, 96))
    for picture, camera in zip(pictures(cameras, len(cameras), 5, folder / "scenes"), cameras, strict=True):
        colours, counts = palette(read_image(picture.path).pixels)
        linear = camera.linearize(colours, "standard", (1.0, 1.0, 1.0)) @ camera.matrix.T
        weights = np.sqrt(counts) / np.sqrt(counts).sum()
        density += np.histogramdd(scene_coordinates(linear), (stops, share, share), weights=weights)[0]
    smooth = scipy.ndimage.gaussian_filter(density, (2.0, 1.5, 1.5))
    smooth = (smooth / smooth.sum() + 1e-3 / smooth.size).reshape(20, 2, 48, 2, 48, 2).sum(axis=(1, 3, 5))
    logs = np.log(smooth / smooth.sum() / (0.5 * 0.05**2))
    codes = np.rint((logs - logs.min()) / np.ptp(logs) * 255).astype(np.uint8)
    middles = [0.5 * (edges[:-2:2] + edges[2::2]) for edges in (stops, share)]
    np.savez_compressed(
        output, log_density=codes, stops=middles[0], share=middles[1], range=np.array([logs.min(), logs.max()])
    )


def main() -> None:
    """Print the table, or fit what it rests on."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("pictures", nargs="?", type=int, default=200)
    parser.add_argument("--folder", type=Path, default=Path(tempfile.gettempdir()) / "lutforge-identify")
    parser.add_argument("--calibrate", action="store_true")
    parser.add_argument("--learn", type=Path, metavar="FILE")
    words = parser.parse_args()
    words.folder.mkdir(parents=True, exist_ok=True)
    if words.learn is not None:
        learn_scene_colours(words.folder, words.learn)
    elif words.calibrate:
        calibrate_options(words.folder)
    else:
        print_table(words.pictures, words.folder)


if __name__ == "__main__":
    main()
