"""A camera model that the thesis's authors published (Nikon D40), as LUTs and as OpenColorIO colour spaces.

    python examples/03_published_model.py OUTPUT_FOLDER MODELS

MODELS is a folder of models of one camera, such as img_pipe/camera_models/NikonD40 of github.com/cucapra/approx-vision.
"""

import sys
from pathlib import Path

import numpy as np

import lutforge as lf
from lutforge.model.published_model import read_published_model

if len(sys.argv) != 3:
    sys.exit("name a folder for the output, and the folder that holds the models")
folder = Path(sys.argv[1])
models = sorted(path.parent for path in Path(sys.argv[2]).glob("*/raw2jpg_coefs.txt"))

profile = lf.import_published(models, "Nikon D40")
print("white balances:", ", ".join(profile.white_balances))

# The model reproduces the colours that it was measured from.
pairs = read_published_model(models[-1])
render = profile.render("standard/daylight")
error = render(pairs.balanced / profile.multipliers("standard/daylight")) - pairs.encoded
print(f"its {len(error)} measured colours: mean error {np.linalg.norm(error, axis=1).mean() * 255:.2f} codes")

lut = lf.bake(profile.refinish("standard/tungsten", "standard/daylight"), size=33)
lut.write(folder / "tungsten_to_daylight.clf")
print(lut)
spaces = lf.build_config([profile]).getColorSpaceNames()
print("as colour spaces:", ", ".join(name for name in spaces if "standard" in name))
