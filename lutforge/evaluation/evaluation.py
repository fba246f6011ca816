"""The result of an evaluation: the thesis's tables as records, and as one JSON document with stable keys.

    format        "lutforge-evaluation"; version: 1 (a key that exists keeps its meaning; new ones may be added)
    camera        the profile's; tables: whether the thesis's tables were asked for
    rows          chapter 5: one entry per direction, style, shot ("all": together) and method, with held_out, count,
                  mean, maximum, q1, median, q3 (of the Euclidean norm of the RGB difference, 1 = full scale), rmse
                  (over channels), de00_mean, de00_max (null where the values are not display colours), fit_seconds and
                  seconds_per_megapixel (null where they were not measured)
    raw           Fig. 4.5: JPEG → RAW before white balance: style, method, held_out, count, rmse, rmse_rgb
    linearization  equation (4.11): style, method, held_out, pairs, delta (r, g, b)
    edited        ΔE00 after exposure and white balance are changed: style, method, held_out, count, and de00, the means
                  by edit ("+2 EV", "warmer" …)
    refinish      Fig. 6.2: source, target (STYLE/WB), method, held_out, shots, and figures as in rows
    departures    shots that depart from the fixed rendering: shot, values and errors (exposure, contrast, saturation),
                  clear (which of them are beyond chance)
    notes         sentences

Directions are "render" (RAW → JPEG) and "linearize" (JPEG → white-balanced RAW). Methods are "rbf" (the full model of
chapter 4), "f and T, no h", "lattice" (the profile's own), "matrix and response", "polynomial per channel", "polynomial
of all channels", "uniform lattice N", "nonuniform lattice N", "lattice by (5.3) N" (the lattice regression that the
thesis compares itself with), and under refinish "unchanged".
"""

from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from lutforge.calibration.shots.departures import Departure
from lutforge.evaluation.errors_table import ErrorFigures, error_figures
from lutforge.evaluation.held_out import Predictions
from lutforge.evaluation.linearization import EDITS, EditedError, LinearizationError
from lutforge.evaluation.methods import LATTICE, RBF
from lutforge.evaluation.refinish_errors import RefinishError
from lutforge.model.profile_data import Direction


@dataclass(frozen=True)
class EvaluationRow:
    """One line of the error table.

    direction: "render" or "linearize"; shot: a name, or "all"; method: what predicted; held_out: whether its fit had
    not seen the shot. fit_seconds: of its fits, the median; seconds_per_megapixel: of its evaluation; None where they
    were not measured.
    """

    direction: Direction
    style: str
    shot: str
    method: str
    held_out: bool
    figures: ErrorFigures
    fit_seconds: float | None = None
    seconds_per_megapixel: float | None = None


@dataclass(frozen=True)
class RawError:
    """JPEG → RAW before white balance, 1 = full scale. rmse: over samples and channels; rmse_rgb: by channel."""

    style: str
    method: str
    held_out: bool
    count: int
    rmse: float
    rmse_rgb: tuple[float, float, float]


@dataclass(frozen=True)
class Evaluation:
    """The result of an evaluation.

    rows: the error table; raw, linearization, edited, refinish: the other tables; notes: what was left out, why;
    predictions: by style, what the rows are made of; departures: of shots.
    """

    camera: str
    rows: tuple[EvaluationRow, ...]
    notes: tuple[str, ...]
    raw: tuple[RawError, ...] = ()
    linearization: tuple[LinearizationError, ...] = ()
    refinish: tuple[RefinishError, ...] = ()
    edited: tuple[EditedError, ...] = ()
    tables: bool = False
    predictions: Mapping[str, Predictions] = field(default_factory=dict, repr=False)  # long arrays
    departures: tuple[Departure, ...] = ()

    def as_json(self) -> dict[str, object]:
        """The document that the head of this module describes."""
        return {
            "format": "lutforge-evaluation",
            "version": 1,
            "camera": self.camera,
            "tables": self.tables,
            "rows": [_plain(row) for row in self.rows],
            "raw": [_plain(row) for row in self.raw],
            "linearization": [_plain(row) for row in self.linearization],
            "departures": [asdict(departure) for departure in self.departures],
            "edited": [_plain(row) | {"de00": dict(zip(EDITS, row.de00, strict=True))} for row in self.edited],
            "refinish": [_plain(row) for row in self.refinish],
            "notes": list(self.notes),
        }


def _plain(row: Any) -> dict[str, object]:
    """The values of a table's row by name, its figures among them."""
    values: dict[str, Any] = asdict(row)
    figures: dict[str, object] = values.pop("figures", {})
    return values | figures


def error_rows(style: str, predictions: Predictions) -> Iterator[EvaluationRow]:
    """Per direction and method: all shots together, then (for the profile's own models) each shot."""
    data = predictions.data
    for direction, predicted in predictions.predicted.items():
        display, measured = direction == "render", data.both[direction][1]
        for method in predictions.methods:
            values = np.clip(predicted[method], 0.0, 1.0)
            said = np.all(np.isfinite(values), axis=1)
            parts = {"all": said}
            if method in (LATTICE, RBF):
                parts |= {str(shot): said & (data.shot == shot) for shot in np.unique(data.shot[said])}
            for shot, rows in parts.items():
                figures = error_figures(values[rows], measured[rows], display=display)
                held_out = bool(np.all(predictions.held_out[rows]))
                yield EvaluationRow(direction, style, shot, method, held_out, figures)


def raw_errors(style: str, predictions: Predictions) -> Iterator[RawError]:
    """RAW before white balance, as the sensor gives it, by method."""
    data = predictions.data
    gain = data.balanced / data.samples.raw
    for method in predictions.methods:
        error = np.clip(predictions.predicted.linearize[method], 0.0, 1.0) / gain - data.samples.raw
        said = np.all(np.isfinite(error), axis=1)
        r, g, b = (float(value) for value in np.sqrt(np.mean(error[said] ** 2, axis=0)))
        held_out = bool(np.all(predictions.held_out[said]))
        rmse = float(np.sqrt(np.mean(error[said] ** 2)))
        yield RawError(style, method, held_out, int(said.sum()), rmse, (r, g, b))
