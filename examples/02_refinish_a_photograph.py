"""Change a finished JPEG as if the camera had been set otherwise (thesis, chapter 6).

    python examples/02_refinish_a_photograph.py OUTPUT_FOLDER

The photograph was taken on tungsten in daylight, too dark, in the standard style. The camera itself says what it would
have made with the right settings, so that the result can be measured.
"""

import sys
from pathlib import Path

import numpy as np

import lutforge as lf
from lutforge.cli.demo_shots import demo_shots
from lutforge.grading.grade import LutRecipe
from lutforge.grading.image import apply_image
from lutforge.images.read import read_image

folder = Path(sys.argv[1] if len(sys.argv) > 1 else "example_02")

shots = demo_shots(folder / "shots")
profile = lf.calibrate(lf.sample(shots.calibration), lf.CalibrationOptions(size=17))

# "standard/tungsten" → "vivid/daylight", +0.7 EV; baked for readers that interpolate in tetrahedra.
refinish = profile.refinish(shots.source, shots.target, ev=shots.ev)
lut = lf.bake(refinish, size=33, interpolation="tetrahedral")
lut.write(folder / "refinish.clf")

spoilt = shots.held_out.jpeg
assert spoilt is not None
apply_image(LutRecipe(folder / "refinish.clf").grade(spoilt), spoilt, folder / "refinished.jpg")

wanted = read_image(shots.right).pixels
for name, path in (("as shot", spoilt), ("refinished", folder / "refinished.jpg")):
    difference = read_image(path).pixels - wanted
    print(f"{name}: RMSE {np.sqrt(np.mean(difference**2)):.4f} from what the camera would have made")
