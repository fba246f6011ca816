"""Figures of single shots: the JPEG with its prediction side by side, and maps of the errors over the picture."""

from collections.abc import Callable, Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from lutforge.arrays import Array
from lutforge.colour.srgb import srgb_encode
from lutforge.evaluation.evaluation import Evaluation, EvaluationRow
from lutforge.evaluation.methods import CAMERA_MODEL, COLOUR_POLYNOMIAL, LATTICE, lattice_name
from lutforge.evaluation.predictions import Predictions, with_compared
from lutforge.images.orientation import upright
from lutforge.model.camera_profile import CameraProfile
from lutforge.model.vignetting import vignetting_of
from lutforge.reports.drawing import ERROR_SCALE, Drawing, Panel, Raster
from lutforge.reports.page import Block, Picture
from lutforge.samples.clipping import clipping
from lutforge.samples.extract import places_in_picture
from lutforge.settings import setting_name
from lutforge.shots.read import read_shot
from lutforge.thesis.options import stated_options

MAP_NAMES = {CAMERA_MODEL: "camera model", COLOUR_POLYNOMIAL: "polynomial"}
"""Short names of methods, for the titles of small pictures."""

MAPS_TEXT = (
    "Each shot's JPEG predicted from its RAW, and its white-balanced RAW from its JPEG: by the profile's own model, a "
    "lattice of evenly spaced nodes, the camera model without a lattice, and a polynomial. Each direction "
    "has one scale in all maps; grey: clipped, or outside the RAW. Above each map is its mean over the picture, edges "
    "and textures included; the tables count the shot's even areas only."
)


def shown_shots(method: str, evaluation: Evaluation, files: Mapping[str, Path]) -> list[EvaluationRow]:
    """The shots with the least, the median and the largest mean ΔE00, of those whose RAW file is available."""
    differences = [
        (row.figures.de00_mean, row.shot, row)
        for row in evaluation.rows
        if row.direction == "render" and row.method == method and row.shot in files
        if row.figures.de00_mean is not None
    ]
    ordered = [row for *_, row in sorted(differences, key=lambda entry: entry[:2])]
    chosen = [ordered[round(place)] for place in np.linspace(0, len(ordered) - 1, 3) if ordered]
    return list({row.shot: row for row in chosen}.values())


def shot_pictures(
    profile: CameraProfile, method: str, evaluation: Evaluation, files: Mapping[str, Path]
) -> Iterator[Picture]:
    """The camera's JPEG of the best, the middle and the worst shot, and its prediction from RAW, side by side."""
    rows = shown_shots(method, evaluation, files)
    kinds = {1: ("",), 2: ("best: ", "worst: "), 3: ("best: ", "middle: ", "worst: ")}
    for kind, row in zip(kinds.get(len(rows), ()), rows, strict=True):
        predictions = evaluation.predictions[row.style]
        cells = ShotCells(profile, predictions, row.shot, files[row.shot], COMPARED_ROWS)
        predicted = rendered_cells(partial(_predicted, predictions, method, cells.samples[0]), cells.balanced)
        panels = (cells.panel("the camera's JPEG", cells.jpeg), cells.panel("predicted from RAW", predicted))
        height, width = upright(cells.jpeg, cells.orientation).shape[:2]
        drawing = Drawing((panels,), 5.5 * height / width + 0.3, 11.0)
        seen_by = "not seen by the fit" if cells.held_out else "the fit had seen it"
        difference = f"; ΔE00 {row.figures.de00_mean:.2f} in the mean"
        yield Picture(
            f"shot_{setting_name(row.shot)}", drawing, f"{kind}{row.shot}, {cells.setting}; {seen_by}{difference}."
        )


def rendered_cells(render: Callable[[Array], Array], balanced: Array) -> Array:
    """Render white-balanced RAW (h, w, 3), by a function of colours (n, 3), to encoded values; grey where RAW is NaN.

    A channel that saturates the sensor is at 1, whatever its white balance: else burnt-out light would get its colour.
    """
    inside = np.isfinite(balanced).all(axis=-1)
    rendered = np.full(balanced.shape, 0.5)
    rendered[inside] = np.clip(render(np.clip(balanced[inside], 0.0, 1.0)), 0.0, 1.0)
    return rendered


def _predicted(predictions: Predictions, method: str, sample: int, balanced: Array) -> Array:
    """Encoded values of balanced RAW (n, 3) by the fit that predicts a sample."""
    return predictions.render(method, balanced, np.full(len(balanced), sample))


def error_map_pictures(
    profile: CameraProfile, method: str, evaluation: Evaluation, files: Mapping[str, Path]
) -> Iterator[Block]:
    """Error maps of the best, the middle and the worst shot, of those whose RAW file is available."""
    rows = shown_shots(method, evaluation, files)
    if rows:
        yield MAPS_TEXT
    for row in rows:
        yield error_map(profile, method, row, evaluation.predictions[row.style], files[row.shot])


COMPARED_ROWS = 480
"""Rows of cells of a shot that is shown with its prediction."""
MAPPED_ROWS = 240
"""Rows of cells of an error map."""


class ShotCells:
    """Means of a shot over small squares, the cells, which have less noise and compression artefacts than pixels.

    jpeg: (h, w, 3) encoded; balanced: RAW with white balance, with the vignetting corrected as in the samples, NaN
    outside the RAW; uncorrected: the same with the vignetting; usable: (h, w), not clipped. samples: the rows of the
    shot in the predictions.
    """

    def __init__(self, profile: CameraProfile, predictions: Predictions, name: str, raw_file: Path, rows: int) -> None:
        self.samples = np.flatnonzero(predictions.data.shot == name)
        of_style = predictions.data.samples
        shot = read_shot(raw_file)
        size = max(2, round(shot.jpeg.shape[0] / rows))
        jpeg = shot.jpeg_cells(size)
        raw = shot.raw_cells(size)
        clips = clipping(jpeg, raw)
        self.usable = np.isfinite(raw.mean[..., 0]) & ~np.any(list(clips.values()), axis=0)
        self.jpeg = jpeg.mean / 255.0

        gain = np.median(predictions.data.balanced[self.samples] / of_style.raw[self.samples], axis=0)
        self.uncorrected = raw.mean * gain
        self.balanced = self.uncorrected
        metadata = shot.metadata
        vignetting = vignetting_of(profile.vignettings, metadata.lens, metadata.focal_mm, metadata.aperture)
        if vignetting is not None:
            height, width = self.usable.shape
            centres = size * (np.argwhere(np.ones((height, width)))[:, ::-1] + 0.5)
            stops = vignetting.stops(places_in_picture(shot, centres)).reshape(height, width, 3)
            self.balanced = self.balanced * 2.0**stops

        self.orientation = shot.raw.orientation
        self.held_out = bool(predictions.held_out[self.samples].all())
        self.setting = f"{of_style.style[self.samples[0]]}/{of_style.white_balance[self.samples[0]]}"

    def panel(self, title: str, values: Array, **scale: Any) -> Panel:
        """A picture of values (h, w) or (h, w, 3), upright."""
        return Panel(title, (Raster(upright(values, self.orientation)),), bare=True, equal=True, **scale)


def error_map(
    profile: CameraProfile, method: str, row: EvaluationRow, predictions: Predictions, raw_file: Path
) -> Picture:
    """The errors of a shot over the picture, in both directions, by fits that have not seen it (thesis 5.5 and 5.6).

    The first row is of RAW → JPEG: the camera's JPEG, then a map of each method's errors; the second row is of
    JPEG → RAW, with the balanced RAW. Errors are norms of RGB, grey where the shot is clipped or outside the RAW.
    method: of the profile's model.
    """
    name = row.shot
    options = stated_options(profile.options)
    predictions = with_compared(predictions, name, profile.shots, options)
    cells = ShotCells(profile, predictions, name, raw_file, MAPPED_ROWS)
    fits = predictions.fits[predictions.fold[cells.samples[0]]]
    uniform = lattice_name(options.size, nonuniform=False)
    candidates = dict.fromkeys((method, LATTICE, uniform, CAMERA_MODEL, COLOUR_POLYNOMIAL))
    methods = [candidate for candidate in candidates if candidate in fits]

    # The RAW is shown scaled such that its brightest percent is white.
    bright = np.nanpercentile(cells.uncorrected, 99)
    scene = np.nan_to_num(srgb_encode(np.clip(cells.uncorrected / bright, 0.0, 1.0)), nan=0.5)
    balanced = cells.balanced[cells.usable]
    encoded = cells.jpeg[cells.usable]
    sample = np.repeat(cells.samples[:1], len(balanced))

    rows: list[tuple[Panel, ...]] = []
    for direction, predict, source, target, picture, most in (
        ("RAW → JPEG", predictions.render, balanced, encoded, ("the camera's JPEG", cells.jpeg), ERROR_SCALE),
        # Linear values, and so their errors, are smaller than encoded ones.
        (
            "JPEG → RAW",
            predictions.linearize,
            encoded,
            balanced,
            ("the RAW, balanced, stretched", scene),
            0.3 * ERROR_SCALE,
        ),
    ):
        panels = [cells.panel(*picture)]
        for compared in methods:
            errors = np.full(cells.usable.shape, np.nan)
            errors[cells.usable] = np.linalg.norm(np.clip(predict(compared, source, sample), 0, 1) - target, axis=1)
            title = f"{direction}\n{MAP_NAMES.get(compared, compared)}: mean {np.nanmean(errors):.4f}"
            panels.append(cells.panel(title, errors, scale=(0.0, most), scale_name=" "))
        rows.append(tuple(panels))
    height, width = upright(cells.jpeg, cells.orientation).shape[:2]
    drawing = Drawing(tuple(rows), 11 / len(rows[0]) * height / width + 0.6, 11.0)
    held_out = "not seen by the fits" if cells.held_out else "the fit had seen it"
    caption = f"{name}, {cells.setting}; {held_out}; mean error of the shot's samples {row.figures.mean:.4f}."
    return Picture(f"error_map_{setting_name(name)}", drawing, caption)
