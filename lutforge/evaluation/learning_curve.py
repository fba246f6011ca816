"""How many shots are enough: the error on shots left out, against the number of shots calibrated from."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lutforge.calibration.options import CalibrationOptions
from lutforge.calibration.style_data import LEAST_SAMPLES, StyleData
from lutforge.calibration.style_fit import fit_style
from lutforge.errors import CalibrationError
from lutforge.evaluation.errors_table import error_figures
from lutforge.solvers.cross_validation import leave_groups_out

SPLITS = 3


@dataclass(frozen=True)
class LearningPoint:
    """shots fitted to; samples: their mean number; render, linearize: mean held-out error; spread: of render (1 σ)."""

    shots: int
    samples: float
    render: float
    linearize: float
    spread: float


@dataclass(frozen=True)
class LearningCurve:
    """Points in rising order of shots, and what they say, in one sentence."""

    points: tuple[LearningPoint, ...]
    advice: str


def learning_curve(
    data: StyleData,
    options: CalibrationOptions | None = None,
    progress: Callable[[str, float], None] = lambda what, share: None,
) -> LearningCurve:
    """Held-out error of one style for 1, 2, 4, … shots, chosen at random, over up to three groups of held-out shots.

    Raises CalibrationError below three shots, or where no part of them suffices for a fit.
    """
    options = options or CalibrationOptions(size=17)
    shots = np.unique(data.shot)
    if len(shots) < 3:
        raise CalibrationError(f"{len(shots)} shots cannot tell how many are enough: at least 3 are needed")
    masks = leave_groups_out(data.shot, SPLITS)
    most = min(len(np.unique(data.shot[~mask])) for mask in masks)
    counts = sorted({*(2**power for power in range(most.bit_length()) if 2**power <= most), most})
    points = []
    for index, count in enumerate(counts):
        progress(f"{count} shots", index / len(counts))
        points.extend(_point(data, masks, count, options))
    progress("done", 1.0)
    if not points:
        raise CalibrationError(f"fewer than {LEAST_SAMPLES} unclipped samples in any part of the shots: add shots")
    return LearningCurve(tuple(points), _advice(points))


def _point(
    data: StyleData, masks: list[NDArray[np.bool_]], count: int, options: CalibrationOptions
) -> list[LearningPoint]:
    """The point of `count` shots; none where they hold too few samples."""
    rng = np.random.default_rng(count)
    rows = []
    for mask in masks:
        chosen = rng.permutation(np.unique(data.shot[~mask]))[:count]
        train, test = data.select(np.isin(data.shot, chosen)), data.select(mask)
        if len(train.shot) < LEAST_SAMPLES:
            continue
        fit = fit_style(train, options)
        rendered = error_figures(np.clip(fit.render.lattice(test.balanced), 0, 1), test.encoded, display=True)
        linear = error_figures(np.clip(fit.linearize.lattice(test.encoded), 0, 1), test.balanced, display=False)
        rows.append((len(train.shot), rendered.mean, linear.mean))
    if not rows:
        return []
    samples, render, linearize = np.mean(rows, axis=0)
    spread = float(np.std([row[1] for row in rows]))
    return [LearningPoint(count, float(samples), float(render), float(linearize), spread)]


def _advice(points: list[LearningPoint]) -> str:
    """Whether more shots would help, from the last doubling."""
    last = points[-1]
    if len(points) < 2:
        return f"{last.shots} shots: too few to see a trend; add shots of other colours"
    before = points[-2]
    gain = 1.0 - last.render / before.render
    if gain > 0.1:
        return (
            f"from {before.shots} to {last.shots} shots the error fell by {gain:.0%}: more shots of other colours "
            "will still help"
        )
    return f"from {before.shots} to {last.shots} shots the error fell by {max(gain, 0.0):.0%}: the shots are enough"
