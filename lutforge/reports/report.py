"""The report on a calibrated camera: answers in plain words, then the figures and tables that they result from."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import matplotlib
import numpy as np

from lutforge.arrays import Array
from lutforge.calibration.brightness_transfer import transfer_functions
from lutforge.calibration.deviations import COLUMNS
from lutforge.calibration.lattice.fit import squares
from lutforge.calibration.pairs_of_samples import pairs_of_samples
from lutforge.calibration.response_verdict import judge
from lutforge.calibration.style import StyleData
from lutforge.errors import CalibrationError
from lutforge.evaluation.evaluation import Evaluation, evaluate
from lutforge.evaluation.linearization_errors import response_deltas
from lutforge.evaluation.methods import CAMERA_MODEL, LATTICE, compared_fits, lattice_name
from lutforge.model.camera_profile import CameraProfile
from lutforge.model.gamut_map import GamutMap
from lutforge.model.inverse_gamut_map import SolvedInverse
from lutforge.model.profile import PictureStyle
from lutforge.model.vignetting import Vignetting
from lutforge.progress import Progress, part, silent
from lutforge.reports import figures
from lutforge.reports.answers import answers
from lutforge.reports.page import Block, Picture, Report
from lutforge.reports.shot_figures import error_map_pictures, shot_pictures
from lutforge.reports.tables import (
    TITLES,
    Table,
    balance_table,
    error_table,
    exposure_time,
    matrix_table,
    more_tables,
)
from lutforge.samples.extract import ShotSamples
from lutforge.samples.sample_set import SampleSet
from lutforge.thesis.lattice import error_histogram
from lutforge.thesis.method import method_of
from lutforge.thesis.options import stated_options


@matplotlib.rc_context({"text.parse_math": False})  # since names may contain dollar signs
def build_report(
    profile: CameraProfile,
    samples: SampleSet | None = None,
    shots: Sequence[ShotSamples] = (),
    files: Mapping[str, Path] | None = None,
    progress: Progress = silent,
) -> Report:
    """Build the report of a profile, with its errors on held-out shots where there are samples.

    shots: those that the samples are from; files: the RAW file of each shot by name, for error maps. Raises
    CalibrationError where the samples hold none of the profile's styles.
    """
    options = stated_options(profile.options)
    lens = list(vignetting_blocks(profile.vignettings))
    evaluation = None
    method = LATTICE  # of the profile's model
    pictures: tuple[Picture, ...] = ()
    sections: dict[str, tuple[Block, ...]] = {"Notes": (profile.notes,) if profile.notes else ()}
    data: dict[str, StyleData] = {}
    if samples is not None:
        evaluation = evaluate(profile, samples, part(progress, 0.0, 0.8))
        methods = {row.method for row in evaluation.rows}
        if CAMERA_MODEL in methods and method_of(options).bakes_camera_model:
            method = CAMERA_MODEL
        data = {name: predictions.data for name, predictions in evaluation.predictions.items()}
        notes = tuple(dict.fromkeys((*profile.notes, *evaluation.notes)))
        progress("error maps", 0.8)
        sections["Notes"] = (notes,) if notes else ()
        sections["Errors"] = (*error_tables(method, evaluation), *error_pictures(method, evaluation))
        sections["Errors on real shots"] = tuple(error_map_pictures(profile, method, evaluation, files or {}))
        if evaluation.deviations:
            title = "Shots that deviate from the fixed rendering, with standard errors"
            rows = [(deviation.shot, *deviation.cells) for deviation in evaluation.deviations]
            lens.append(Table(title, ("shot", *COLUMNS), rows))
        pictures = tuple(shot_pictures(profile, method, evaluation, files or {}))
    progress("models", 0.9)
    sections["Lens and scene"] = tuple(lens)
    sections["White balances and matrix"] = balance_table(profile), matrix_table(profile)
    for name, style in profile.styles.items():
        sections[f"Style {name}"] = tuple(style_pictures(profile, name, style, data.get(name)))
    if samples is not None:
        sections["Samples"] = tuple(sample_blocks(samples, shots))
        sections["Exposures"] = tuple(exposure_blocks(data, profile.matrix))
    progress("done", 1.0)
    return Report(
        f"{profile.camera}: calibration report",
        f"Picture styles: {', '.join(profile.styles)}. White balances: {', '.join(profile.white_balances)}. "
        f"Shots: {len(profile.shots)}. Calibrated by {options.method}, with lattices of {options.size}³ nodes.",
        sections={title: blocks for title, blocks in sections.items() if blocks},
        answers=answers(profile, method, evaluation, data, pictures),
    )


def error_tables(method: str, evaluation: Evaluation) -> Iterator[Table]:
    """Tables of errors: of each direction, of RAW, of refinishing, and of exposure pairs. method: the one set bold."""
    for direction, title in TITLES.items():
        rows = [row for row in evaluation.rows if row.direction == direction and row.all_shots]
        if rows:
            seen = "held out by shot" if all(row.held_out for row in rows) else "NOT all held out"
            yield error_table(f"{title}, all shots, {seen}", rows, method)
    rendered = [row for row in evaluation.rows if row.direction == "render" and row.method == method]
    if shots := [row for row in rendered if not row.all_shots]:
        yield error_table("RAW → JPEG by shot", shots)
    yield from more_tables(evaluation, method)


def error_pictures(method: str, evaluation: Evaluation) -> Iterator[Picture]:
    """Figures of a method's errors by colour."""
    for style, predictions in evaluation.predictions.items():
        error = np.linalg.norm(np.clip(predictions.predicted.render[method], 0, 1) - predictions.data.encoded, axis=1)
        finite = np.isfinite(error)
        seen = "held out by shot" if predictions.held_out[finite].all() else "NOT all held out"
        drawing = figures.error_by_colour_figure(predictions.data.encoded[finite], error[finite])
        caption = f"{style}: which colours are predicted badly, RAW → JPEG, {seen}."
        yield Picture(f"error_by_colour_{style}", drawing, caption)


def sample_blocks(samples: SampleSet, shots: Sequence[ShotSamples]) -> Iterator[Block]:
    """The blocks on the samples and the shots that they are from."""
    yield Picture("samples", figures.chromaticity_figure(samples.srgb), "The JPEG colours of all samples.")
    left_out = {shot.shot: (str(sum(shot.clipped.values())), str(sum(shot.rejected.values()))) for shot in shots}
    rows = []
    for name, of_shot in samples.by_shot():
        setting = f"{of_shot.style[0]}/{of_shot.white_balance[0]}"
        exposure = exposure_time(of_shot.exposure_s[0])
        rows.append((name, setting, exposure, str(len(of_shot)), *left_out.get(name, ("–", "–"))))
    yield Table("Shots", ("shot", "setting", "exposure", "samples", "areas clipped", "areas rejected"), tuple(rows))


def exposure_blocks(data: Mapping[str, StyleData], matrix: Array) -> Iterator[Block]:
    """The blocks on exposures: whether pairs of them show that each style's response is a fixed curve.

    matrix: (3, 3), white-balanced RAW → linear sRGB, by which errors have the unit of the evaluation's.
    """
    for name, style in data.items():
        try:
            pairs = pairs_of_samples(style.samples)
            verdict = judge(pairs)
            functions = transfer_functions(pairs)
        except CalibrationError:  # no two shots, or too few, show the same patches at different exposures
            continue
        yield f"{name}: {verdict.words}."
        header = ("response fitted to", "red", "green", "blue")
        deltas = response_deltas(pairs, (style.balanced @ matrix.T)[pairs.first_row])
        rows = tuple((source, *(f"{value:.4f}" for value in delta)) for source, delta in deltas.items())
        caption = (
            f"{name}: linearization error of the response over pairs of exposures, unsaturated colours (1 = full scale)"
        )
        yield Table(caption, header, rows)

        # The errors of the stated exposure times, compared with RAW, which is linear (thesis 3.1).
        samples = style.samples
        stated = np.array([np.nanmedian(samples.exposure_s[samples.shot == shot]) for shot in pairs.shots])
        if np.all(stated > 0):
            error = pairs.shot_exposure - np.log(stated)
            exposures = [
                (shot, exposure_time(time), f"{ratio:.3f}")
                for shot, time, ratio in zip(pairs.shots, stated, np.exp(error - np.median(error)), strict=True)
            ]
            title = f"{name}: exposures of the shots, as RAW tells them"
            yield Table(title, ("shot", "stated", "true / stated"), exposures)
        caption = (
            f"{name}: JPEG values of one exposure against another's, with f(k f⁻¹(I)); crosses leave it. Dashed: an f "
            "that is fitted to all colours, outliers too."
        )
        yield Picture(f"brightness_transfer_{name}", figures.brightness_transfer_figure(functions), caption)


def style_pictures(profile: CameraProfile, name: str, style: PictureStyle, data: StyleData | None) -> Iterator[Block]:
    """The blocks on the models of a style: response, gamut map and lattices."""
    curve = "the tone response" if style.models else "the grey axis of the lattice"
    yield Picture(f"response_{name}", figures.response_figure(style), f"{name}: {curve}, per channel.")
    maps: dict[str, GamutMap | SolvedInverse] = {f"{name}, rendering": model.gamut_map for model in style.models[:1]}
    if maps:
        maps[f"{name}, linearizing"] = style.models[0].inverse_gamut_map
        text = (
            "The gamut map at constant luminance Y in linear sRGB: arrows lead from the colour before it to the colour "
            "after; dots are control points."
        )
        yield Picture(f"gamut_map_{name}", figures.gamut_figure(maps), text)
    options = stated_options(profile.options)
    even = None if data is None else compared_fits(data, options)[lattice_name(options.size, nonuniform=False)]
    for direction, lattice in style.lattices.items():
        source, target = figures.ENDS[direction]
        caption = f"{direction}: nodes lie densely where the function bends; those without samples continue the model."
        yield Picture(f"lattice_{direction}_{name}", figures.lattice_figure(style, [direction]), caption)
        if data is not None and even is not None:
            x, y = data.both[direction]
            histograms = error_histogram(x, squares(even[direction](x) - y))
            caption = f"{direction}: node levels (ticks) follow the error that a uniform lattice makes."
            yield Picture(f"levels_{direction}_{name}", figures.levels_on_errors(lattice, histograms, source), caption)
        planes = figures.plane_figure(lattice, target, dict.fromkeys(range(3), 0.4))
        yield Picture(f"planes_{direction}_{name}", planes, f"{direction}: where three planes of nodes go.")


def vignetting_blocks(vignettings: Sequence[Vignetting]) -> Iterator[Block]:
    """The blocks on vignettings; nothing where there are none."""
    if not vignettings:
        return
    rows = tuple(
        (vignetting.setting, vignetting.corners, *(f"{100 * value:.1f} %" for value in vignetting.centre))
        for vignetting in vignettings
    )
    header = ("lens setting", "corners", "centre right", "centre down")
    yield Table("Vignetting that the camera corrects in its JPEGs only", header, rows)
    yield (
        "In the corners the JPEGs are by so much brighter than the RAW. The profile renders the middle; RAW is "
        "brightened by this first. Centres: in per cent of half the diagonal."
    )
