"""The learning curve: the error on left-out shots against the number of shots calibrated from."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lutforge.arrays import Mask
from lutforge.calibration.options import CalibrationOptions
from lutforge.calibration.style_data import LEAST_SAMPLES, StyleData
from lutforge.calibration.style_fit import fit_style
from lutforge.errors import CalibrationError
from lutforge.evaluation.errors_table import JUST_VISIBLE, error_figures, visibility
from lutforge.progress import Progress, silent
from lutforge.solvers.cross_validation import leave_groups_out


@dataclass(frozen=True)
class LearningPoint:
    """Mean errors on held-out shots of fits to so many shots.

    samples: the mean number fitted to; render, linearize: RGB norms, 1 = full scale; de00: of render; spread: the
    standard deviation of render over the groups of held-out shots.
    """

    shots: int
    samples: float
    render: float
    linearize: float
    spread: float
    de00: float


@dataclass(frozen=True)
class LearningCurve:
    """Points in rising order of shots, and what they say, in one sentence."""

    points: tuple[LearningPoint, ...]
    advice: str


def learning_curve(
    data: StyleData,
    options: CalibrationOptions | None = None,
    progress: Progress = silent,
) -> LearningCurve:
    """Measure the held-out error of one style for 1, 2, 4, … random shots, over three groups of held-out shots.

    Raises CalibrationError below three shots, or where no part of them suffices for a fit.
    """
    options = options or CalibrationOptions(size=17)
    shots = np.unique(data.shot)
    if len(shots) < 3:
        raise CalibrationError(f"{len(shots)} shots cannot tell how many are enough: at least 3 are needed")
    masks = leave_groups_out(data.shot, 3)
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


def _point(data: StyleData, masks: list[Mask], count: int, options: CalibrationOptions) -> list[LearningPoint]:
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
        rows.append((len(train.shot), rendered.mean, linear.mean, rendered.de00_mean or 0.0))
    if not rows:
        return []
    samples, render, linearize, de00 = (float(value) for value in np.mean(rows, axis=0))
    return [LearningPoint(count, samples, render, linearize, float(np.std([row[1] for row in rows])), de00)]


def _advice(points: Sequence[LearningPoint]) -> str:
    """Say whether more shots would help. They are called enough only if three points agree and no error is visible."""
    last = points[-1]
    now = f"the error on held-out shots is ΔE00 {last.de00:.1f}, {visibility(last.de00)}"
    if len(points) < 3:
        return f"{now}; {len(points)} point{'s' * (len(points) > 1)} cannot tell a trend: add shots of other colours"
    before = points[-2]
    gain = 1.0 - last.render / before.render
    fell = f"from {before.shots} to {last.shots} shots the error fell by {max(gain, 0.0):.0%}; {now}"
    if gain > 0.1:
        return f"{fell}: more shots of other colours will still help"
    if last.de00 >= JUST_VISIBLE:
        return f"{fell}: more shots like these will not help; add other colours, or see whether all shots agree"
    return f"{fell}: the shots are enough"
