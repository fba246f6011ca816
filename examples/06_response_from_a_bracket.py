"""The response of a camera from photographs of one still scene at several exposures, without RAW.

    python examples/06_response_from_a_bracket.py OUTPUT_FOLDER PICTURES

PICTURES is a folder of JPEGs that state their exposures (EXIF). Where they do not, give these to `lf.response`
(exposure_s); where nothing in the scene is near neutral, all colours (all_colours).
"""

import sys
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import lutforge as lf

if len(sys.argv) != 3:
    sys.exit("name a folder for the output, and the folder that holds the pictures")
folder, fitted = Path(sys.argv[1]), lf.response(sys.argv[2])
fit, name = fitted.fit, fitted.profile.camera

figure = Figure(figsize=(6, 4.5), layout="constrained")
axis = figure.subplots()
print(f"{name}: {fit.pairs} pairs; JPEG values follow the exposure from {255 * fit.black.max():.0f} to "
      f"{255 * fit.white.min():.0f}")  # fmt: skip
off = max(fit.exposure_error.values(), key=lambda ratio: abs(np.log(ratio)))
print(f"  exposure furthest from what is stated: {100 * (off - 1):+.1f} %")
for curve in fit.curves:
    print(f"  {curve.name:16} next exposure predicted to {curve.median:4.1f} codes (median), {curve.rms:4.1f} (RMS)")
    linear = curve.response.inverse[:, 1]
    codes = np.linspace(0, 255, len(linear))
    shown = (codes > 255 * fit.black[1] + 8) & (codes < 255 * fit.white[1] - 8)
    axis.semilogy(codes[shown], linear[shown] / linear[shown][-1], label=curve.name)  # the scale is not determined
axis.set(title=f"{name}, green", xlabel="JPEG value", ylabel="light, relative")
axis.legend()
folder.mkdir(parents=True, exist_ok=True)
figure.savefig(folder / "response.png")
