"""Errors of RAW before white balance, recovered from JPEGs (thesis, Fig. 4.5)."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from lutforge.evaluation.predictions import Predictions


@dataclass(frozen=True)
class MethodError:
    """An error of one method in a style. count: of samples, or of pairs; values: by the titles of their columns."""

    style: str
    method: str
    held_out: bool
    count: int
    values: dict[str, float]


def raw_errors(style: str, predictions: Predictions) -> Iterator[MethodError]:
    """The errors of JPEG → RAW before white balance, by method: root mean square, 1 = full scale."""
    data = predictions.data
    gain = data.balanced / data.samples.raw
    for method in predictions.methods:
        error = np.clip(predictions.predicted.linearize[method], 0.0, 1.0) / gain - data.samples.raw
        finite = np.all(np.isfinite(error), axis=1)
        squares = error[finite] ** 2
        rms = np.sqrt([np.mean(squares), *np.mean(squares, axis=0)]).tolist()
        held_out = bool(np.all(predictions.held_out[finite]))
        values = dict(zip(("RMSE", *"RGB"), rms, strict=True))
        yield MethodError(style, method, held_out, int(finite.sum()), values)
