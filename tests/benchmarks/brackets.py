"""How surely a bracket of JPEGs tells a camera that adapts to the scene, by what it does; fixed ones are not accused.

    python -m tests.benchmarks.brackets [draws]

Eight simulated responses with noise, clipping and a shutter that is 3 % off.
"""

import sys

import numpy as np

from lutforge.calibration.physical.bracket import fit_bracket
from lutforge.calibration.physical.response_from_exposures import pairs_of_bracket
from tests.benchmarks.common import heading, row
from tests.cases.brackets import ADAPTATIONS, CURVES, adapted, bracket


def main() -> None:
    """Print the table."""
    draws = int(sys.argv[1]) if len(sys.argv) > 1 else 1
    heading("camera", "moves a code of the median shot by", "own curves: least, median, most", "said to adapt")
    for kind, sizes in {"fixed": (0.0,), **dict.fromkeys(ADAPTATIONS, (0.05, 0.1, 0.2))}.items():
        for size in sizes:
            verdicts, moved = [], []
            for curve in CURVES.values():
                for seed in range(draws):
                    times, _, images = bracket(curve, cells=28, seed=seed)
                    seen = adapted(kind, size, images) if size else images
                    moved.append(np.median([np.abs(one - was).max() for one, was in zip(seen, images, strict=True)]))
                    fit = fit_bracket(pairs_of_bracket([f"{time:g}" for time in times], seen, times))
                    verdicts.append(fit.verdict)
            shares = [verdict.own_curves for verdict in verdicts]
            spread = ", ".join(f"{value:.1%}" for value in (min(shares), np.median(shares), max(shares)))
            told = sum(not verdict.fixed for verdict in verdicts)
            row(f"{kind} {size or ''}", f"{255 * np.median(moved):.1f}", spread, f"{told} of {len(verdicts)}")


if __name__ == "__main__":
    main()
