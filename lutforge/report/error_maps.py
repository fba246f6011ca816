"""Error maps of real shots, in both directions, by fits that never saw the shot (thesis, Figs. 5.5 and 5.6)."""

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

    picture: the camera's JPEG, upright (h, w, 3), encoded; rendered, linearized: by method the RGB error (h, w) of RAW
    → JPEG, and of JPEG → RAW with white balance, NaN where clipped or outside the RAW; held_out: whether the fits had
    not seen the shot.
    """

    shot: str
    setting: str
    picture: Array
    rendered: Mapping[str, Array]
    linearized: Mapping[str, Array]
    held_out: bool


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
    return ErrorMaps(shot.name, setting, np.rot90(jpeg.mean / 255.0, turns), rendered, linearized, held_out)


def error_maps_figure(maps: ErrorMaps) -> Figure:
    """The photograph, and beside it the errors of each method, a row and a scale for each direction."""
    height, width = maps.picture.shape[:2]
    columns = 1 + len(maps.rendered)
    figure = Figure(figsize=(11, 22 / columns * height / width + 1.2), layout="compressed")
    axes = figure.subplots(2, columns, squeeze=False)
    axes[0, 0].imshow(np.clip(maps.picture, 0, 1))
    axes[0, 0].set_title("the camera's JPEG", fontsize=9)
    # Linear values are small where encoded ones are not: their errors are, too.
    rows = (("RAW → JPEG", maps.rendered, ERROR_SCALE), ("JPEG → RAW", maps.linearized, 0.3 * ERROR_SCALE))
    for row, (title, errors, scale) in zip(axes, rows, strict=True):
        drawn = None
        for axis, (name, error) in zip(row[1:], errors.items(), strict=True):
            drawn = axis.imshow(error, cmap=MAP, vmin=0, vmax=scale, interpolation="nearest")
            axis.set_facecolor("0.85")
            axis.set_title(f"{title}\n{name}: mean {np.nanmean(error):.4f}", fontsize=8)
        if drawn is not None:
            figure.colorbar(drawn, ax=row, shrink=0.8, extend="max", aspect=20, pad=0.01)
    for axis in axes.flat:
        axis.set(xticks=[], yticks=[])
        axis.spines[:].set_visible(False)
    axes[1, 0].set_visible(False)
    return figure
