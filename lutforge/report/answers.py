"""The first page of a report: how good a profile is, what it is fit for, and what to photograph next."""

from collections.abc import Iterator, Mapping

from lutforge.calibration.style_data import StyleData
from lutforge.evaluation.errors_table import visibility
from lutforge.evaluation.evaluation import Evaluation
from lutforge.evaluation.next_shots import colour_gaps
from lutforge.model.camera_profile import CameraProfile
from lutforge.model.coverage import linearizing_error
from lutforge.model.diagnosis import told
from lutforge.model.response_profile import is_response_alone
from lutforge.report.page import Block, BulletList, Section, Text
from lutforge.report.tables import Table

FIT = {
    "less than an eye sees side by side": "yes",
    "what an eye just sees side by side": "yes",
    "visible": "with care",
    "far off": "not yet: add shots",
}
"""By what `visibility` says of an error: whether a profile is fit for a use."""


def answers(
    profile: CameraProfile, own: str, evaluation: Evaluation | None, data: Mapping[str, StyleData]
) -> tuple[Section, ...]:
    """Answer the three questions; own: the method of `evaluation` that is the profile's model.

    Without an evaluation the errors are those that the profile holds. Each figure is one that `calibrate` or `evaluate`
    prints, too.
    """
    errors = _errors_of_profile(profile) if evaluation is None else _errors(own, evaluation)
    strangers = sorted({str(style.samples.camera[0]) for style in data.values()} - {profile.camera})
    good = (
        *map(Text, told(profile.diagnoses)),
        *(Text(f"The samples are of {name}, not of {profile.camera}: so are the errors.") for name in strangers),
        *(Text(_how_good(name, *found)) for name, found in errors.items()),
        *(Text(note) for note in profile.notes if is_response_alone(profile)),
    )
    uses = Table("", ("job", "fit for it?", "why", "command"), tuple(_uses(own, evaluation, errors)))
    return (
        Section("How good is it?", good or (Text("Not known: the profile holds no errors. Give its samples, too."),)),
        Section("What for?", (uses,) if errors else ()),
        Section("What to shoot next?", tuple(_next_shots(profile, data))),
    )


Errors = tuple[float, float | None, float | None, bool]
"""A style's mean error RAW → JPEG, its mean ΔE00, its mean error JPEG → RAW, and whether shots were held out."""


def _errors(own: str, evaluation: Evaluation) -> dict[str, Errors]:
    rows = {(row.style, row.direction): row for row in evaluation.rows if row.method == own and row.shot == "all"}
    found: dict[str, Errors] = {}
    for (style, direction), row in rows.items():
        if direction == "render":
            back = rows.get((style, "linearize"))
            backward = None if back is None else back.figures.mean
            found[style] = (row.figures.mean, row.figures.de00_mean, backward, row.held_out)
    return found


def _errors_of_profile(profile: CameraProfile) -> dict[str, Errors]:
    return {
        name: (errors["render_mean"], errors.get("render_de00_mean"), errors.get("linearize_mean"), True)
        for name, errors in ((name, style.errors) for name, style in profile.styles.items())
        if "render_mean" in errors
    }


def _how_good(style: str, mean: float, de00: float | None, backward: float | None, held_out: bool) -> str:
    seen = "" if de00 is None else f", ΔE00 {de00:.2f}"
    figures = f"the JPEG predicted from RAW is {mean:.4f} of full scale off in the mean{seen}"
    if not held_out:
        return (
            f"{style}: on the shots that it was fitted to, {figures}. How well it predicts other shots is not known: "
            "calibrate from two shots or more."
        )
    judged = "" if de00 is None else f": {visibility(de00)}"
    back = "" if backward is None else f" RAW recovered from the JPEG is {backward:.4f} of full scale off."
    return f"{style}: on shots that it had not seen, {figures}{judged}.{back}"


def _uses(own: str, evaluation: Evaluation | None, errors: Mapping[str, Errors]) -> Iterator[tuple[str, ...]]:
    """A row for each job: of the style, or the pair of settings, that is worst at it."""
    look = ("the camera's look on RAW, in other programs", "lutforge kit")
    light = ("linear light from its JPEGs", "lutforge bake … linearize")
    other = ("its JPEGs with another white balance, exposure or style", "lutforge apply")
    if not all(held_out for *_, held_out in errors.values()):
        for job, command in (look, light, other):
            yield job, "not known", "one shot only: none is left to try it on", command
        return
    rendered = {name: de00 for name, (_, de00, _, _) in errors.items() if de00 is not None}
    if rendered:
        worst = max(rendered, key=lambda name: rendered[name])
        yield look[0], FIT[visibility(rendered[worst])], _said(rendered[worst], worst, len(rendered)), look[1]
    linear = {name: back for name, (_, _, back, _) in errors.items() if back is not None}
    if linear:
        worst = max(linear, key=lambda name: linear[name])
        named = f" ({worst})" if len(linear) > 1 else ""
        reason = f"{linear[worst]:.4f} of full scale off in the mean{named}; what the JPEG clipped is lost"
        yield light[0], FIT[visibility(rendered[worst])] if worst in rendered else "yes", reason, light[1]
    pairs = [row for row in (evaluation.refinish if evaluation else ()) if row.method == own and row.figures.de00_mean]
    if pairs:
        pair = max(pairs, key=lambda row: row.figures.de00_mean or 0.0)
        de00 = pair.figures.de00_mean or 0.0
        yield other[0], FIT[visibility(de00)], _said(de00, f"{pair.source} → {pair.target}", len(pairs)), other[1]
    else:
        yield other[0], "not measured", "no two of the shots show one scene under two settings", other[1]


def _said(de00: float, name: str, count: int) -> str:
    return f"ΔE00 {de00:.2f} in the mean{f', at worst ({name})' if count > 1 else ''}: {visibility(de00)}"


def _next_shots(profile: CameraProfile, data: Mapping[str, StyleData]) -> Iterator[Block]:
    """The colours to photograph next, style by style."""
    if not data:
        yield Text("Give the shots or their samples to the report, too: it then names the colours that they lack.")
    for name, style in data.items():
        gaps = colour_gaps(style.encoded, linearizing_error(profile.styles[name]))
        if gaps:
            yield Text(f"{name}: of the colours that real surfaces have, these are known least:")
            yield BulletList(tuple(str(gap) for gap in gaps[:4]))
        else:
            yield Text(f"{name}: the samples come near most colours that real surfaces have.")
