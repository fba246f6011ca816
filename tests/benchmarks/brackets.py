"""What a bracket of JPEGs tells of a camera without RAW: its response, its shutter, and whether it adapts to the scene.

    python -m tests.benchmarks.brackets [draws]

Prints, for eight simulated responses with noise, clipping and a shutter that is 3 % off, the worst of some draws; the
errors on two real brackets, where LUTFORGE_TEST_DATA names their folder; then how often cameras that adapt are told, by
the size of what they do, and how often fixed ones are accused.
"""

import os
import sys
from pathlib import Path

import numpy as np

from lutforge.calibration.physical.bracket import BracketFit, fit_bracket
from lutforge.calibration.physical.exposure_pairs import pairs_of_bracket
from lutforge.pipeline.response import response
from tests.cases.brackets import ADAPTATIONS, CURVES, adapted, bracket, errors_of


def _fit(times: list[float], images: list[np.ndarray]) -> BracketFit:
    return fit_bracket(pairs_of_bracket([f"{time:g}" for time in times], images, times))


def simulated(draws: int) -> None:
    """The worst errors of each response over draws."""
    print("| response | held-out, codes | f⁻¹(255) | f⁻¹(20) | shutter |\n|---|---|---|---|---|")
    for name, curve in CURVES.items():
        rows = []
        for seed in range(draws):
            times, errors, images = bracket(curve, seed=seed)
            fit = _fit(times, images)
            off = errors_of(fit, curve, times, errors)
            rows.append((fit.held_out, off.white, off.dark, off.shutter))
        held_out, white, dark, shutter = np.max(rows, axis=0)
        print(f"| {name} | {held_out:.2f} | {white:.1%} | {dark:.1%} | {shutter:.2%} |", flush=True)


def real(folder: Path) -> None:
    """Errors on brackets of a digital camera, and of scanned film."""
    film = folder / "debevec_memorial"
    lines = [line.split() for line in (film / "image_list.txt").read_text().splitlines() if line[0] not in "#\n"]
    fits = {
        "Nikon E995": response(sorted((folder / "nikon_e995_window").glob("*.jpg"))).fit,
        "film": response(
            [film / words[0] for words in lines], exposure_s=[float(words[1]) for words in lines], all_colours=True
        ).fit,
    }
    print(
        "\n| bracket | next exposure as stated, codes | held-out | own curves of shots | fixed |\n|---|---|---|---|---|"
    )
    for name, fit in fits.items():
        verdict = f"{fit.verdict.own_curves:.1%} | {'yes' if fit.verdict.fixed else 'no'}"
        print(f"| {name} | {fit.curves[0].median:.2f} | {fit.held_out:.2f} | {verdict} |")


def verdicts(draws: int) -> None:
    """How often a camera is said to adapt."""
    print("\n| camera | moves a code of the median shot by | own curves: least, median, most | said to adapt |")
    print("|---|---|---|---|")
    for kind, sizes in {"fixed": (0.0,), **dict.fromkeys(ADAPTATIONS, (0.05, 0.1, 0.2))}.items():
        for size in sizes:
            shares, moved, told = [], [], []
            for curve in CURVES.values():
                for seed in range(draws):
                    times, _, images = bracket(curve, cells=28, seed=seed)
                    seen = adapted(kind, size, images) if size else images
                    moved.append(np.median([np.abs(one - was).max() for one, was in zip(seen, images, strict=True)]))
                    verdict = _fit(times, seen).verdict
                    shares.append(verdict.own_curves)
                    told.append(not verdict.fixed)
            spread = ", ".join(f"{value:.1%}" for value in (min(shares), np.median(shares), max(shares)))
            print(
                f"| {kind} {size or ''} | {255 * np.median(moved):.1f} | {spread} | {sum(told)} of {len(told)} |",
                flush=True,
            )


if __name__ == "__main__":
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 1
    simulated(count)
    if "LUTFORGE_TEST_DATA" in os.environ:
        real(Path(os.environ["LUTFORGE_TEST_DATA"]) / "brackets")
    verdicts(count)
