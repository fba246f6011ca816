"""A camera model that the thesis's authors published (Nikon D40), as LUTs and as OpenColorIO colour spaces.

    LUTFORGE_TEST_DATA=FOLDER python examples/03_published_model.py OUTPUT_FOLDER

FOLDER holds nus_nikon_d40/{fluorescent,other_white_balances}.
"""

import os
import sys
from pathlib import Path

import numpy as np

import lutforge as lf
from lutforge.model.published_model import read_published_model

folder = Path(sys.argv[1] if len(sys.argv) > 1 else "example_03")
data = Path(os.environ.get("LUTFORGE_TEST_DATA", "")) / "nus_nikon_d40"
if not data.is_dir():
    sys.exit("set LUTFORGE_TEST_DATA to the folder that holds nus_nikon_d40, the authors' model of a Nikon D40")

profile = lf.import_published([data / "fluorescent", data / "other_white_balances"], "Nikon D40")
print("white balances:", ", ".join(profile.white_balances))

# The model reproduces the colours that it was measured from.
pairs = read_published_model(data / "other_white_balances")
render = profile.render("standard/daylight")
error = render(pairs.balanced / profile.multipliers("standard/daylight")) - pairs.encoded
print(f"its {len(error)} measured colours: mean error {np.linalg.norm(error, axis=1).mean() * 255:.2f} codes")

lut = lf.bake(profile.refinish("standard/tungsten", "standard/daylight"), size=33)
lut.write(folder / "tungsten_to_daylight.clf")
print(lut)
spaces = lf.build_config([profile]).getColorSpaceNames()
print("as colour spaces:", ", ".join(name for name in spaces if "standard" in name))
