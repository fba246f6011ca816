"""An input transform of a camera without RAW, from JPEGs of a colour chart at seven exposures.

    python examples/07_input_transform_from_a_chart.py OUTPUT_FOLDER

A simulated camera takes the photographs, so that what comes out can be compared with the truth.
"""

import sys
from pathlib import Path

import numpy as np
from PIL import Image

import lutforge as lf
from lutforge.colour.spectra import chart_reflectances
from lutforge.pipeline.input_transform import write_input_transform
from lutforge.samples.chart import chart_kind
from lutforge.simulate.camera import nikon_d5100

folder = Path(sys.argv[1] if len(sys.argv) > 1 else "example_07")
folder.mkdir(parents=True, exist_ok=True)
camera, kind = nikon_d5100(), chart_kind("classic")
centres = 60 * kind.centres.astype(int) + 90

files, seconds = [], [camera.nominal_exposure_s * 2.0**stop for stop in range(-4, 3)]
for number, time in enumerate(seconds):
    light = np.full((4 * 60 + 120, 6 * 60 + 120, 3), 0.01)
    for (x, y), patch in zip(
        60 * kind.centres + 60, camera.expose(chart_reflectances(), "daylight", time), strict=True
    ):
        light[int(y) - 25 : int(y) + 25, int(x) - 25 : int(x) + 25] = patch
    noise = 0.002 * np.sqrt(light) * np.random.default_rng(number).standard_normal(light.shape)
    files.append(folder / f"chart_{number}.jpg")
    codes = np.rint(255 * camera.render(np.clip(light + noise, 0, 1), "standard", "daylight")).astype(np.uint8)
    Image.fromarray(codes).save(files[-1], quality=95)

corners = 60 + 60 * kind.outline  # without these OpenCV looks for the chart
fitted = write_input_transform(files, folder / "camera.npz", kind, "5200K", corners, seconds, camera="Simulated phone")
for name, level in fitted.level.items():
    print(f"{name}: white beside the chart is {level:.3f} of the camera's white")

profile = fitted.profile
linearize = profile.linearize("standard/auto", space="aces2065-1")
lf.bake(linearize, size=33).write(folder / "input.clf")
greys = camera.render(camera.expose(chart_reflectances()[18:], "daylight"), "standard", "daylight")
found, true = linearize(greys)[:, 1], chart_reflectances()[18:].mean(axis=1)
print("reflectance of the greys, found and true:")
for one, other in zip(found * (true[2] / found[2]), true, strict=True):
    print(f"  {one:.3f}  {other:.3f}")
