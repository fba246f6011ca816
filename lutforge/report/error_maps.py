"""Error maps of real shots: RAW rendered by fits that never saw the shot, against the camera's JPEG (Fig. 5.5)."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure

from lutforge.arrays import Array
from lutforge.evaluation.held_out import Predictions
from lutforge.model.falloff import Falloff, falloff_of
from lutforge.report.figures import ERROR_SCALE, MAP
from lutforge.samples.clipping import Extremes, clipping, saturation_levels
from lutforge.samples.extract import places_in_picture
from lutforge.samples.tiles import jpeg_cells
from lutforge.shots.cells import raw_on_jpeg_cells
from lutforge.shots.read import TURNS
from lutforge.shots.shot import Shot


@dataclass(frozen=True, eq=False)
class ErrorMaps:
    """The errors of one shot, pixel by pixel.

    picture: the camera's JPEG, upright (h, w, 3), encoded; errors: by method the RGB error (h, w), NaN where clipped or
    outside the RAW; held_out: whether the fits had not seen the shot.
    """

    shot: str
    setting: str
    picture: Array
    errors: Mapping[str, Array]
    held_out: bool


def error_maps(
    shot: Shot, predictions: Predictions, methods: Sequence[str], falloffs: Sequence[Falloff] = ()
) -> ErrorMaps:
    """Render a shot, of which the predictions hold samples, by the fits that predict these samples.

    falloffs: of the profile, which brighten the RAW away from the middle as they did that of the samples.
    """
    cell = max(2, round(shot.jpeg.shape[0] / 240))  # averages some noise and compression away
    jpeg, raw = jpeg_cells(shot.jpeg, cell), raw_on_jpeg_cells(shot, cell)
    clip = clipping(jpeg.extremes, Extremes(raw.minimum, raw.maximum), saturation_levels(shot.raw.pixels))
    usable = np.isfinite(raw.mean[..., 0]) & ~clip.any
    own = np.flatnonzero(predictions.data.shot == shot.name)
    samples = predictions.data.samples
    gain = np.median(predictions.data.balanced[own] / samples.raw[own], axis=0)
    falloff = falloff_of(falloffs, shot.metadata.lens, shot.metadata.focal_mm, shot.metadata.aperture)
    if falloff is not None:
        centres = cell * (np.argwhere(usable)[:, ::-1] + 0.5)
        gain = gain * 2.0 ** falloff.stops(places_in_picture(shot, centres))[:, None]
    balanced, encoded = raw.mean[usable] * gain, jpeg.mean[usable] / 255.0
    fold = np.repeat(own[:1], len(balanced))
    turns = -TURNS.get(shot.raw.flip, 0)
    errors = {}
    for name in methods:
        error = np.full(usable.shape, np.nan)
        rendered = np.clip(predictions.render(name, balanced, fold), 0, 1)
        error[usable] = np.linalg.norm(rendered - encoded, axis=1)
        errors[name] = np.rot90(error, turns)
    setting = f"{samples.style[own[0]]}/{samples.white_balance[own[0]]}"
    held_out = bool(predictions.held_out[own].all())
    return ErrorMaps(shot.name, setting, np.rot90(jpeg.mean / 255.0, turns), errors, held_out)


def error_maps_figure(maps: ErrorMaps) -> Figure:
    """The photograph and the errors of each method beside it, on one scale."""
    height, width = maps.picture.shape[:2]
    columns = 1 + len(maps.errors)
    figure = Figure(figsize=(11, 11 / columns * height / width + 0.75), layout="compressed")
    axes = figure.subplots(1, columns, squeeze=False)[0]
    axes[0].imshow(np.clip(maps.picture, 0, 1))
    axes[0].set_title("the camera's JPEG", fontsize=9)
    drawn = None
    for axis, (name, error) in zip(axes[1:], maps.errors.items(), strict=True):
        drawn = axis.imshow(error, cmap=MAP, vmin=0, vmax=ERROR_SCALE, interpolation="nearest")
        axis.set_facecolor("0.85")
        axis.set_title(f"{name}: mean {np.nanmean(error):.4f}", fontsize=9)
    for axis in axes:
        axis.set(xticks=[], yticks=[])
        axis.spines[:].set_visible(False)
    if drawn is not None:
        figure.colorbar(drawn, ax=axes, shrink=0.6, extend="max", aspect=30, orientation="horizontal", pad=0.02)
    return figure
