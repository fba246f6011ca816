"""The tables of a profile, its errors and its shots, for the command line, reports and the studio."""

from __future__ import annotations  # the types of records are not imported, so that commands start fast

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from lutforge.calibration.bracket import BracketFit
    from lutforge.evaluation.evaluation import Evaluation, EvaluationRow
    from lutforge.model.camera_profile import CameraProfile

TITLES = {"render": "RAW → JPEG", "linearize": "JPEG → RAW, white-balanced"}
"""The directions of a profile's models, for captions."""

METHOD_NAMES = {
    "camera model": "camera model, without a lattice",
    "f and T, no h": "its matrix and response, without its gamut map",
    "matrix and response": "matrix and response, fitted alone",
    "lattice": "LutForge's lattice",
}
"""Names of methods for tables, in place of their short names, where these are not words."""

YES_OR_NO = {True: "yes", False: "no"}


@dataclass(frozen=True)
class Table:
    """Rows of cells as long as the header. bold: the indices of rows that are set bold."""

    caption: str
    header: Sequence[str]
    rows: Sequence[Sequence[str]]
    bold: frozenset[int] = frozenset()

    @property
    def numeric(self) -> tuple[bool, ...]:
        """For each column whether it holds numbers only; such columns are aligned right."""
        number = re.compile(r"[-−+±]?[\d.]+(e[-+]?\d+)?( K| %| EV)?|–|")
        columns = zip(*self.rows, strict=True) if self.rows else ["text" for _ in self.header]
        return tuple(all(map(number.fullmatch, column)) for column in columns)


def method_name(method: str) -> str:
    """A method of an evaluation in words."""
    return METHOD_NAMES.get(method, method)


def exposure_time(seconds: float) -> str:
    """An exposure time as cameras show it: "1/60 s", "0.5 s"; "–" where it is not known."""
    if not seconds > 0:
        return "–"
    return f"{seconds:.3g} s" if seconds >= 0.3 else f"1/{1 / seconds:.0f} s"


def held_out_table(profile: CameraProfile) -> Table:
    """The errors on held-out shots that a profile holds; no rows where it holds none."""
    rows = []
    for name, style in profile.styles.items():
        for direction in ("render", "linearize"):
            figures = [style.errors.get(f"{direction}_{kind}") for kind in ("mean", "max", "de00_mean")]
            if figures[0] is not None:
                digits = zip(figures, (4, 4, 2), strict=True)
                rows.append((name, direction, *("–" if value is None else f"{value:.{d}f}" for value, d in digits)))
    return Table("Error on held-out shots", ("style", "direction", "mean", "max", "mean ΔE00"), rows)


def balance_table(profile: CameraProfile) -> Table:
    """The white balances of a profile."""
    rows = []
    for name, balance in profile.white_balances.items():
        kelvin = "–" if balance.kelvin is None else f"{balance.kelvin:.0f} K"
        factors = (f"{value:.4f}" for value in balance.factors)
        rows.append((name, *factors, kelvin, f"{100 * balance.spread:.1f} %" if balance.spread else "–"))
    header = ("name", "red", "green", "blue", "temperature", "spread over shots")
    return Table("White balances: what the RAW channels are multiplied by", header, rows)


def matrix_table(profile: CameraProfile) -> Table:
    """The matrix of a profile."""
    numbers = [[f"{value:.4f}".replace("-", "−") for value in row] for row in profile.matrix]
    rows = [(f"linear {channel}", *row) for channel, row in zip("RGB", numbers, strict=True)]
    header = ("", "camera R", "camera G", "camera B")
    return Table("Matrix: white-balanced camera RGB → linear sRGB", header, rows)


def response_table(fit: BracketFit) -> Table:
    """The errors by which the response of a bracket, and other curves, predict the next exposure."""
    rows = [(curve.name, f"{curve.median:.1f}", f"{curve.rms:.1f}") for curve in fit.curves]
    return Table("Error of the next exposure in codes, exposures as stated", ("curve", "median", "RMS"), rows)


def error_table(caption: str, rows: Sequence[EvaluationRow], bold_method: str = "") -> Table:
    """The errors of one direction, with times where these were measured. bold_method: the one set bold."""
    from lutforge.evaluation.figures import FIGURES

    timed = any(row.fit_seconds is not None for row in rows)
    cells = []
    for row in rows:
        seconds = (row.fit_seconds, row.seconds_per_megapixel) if timed else ()
        times = ("–" if value is None else f"{value:.3g}" for value in seconds)
        cells.append(
            (row.style, row.shot, method_name(row.method), YES_OR_NO[row.held_out], *row.figures.cells, *times)
        )
    header = ("style", "shot", "method", "held out", *FIGURES, *(("fit, s", "s/Mpixel") if timed else ()))
    return Table(caption, header, cells, _rows_of(bold_method, rows))


def more_tables(evaluation: Evaluation, bold_method: str = "") -> Iterator[Table]:
    """The errors of RAW, after edits, over exposure pairs and of refinishing in an evaluation, where it has them."""
    from lutforge.evaluation.figures import FIGURES

    tables = (
        ("JPEG → RAW before white balance: RMSE (1 = saturation)", "n", evaluation.raw, 4),
        (
            "JPEGs made linear, then exposed and balanced anew: mean ΔE00 to the same edit of the RAW",
            "n", evaluation.edited, 2,
        ),
        (
            "Two exposures of one scene: how far their linearized JPEGs differ, beyond the exposure (1 = full scale)",
            "pairs", evaluation.linearization, 4,
        ),
    )  # fmt: skip
    for caption, counted, errors, digits in tables:
        cells = []
        for error in errors:
            numbers = (f"{value:.{digits}f}" for value in error.values.values())
            held_out = YES_OR_NO[error.held_out]
            cells.append((error.style, method_name(error.method), held_out, str(error.count), *numbers))
        if errors:
            header = ("style", "method", "held out", counted, *errors[0].values)
            yield Table(caption, header, cells, _rows_of(bold_method, errors))
    if pairs := evaluation.refinish:
        yield Table(
            "JPEGs changed to another setting, against the camera's own JPEG of the same scene (1 = full scale)",
            ("from", "to", "method", "held out", "pairs", *FIGURES),
            [
                (
                    row.source,
                    row.target,
                    method_name(row.method),
                    YES_OR_NO[row.held_out],
                    str(row.shots),
                    *row.figures.cells,
                )
                for row in pairs
            ],
            _rows_of(bold_method, pairs),
        )


def _rows_of(method: str, rows: Sequence[Any]) -> frozenset[int]:
    """The indices of the rows of a method."""
    return frozenset(index for index, row in enumerate(rows) if row.method == method)
