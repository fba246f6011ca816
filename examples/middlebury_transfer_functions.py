"""Is the response a fixed property of a camera? Brightness transfer functions of ten cameras (thesis, chapter 3).

Writes a table as Markdown to standard output and, where a folder is given, one plot a camera into it.

    python examples/middlebury_transfer_functions.py [FOLDER] > examples/middlebury_transfer_functions.md
"""

import sys
from collections.abc import Mapping
from pathlib import Path
from textwrap import fill

import numpy as np
from matplotlib.figure import Figure
from middlebury_table import read_patches, unclipped

from lutforge.calibration.brightness_transfer import TransferFunction, transfer_functions
from lutforge.calibration.pairs_of_samples import pairs_of_samples
from lutforge.calibration.response_verdict import ResponseVerdict, judge

NOTES = """Made by `examples/middlebury_transfer_functions.py` from the photographs named in middlebury_table.md: pairs
of one chart at two exposures, both lights. A colour is an outlier where it leaves the camera's common function by more
than three codes in any channel; R, G, B are the channels in which it does. The shift is the median departure of
unsaturated colours in the pairs of the worst shot, in the middle one of its channels; a shutter 5 % off shifts middle
grey by three codes. RAW departs from one ratio a pair of shots by the share given (median of the worst pair), noise
and 8 bits included.
"""


def plot(camera: str, function: TransferFunction, path: Path) -> None:
    """JPEG and RAW of one exposure ratio: colours that follow the common function, outliers, and the function."""
    figure = Figure(figsize=(14, 4.2), layout="constrained")
    panels = figure.subplots(1, 4)
    codes, ratio = np.linspace(0, 255, 256), 2**function.stops
    for channel, name in enumerate(("red", "green", "blue")):
        x, y = 255 * function.first[:, channel], 255 * function.second[:, channel]
        axis = panels[channel]
        axis.plot(codes, 255 * function.curve[:, channel], color="0.6", label="common function")
        axis.plot(x[~function.outlier], y[~function.outlier], ".", color=name, label="follows it")
        axis.plot(
            x[function.outlier], y[function.outlier], "o", color=name, fillstyle="none", markersize=5, alpha=0.6,
            label="outlier in any channel",
        )  # fmt: skip
        axis.set(title=name, xlabel="JPEG value", xlim=(0, 255), ylim=(0, 255), aspect="equal")
        panels[3].plot(function.raw_first[:, channel], function.raw_second[:, channel], ".", color=name)
    panels[0].set_ylabel(f"JPEG value, exposure ×{ratio:.2f}")
    panels[1].legend(loc="lower right", fontsize=8)
    top = float(np.nanmax(function.raw_second)) * 1.05
    panels[3].plot([0, top / ratio], [0, top], color="0.6")
    panels[3].set(title="RAW, three channels", xlabel="RAW value", ylabel=f"RAW value, exposure ×{ratio:.2f}")
    panels[3].set(xlim=(0, top / ratio), ylim=(0, top))
    figure.suptitle(f"{camera}: brightness transfer")
    figure.savefig(path, dpi=90)


def answer(verdicts: Mapping[str, ResponseVerdict]) -> str:
    """Is the response a fixed property of a camera? In figures."""
    shifts = {camera: 255 * verdict.shift for camera, verdict in verdicts.items()}
    fixed = [camera for camera, verdict in verdicts.items() if verdict.fixed]
    near = [camera for camera, shift in shifts.items() if camera not in fixed and shift <= 6]
    rest = [f"{camera} ({shift:.0f} codes)" for camera, shift in shifts.items() if camera not in (*fixed, *near)]
    moved = [verdict for verdict in verdicts.values() if verdict.outliers > 0]
    apart = sum(verdict.outlier_saturation > verdict.inlier_saturation for verdict in moved)
    others = " and ".join(rest) or "any other"
    return (
        f"Is the response a fixed property of the camera? Within 3 codes for {len(fixed)} of {len(verdicts)}, within 6 "
        f"for {len(fixed) + len(near)}; not for {others}, whose greys move from pair to pair. What leaves the common "
        f"function is more saturated than what follows it in {apart} of the {len(moved)} cameras that move any colour, "
        "most in blue or red, while RAW keeps one ratio: a map of colours, not another response."
    )


def main() -> None:
    """Print the table and the answer; write the plots."""
    samples = read_patches()
    head = ("camera", "pairs", "outliers", "R / G / B", "saturation of inliers", "of outliers", "worst shift, codes")
    print("# Brightness transfer functions of ten cameras\n")
    print(f"| {' | '.join((*head, 'RAW departs', 'fixed'))} |")
    print("|" + " --- |" * (len(head) + 2))
    verdicts = {}
    for camera in np.unique(samples.camera):
        own = samples.select(samples.camera == camera)
        pairs = pairs_of_samples(own.select(unclipped(own)))
        verdict = verdicts[str(camera)] = judge(pairs)
        channels = " / ".join(f"{100 * share:.0f} %" for share in verdict.outliers_by_channel)
        saturations = (verdict.inlier_saturation, verdict.outlier_saturation)
        chroma = " | ".join("–" if np.isnan(value) else f"{value:.2f}" for value in saturations)
        print(
            f"| {camera} | {len(pairs)} | {100 * verdict.outliers:.0f} % | {channels} | {chroma} "
            f"| {255 * verdict.shift:.1f} | {100 * verdict.raw_spread:.1f} % | {'yes' if verdict.fixed else 'no'} |"
        )
        if len(sys.argv) > 1:
            folder = Path(sys.argv[1])
            folder.mkdir(parents=True, exist_ok=True)
            function = max(transfer_functions(pairs), key=lambda one: len(one.first))
            plot(str(camera), function, folder / f"{camera}.png")
    print(f"\n{fill(answer(verdicts), 118)}\n\n{NOTES}", end="")


if __name__ == "__main__":
    main()
