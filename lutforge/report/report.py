"""What is known of a calibrated camera, for reading: how good it is, what it rests on, what to shoot next."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import matplotlib
import numpy as np
from numpy.typing import NDArray

from lutforge.calibration.evaluate import evaluate
from lutforge.calibration.evaluation import Evaluation, EvaluationRow
from lutforge.calibration.held_out import COLOUR_POLYNOMIAL, LATTICE, MATRIX_AND_RESPONSE, RBF
from lutforge.calibration.next_shots import colour_gaps
from lutforge.calibration.options import options_from_json
from lutforge.calibration.refinish_errors import RefinishError
from lutforge.calibration.style_data import StyleData
from lutforge.calibration.style_fit import fit_style
from lutforge.model.camera_profile import CameraProfile, PictureStyle
from lutforge.regression.node_levels import error_histogram
from lutforge.report.error_maps import error_maps, error_maps_figure
from lutforge.report.error_table_figure import error_boxes
from lutforge.report.gamut_slices import gamut_figure
from lutforge.report.lattice_figures import lattice_figure, levels_on_errors, plane_destinations
from lutforge.report.page import Block, Picture, Points, Report, Section, Table, Text
from lutforge.report.response_figure import response_figure
from lutforge.report.sample_figures import chromaticity_figure, error_by_colour_figure
from lutforge.report.sheets import DIRECTIONS
from lutforge.samples.extract import ShotSamples
from lutforge.samples.sample_set import SampleSet
from lutforge.settings import setting_name
from lutforge.shots.read import read_shot

Array = NDArray[np.float64]
Progress = Callable[[str, float], None]

MOST_MAPS = 3
"""Shots that error maps are drawn of: the best, the middle and the worst."""
VERDICTS = (
    (1.0, "less than an eye sees side by side"),
    (2.0, "what an eye just sees side by side"),
    (5.0, "visible"),
    (np.inf, "far off: see the notes and what to shoot next"),
)
"""What a mean ΔE00 below each bound means."""


@matplotlib.rc_context({"text.parse_math": False})  # names may hold dollar signs
def build_report(
    profile: CameraProfile,
    samples: SampleSet | None = None,
    accounts: Sequence[ShotSamples] = (),
    files: Mapping[str, Path] | None = None,
    progress: Progress = lambda what, share: None,
) -> Report:
    """The report of a profile, and with samples its errors, held out by shot.

    accounts: of the shots that the samples are from; files: the RAW file of each shot by name, for error maps.
    Raises CalibrationError where the samples hold none of the profile's styles.
    """
    lead, notes = _lead_of_profile(profile), profile.notes
    judged: list[Section] = []
    shown: list[Section] = []
    data: dict[str, StyleData] = {}
    if samples is not None:
        evaluation = evaluate(profile, samples, lambda what, share: progress(what, 0.6 * share))
        own = _own(profile, evaluation)
        data = {name: predictions.data for name, predictions in evaluation.predictions.items()}
        lead = tuple(_lead(own, evaluation)) or lead
        notes = tuple(dict.fromkeys((*notes, *evaluation.notes)))
        progress("error maps", 0.6)
        judged.append(Section("What to shoot next", tuple(_next(data))))
        judged.append(Section("Errors", (*_error_tables(own, evaluation), *_error_pictures(own, evaluation))))
        judged.append(Section("Errors on real shots", tuple(_error_maps(own, evaluation, files or {}))))
        shown.append(Section("Samples", tuple(_samples(samples, accounts))))
    progress("models", 0.8)
    models = [
        Section(f"Style {name}", tuple(_style(profile, name, style, data.get(name))))
        for name, style in profile.styles.items()
    ]
    said = Section("Notes", (Points(notes),) if notes else ())
    settings = Section("White balances and matrix", tuple(_settings(profile)))
    sections = tuple(section for section in (said, *judged, settings, *models, *shown) if section.blocks)
    progress("done", 1.0)
    return Report(f"{profile.camera}: calibration report", _subtitle(profile), lead, sections)


def _subtitle(profile: CameraProfile) -> str:
    options = options_from_json(profile.options)
    model = {"lattice": f"lattices of {options.size}³ nodes", "rbf": "the physical model and lattices"}[options.model]
    return (
        f"Picture styles: {', '.join(profile.styles)}. White balances: {', '.join(profile.white_balances)}. "
        f"Shots: {len(profile.shots)}. Model: {model}, preset {options.preset}."
    )


def _lead_of_profile(profile: CameraProfile) -> tuple[str, ...]:
    """From the errors that the profile itself holds."""
    return tuple(
        _sentence(name, style.errors["render_mean"], style.errors["render_de00_mean"])
        for name, style in profile.styles.items()
        if "render_mean" in style.errors and "render_de00_mean" in style.errors
    )


def _lead(own: str, evaluation: Evaluation) -> Iterator[str]:
    for row in evaluation.rows:
        if row.method == own and row.shot.startswith("all") and row.figures.de00_mean is not None:
            yield _sentence(row.style, row.figures.mean, row.figures.de00_mean, row.held_out)


def _sentence(style: str, mean: float, de00: float, held_out: bool = True) -> str:
    verdict = next(text for bound, text in VERDICTS if de00 < bound)
    seen = "that it had not seen" if held_out else "that it was fitted to"
    return (
        f"{style}: on shots {seen}, the JPEG predicted from RAW is {mean:.4f} of full scale off in the mean, "
        f"ΔE00 {de00:.2f}: {verdict}."
    )


def _own(profile: CameraProfile, evaluation: Evaluation) -> str:
    """The method that is the profile's own model."""
    methods = {row.method for row in evaluation.rows}
    physical = LATTICE not in methods or options_from_json(profile.options).model == "rbf"
    return RBF if physical and RBF in methods else LATTICE


# --- errors ---------------------------------------------------------------------------------------------------------

TITLES = {"render": "RAW → JPEG", "linearize": "JPEG → RAW, white-balanced"}
BASELINES = (COLOUR_POLYNOMIAL, MATRIX_AND_RESPONSE)
MAPS_TEXT = (
    "Each shot's RAW, rendered by fits that had not seen the shot, against the camera's own JPEG: the same scale "
    "everywhere; grey: clipped, or outside the RAW."
)


def _error_tables(own: str, evaluation: Evaluation) -> Iterator[Block]:
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
    if evaluation.refinish:
        yield Table(
            "Refinish between settings of one scene (Fig. 6.2)",
            ("from", "to", "method", "n", "mean", "max", "RMSE", "ΔE00"),
            tuple(map(_refinish_cells, evaluation.refinish)),
            frozenset(index for index, row in enumerate(evaluation.refinish) if row.method == own),
        )
    if evaluation.linearisation:
        yield Table(
            "Linearisation error δ over exposure pairs (4.11)",
            ("style", "method", "pairs", "R", "G", "B"),
            tuple(
                (entry.style, entry.method, str(entry.pairs), *(f"{value:.4f}" for value in entry.delta))
                for entry in evaluation.linearisation
            ),
        )


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


def _error_pictures(own: str, evaluation: Evaluation) -> Iterator[Block]:
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


def _error_maps(own: str, evaluation: Evaluation, files: Mapping[str, Path]) -> Iterator[Block]:
    """Of the best, the middle and the worst shot whose RAW file is at hand."""
    rows = [row for row in evaluation.rows if row.direction == "render" and row.method == own and row.shot in files]
    rows.sort(key=lambda row: row.figures.mean)
    chosen = {rows[round(index)].shot: rows[round(index)] for index in np.linspace(0, len(rows) - 1, MOST_MAPS) if rows}
    if chosen:
        yield Text(MAPS_TEXT)
    for name, row in chosen.items():
        predictions = evaluation.predictions[row.style]
        methods = [method for method in (own, *BASELINES) if method in predictions.methods]
        maps = error_maps(replace(read_shot(files[name]), name=name), predictions, methods)
        held = "not seen by the fits" if maps.held_out else "the fit had seen it"
        yield Picture(f"error_map_{setting_name(name)}", error_maps_figure(maps), f"{name}, {maps.setting}; {held}.")


# --- the profile ----------------------------------------------------------------------------------------------------


def _settings(profile: CameraProfile) -> Iterator[Block]:
    rows = []
    for name, balance in profile.white_balances.items():
        r, _, b = balance.multipliers
        kelvin = "–" if balance.kelvin is None else f"{balance.kelvin:.0f} K"
        rows.append((name, f"{r:.4f}", "1", f"{b:.4f}", kelvin, f"{100 * balance.spread:.1f} %"))
    yield Table("White balances Tw", ("name", "red", "green", "blue", "temperature", "spread over shots"), tuple(rows))
    matrix = tuple(
        (f"linear {channel}", *(f"{value:+.4f}".replace("-", "−").replace("+", "") for value in row))
        for channel, row in zip("RGB", profile.matrix, strict=True)
    )
    yield Table("Ts: white-balanced camera RGB → linear sRGB", ("", "camera R", "camera G", "camera B"), matrix)


def _style(profile: CameraProfile, name: str, style: PictureStyle, data: StyleData | None) -> Iterator[Block]:
    what = "the response f" if style.physical else "the grey axis of the lattice"
    yield Picture(f"response_{name}", response_figure(style), f"{name}: {what}, per channel.")
    maps = {f"{name}, h": model.gamut_map for model in style.physical[:1]}
    if maps:
        maps[f"{name}, h⁻¹"] = style.physical[0].inverse_gamut_map
        text = (
            "The gamut map at constant luminance Y in linear sRGB: arrows lead from the colour before it to the colour "
            "after; dots are control points."
        )
        yield Picture(f"gamut_map_{name}", gamut_figure(maps), text)
    for direction, (source, target) in DIRECTIONS.items():
        lattice = getattr(style, direction)
        if lattice is None:
            continue
        caption = f"{direction}: nodes lie densely where the function bends; those without samples continue the model."
        yield Picture(
            f"lattice_{direction}_{name}",
            lattice_figure(lattice, style.coverage.get(direction), source, target),
            caption,
        )
        if data is not None:
            histograms = _uniform_errors(profile, data, direction)
            caption = f"{direction}: node levels (ticks) follow the error that a uniform lattice makes."
            yield Picture(f"levels_{direction}_{name}", levels_on_errors(lattice, histograms, source), caption)
        yield Picture(
            f"planes_{direction}_{name}",
            plane_destinations(lattice, target),
            f"{direction}: where three planes of nodes go.",
        )


def _uniform_errors(profile: CameraProfile, data: StyleData, direction: str) -> tuple[Array, Array, Array]:
    """Per axis the histogram of a uniform lattice's squared errors on the samples."""
    options = replace(options_from_json(profile.options), nonuniform=False)
    fit = fit_style(data, options)
    x, y, lattice = (
        (data.balanced, data.encoded, fit.render.lattice)
        if direction == "render"
        else (data.encoded, data.balanced, fit.linearize.lattice)
    )
    return error_histogram(x, np.sum((lattice(x) - y) ** 2, axis=1))


# --- samples --------------------------------------------------------------------------------------------------------


def _samples(samples: SampleSet, accounts: Sequence[ShotSamples]) -> Iterator[Block]:
    yield Picture("samples", chromaticity_figure(samples.srgb), "The JPEG colours of all samples.")
    by_name = {account.shot: account for account in accounts}
    rows = []
    for name, part in samples.by_shot():
        setting = f"{part.style[0]}/{part.white_balance[0]}"
        time = part.exposure_s[0]
        exposure = "–" if not np.isfinite(time) else f"{time:g} s" if time >= 0.3 else f"1/{1 / time:.0f} s"
        account = by_name.get(name)
        clipped = "–" if account is None else str(sum(account.clipped.values()))
        rejected = "–" if account is None else str(sum(account.rejected.values()))
        rows.append((name, setting, exposure, str(len(part)), clipped, rejected))
    yield Table("Shots", ("shot", "setting", "exposure", "samples", "areas clipped", "areas rejected"), tuple(rows))


def _next(data: Mapping[str, StyleData]) -> Iterator[Block]:
    for name, style in data.items():
        gaps = colour_gaps(style.encoded)
        if gaps:
            yield Text(f"{name}: of the colours that real surfaces have, these are not among the samples:")
            yield Points(tuple(str(gap) for gap in gaps))
        else:
            yield Text(f"{name}: the samples come near most colours that real surfaces have.")
