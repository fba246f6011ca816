"""The errors of a report: tables, boxes, colours that are predicted badly, and maps of real shots."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from lutforge.calibration.lattice.base import fit_base
from lutforge.evaluation.evaluation import Evaluation, EvaluationRow
from lutforge.evaluation.expected_error import by_distance, held_out_errors
from lutforge.evaluation.methods import COLOUR_POLYNOMIAL, MATRIX_AND_RESPONSE
from lutforge.evaluation.refinish_errors import RefinishError
from lutforge.model.falloff import Falloff
from lutforge.report.error_maps import error_maps, error_maps_figure
from lutforge.report.error_table_figure import error_boxes
from lutforge.report.page import Block, Picture, Table, Text
from lutforge.report.sample_figures import error_by_colour_figure
from lutforge.settings import setting_name
from lutforge.shots.read import read_shot

TITLES = {"render": "RAW → JPEG", "linearize": "JPEG → RAW, white-balanced"}
BASELINES = (COLOUR_POLYNOMIAL, MATRIX_AND_RESPONSE)
MAPS_TEXT = (
    "Each shot's RAW, rendered by fits that had not seen the shot, against the camera's own JPEG: the same scale "
    "everywhere; grey: clipped, or outside the RAW. Above each map is its mean over the picture, edges and textures "
    "included; the tables count the shot's even areas only."
)


def error_tables(own: str, evaluation: Evaluation) -> Iterator[Block]:
    header = ("style", "shot", "method", "n", "mean", "max", "Q1", "median", "Q3", "RMSE", "ΔE00", "max ΔE00")
    for direction, title in TITLES.items():
        rows = [row for row in evaluation.rows if row.direction == direction and row.shot.startswith("all")]
        if not rows:
            continue
        held = "held out by shot" if all(row.held_out for row in rows) else "NOT all held out"
        bold = frozenset(index for index, row in enumerate(rows) if row.method == own)
        yield Table(f"{title}, all shots, {held}", header, tuple(map(_cells, rows)), bold)
    shots = [
        row
        for row in evaluation.rows
        if row.direction == "render" and row.method == own and not row.shot.startswith("all")
    ]
    if shots:
        yield Table("RAW → JPEG by shot", header, tuple(map(_cells, shots)))
    yield from _by_distance(own, evaluation)
    if evaluation.refinish:
        yield Table(
            "JPEGs changed to another setting, against the camera's own JPEG of the same scene",
            ("from", "to", "method", "n", "mean", "max", "RMSE", "ΔE00"),
            tuple(map(_refinish_cells, evaluation.refinish)),
            frozenset(index for index, row in enumerate(evaluation.refinish) if row.method == own),
        )
    if evaluation.linearisation:
        yield Table(
            "Two exposures of one scene: how far their linearized JPEGs differ, beyond the exposure",
            ("style", "method", "pairs", "R", "G", "B"),
            tuple(
                (entry.style, entry.method, str(entry.pairs), *(f"{value:.4f}" for value in entry.delta))
                for entry in evaluation.linearisation
            ),
        )


def _by_distance(own: str, evaluation: Evaluation) -> Iterator[Block]:
    """How the error grows away from the samples, in encoded RGB."""
    rows = []
    for style, found in evaluation.predictions.items():
        told = held_out_errors(found, own, fit_base(found.data.balanced, found.data.encoded))
        for distance, errors in by_distance(told):
            rows.append((style, f"{distance:.0f}", f"{errors['render']:.4f}", f"{errors['linearize']:.4f}"))
    if rows:
        header = ("style", "codes to the nearest sample", "RAW → JPEG", "JPEG → RAW, as rendered")
        yield Table("Mean error by distance to the nearest sample", header, tuple(rows))


def _cells(row: EvaluationRow) -> tuple[str, ...]:
    f = row.figures
    numbers = (f"{value:.4f}" for value in (f.mean, f.maximum, f.q1, f.median, f.q3, f.rmse))
    differences = ("–" if value is None else f"{value:.2f}" for value in (f.de00_mean, f.de00_max))
    return (row.style, row.shot, row.method, str(f.count), *numbers, *differences)


def _refinish_cells(row: RefinishError) -> tuple[str, ...]:
    f = row.figures
    difference = "–" if f.de00_mean is None else f"{f.de00_mean:.2f}"
    numbers = (f"{value:.4f}" for value in (f.mean, f.maximum, f.rmse))
    return (row.source, row.target, row.method, str(f.count), *numbers, difference)


def error_pictures(own: str, evaluation: Evaluation) -> Iterator[Block]:
    for style in dict.fromkeys(row.style for row in evaluation.rows):
        directions = []
        for direction, title in TITLES.items():
            rows = [row for row in evaluation.rows if row.direction == direction and row.style == style]
            methods = [(row.method, row.figures) for row in rows if row.shot == "all"]
            if methods:
                directions.append((title, methods))
        if directions:
            yield Picture(
                f"errors_{style}",
                error_boxes(directions, own),
                f"{style}: box from the first to the third quartile, line to the maximum, white the median, diamond "
                "the mean. Logarithmic.",
            )
    for style, predictions in evaluation.predictions.items():
        error = np.linalg.norm(np.clip(predictions.rendered[own], 0, 1) - predictions.data.encoded, axis=1)
        said = np.isfinite(error)
        held = "held out by shot" if predictions.held_out[said].all() else "NOT all held out"
        yield Picture(
            f"error_by_colour_{style}",
            error_by_colour_figure(predictions.data.encoded[said], error[said]),
            f"{style}: which colours are predicted badly, RAW → JPEG, {held}.",
        )


def error_map_pictures(
    own: str, evaluation: Evaluation, files: Mapping[str, Path], falloffs: Sequence[Falloff]
) -> Iterator[Block]:
    """Of the best, the middle and the worst shot whose RAW file is at hand; falloffs: of the profile."""
    rows = [row for row in evaluation.rows if row.direction == "render" and row.method == own and row.shot in files]
    rows.sort(key=lambda row: row.figures.mean)
    chosen = {rows[round(index)].shot: rows[round(index)] for index in np.linspace(0, len(rows) - 1, 3) if rows}
    if chosen:
        yield Text(MAPS_TEXT)
    for name, row in chosen.items():
        predictions = evaluation.predictions[row.style]
        methods = [method for method in (own, *BASELINES) if method in predictions.methods]
        maps = error_maps(replace(read_shot(files[name]), name=name), predictions, methods, falloffs)
        held = "not seen by the fits" if maps.held_out else "the fit had seen it"
        caption = f"{name}, {maps.setting}; {held}; mean error of the shot's samples {row.figures.mean:.4f}."
        yield Picture(f"error_map_{setting_name(name)}", error_maps_figure(maps), caption)
