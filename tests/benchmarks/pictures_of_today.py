"""Refinished pictures of a simulated camera: the demo's photograph with its blue ball, and all pairs of settings."""

from pathlib import Path

import numpy as np
from scipy import ndimage

import lutforge as lf
from lutforge.arrays import Mask
from lutforge.colour.srgb import delta_e_2000
from lutforge.images.read import read_image
from lutforge.simulate.camera import nikon_d5100
from lutforge.simulate.demo import HELD_OUT, demo_shots
from lutforge.simulate.scene import SCENES
from tests.benchmarks import refinish_table
from tests.benchmarks.rows_of_today import Row, Rows


def demo_picture(keep: Path) -> Rows:
    """The demo's graded photograph beside what the camera makes with the wanted settings; its ball is a strong blue."""
    shots = demo_shots(keep / "demo")
    profile = lf.calibrate(lf.sample(list(shots.calibration)))
    assert shots.held_out.jpeg is not None
    before, wanted = (
        read_image(path).pixels[..., :3].astype(np.float64) for path in (shots.held_out.jpeg, shots.wanted)
    )
    after = np.rint(255 * np.clip(profile.refinish(shots.source, shots.target, shots.ev)(before), 0, 1)) / 255
    ball = _blue_ball(wanted.shape[:2])
    yield Row("demo, blue ball: mean ΔE00", float(delta_e_2000(after[ball], wanted[ball]).mean()), 4.0)
    usable = ((before > 0) & (before < 1) & (wanted > 0) & (wanted < 1)).all(axis=-1)
    yield Row("demo, graded picture: RMSE", float(np.sqrt(np.mean((after - wanted)[usable] ** 2))), 0.0173)


def _blue_ball(shape: tuple[int, int]) -> Mask:
    """Return the mask of the ball in the demo's photograph of this shape: the largest blue part of its scene."""
    surface = SCENES[HELD_OUT.scene](808, 1216, HELD_OUT.seed).first
    top, left = ((length - inner) // 2 for length, inner in zip(surface.shape, shape, strict=True))
    parts, _ = ndimage.label(surface[top : top + shape[0], left : left + shape[1]] == 12)  # "blue" of the chart
    return np.asarray(parts == 1 + np.argmax(np.bincount(parts.ravel())[1:]))


def refinished_pairs(keep: Path) -> Rows:
    """The 132 pairs of settings of `refinish_table`, calibrated from 144 shots: RMSE of the means of tiles."""
    camera, folder = nikon_d5100(), keep / "refinish"
    profile = refinish_table.calibrated(camera, folder)
    found = refinish_table.errors(camera, profile, refinish_table.held_out(camera, profile, folder))
    tiles = np.array([figures[0] for figures in found.values()])
    yield Row("refinish, 144 shots: worst of 132 pairs", float(tiles.max()), 0.012)
    yield Row("refinish, 144 shots: second worst pair", float(np.sort(tiles)[-2]), 0.012)
