"""The answers at the start of a report: how good a profile is, what it is fit for, what to photograph next."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from lutforge.calibration.style import StyleData
from lutforge.colour.srgb import delta_e_2000, srgb_to_lab
from lutforge.evaluation.evaluation import Evaluation
from lutforge.evaluation.next_shots import known_colours
from lutforge.evaluation.predictions import Predictions
from lutforge.model.camera_profile import CameraProfile
from lutforge.model.provenance import ResponseOnly
from lutforge.reports.page import Block, Picture, Sections
from lutforge.reports.tables import Table

FIT_FOR_USE = "yes, on colours like those of the shots"
VISIBILITY = (
    (1.0, "less than an eye sees side by side", FIT_FOR_USE),  # about a just noticeable difference (CIE 142-2001)
    (2.0, "what an eye just sees side by side", FIT_FOR_USE),
    (5.0, "visible", "with care"),
    (np.inf, "far off", "not yet: add shots"),
)
"""Verdicts by the upper bound of a mean ΔE00: its visibility, and whether a profile with it is fit for use."""


@dataclass(frozen=True)
class StyleErrors:
    """The mean errors of a style, as shares of full scale.

    render: RAW → JPEG; render_de00: the same in ΔE00; linearize: JPEG → RAW; held_out: they were measured on shots that
    were held out of the fit.
    """

    render: float
    render_de00: float | None
    linearize: float | None
    held_out: bool


def answers(
    profile: CameraProfile,
    method: str,
    evaluation: Evaluation | None,
    data: Mapping[str, StyleData],
    pictures: tuple[Picture, ...] = (),
) -> Sections:
    """Answer a photographer's questions: how good a profile is, what it is fit for, what to photograph next.

    method: of `evaluation`, that of the profile's model. Without an evaluation the errors are those that the profile
    holds. Each figure is also printed by `calibrate` or `evaluate`.
    """
    errors = _errors_of_profile(profile) if evaluation is None else _errors_of_evaluation(evaluation, method)

    other_cameras = sorted({str(style.samples.camera[0]) for style in data.values()} - {profile.camera})
    good = (
        *map(str, profile.diagnoses),
        *(f"The samples are of {name}, not of {profile.camera}: so are the errors." for name in other_cameras),
        *(_how_good(name, style_errors) for name, style_errors in errors.items()),
        *(profile.notes if isinstance(profile.provenance, ResponseOnly) else ()),
    )
    best_and_worst = [
        f"{name}: {sentence}"
        for name, predictions in (evaluation.predictions if evaluation else {}).items()
        if (sentence := colour_sentence(predictions, method))
    ]
    uses = Table("", ("job", "fit for it?", "why", "command"), tuple(_uses(method, evaluation, errors)))

    # The colours to photograph next, style by style.
    gaps: list[Block] = []
    if not data:
        gaps.append("Give the shots or their samples to the report, too: it then names the colours that they lack.")
    for name, style_data in data.items():
        known = known_colours(profile, name, style_data.encoded)
        gaps.append(f"{name}: {known.advice}")
        if known.gaps:
            gaps.append(tuple(map(str, known.gaps[:4])))
    return {
        "How good is it?": good or ("Not known: the profile holds no errors. Give its samples, too.",),
        "On which colours?": tuple(best_and_worst),
        "What to shoot next?": tuple(gaps),
        "See for yourself": pictures,
        "What for?": (uses,) if errors else (),
    }


def _errors_of_profile(profile: CameraProfile) -> dict[str, StyleErrors]:
    """The errors that a profile holds, by style: of those whose render was measured."""
    return {
        name: StyleErrors(
            style.errors["render_mean"],
            style.errors.get("render_de00_mean"),
            style.errors.get("linearize_mean"),
            held_out=True,
        )
        for name, style in profile.styles.items()
        if "render_mean" in style.errors
    }


def _errors_of_evaluation(evaluation: Evaluation, method: str) -> dict[str, StyleErrors]:
    """The errors of a method over all shots, by style."""
    rows = [row for row in evaluation.rows if row.method == method and row.all_shots]
    linearize = {row.style: row.figures.mean for row in rows if row.direction == "linearize"}
    return {
        row.style: StyleErrors(row.figures.mean, row.figures.de00_mean, linearize.get(row.style), row.held_out)
        for row in rows
        if row.direction == "render"
    }


def _how_good(style: str, errors: StyleErrors) -> str:
    """A sentence on the errors of a style."""
    de00 = errors.render_de00
    error = f"{errors.render:.4f} of full scale"
    off = f"the JPEG predicted from RAW is ΔE00 {de00:.2f} off" if de00 is not None else f"the JPEG is {error} off"
    if not errors.held_out:
        return (
            f"{style}: on these shots, to which it was fitted in part or in whole, {off} in the mean. How well it "
            "predicts others is not known: calibrate from two shots or more."
        )
    visibility = "" if de00 is None else f": {judged(de00)[0]}"
    recovered = ""
    if errors.linearize is not None:
        recovered = f" RAW recovered from the JPEG is {errors.linearize:.4f} of full scale off."
    return f"{style}: on shots that it had not seen, {off} in the mean{visibility}.{recovered}"


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
LEAST_OF_A_FAMILY = 10
"""The least number of samples for a statement on a family."""


def colour_sentence(predictions: Predictions, method: str) -> str:
    """A sentence on the families of colours that a method predicts best and worst; "" where no two can be compared."""
    predicted = predictions.predicted.render[method]
    finite = np.isfinite(predicted).all(axis=1)
    encoded = predictions.data.encoded[finite]
    lab = srgb_to_lab(encoded)
    error = delta_e_2000(np.clip(predicted[finite], 0, 1), encoded)
    hue = np.degrees(np.arctan2(lab[:, 2], lab[:, 1])) % 360.0
    names = np.array([name for _, name in FAMILIES])[np.searchsorted([bound for bound, _ in FAMILIES], hue)]
    names = np.where(np.hypot(lab[:, 1], lab[:, 2]) < GREY_CHROMA, "greys", names)

    means = {name: float(error[names == name].mean()) for name in np.unique(names)}
    means = {name: mean for name, mean in means.items() if np.sum(names == name) >= LEAST_OF_A_FAMILY}
    if len(means) < 2:
        return ""
    best = min(means, key=lambda name: means[name])
    worst = max(means, key=lambda name: means[name])
    return f"most exact on {best} (ΔE00 {means[best]:.2f} in the mean), least on {worst} ({means[worst]:.2f})."


def _uses(method: str, evaluation: Evaluation | None, errors: Mapping[str, StyleErrors]) -> Iterator[tuple[str, ...]]:
    """A row for each job, on the style or the pair of settings with the largest error in it."""
    render = ("the camera's look on RAW, in other programs", "lutforge kit")
    linearize = ("linear light from its JPEGs", "lutforge bake … linearize")
    refinish = ("its JPEGs with another white balance, exposure or style", "lutforge apply")
    if not all(style.held_out for style in errors.values()):
        for job, command in (render, linearize, refinish):
            yield job, "not known", "one shot only: none is left to try it on", command
        return

    def verdict(de00: Mapping[str, float]) -> tuple[str, str]:
        worst = max(de00, key=lambda name: de00[name])
        words, fit = judged(de00[worst])
        where = f", at worst ({worst})" if len(de00) > 1 else ""
        return fit, f"ΔE00 {de00[worst]:.2f} in the mean{where}: {words}"

    rendered = {name: style.render_de00 for name, style in errors.items() if style.render_de00 is not None}
    if rendered:
        yield render[0], *verdict(rendered), render[1]

    linear = {name: style.linearize for name, style in errors.items() if style.linearize is not None}
    if linear:
        worst = max(linear, key=lambda name: linear[name])
        where = f" ({worst})" if len(linear) > 1 else ""
        reason = f"{linear[worst]:.4f} of full scale off in the mean{where}; what the JPEG clipped is lost"
        yield linearize[0], judged(rendered.get(worst, 0.0))[1], reason, linearize[1]

    rows = [row for row in (evaluation.refinish if evaluation else ()) if row.method == method]
    pairs = {f"{row.source} → {row.target}": row.figures.de00_mean or 0.0 for row in rows}
    reason = "no two of the shots show one scene under two settings"
    yield refinish[0], *(verdict(pairs) if pairs else ("not measured", reason)), refinish[1]


def judged(de00: float) -> tuple[str, str]:
    """The visibility of a mean ΔE00 in words, and whether a profile with it is fit for use."""
    return next((words, fit) for bound, words, fit in VISIBILITY if de00 < bound)
