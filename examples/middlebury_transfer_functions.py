"""Is the response a fixed property of a camera? Brightness transfer functions of ten cameras (thesis, chapter 3).

Writes a table as Markdown to standard output and, where a folder is given, one plot a camera into it.

    python examples/middlebury_transfer_functions.py [FOLDER] > examples/middlebury_transfer_functions.md
"""

import os
import sys
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from middlebury_table import read_patches, unclipped

from lutforge.calibration.brightness_transfer import TransferFunction, judge, transfer_functions
from lutforge.calibration.exposure_pairs import pairs_of_samples


def plot(camera: str, function: TransferFunction, path: Path) -> None:
    """JPEG and RAW of one exposure ratio: inliers, outliers, and the common function."""
    figure = Figure(figsize=(12, 4), layout="constrained")
    panels = figure.subplots(1, 4)
    codes = np.linspace(0, 255, 256)
    for channel, name in enumerate(("red", "green", "blue")):
        x, y = 255 * function.first[:, channel], 255 * function.second[:, channel]
        panels[channel].plot(codes, 255 * function.curve[:, channel], color="0.6")
        panels[channel].plot(x[~function.outlier], y[~function.outlier], ".", color=name)
        panels[channel].plot(x[function.outlier], y[function.outlier], "x", color="black", label="outlier")
        panels[channel].set(
            title=f"{name}, ×{2**function.stops:.2f}", xlabel="JPEG value", xlim=(0, 255), ylim=(0, 255)
        )
        panels[3].plot(function.raw_first[:, channel], function.raw_second[:, channel], ".", color=name)
    panels[3].set(title="RAW", xlabel="RAW value", xlim=(0, 0.5), ylim=(0, 1))
    figure.suptitle(camera)
    figure.savefig(path)


def main() -> None:
    """Print the table; write the plots."""
    root = os.environ.get("LUTFORGE_TEST_DATA")
    if not root or not (Path(root) / "middlebury_charts").is_dir():
        sys.exit("set LUTFORGE_TEST_DATA to the folder that holds middlebury_charts")
    samples = read_patches(Path(root) / "middlebury_charts")
    print(
        "| camera | pairs | outliers | R / G / B | saturation of inliers | of outliers | worst shift, codes | fixed |"
    )
    print("|" + " --- |" * 8)
    for camera in np.unique(samples.camera):
        own = samples.select(samples.camera == camera)
        pairs = pairs_of_samples(own.select(unclipped(own)))
        verdict = judge(pairs)
        outliers = f"{100 * verdict.outliers:.0f} %"
        channels = " / ".join(f"{100 * share:.0f} %" for share in verdict.outliers_by_channel)
        fixed = "yes" if verdict.fixed else "no"
        print(
            f"| {camera} | {len(pairs)} | {outliers} | {channels} | {verdict.inlier_saturation:.2f} "
            f"| {verdict.outlier_saturation:.2f} | {255 * verdict.shift:.1f} | {fixed} |"
        )
        if len(sys.argv) > 1:
            folder = Path(sys.argv[1])
            folder.mkdir(parents=True, exist_ok=True)
            function = max(transfer_functions(pairs), key=lambda one: len(one.first))
            plot(str(camera), function, folder / f"{camera}.png")


if __name__ == "__main__":
    main()
