"""Error maps of real shots, in both directions, by fits that never saw the shot (thesis, Figs. 5.5 and 5.6)."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from lutforge.arrays import Array
from lutforge.calibration.options import options_from_json
from lutforge.colour.srgb import srgb_encode
from lutforge.errors import CalibrationError
from lutforge.evaluation.evaluate import evaluate
from lutforge.evaluation.evaluation import Evaluation
from lutforge.evaluation.held_out import Predictions, with_compared
from lutforge.evaluation.methods import COLOUR_POLYNOMIAL, LATTICE, RBF, lattice_name
from lutforge.model.camera_profile import CameraProfile
from lutforge.model.directions import Both
from lutforge.model.falloff import Falloff, falloff_of
from lutforge.progress import Progress
from lutforge.report.figures import ERROR_SCALE, MAP
from lutforge.samples.clipping import Extremes, clipping, saturation_levels
from lutforge.samples.extract import places_in_picture
from lutforge.samples.sample_set import SampleSet
from lutforge.samples.tiles import jpeg_cells
from lutforge.shots.cells import raw_on_jpeg_cells
from lutforge.shots.read import TURNS, read_shot
from lutforge.shots.shot import Shot

DIRECTIONS = (("RAW → JPEG", ERROR_SCALE), ("JPEG → RAW", 0.3 * ERROR_SCALE))
"""Each with the error that is drawn brightest: linear values are small where encoded ones are not; so are errors."""


@dataclass(frozen=True, eq=False)
class ErrorRow:
    """The errors of one direction as they are drawn, up to a scale, beside a picture of what predicts them."""

    title: str
    scale: float
    name: str
    picture: Array
    errors: Mapping[str, Array]


@dataclass(frozen=True, eq=False)
class ErrorMaps:
    """The errors of one shot, pixel by pixel.

    picture: the camera's JPEG, upright (h, w, 3), encoded; raw: the white-balanced RAW, stretched and encoded, grey
    where there is none; errors: by method the RGB error (h, w), of RAW with white balance, NaN where clipped or outside
    the RAW; held_out: whether the fits had not seen the shot.
    """

    shot: str
    setting: str
    picture: Array
    raw: Array
    errors: Both[Mapping[str, Array]]
    held_out: bool

    @property
    def rows(self) -> tuple[ErrorRow, ...]:
        """What is drawn of them: a row for each direction."""
        pictures = (("the camera's JPEG", self.picture), ("the RAW,\nbalanced, stretched", self.raw))
        render, linearize = (
            ErrorRow(*drawn, *picture, errors)
            for drawn, picture, errors in zip(DIRECTIONS, pictures, self.errors, strict=True)
        )
        return render, linearize


def error_maps(
    shot: Shot, predictions: Predictions, methods: Sequence[str], falloffs: Sequence[Falloff] = ()
) -> ErrorMaps:
    """Predict a shot, of which the predictions hold samples, both ways by the fits that predict these samples.

    falloffs: of the profile, which brighten the RAW away from the middle as they did that of the samples.
    """
    cell = max(2, round(shot.jpeg.shape[0] / 240))  # averages some noise and compression away
    jpeg, raw = jpeg_cells(shot.jpeg, cell), raw_on_jpeg_cells(shot, cell)
    clip = clipping(jpeg.extremes, Extremes(raw.minimum, raw.maximum), saturation_levels(shot.raw.pixels))
    usable = np.isfinite(raw.mean[..., 0]) & ~clip.any
    own = np.flatnonzero(predictions.data.shot == shot.name)
    samples = predictions.data.samples
    gain = np.median(predictions.data.balanced[own] / samples.raw[own], axis=0)
    bright = np.nanpercentile(raw.mean * gain, 99)
    scene = np.nan_to_num(srgb_encode(np.clip(raw.mean * gain / bright, 0.0, 1.0)), nan=0.5)
    falloff = falloff_of(falloffs, shot.metadata.lens, shot.metadata.focal_mm, shot.metadata.aperture)
    if falloff is not None:
        centres = cell * (np.argwhere(usable)[:, ::-1] + 0.5)
        gain = gain * 2.0 ** falloff.stops(places_in_picture(shot, centres))[:, None]
    balanced, encoded = raw.mean[usable] * gain, jpeg.mean[usable] / 255.0
    fold = np.repeat(own[:1], len(balanced))
    turns = -TURNS.get(shot.raw.flip, 0)

    def error(predicted: Array, measured: Array) -> Array:
        found = np.full(usable.shape, np.nan)
        found[usable] = np.linalg.norm(np.clip(predicted, 0, 1) - measured, axis=1)
        return np.rot90(found, turns)

    rendered = {name: error(predictions.render(name, balanced, fold), encoded) for name in methods}
    linearized = {name: error(predictions.linearize(name, encoded, fold), balanced) for name in methods}
    setting = f"{samples.style[own[0]]}/{samples.white_balance[own[0]]}"
    held_out = bool(predictions.held_out[own].all())
    pictures = (np.rot90(jpeg.mean / 255.0, turns), np.rot90(scene, turns))
    return ErrorMaps(shot.name, setting, *pictures, Both(rendered, linearized), held_out)


def own_method(profile: CameraProfile, evaluation: Evaluation) -> str:
    """The method that is the profile's own model."""
    methods = {row.method for row in evaluation.rows}
    physical = LATTICE not in methods or options_from_json(profile.options).model == "rbf"
    return RBF if physical and RBF in methods else LATTICE


def maps_of_shot(profile: CameraProfile, evaluation: Evaluation, shot: str, raw_file: Path) -> ErrorMaps:
    """Predict a shot of an evaluation by the profile's own model, a uniform lattice, RBFs and a polynomial.

    Raises CalibrationError where the evaluation holds no sample of the shot.
    """
    held = [(name, each) for name, each in evaluation.predictions.items() if (each.data.shot == shot).any()]
    if not held:
        raise CalibrationError(f"{shot}: all its samples are clipped; choose another shot")
    style, found = held[0]
    options = options_from_json(profile.options)
    found = with_compared(found, shot, profile.styles[style], profile.shots, options)
    fits = found.fits[found.fold[found.data.shot == shot][0]]
    named = (
        own_method(profile, evaluation),
        LATTICE,
        lattice_name(options.size, nonuniform=False),
        RBF,
        COLOUR_POLYNOMIAL,
    )
    methods = [method for method in dict.fromkeys(named) if method in fits]
    return error_maps(replace(read_shot(raw_file), name=shot), found, methods, profile.falloffs)


def maps_of_file(
    profile: CameraProfile, samples: SampleSet, shot: str, raw_file: Path, progress: Progress
) -> ErrorMaps:
    """Leave shots of one style out in turn, and predict one of them; see `maps_of_shot`.

    Raises CalibrationError where the samples do not determine the fits.
    """
    style = samples.style[samples.shot == shot][0]
    evaluation = evaluate(profile, samples.select(samples.style == style), progress)
    progress("error maps", 0.9)
    return maps_of_shot(profile, evaluation, shot, raw_file)


def error_maps_figure(maps: ErrorMaps) -> Figure:
    """The photograph, and beside it the errors of each method, a row and a scale for each direction."""
    height, width = maps.picture.shape[:2]
    columns = 1 + len(maps.errors.render)
    figure = Figure(figsize=(11, 22 / columns * height / width + 1.2), layout="compressed")
    axes = figure.subplots(2, columns, squeeze=False)
    for row, shown in zip(axes, maps.rows, strict=True):
        row[0].imshow(np.clip(shown.picture, 0, 1))
        row[0].set_title(shown.name.replace("\n", " "), fontsize=8)
        for axis, (method, error) in zip(row[1:], shown.errors.items(), strict=True):
            drawn = axis.imshow(error, cmap=MAP, vmin=0, vmax=shown.scale, interpolation="nearest")
            axis.set_facecolor("0.85")
            axis.set_title(f"{shown.title}\n{method}: mean {np.nanmean(error):.4f}", fontsize=8)
        figure.colorbar(drawn, ax=row, shrink=0.8, extend="max", aspect=20, pad=0.01)
    for axis in axes.flat:
        axis.set(xticks=[], yticks=[])
        axis.spines[:].set_visible(False)
    return figure
