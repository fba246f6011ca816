"""Use a generated OpenColorIO config: from PyOpenColorIO, and by oiiotool on a photograph.

python examples/04_open_color_io.py OUTPUT_FOLDER
"""

import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import PyOpenColorIO as OCIO  # noqa: N814 - the name that its documentation uses

import lutforge as lf
from lutforge.cli.demo_shots import demo_shots

folder = Path(sys.argv[1] if len(sys.argv) > 1 else "example_04")

shots = demo_shots(folder / "shots")
standard = [shot for shot in shots.calibration if "standard" in shot.name]
profile = lf.calibrate(lf.sample(standard), lf.CalibrationOptions(size=17))
path = lf.write_config([profile], folder / "ocio", replace=True).path

config = OCIO.Config.CreateFromFile(str(path))
camera = profile.camera
source, target = f"{camera} JPEG standard tungsten", f"{camera} JPEG standard daylight"

# From one of the camera's settings to another is a refinish; to ACEScg it is a linearization.
pixels = np.array([[0.2, 0.4, 0.8]], dtype=np.float32)
config.getProcessor(source, target).getDefaultCPUProcessor().applyRGB(pixels)
print("refinished by the config:", np.round(pixels[0], 3), "by the model:",
      np.round(profile.refinish("standard/tungsten", "standard/daylight")([0.2, 0.4, 0.8]), 3))  # fmt: skip

oiiotool = shutil.which("oiiotool", path=str(Path(sys.executable).parent)) or shutil.which("oiiotool")
if oiiotool:
    command = [oiiotool, "--colorconfig", str(path), str(shots.held_out.jpeg),
               "--colorconvert", source, "ACEScg", "-o", str(folder / "scene_linear.exr")]  # fmt: skip
    subprocess.run(command, check=True)
    print("oiiotool wrote", folder / "scene_linear.exr")
