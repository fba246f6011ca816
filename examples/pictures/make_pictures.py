"""Make the README's pictures of the five jobs, of what `lutforge demo` made, with a simulated camera of known truth.

    lutforge demo -o demo
    python examples/pictures/make_pictures.py demo

The pictures go beside this file; refinish.png is the demo's own.
"""

import shutil
import sys
from pathlib import Path

import numpy as np
import PyOpenColorIO as OCIO  # noqa: N814 - the name that its documentation uses
from matplotlib.image import imsave
from numpy.typing import NDArray

import lutforge as lf
from lutforge.images.raw import read_raw
from lutforge.images.read import read_image

Pixels = NDArray[np.floating]

HERE = Path(__file__).parent
SETTING, EV = "vivid/daylight", 0.7
"""What the demo's photograph should have been taken with, and the stops that it lacks."""
SHRUNK = 3
"""Pixels of a photograph, per axis, to one of a picture."""


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
    """Make render.jpg, linearize.jpg and views.jpg, and copy refinish.png."""
    demo = Path(sys.argv[1] if len(sys.argv) > 1 else "demo")
    profile = lf.load_profile(demo / "camera.npz")
    shutil.copyfile(demo / "refinish.png", HERE / "refinish.png")

    finished = read_image(demo / "shots" / "held-out" / "wanted.JPG").pixels
    raw = read_raw(demo / "shots" / "held-out" / "held-out.dng").pixels * 2.0**EV
    top, left = ((a - b) // 2 for a, b in zip(raw.shape[:2], finished.shape[:2], strict=True))
    raw = np.clip(raw[top : top + finished.shape[0], left : left + finished.shape[1]], 0.0, 1.0)
    strip("render", raw, lf.bake(profile.render(SETTING), size=33)(raw), finished)

    # The RAW with white balance: what one channel clipped is white, as RAW developers show it, and not magenta
    gain = profile.multipliers(SETTING)
    scene = np.minimum(raw * gain, gain.min()) @ profile.matrix.T
    linear = profile.linearize(SETTING, "linear-srgb")(finished)
    strip("linearize", finished, encoded(linear), encoded(scene))

    scene = profile.linearize(SETTING, "acescg")(finished)
    config = OCIO.Config.CreateFromFile(str(demo / "ocio" / "config.ocio"))
    seen = []
    for style in profile.styles:
        pixels = np.ascontiguousarray(scene, dtype=np.float32)
        view = OCIO.DisplayViewTransform(src="ACEScg", display="sRGB - Display", view=f"{profile.camera} {style}")
        config.getProcessor(view).getDefaultCPUProcessor().applyRGB(pixels)
        seen.append(pixels)
    strip("views", encoded(linear), *seen)


if __name__ == "__main__":
    main()
