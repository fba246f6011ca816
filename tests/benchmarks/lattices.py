"""The lattice fit beside its peers on the Nikon D40's published pairs, 70 % of them fitted and 30 % predicted.

    python -m tests.benchmarks.lattices [--json FILE]

Errors are norms of the RGB difference, those of LutForge's lattices through their CLF files as OpenColorIO reads them.
Peers are uniform lattices and the thesis preset, radial basis functions, and camera-match (PyPI, the same paper), which
is left out where it is missing. Printed are medians of five splits and the least time of a fit; whether LutForge is
better than camera-match in every figure and size, and no slower, decides the exit status.
"""

import argparse
import importlib
import importlib.util
import json
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from lutforge.arrays import Array
from lutforge.calibration.options import CalibrationOptions
from lutforge.calibration.style import fit_lattices
from lutforge.luts.ocio_transforms import evaluate
from lutforge.luts.reading import trusted_processor
from lutforge.luts.sequence import Lut
from lutforge.luts.shaper import lattice_ops
from lutforge.thesis.calibrate import fit_lattices as fit_thesis
from lutforge.thesis.options import Options, ThesisOptions
from tests.benchmarks.common import heading, row
from tests.cases.real_data import radial_basis_functions, read_published_pairs, split
from tests.cases.samples import style_of

Predictor = Callable[[Array], Array]
Fit = Callable[[Array, Array], Predictor]

SIZES = (9, 13, 17, 24, 33)
SEEDS = (1, 2, 3, 4, 5)
REPEATS, LONG = 7, 1.0
"""Of a fit that is timed, the least counts: so many, but no more once they took so many seconds."""


def lattice(options: Options) -> Fit:
    """LutForge's fit, matrix and response included, through a CLF file."""

    def fit(x: Array, y: Array) -> Predictor:
        style = style_of(x, y)
        both = fit_thesis(style, options) if isinstance(options, ThesisOptions) else fit_lattices(style, options)
        fitted = both.render

        def predict(points: Array) -> Array:
            with tempfile.TemporaryDirectory() as folder:
                path = Path(folder) / "fitted.clf"
                Lut(lattice_ops(fitted)).write(path)
                return evaluate(trusted_processor(path, options.interpolation), points).astype(np.float64)

        return predict

    return fit


def camera_match(size: int) -> Fit:
    """camera-match's LUT3D with its own settings. Raises ImportError where it is missing."""
    lut3d = importlib.import_module("camera_match").LUT3D

    def fit(x: Array, y: Array) -> Predictor:
        node = lut3d(size=size)
        node.solve(x, y)
        return lambda points: np.asarray(node(points), dtype=np.float64)

    return fit


def held_out(fit: Fit) -> Array:
    """Mean, 95th percentile and maximum of each split, and the least seconds of a few fits: (splits, 4)."""
    pairs, rows = read_published_pairs(), []
    for seed in SEEDS:
        inside, outside = split(len(pairs.balanced), seed)
        seconds: list[float] = []
        while len(seconds) < REPEATS and sum(seconds) < LONG:
            start = time.perf_counter()
            predict = fit(pairs.balanced[inside], pairs.encoded[inside])
            seconds.append(time.perf_counter() - start)
        error = np.linalg.norm(np.clip(predict(pairs.balanced[outside]), 0, 1) - pairs.encoded[outside], axis=1)
        rows.append((error.mean(), np.quantile(error, 0.95), error.max(), min(seconds)))
    return np.array(rows)


def main() -> int:
    """Print the table; returns in how many sizes camera-match is better in an error or faster."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", type=Path, help="write the figures to this file")
    arguments, kept = parser.parse_args(), dict[str, float]()
    peer = importlib.util.find_spec("camera_match") is not None
    heading("size", "method", "mean", "95 %", "max", "max / RBF's", "fit, s")
    of_rbf, behind = held_out(radial_basis_functions), 0

    def measured(size: str, method: str, rows: Array) -> Array:
        """The errors' medians, and the least seconds."""
        figures = np.append(np.median(rows[:, :3], axis=0), rows[:, 3].min())
        ratio = np.median(rows[:, 2] / of_rbf[:, 2])
        names = ("mean", "95 %", "max", "seconds")
        kept.update({f"{size}, {method}: {name}": float(value) for name, value in zip(names, figures, strict=True)})
        row(size, method, *figures[:2], f"{figures[2]:.3f}", f"{ratio:.2f}", f"{figures[3]:.3f}")
        return figures

    measured("", "radial basis functions", of_rbf)
    for size in SIZES:
        options, thesis = CalibrationOptions(size=size), ThesisOptions(size=size)
        ours = measured(f"{size}³", "LutForge", held_out(lattice(options)))
        measured(f"{size}³", "thesis preset", held_out(lattice(thesis)))
        measured(f"{size}³", "uniform", held_out(lattice(replace(thesis, nonuniform=False))))
        if peer:
            behind += bool(np.any(ours >= measured(f"{size}³", "camera-match", held_out(camera_match(size)))))
    if arguments.json:
        arguments.json.write_text(json.dumps(kept, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    return behind


if __name__ == "__main__":
    sys.exit(main())
