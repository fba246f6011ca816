"""The response of two cameras from exposure brackets without RAW: a digital camera's JPEGs, and scans of film.

    LUTFORGE_TEST_DATA=FOLDER python examples/06_response_from_a_bracket.py OUTPUT_FOLDER

FOLDER holds brackets/nikon_e995_window (exposures in EXIF) and brackets/debevec_memorial (exposures in a list).
"""

import os
import sys
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import lutforge as lf

folder = Path(sys.argv[1] if len(sys.argv) > 1 else "example_06")
data = Path(os.environ.get("LUTFORGE_TEST_DATA", "")) / "brackets"
if not data.is_dir():
    sys.exit("set LUTFORGE_TEST_DATA to the folder that holds brackets, photographs at several exposures")

window = lf.response(sorted((data / "nikon_e995_window").glob("*.jpg"))).fit

listed = [line.split() for line in (data / "debevec_memorial" / "image_list.txt").read_text().splitlines()]
church = [(data / "debevec_memorial" / words[0], float(words[1])) for words in listed if words[0].endswith(".png")]
# Tungsten light on daylight film: nothing is near neutral, so all colours count.
times = [seconds for _, seconds in church]
memorial = lf.response([path for path, _ in church], exposure_s=times, all_colours=True).fit

figure = Figure(figsize=(10, 4.5), layout="constrained")
for axis, name, fit in zip(figure.subplots(1, 2), ("Nikon E995", "film, scanned"), (window, memorial), strict=True):
    ends = f"{255 * fit.black.max():.0f} to {255 * fit.white.min():.0f}"
    print(f"{name}: {fit.pairs} pairs; JPEG values follow the exposure from {ends}")
    off = max(fit.exposure_error.values(), key=lambda ratio: abs(np.log(ratio)))
    print(f"  exposure furthest from what is stated: {100 * (off - 1):+.1f} %")
    for curve in fit.curves:
        print(
            f"  {curve.name:16} next exposure predicted to {curve.median:4.1f} codes (median), {curve.rms:4.1f} (RMS)"
        )
        linear = curve.response.inverse[:, 1]
        codes = np.linspace(0, 255, len(linear))
        shown = (codes > 255 * fit.black[1] + 8) & (
            codes < 255 * fit.white[1] - 8
        )  # the scale is not determined: 1 here
        axis.semilogy(codes[shown], linear[shown] / linear[shown][-1], label=curve.name)
    axis.set(title=f"{name}, green", xlabel="JPEG value", ylabel="light, relative")
    axis.legend()
folder.mkdir(parents=True, exist_ok=True)
figure.savefig(folder / "response.png")
