"""Make the README's pictures of the five jobs, with a simulated camera of known truth.

    python examples/pictures/make_pictures.py WORK_FOLDER

Photographs and profiles go to WORK_FOLDER, the pictures beside this file. `make demo` makes refinish.png.
"""

import sys
from pathlib import Path

import numpy as np
import PyOpenColorIO as OCIO  # noqa: N814 - the name that its documentation uses
from matplotlib.image import imsave
from numpy.typing import NDArray

import lutforge as lf
from lutforge.cli.demo_shots import DemoShots, demo_shots
from lutforge.images.raw import read_raw
from lutforge.images.read import read_image
from lutforge.model.camera_profile import CameraProfile
from lutforge.simulate.camera import SimulatedCamera, nikon_d5100

Pixels = NDArray[np.floating]

HERE = Path(__file__).parent
SHRUNK = 3
"""Pixels of a photograph, per axis, to one of a picture."""


def calibrated(camera: SimulatedCamera, folder: Path) -> tuple[DemoShots, CameraProfile]:
    """Photograph with a camera, and return the shots and a profile of them."""
    shots = demo_shots(folder, camera=camera)
    return shots, lf.calibrate(lf.sample(shots.calibration), lf.CalibrationOptions(size=17))


def encoded(linear: Pixels) -> Pixels:
    """Linear sRGB (…, 3) as a screen shows it."""
    clipped = np.clip(linear, 0.0, 1.0)
    return np.where(clipped <= 0.0031308, 12.92 * clipped, 1.055 * clipped ** (1 / 2.4) - 0.055)


def strip(name: str, *panels: Pixels) -> None:
    """Write panels (height, width, 3) side by side, shrunk, with a white gap between them."""
    small = []
    for panel in panels:
        height, width = (size - size % SHRUNK for size in panel.shape[:2])
        blocks = panel[:height, :width].reshape(height // SHRUNK, SHRUNK, width // SHRUNK, SHRUNK, 3)
        small.append(np.clip(blocks.mean(axis=(1, 3)), 0.0, 1.0))
    gap = np.ones((small[0].shape[0], 8, 3))
    row = [part for panel in small for part in (panel, gap)][:-1]
    picture = np.rint(255 * np.concatenate(row, axis=1)).astype(np.uint8)
    imsave(HERE / f"{name}.jpg", picture, pil_kwargs={"quality": 92})


def main() -> None:
    """Make render.jpg, linearize.jpg and views.jpg."""
    work = Path(sys.argv[1] if len(sys.argv) > 1 else "pictures")
    shots, profile = calibrated(nikon_d5100(), work / "shots")
    setting = shots.target

    finished = read_image(shots.wanted).pixels
    raw = read_raw(shots.held_out.dng).pixels * 2.0**shots.ev
    top, left = ((a - b) // 2 for a, b in zip(raw.shape[:2], finished.shape[:2], strict=True))
    raw = np.clip(raw[top : top + finished.shape[0], left : left + finished.shape[1]], 0.0, 1.0)
    strip("render", raw, lf.bake(profile.render(setting), size=33)(raw), finished)

    light = profile.linearize(setting, "linear-srgb")(finished)
    strip("linearize", finished, light, raw * profile.multipliers(setting) @ profile.matrix.T)

    scene = profile.linearize(setting, "acescg")(finished)
    config = OCIO.Config.CreateFromFile(str(lf.write_config([profile], work / "ocio", replace=True)))
    seen = []
    for style in profile.styles:
        pixels = np.ascontiguousarray(scene, dtype=np.float32)
        view = OCIO.DisplayViewTransform(src="ACEScg", display="sRGB - Display", view=f"{profile.camera} {style}")
        config.getProcessor(view).getDefaultCPUProcessor().applyRGB(pixels)
        seen.append(pixels)
    strip("views", encoded(light), *seen)


if __name__ == "__main__":
    main()
