"""What is known of a calibrated camera, for reading: plain answers first, what they rest on behind them.

A report is made of blocks of text, tables and pictures, and becomes one HTML file that needs nothing else.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined
from matplotlib.figure import Figure
from scipy.optimize import brentq

from lutforge import __version__
from lutforge.arrays import Array
from lutforge.atomic_write import atomic_path
from lutforge.calibration.brightness_transfer import judge, transfer_functions
from lutforge.calibration.exposure_pairs import pairs_of_samples
from lutforge.calibration.lattice.fit import squares
from lutforge.calibration.style import StyleData
from lutforge.colour.srgb import delta_e_2000, srgb_encode, srgb_to_lab
from lutforge.errors import CalibrationError
from lutforge.evaluation.evaluation import Evaluation, EvaluationRow, evaluate
from lutforge.evaluation.further_errors import response_deltas
from lutforge.evaluation.methods import COLOUR_POLYNOMIAL, LATTICE, MODEL, compared_fits, lattice_name
from lutforge.evaluation.next_shots import colour_gaps
from lutforge.evaluation.predictions import Predictions, with_compared
from lutforge.images.orientation import upright
from lutforge.model.camera_profile import CameraProfile, through_camera
from lutforge.model.coverage import linearizing_error
from lutforge.model.gamut_map import GamutMap
from lutforge.model.inverse_gamut_map import SolvedInverse
from lutforge.model.profile import PictureStyle
from lutforge.model.provenance import ResponseOnly
from lutforge.model.vignetting import Vignetting, vignetting_of
from lutforge.progress import Progress, part, silent
from lutforge.reports import figures
from lutforge.reports.figures import ERROR_SCALE, Drawing, Line, Panel, Raster
from lutforge.reports.matplotlib_figure import figure_of, to_svg
from lutforge.reports.tables import (
    TITLES,
    Table,
    balance_table,
    error_table,
    exposure_time,
    matrix_table,
    more_tables,
)
from lutforge.samples.clipping import clipping
from lutforge.samples.extract import ShotSamples, places_in_picture
from lutforge.samples.sample_set import SampleSet
from lutforge.settings import setting_name
from lutforge.shots.read import read_shot
from lutforge.thesis.lattice import error_histogram
from lutforge.thesis.options import ThesisOptions, stated_options


@dataclass(frozen=True, eq=False)
class Picture:
    """A figure; name: its own within a page."""

    name: str
    drawing: Drawing
    caption: str

    @cached_property
    def figure(self) -> Figure:
        """The figure as matplotlib draws it."""
        return figure_of(self.drawing)

    @cached_property
    def svg(self) -> str:
        """The figure as an <svg> element, whose ids are its own within a page."""
        prefix = re.sub(r"\W", "_", self.name)
        return re.sub(r'(id="|href="#|url\(#)', rf"\g<1>{prefix}_", to_svg(self.figure))


Block = str | tuple[str, ...] | Picture | Table
"""A paragraph, sentences one below the other, a figure, a table."""

Sections = Mapping[str, tuple[Block, ...]]
"""Headings and what stands below each."""


@dataclass(frozen=True, eq=False)
class Report:
    """A page: its title, the line below it, what it says in short, its sections, and answers that come before them."""

    title: str
    subtitle: str
    lead: tuple[str, ...] = ()
    sections: Sections = field(default_factory=dict)
    answers: Sections = field(default_factory=dict)

    @property
    def pictures(self) -> Sequence[Picture]:
        """All figures in order."""
        blocks = (block for part in (self.answers, self.sections) for blocks in part.values() for block in blocks)
        return [block for block in blocks if isinstance(block, Picture)]


@matplotlib.rc_context({"text.parse_math": False})  # names may hold dollar signs
def build_report(
    profile: CameraProfile,
    samples: SampleSet | None = None,
    accounts: Sequence[ShotSamples] = (),
    files: Mapping[str, Path] | None = None,
    progress: Progress = silent,
) -> Report:
    """Build the report of a profile, and with samples its errors on shots that were left out.

    accounts: of the shots that the samples are from; files: the RAW file of each shot by name, for error maps.
    Raises CalibrationError where the samples hold none of the profile's styles.
    """
    options, lens = stated_options(profile.options), list(vignetting_blocks(profile.vignettings))
    evaluation, own = None, LATTICE  # the method that is the profile's own model
    pictures: tuple[Picture, ...] = ()
    sections: dict[str, tuple[Block, ...]] = {"Notes": (profile.notes,) if profile.notes else ()}
    data: dict[str, StyleData] = {}
    if samples is not None:
        evaluation = evaluate(profile, samples, part(progress, 0.0, 0.8))
        methods = {row.method for row in evaluation.rows}
        if MODEL in methods and not isinstance(options, ThesisOptions):
            own = MODEL
        data = {name: predictions.data for name, predictions in evaluation.predictions.items()}
        notes = tuple(dict.fromkeys((*profile.notes, *evaluation.notes)))
        progress("error maps", 0.8)
        sections["Notes"] = (notes,) if notes else ()
        sections["Errors"] = (*error_tables(own, evaluation), *error_pictures(own, evaluation))
        sections["Errors on real shots"] = tuple(error_map_pictures(profile, own, evaluation, files or {}))
        if evaluation.deviations:
            title = "Shots that deviate from the fixed rendering, with standard errors"
            rows = [(each.shot, *each.cells) for each in evaluation.deviations]
            lens.append(Table(title, ("shot", "exposure, EV", "contrast", "saturation"), rows))
        pictures = tuple(shot_pictures(profile, own, evaluation, files or {}))
    progress("models", 0.9)
    sections["Lens and scene"] = tuple(lens)
    sections["White balances and matrix"] = balance_table(profile), matrix_table(profile)
    for name, style in profile.styles.items():
        sections[f"Style {name}"] = tuple(style_pictures(profile, name, style, data.get(name)))
    if samples is not None:
        sections["Samples"] = tuple(sample_blocks(samples, accounts))
        sections["Exposures"] = tuple(exposure_blocks(data))
    progress("done", 1.0)
    method = "by the thesis's method" if isinstance(options, ThesisOptions) else "by LutForge's own method"
    return Report(
        f"{profile.camera}: calibration report",
        f"Picture styles: {', '.join(profile.styles)}. White balances: {', '.join(profile.white_balances)}. "
        f"Shots: {len(profile.shots)}. Calibrated {method}, with lattices of {options.size}³ nodes.",
        sections={title: blocks for title, blocks in sections.items() if blocks},
        answers=answers(profile, own, evaluation, data, pictures),
    )


# --- Answers: how good a profile is, what it is fit for, what to photograph next -------------------------------------


YES = "yes, on colours like those of the shots"
VISIBILITY = (
    (1.0, "less than an eye sees side by side", YES),  # about what is just noticed (CIE 142-2001)
    (2.0, "what an eye just sees side by side", YES),
    (5.0, "visible", "with care"),
    (np.inf, "far off", "not yet: add shots"),
)
"""By upper bound of a mean ΔE00: what it looks like, and whether a profile with it is fit for use."""

Errors = tuple[float, float | None, float | None, bool]
"""A style's mean error RAW → JPEG, its mean ΔE00, its mean error JPEG → RAW, and whether shots were held out."""


def answers(
    profile: CameraProfile,
    own: str,
    evaluation: Evaluation | None,
    data: Mapping[str, StyleData],
    pictures: tuple[Picture, ...] = (),
) -> Sections:
    """Answer a photographer's questions, with pictures to judge by.

    own: the method of `evaluation` that is the profile's model. Without an evaluation the errors are those that the
    profile holds. Each figure is one that `calibrate` or `evaluate` prints, too.
    """
    errors: dict[str, Errors] = {}
    for name, style in profile.styles.items() if evaluation is None else ():
        if "render_mean" in style.errors:
            seen, back = style.errors.get("render_de00_mean"), style.errors.get("linearize_mean")
            errors[name] = style.errors["render_mean"], seen, back, True
    whole = [row for row in (evaluation.rows if evaluation else ()) if row.method == own and row.all_shots]
    backward = {row.style: row.figures.mean for row in whole if row.direction == "linearize"}
    for row in whole:
        if row.direction == "render":
            errors[row.style] = row.figures.mean, row.figures.de00_mean, backward.get(row.style), row.held_out
    strangers = sorted({str(style.samples.camera[0]) for style in data.values()} - {profile.camera})
    good = (
        *map(str, profile.diagnoses),
        *(f"The samples are of {name}, not of {profile.camera}: so are the errors." for name in strangers),
        *(_how_good(name, *known) for name, known in errors.items()),
        *(profile.notes if isinstance(profile.provenance, ResponseOnly) else ()),
    )
    best_and_worst = [
        f"{name}: {sentence}"
        for name, predictions in (evaluation.predictions if evaluation else {}).items()
        if (sentence := colour_sentence(predictions, own))
    ]
    uses = Table("", ("job", "fit for it?", "why", "command"), tuple(_uses(own, evaluation, errors)))
    # The colours to photograph next, style by style
    gaps: list[Block] = []
    if not data:
        gaps.append("Give the shots or their samples to the report, too: it then names the colours that they lack.")
    for name, of_style in data.items():
        if colours := colour_gaps(of_style.encoded, linearizing_error(profile.styles[name])):
            gaps.append(f"{name}: of the colours that real surfaces have, these are known least:")
            gaps.append(tuple(map(str, colours[:4])))
        else:
            gaps.append(f"{name}: the samples come near most colours that real surfaces have.")
    return {
        "How good is it?": good or ("Not known: the profile holds no errors. Give its samples, too.",),
        "On which colours?": tuple(best_and_worst),
        "What to shoot next?": tuple(gaps),
        "See for yourself": pictures,
        "What for?": (uses,) if errors else (),
    }


def _how_good(style: str, mean: float, de00: float | None, backward: float | None, held_out: bool) -> str:
    error = f"{mean:.4f} of full scale"
    off = f"the JPEG predicted from RAW is ΔE00 {de00:.2f} off" if de00 is not None else f"the JPEG is {error} off"
    if not held_out:
        return (
            f"{style}: on these shots, to which it was fitted in part or in whole, {off} in the mean. How well it "
            "predicts others is not known: calibrate from two shots or more."
        )
    seen_as = "" if de00 is None else f": {judged(de00)[0]}. As RGB that is {error}"
    back = "" if backward is None else f"; RAW recovered from the JPEG is {backward:.4f} of full scale off"
    return f"{style}: on shots that it had not seen, {off} in the mean{seen_as}{back}."


FAMILIES = (
    (40.0, "reds"),
    (75.0, "oranges"),
    (110.0, "yellows"),
    (170.0, "greens"),
    (240.0, "cyans"),
    (310.0, "blues"),
    (345.0, "purples"),
    (360.0, "reds"),
)
"""Families of colours by the upper bound of their CIELAB hue angle in degrees, about as people name them."""
GREY_CHROMA = 10.0
"""The CIELAB chroma below which a colour is called a grey."""
FEW_OF_A_FAMILY = 10
"""Fewer samples than these say nothing about a family."""


def colour_sentence(predictions: Predictions, own: str) -> str:
    """Say on which families of colours a style's predictions are best and worst; "" where no two can be compared."""
    encoded, predicted = predictions.data.encoded, predictions.predicted.render[own]
    known = np.isfinite(predicted).all(axis=1)
    lab, error = srgb_to_lab(encoded[known]), delta_e_2000(np.clip(predicted[known], 0, 1), encoded[known])
    hue = np.degrees(np.arctan2(lab[:, 2], lab[:, 1])) % 360.0
    names = np.array([name for _, name in FAMILIES])[np.searchsorted([bound for bound, _ in FAMILIES], hue)]
    names = np.where(np.hypot(lab[:, 1], lab[:, 2]) < GREY_CHROMA, "greys", names)

    means = {name: float(error[names == name].mean()) for name in np.unique(names)}
    means = {name: mean for name, mean in means.items() if np.sum(names == name) >= FEW_OF_A_FAMILY}
    if len(means) < 2:
        return ""
    best, worst = min(means, key=lambda name: means[name]), max(means, key=lambda name: means[name])
    return f"most exact on {best} (ΔE00 {means[best]:.2f} in the mean), least on {worst} ({means[worst]:.2f})."


def _uses(own: str, evaluation: Evaluation | None, errors: Mapping[str, Errors]) -> Iterator[tuple[str, ...]]:
    """A row for each job: of the style, or the pair of settings, that is worst at it."""
    look = ("the camera's look on RAW, in other programs", "lutforge kit")
    light = ("linear light from its JPEGs", "lutforge bake … linearize")
    other = ("its JPEGs with another white balance, exposure or style", "lutforge apply")
    if not all(held_out for *_, held_out in errors.values()):
        for job, command in (look, light, other):
            yield job, "not known", "one shot only: none is left to try it on", command
        return

    def verdict(de00: Mapping[str, float]) -> tuple[str, str]:
        worst = max(de00, key=lambda name: de00[name])
        words, fit = judged(de00[worst])
        where = f", at worst ({worst})" if len(de00) > 1 else ""
        return fit, f"ΔE00 {de00[worst]:.2f} in the mean{where}: {words}"

    rendered = {name: de00 for name, (_, de00, _, _) in errors.items() if de00 is not None}
    if rendered:
        yield look[0], *verdict(rendered), look[1]
    linear = {name: back for name, (_, _, back, _) in errors.items() if back is not None}
    if linear:
        worst = max(linear, key=lambda name: linear[name])
        where = f" ({worst})" if len(linear) > 1 else ""
        reason = f"{linear[worst]:.4f} of full scale off in the mean{where}; what the JPEG clipped is lost"
        yield light[0], judged(rendered.get(worst, 0.0))[1], reason, light[1]
    rows = [row for row in (evaluation.refinish if evaluation else ()) if row.method == own]
    pairs = {f"{row.source} → {row.target}": row.figures.de00_mean or 0.0 for row in rows}
    reason = "no two of the shots show one scene under two settings"
    yield other[0], *(verdict(pairs) if pairs else ("not measured", reason)), other[1]


def judged(de00: float) -> tuple[str, str]:
    """Say what a mean ΔE00 looks like, and whether a profile with it is fit for use."""
    return next((words, fit) for bound, words, fit in VISIBILITY if de00 < bound)


MAP_NAMES = {MODEL: "camera model", COLOUR_POLYNOMIAL: "polynomial"}
"""Short names of methods, above small pictures."""

MAPS_TEXT = (
    "Each shot's JPEG predicted from its RAW, and its white-balanced RAW from its JPEG: by the profile's own model, a "
    "lattice of evenly spaced nodes, the camera model without a lattice, and a polynomial. Each direction "
    "has one scale in all maps; grey: clipped, or outside the RAW. Above each map is its mean over the picture, edges "
    "and textures included; the tables count the shot's even areas only."
)


def error_tables(own: str, evaluation: Evaluation) -> Iterator[Table]:
    """Tabulate the errors of both directions, of RAW, of refinishing, and of exposure pairs."""
    for direction, title in TITLES.items():
        rows = [row for row in evaluation.rows if row.direction == direction and row.all_shots]
        if rows:
            held = "held out by shot" if all(row.held_out for row in rows) else "NOT all held out"
            yield error_table(f"{title}, all shots, {held}", rows, own)
    rendered = [row for row in evaluation.rows if row.direction == "render" and row.method == own]
    if shots := [row for row in rendered if not row.all_shots]:
        yield error_table("RAW → JPEG by shot", shots)
    yield from more_tables(evaluation, own)


def error_pictures(own: str, evaluation: Evaluation) -> Iterator[Picture]:
    """Draw errors by colour."""
    for style, predictions in evaluation.predictions.items():
        error = np.linalg.norm(np.clip(predictions.predicted.render[own], 0, 1) - predictions.data.encoded, axis=1)
        known = np.isfinite(error)
        held = "held out by shot" if predictions.held_out[known].all() else "NOT all held out"
        drawing = figures.error_by_colour_figure(predictions.data.encoded[known], error[known])
        caption = f"{style}: which colours are predicted badly, RAW → JPEG, {held}."
        yield Picture(f"error_by_colour_{style}", drawing, caption)


def shown_shots(own: str, evaluation: Evaluation, files: Mapping[str, Path]) -> list[EvaluationRow]:
    """Choose the best, the middle and the worst of the shots whose RAW file is at hand."""
    rows = [row for row in evaluation.rows if row.direction == "render" and row.method == own and row.shot in files]
    rows.sort(key=lambda row: row.figures.mean)
    return list(
        {rows[round(place)].shot: rows[round(place)] for place in np.linspace(0, len(rows) - 1, 3) if rows}.values()
    )


def shot_pictures(
    profile: CameraProfile, own: str, evaluation: Evaluation, files: Mapping[str, Path]
) -> Iterator[Picture]:
    """Show the camera's JPEG of the best, the middle and the worst shot beside the prediction from its RAW."""
    rows = shown_shots(own, evaluation, files)
    kinds = {1: ("",), 2: ("best: ", "worst: "), 3: ("best: ", "middle: ", "worst: ")}
    for kind, row in zip(kinds.get(len(rows), ()), rows, strict=True):
        predictions = evaluation.predictions[row.style]
        cells = ShotCells(profile, predictions, row.shot, files[row.shot], COMPARED_ROWS)
        seen = np.isfinite(cells.balanced).all(axis=-1)
        predicted = np.full(cells.jpeg.shape, 0.5)
        fold = np.repeat(cells.samples[:1], np.count_nonzero(seen))
        predicted[seen] = np.clip(predictions.render(own, cells.balanced[seen], fold), 0.0, 1.0)
        panels = (cells.panel("the camera's JPEG", cells.jpeg), cells.panel("predicted from RAW", predicted))
        height, width = upright(cells.jpeg, cells.orientation).shape[:2]
        drawing = Drawing((panels,), 5.5 * height / width + 0.3, 11.0)
        seen_by = "not seen by the fit" if cells.held_out else "the fit had seen it"
        difference = "" if row.figures.de00_mean is None else f"; ΔE00 {row.figures.de00_mean:.2f} in the mean"
        yield Picture(
            f"shot_{setting_name(row.shot)}", drawing, f"{kind}{row.shot}, {cells.setting}; {seen_by}{difference}."
        )


def error_map_pictures(
    profile: CameraProfile, own: str, evaluation: Evaluation, files: Mapping[str, Path]
) -> Iterator[Block]:
    """Draw the errors of the best, the middle and the worst shot whose RAW file is at hand."""
    chosen = shown_shots(own, evaluation, files)
    if chosen:
        yield MAPS_TEXT
    for row in chosen:
        yield error_map(profile, own, row, evaluation.predictions[row.style], files[row.shot])


COMPARED_ROWS, MAPPED_ROWS = 480, 240
"""Rows of cells of a shot beside its prediction, and of an error map."""


class ShotCells:
    """Means of a shot over small squares: averages take some noise and compression away.

    jpeg: (h, w, 3) encoded; raw: as recorded; balanced: with white balance, and brightened away from the middle by the
    profile's vignettings, as that of the samples was, NaN outside the RAW; usable: (h, w), not clipped. samples: the
    rows of the shot in the predictions.
    """

    def __init__(self, profile: CameraProfile, predictions: Predictions, name: str, raw_file: Path, rows: int) -> None:
        self.samples = np.flatnonzero(predictions.data.shot == name)
        of_style = predictions.data.samples
        shot = read_shot(raw_file)
        size = max(2, round(shot.jpeg.shape[0] / rows))
        jpeg, raw = shot.jpeg_cells(size), shot.raw_cells(size)
        clips = clipping(jpeg, raw)
        self.usable = np.isfinite(raw.mean[..., 0]) & ~np.any(list(clips.values()), axis=0)
        self.jpeg = jpeg.mean / 255.0

        gain = np.median(predictions.data.balanced[self.samples] / of_style.raw[self.samples], axis=0)
        self.unbrightened = raw.mean * gain
        self.balanced = self.unbrightened
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
    profile: CameraProfile, own: str, row: EvaluationRow, predictions: Predictions, raw_file: Path
) -> Picture:
    """Draw the errors of a shot, pixel by pixel, in both directions, by fits that never saw it (thesis 5.5 and 5.6).

    They are norms of RGB, of RAW with white balance, a row for each direction: of the camera's JPEG and of its RAW,
    balanced and stretched, before the maps of what predicts it; grey where it is clipped or outside the RAW. The RAW is
    brightened away from the middle by the profile's vignettings, as that of the samples was.
    """
    name, options = row.shot, stated_options(profile.options)
    predictions = with_compared(predictions, name, profile.shots, options)
    cells = ShotCells(profile, predictions, name, raw_file, MAPPED_ROWS)
    fits = predictions.fits[predictions.fold[cells.samples[0]]]
    uniform = lattice_name(options.size, nonuniform=False)
    methods = [each for each in dict.fromkeys((own, LATTICE, uniform, MODEL, COLOUR_POLYNOMIAL)) if each in fits]

    # The RAW is shown stretched to its brightest percent
    bright = np.nanpercentile(cells.unbrightened, 99)
    scene = np.nan_to_num(srgb_encode(np.clip(cells.unbrightened / bright, 0.0, 1.0)), nan=0.5)
    balanced, encoded = cells.balanced[cells.usable], cells.jpeg[cells.usable]
    fold = np.repeat(cells.samples[:1], len(balanced))

    rows: list[tuple[Panel, ...]] = []
    for direction, predict, source, target, picture, most in (
        ("RAW → JPEG", predictions.render, balanced, encoded, ("the camera's JPEG", cells.jpeg), ERROR_SCALE),
        # Linear values are small where encoded ones are not; so are errors
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
        for method in methods:
            errors = np.full(cells.usable.shape, np.nan)
            errors[cells.usable] = np.linalg.norm(np.clip(predict(method, source, fold), 0, 1) - target, axis=1)
            words = f"{direction}\n{MAP_NAMES.get(method, method)}: mean {np.nanmean(errors):.4f}"
            panels.append(cells.panel(words, errors, scale=(0.0, most), scale_name=" "))
        rows.append(tuple(panels))
    height, width = upright(cells.jpeg, cells.orientation).shape[:2]
    drawing = Drawing(tuple(rows), 11 / len(rows[0]) * height / width + 0.6, 11.0)
    held_out = "not seen by the fits" if cells.held_out else "the fit had seen it"
    caption = f"{name}, {cells.setting}; {held_out}; mean error of the shot's samples {row.figures.mean:.4f}."
    return Picture(f"error_map_{setting_name(name)}", drawing, caption)


def sample_blocks(samples: SampleSet, accounts: Sequence[ShotSamples]) -> Iterator[Block]:
    """Show the samples and the shots that they are from."""
    yield Picture("samples", figures.chromaticity_figure(samples.srgb), "The JPEG colours of all samples.")
    lost = {each.shot: (str(sum(each.clipped.values())), str(sum(each.rejected.values()))) for each in accounts}
    rows = []
    for name, taken in samples.by_shot():
        setting, time = f"{taken.style[0]}/{taken.white_balance[0]}", taken.exposure_s[0]
        exposure = exposure_time(time)
        rows.append((name, setting, exposure, str(len(taken)), *lost.get(name, ("–", "–"))))
    yield Table("Shots", ("shot", "setting", "exposure", "samples", "areas clipped", "areas rejected"), tuple(rows))


def exposure_blocks(data: Mapping[str, StyleData]) -> Iterator[Block]:
    """Say whether each style's response is a fixed property of the camera, as pairs of exposures show it."""
    for name, style in data.items():
        try:
            pairs = pairs_of_samples(style.samples)
            verdict, functions = judge(pairs), transfer_functions(pairs)
        except CalibrationError:  # no two shots show the same patches at different exposures, or too few
            continue
        yield f"{name}: {verdict.told}."
        header = ("response fitted to", "red", "green", "blue")
        # In the unit of the table of exposures in the evaluation, which states the same error of whole models.
        rows = tuple((what, *(f"{value:.4f}" for value in each)) for what, each in response_deltas(pairs).items())
        caption = (
            f"{name}: linearization error of the response over pairs of exposures, unsaturated colours (1 = full scale)"
        )
        yield Table(caption, header, rows)
        # How exact the exposure times of the files are, beside RAW, which is linear (thesis 3.1)
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
    """Draw the models of a style."""
    what = "the tone response" if style.models else "the grey axis of the lattice"
    yield Picture(f"response_{name}", figures.response_figure(style), f"{name}: {what}, per channel.")
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
    """A table of the vignettings; nothing where there are none."""
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


# --- Two cameras, or two styles of one, side by side: what each makes of the same light ------------------------------


def build_comparison(first: CameraProfile, one: str, second: CameraProfile, other: str) -> Report:
    """A page about two settings, STYLE/WB, of two profiles: a chart through both, and their ΔE00.

    Light is that of neutral white balance; the second is exposed so that both show 18 % grey equally light. Raises
    SettingsError on an unknown setting.
    """
    import colour  # imported here: it takes a second

    # The exposure at which the second shows 18 % grey as light as the first
    render, grey = through_camera(first, one, "linear-srgb"), np.full((1, 3), 0.18)
    wanted = srgb_to_lab(render(grey))[0, 0]

    def apart(ev: float) -> float:
        return float(srgb_to_lab(through_camera(second, other, "linear-srgb", ev)(grey))[0, 0] - wanted)

    ev = float(brentq(apart, -4.0, 4.0, xtol=1e-3)) if apart(-4.0) < 0 < apart(4.0) else 0.0
    beside = through_camera(second, other, "linear-srgb", ev)
    names = tuple(f"{profile.camera} {setting}" for profile, setting in ((first, one), (second, other)))

    # The ColorChecker Classic, 2005 measurements, by colour-science: a patch is drawn as two halves, within dark lines
    checker = colour.CCS_COLOURCHECKERS["ColorChecker 2005"]
    xyz = colour.xyY_to_XYZ(np.array(list(checker.data.values())))
    chart = np.asarray(colour.XYZ_to_RGB(xyz, "sRGB", checker.illuminant, apply_cctf_encoding=False)).clip(0.0, None)
    a, b = render(chart), beside(chart)
    difference, (lab_a, lab_b) = delta_e_2000(a, b), (srgb_to_lab(a), srgb_to_lab(b))
    lightness = lab_b[:, 0] - lab_a[:, 0]
    chroma = np.hypot(*lab_b[:, 1:].T) - np.hypot(*lab_a[:, 1:].T)
    patches, rows = [name.partition(" (")[0] for name in checker.data], []
    for n, patch in enumerate(patches):
        codes = (" ".join(f"{255 * value:.0f}" for value in np.clip(each[n], 0, 1)) for each in (a, b))
        rows.append((patch, *codes, f"{difference[n]:.1f}", f"{lightness[n]:+.1f}", f"{chroma[n]:+.1f}"))
    halves = np.stack([a.reshape(4, 6, 3), b.reshape(4, 6, 3)], axis=2).reshape(4, 12, 3)
    lines = [Line(np.full(2, x), np.array([0.0, 4.0]), "#191919", width=6.0) for x in range(1, 6)]
    lines += [Line(np.array([0.0, 6.0]), np.full(2, y), "#191919", width=6.0) for y in range(1, 4)]
    two_charts = Drawing(((Panel("", (Raster(halves, (6, 4)), *lines), bare=True, equal=True),),), 6.1)
    lead = (
        f"The chart's colours differ by ΔE00 {difference.mean():.1f} in the mean, most by {difference.max():.1f} "
        f"({patches[int(difference.argmax())]}).",
    )
    caption = f"Left halves: {names[0]}; right halves: {names[1]}."
    header = ("patch", names[0], names[1], "ΔE00", "ΔL*", "ΔC*")
    table = Table("JPEG codes, and the differences of the second from the first", header, rows)
    return Report(
        f"{names[0]} beside {names[1]}",
        f"the same light through both; the second at {ev:+.2f} EV, so that 18 % grey is equally light",
        lead,
        {"A chart": (Picture("chart", two_charts, caption), table)},
    )


def write_page(report: Report, path: str | Path, progress: Progress = silent) -> None:
    """One self-contained HTML file: no script, nothing from a network; names are escaped."""
    loader = PackageLoader("lutforge.reports")
    jinja = Environment(loader=loader, autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    for index, picture in enumerate(report.pictures):
        progress(f"drawing {picture.name}", index / len(report.pictures))
        _ = picture.svg
    html = jinja.get_template("report.html").render(report=report, version=__version__)
    with atomic_path(path) as temporary:
        temporary.write_text(html, encoding="utf-8")
