"""Error maps of real shots, in both directions, by fits that never saw the shot (thesis, Figs. 5.5 and 5.6)."""

from pathlib import Path

import numpy as np

from lutforge.arrays import Array
from lutforge.calibration.options import options_from_json
from lutforge.colour.srgb import srgb_encode
from lutforge.errors import CalibrationError
from lutforge.evaluation.evaluation import Evaluation
from lutforge.evaluation.methods import COLOUR_POLYNOMIAL, LATTICE, RBF, lattice_name, with_compared
from lutforge.model.camera_profile import CameraProfile
from lutforge.model.falloff import falloff_of
from lutforge.report.drawing import ERROR_SCALE, Drawing, Panel, Raster
from lutforge.samples.extract import places_in_picture
from lutforge.samples.tiles import clipping, saturation_levels
from lutforge.shots.read import TURNS, read_shot

DIRECTIONS = (("RAW → JPEG", ERROR_SCALE), ("JPEG → RAW", 0.3 * ERROR_SCALE))
"""Each with the error that is drawn brightest: linear values are small where encoded ones are not; so are errors."""


def own_method(profile: CameraProfile, evaluation: Evaluation) -> str:
    """The method that is the profile's own model."""
    methods = {row.method for row in evaluation.rows}
    physical = LATTICE not in methods or options_from_json(profile.options).model == "rbf"
    return RBF if physical and RBF in methods else LATTICE


def maps_of_shot(
    profile: CameraProfile, evaluation: Evaluation, name: str, raw_file: Path
) -> tuple[Drawing, str, bool]:
    """Draw the errors of a shot by the profile's own model, a uniform lattice, RBFs and a polynomial, pixel by pixel.

    They are norms of RGB, of RAW with white balance, a row for each direction: of the camera's JPEG and of its RAW,
    balanced and stretched, before the maps of what predicts it; grey where it is clipped or outside the RAW. The RAW is
    brightened away from the middle by the profile's falloffs, as that of the samples was. Returned are also the shot's
    setting, and whether the fits had not seen it.
    """
    held = [(style, each) for style, each in evaluation.predictions.items() if (each.data.shot == name).any()]
    if not held:
        raise CalibrationError(f"{name}: all its samples are clipped; choose another shot")
    style, predictions = held[0]
    options = options_from_json(profile.options)
    predictions = with_compared(predictions, name, profile.styles[style], profile.shots, options)
    own = np.flatnonzero(predictions.data.shot == name)
    fits = predictions.fits[predictions.fold[own[0]]]
    uniform = lattice_name(options.size, nonuniform=False)
    named = dict.fromkeys((own_method(profile, evaluation), LATTICE, uniform, RBF, COLOUR_POLYNOMIAL))
    methods = [method for method in named if method in fits]

    # Averages over cells take some noise and compression away
    shot, samples = read_shot(raw_file), predictions.data.samples
    cell = max(2, round(shot.jpeg.shape[0] / 240))
    jpeg, raw = shot.jpeg_cells(cell), shot.raw_cells(cell)
    clips = clipping(jpeg, raw, saturation_levels(shot.raw.pixels))
    usable = np.isfinite(raw.mean[..., 0]) & ~np.any(list(clips.values()), axis=0)
    gain = np.median(predictions.data.balanced[own] / samples.raw[own], axis=0)
    bright = np.nanpercentile(raw.mean * gain, 99)
    scene = np.nan_to_num(srgb_encode(np.clip(raw.mean * gain / bright, 0.0, 1.0)), nan=0.5)
    falloff = falloff_of(profile.falloffs, shot.metadata.lens, shot.metadata.focal_mm, shot.metadata.aperture)
    if falloff is not None:
        centres = cell * (np.argwhere(usable)[:, ::-1] + 0.5)
        gain = gain * 2.0 ** falloff.stops(places_in_picture(shot, centres))[:, None]
    balanced, encoded = raw.mean[usable] * gain, jpeg.mean[usable] / 255.0
    fold = np.repeat(own[:1], len(balanced))
    turns = -TURNS.get(shot.raw.flip, 0)

    def error(predicted: Array, measured: Array) -> Array:
        errors = np.full(usable.shape, np.nan)
        errors[usable] = np.linalg.norm(np.clip(predicted, 0, 1) - measured, axis=1)
        return np.rot90(errors, turns)

    both = (
        {method: error(predictions.render(method, balanced, fold), encoded) for method in methods},
        {method: error(predictions.linearize(method, encoded, fold), balanced) for method in methods},
    )
    pictures = {"the camera's JPEG": jpeg.mean / 255.0, "the RAW, balanced, stretched": scene}
    height, width = np.rot90(jpeg.mean, turns).shape[:2]
    rows: list[tuple[Panel, ...]] = []
    for (direction, scale), (title, picture), errors in zip(DIRECTIONS, pictures.items(), both, strict=True):
        panels = [Panel(title, (Raster(np.rot90(picture, turns)),), bare=True, equal=True)]
        for method, each in errors.items():
            words = f"{direction}\n{method}: mean {np.nanmean(each):.4f}"
            panels.append(Panel(words, (Raster(each),), bare=True, equal=True, scale=(0.0, scale), scale_name=" "))
        rows.append(tuple(panels))
    drawing = Drawing(tuple(rows), 11 / len(rows[0]) * height / width + 0.6, 11.0)
    setting = f"{samples.style[own[0]]}/{samples.white_balance[own[0]]}"
    return drawing, setting, bool(predictions.held_out[own].all())
