"""From RAW files to LUT files, in Python: photograph, sample, calibrate, bake, and read the files back.

    python examples/01_calibrate_and_bake.py OUTPUT_FOLDER

The shots are made by the simulated camera; give your own RAW files to `lf.sample` instead.
"""

import sys
from pathlib import Path

import lutforge as lf
from lutforge.cli.demo_shots import demo_shots

folder = Path(sys.argv[1] if len(sys.argv) > 1 else "example_01")

shots = demo_shots(folder / "shots").calibration
samples = lf.sample(shots)
print(f"{len(samples)} samples of {len(set(samples.shot))} shots")

profile = lf.calibrate(samples, lf.CalibrationOptions(size=17))
profile.save(folder / "camera.npz")
for name, style in profile.styles.items():
    render_error, linearize_error = style.errors["render_mean"], style.errors["linearize_mean"]
    print(f"{name}: held-out error of render {render_error:.4f}, of linearize {linearize_error:.4f}")

# The camera's look as a LUT: RAW in, JPEG out. The white balance is a gain in front; all share one cube.
render = profile.render("vivid/daylight")
for file in ("vivid.clf", "vivid.resolve.cube", "vivid.cube"):
    lut = lf.bake(render, folder / file, title="Vivid, daylight")  # to the form that this file can hold
    print(lut.files[0])
