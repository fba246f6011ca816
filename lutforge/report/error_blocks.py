"""The blocks of a report: errors, maps of real shots, samples, settings, and the models of a style."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

from lutforge.calibration.options import options_from_json
from lutforge.calibration.physical.brightness_transfer import judge, transfer_functions
from lutforge.calibration.physical.exposure_pairs import ExposurePairs, pairs_of_samples
from lutforge.calibration.physical.matrix_and_response import fit_matrix_and_response
from lutforge.calibration.style_data import StyleData
from lutforge.calibration.style_fit import uniform_lattice_errors
from lutforge.errors import CalibrationError
from lutforge.evaluation.evaluation import Evaluation
from lutforge.evaluation.expected_error import by_distance, held_out_errors
from lutforge.evaluation.linearization import response_deltas
from lutforge.model.camera_profile import CameraProfile
from lutforge.model.profile_data import PictureStyle
from lutforge.report.error_maps import maps_of_shot
from lutforge.report.figures import (
    ENDS,
    brightness_transfer_figure,
    chromaticity_figure,
    error_boxes,
    error_by_colour_figure,
    gamut_figure,
    lattice_figure,
    levels_on_errors,
    plane_figure,
    response_figure,
)
from lutforge.report.page import Block, Picture, Text
from lutforge.report.tables import TITLES, Table, error_table, more_tables
from lutforge.samples.extract import ShotSamples
from lutforge.samples.sample_set import SampleSet
from lutforge.settings import setting_name

MAPS_TEXT = (
    "Each shot's JPEG predicted from its RAW, and its white-balanced RAW from its JPEG: by the profile's own model, a "
    "lattice of evenly spaced nodes, the physical model with its gamut map by RBFs, and a polynomial. Each direction "
    "has one scale in all maps; grey: clipped, or outside the RAW. Above each map is its mean over the picture, edges "
    "and textures included; the tables count the shot's even areas only."
)


def error_tables(own: str, evaluation: Evaluation) -> Iterator[Block]:
    """Tabulate the errors of both directions, of RAW, of refinishing, and of exposure pairs."""
    for direction, title in TITLES.items():
        rows = [row for row in evaluation.rows if row.direction == direction and row.shot.startswith("all")]
        if rows:
            held = "held out by shot" if all(row.held_out for row in rows) else "NOT all held out"
            yield error_table(f"{title}, all shots, {held}", rows, own)
    shots = [
        row
        for row in evaluation.rows
        if row.direction == "render" and row.method == own and not row.shot.startswith("all")
    ]
    if shots:
        yield error_table("RAW → JPEG by shot", shots)
    yield from _by_distance(own, evaluation)
    yield from more_tables(evaluation, own)


def _by_distance(own: str, evaluation: Evaluation) -> Iterator[Block]:
    """How the error grows away from the samples, in encoded RGB."""
    rows = []
    for style, found in evaluation.predictions.items():
        told = held_out_errors(found, own, fit_matrix_and_response(found.data.balanced, found.data.encoded))
        for distance, errors in by_distance(told):
            rows.append((style, f"{distance:.0f}", f"{errors['render']:.4f}", f"{errors['linearize']:.4f}"))
    if rows:
        header = ("style", "codes to the nearest sample", "RAW → JPEG", "JPEG → RAW, as rendered")
        yield Table("Mean error by distance to the nearest sample", header, tuple(rows))


def error_pictures(own: str, evaluation: Evaluation) -> Iterator[Block]:
    """Draw errors by method, and by colour."""
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
        error = np.linalg.norm(np.clip(predictions.predicted.render[own], 0, 1) - predictions.data.encoded, axis=1)
        said = np.isfinite(error)
        held = "held out by shot" if predictions.held_out[said].all() else "NOT all held out"
        yield Picture(
            f"error_by_colour_{style}",
            error_by_colour_figure(predictions.data.encoded[said], error[said]),
            f"{style}: which colours are predicted badly, RAW → JPEG, {held}.",
        )


def error_map_pictures(
    profile: CameraProfile, own: str, evaluation: Evaluation, files: Mapping[str, Path]
) -> Iterator[Block]:
    """Draw the errors of the best, the middle and the worst shot whose RAW file is at hand."""
    rows = [row for row in evaluation.rows if row.direction == "render" and row.method == own and row.shot in files]
    rows.sort(key=lambda row: row.figures.mean)
    chosen = {rows[round(index)].shot: rows[round(index)] for index in np.linspace(0, len(rows) - 1, 3) if rows}
    if chosen:
        yield Text(MAPS_TEXT)
    for name, row in chosen.items():
        maps = maps_of_shot(profile, evaluation, name, files[name])
        held = "not seen by the fits" if maps.held_out else "the fit had seen it"
        caption = f"{name}, {maps.setting}; {held}; mean error of the shot's samples {row.figures.mean:.4f}."
        yield Picture(f"error_map_{setting_name(name)}", maps.drawing, caption)


def sample_blocks(samples: SampleSet, accounts: Sequence[ShotSamples]) -> Iterator[Block]:
    """Show the samples and the shots that they are from."""
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


def exposure_blocks(data: Mapping[str, StyleData]) -> Iterator[Block]:
    """Say whether each style's response is a fixed property of the camera, as pairs of exposures show it."""
    for name, style in data.items():
        try:
            pairs = pairs_of_samples(style.samples)
            verdict, functions = judge(pairs), transfer_functions(pairs)
        except CalibrationError:  # no two shots show the same patches at different exposures, or too few
            continue
        yield Text(f"{name}: {verdict.told}.")
        header = ("f is fitted to", "red", "green", "blue")
        rows = tuple((what, *(f"{value:.4f}" for value in each)) for what, each in response_deltas(pairs).items())
        caption = f"{name}: linearization error of f over pairs of exposures, unsaturated colours (1 = full scale)"
        yield Table(caption, header, rows)
        yield from _shutters(name, style.samples, pairs)
        caption = (
            f"{name}: JPEG values of one exposure against another's, with f(k f⁻¹(I)); crosses leave it. Dashed: an f "
            "that is fitted to all colours, outliers too."
        )
        yield Picture(f"brightness_transfer_{name}", brightness_transfer_figure(functions), caption)


def _shutters(name: str, samples: SampleSet, pairs: ExposurePairs) -> Iterator[Block]:
    """Tabulate how exact the exposure times of the files are, beside RAW, which is linear (thesis 3.1)."""
    stated = np.array([np.nanmedian(samples.exposure_s[samples.shot == shot]) for shot in pairs.shots])
    if not np.all(stated > 0):
        return
    error = pairs.shot_exposure - np.log(stated)
    rows = [
        (shot, f"{time:.3g} s" if time >= 0.3 else f"1/{1 / time:.3g} s", f"{ratio:.3f}")
        for shot, time, ratio in zip(pairs.shots, stated, np.exp(error - np.median(error)), strict=True)
    ]
    yield Table(f"{name}: exposures of the shots, as RAW tells them", ("shot", "stated", "true / stated"), rows)


def style_pictures(profile: CameraProfile, name: str, style: PictureStyle, data: StyleData | None) -> Iterator[Block]:
    """Draw the models of a style."""
    what = "the tone response" if style.physical else "the grey axis of the lattice"
    yield Picture(f"response_{name}", response_figure(style), f"{name}: {what}, per channel.")
    maps = {f"{name}, rendering": model.gamut_map for model in style.physical[:1]}
    if maps:
        maps[f"{name}, linearizing"] = style.physical[0].inverse_gamut_map
        text = (
            "The gamut map at constant luminance Y in linear sRGB: arrows lead from the colour before it to the colour "
            "after; dots are control points."
        )
        yield Picture(f"gamut_map_{name}", gamut_figure(maps), text)
    for direction, lattice in style.lattices.items():
        source, target = ENDS[direction]
        caption = f"{direction}: nodes lie densely where the function bends; those without samples continue the model."
        yield Picture(f"lattice_{direction}_{name}", lattice_figure(style, [direction]), caption)
        if data is not None:
            options = options_from_json(profile.options)
            histograms = uniform_lattice_errors(data, options, direction)
            caption = f"{direction}: node levels (ticks) follow the error that a uniform lattice makes."
            yield Picture(f"levels_{direction}_{name}", levels_on_errors(lattice, histograms, source), caption)
        yield Picture(
            f"planes_{direction}_{name}",
            plane_figure(lattice, target, dict.fromkeys(range(3), 0.4)),
            f"{direction}: where three planes of nodes go.",
        )
