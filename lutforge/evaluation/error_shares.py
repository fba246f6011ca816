"""Split the error of a render into shares: fixed rendering, falloff of the lens, scene, noise.

The shares are mean squares, which add up. The falloff's share is the reduction of the error when each sample is
corrected for its place in the picture. The scene's share is the further reduction when each shot's departure in tone is
removed. The noise is estimated from the differences between samples of nearly the same colour within a shot (Gasser,
Sroka & Jennen-Steinmetz 1986, https://doi.org/10.1093/biomet/73.3.625). The rest is the error of the fixed rendering.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from lutforge.arrays import Array
from lutforge.calibration.shots.falloff import falloff_stops
from lutforge.evaluation.held_out import Predictions
from lutforge.model.falloff import Falloff
from lutforge.model.shot_tone import ShotTone, tone_stops

SHARES = ("style", "method", "all", "fixed rendering", "lens falloff", "scene", "noise")


@dataclass(frozen=True)
class ErrorShares:
    """Root mean squares of the errors of rendered colours per channel, as RMSE in the error tables, 1 = full scale.

    The squares of the last four add up to that of total. total: the error of a render without corrections for place and
    scene; method: the name of what renders.
    """

    style: str
    method: str
    total: float
    rendering: float
    falloff: float
    scene: float
    noise: float

    @property
    def cells(self) -> tuple[str, ...]:
        """The shares as cells of a table, whose columns SHARES names."""
        values = (self.total, self.rendering, self.falloff, self.scene, self.noise)
        return (self.style, self.method, *(f"{value:.4f}" for value in values))


def error_shares(
    style: str,
    method: str,
    predictions: Predictions,
    falloffs: Sequence[Falloff],
    taken_out: Sequence[ShotTone],
    tones: Sequence[ShotTone],
) -> ErrorShares:
    """Split the error of one method on the samples of a style.

    falloffs, taken_out: by which the samples' RAW has been brightened; tones: all departures that are known.
    """
    data, rows = predictions.data, np.arange(len(predictions.data.shot))
    placed = data.balanced / 2.0 ** tone_stops(data.samples, taken_out)[:, None]
    bare = placed / 2.0 ** falloff_stops(data.samples, falloffs)[:, None]
    even = placed * 2.0 ** tone_stops(data.samples, tones, local=True)[:, None]

    def residual(balanced: Array) -> Array:
        return np.clip(predictions.render(method, balanced, rows), 0.0, 1.0) - data.encoded

    residuals = [residual(values) for values in (bare, placed, even)]
    said = np.all(np.isfinite(residuals[-1]), axis=1)
    squares = [float(np.mean(values[said] ** 2)) for values in residuals]
    noise = min(_noise(residuals[-1][said], data.encoded[said], data.shot[said]), squares[-1])
    shares = (squares[0], squares[-1] - noise, squares[0] - squares[1], squares[1] - squares[2], noise)
    return ErrorShares(style, method, *(float(np.sqrt(max(share, 0.0))) for share in shares))


def _noise(residual: Array, encoded: Array, shot: "np.ndarray[tuple[int], np.dtype[np.str_]]") -> float:
    """The mean square by which residuals (n, 3) of like colours differ within a shot; 0 where no colours are alike."""
    squares = []
    for name in np.unique(shot):
        mine = np.flatnonzero(shot == name)
        if len(mine) > 1:
            distance, near = cKDTree(encoded[mine]).query(encoded[mine], k=2)
            alike = distance[:, 1] < 0.02  # five codes
            squares.append(np.mean((residual[mine[alike]] - residual[mine[near[alike, 1]]]) ** 2, axis=1) / 2.0)
    found = np.concatenate(squares) if squares else np.zeros(0)
    return float(found.mean()) if len(found) else 0.0
