"""What is known of a calibrated camera, for reading: plain answers first, what they rest on behind them."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import matplotlib

from lutforge.calibration.options import options_from_json
from lutforge.calibration.shots.departures import Departure
from lutforge.calibration.style_data import StyleData
from lutforge.evaluation.evaluate import evaluate
from lutforge.evaluation.methods import LATTICE
from lutforge.model.camera_profile import CameraProfile
from lutforge.progress import Progress, part, silent
from lutforge.report.answers import answers
from lutforge.report.error_blocks import (
    error_map_pictures,
    error_pictures,
    error_tables,
    exposure_blocks,
    sample_blocks,
    style_pictures,
)
from lutforge.report.error_maps import own_method
from lutforge.report.page import BulletList, Report, Section
from lutforge.report.scene_blocks import departure_blocks, falloff_blocks
from lutforge.report.tables import balance_table, matrix_table
from lutforge.samples.extract import ShotSamples
from lutforge.samples.sample_set import SampleSet


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
    notes, own = profile.notes, LATTICE
    evaluation = None
    judged: list[Section] = []
    shown: list[Section] = []
    data: dict[str, StyleData] = {}
    departures: tuple[Departure, ...] = ()
    if samples is not None:
        evaluation = evaluate(profile, samples, part(progress, 0.0, 0.8))
        own = own_method(profile, evaluation)
        departures = evaluation.departures
        data = {name: predictions.data for name, predictions in evaluation.predictions.items()}
        notes = tuple(dict.fromkeys((*notes, *evaluation.notes)))
        progress("error maps", 0.8)
        judged.append(Section("Errors", (*error_tables(own, evaluation), *error_pictures(own, evaluation))))
        judged.append(Section("Errors on real shots", tuple(error_map_pictures(profile, own, evaluation, files or {}))))
        shown.append(Section("Samples", tuple(sample_blocks(samples, accounts))))
        shown.append(Section("Exposures", tuple(exposure_blocks(data))))
    progress("models", 0.9)
    models = [
        Section(f"Style {name}", tuple(style_pictures(profile, name, style, data.get(name))))
        for name, style in profile.styles.items()
    ]
    said = Section("Notes", (BulletList(notes),) if notes else ())
    lens = Section("Lens and scene", (*falloff_blocks(profile.falloffs), *departure_blocks(departures)))
    settings = Section("White balances and matrix", (balance_table(profile), matrix_table(profile)))
    sections = tuple(section for section in (said, *judged, lens, settings, *models, *shown) if section.blocks)
    progress("done", 1.0)
    return Report(
        f"{profile.camera}: calibration report",
        _subtitle(profile),
        sections=sections,
        answers=answers(profile, own, evaluation, data),
    )


def _subtitle(profile: CameraProfile) -> str:
    options = options_from_json(profile.options)
    model = {"lattice": f"lattices of {options.size}³ nodes", "rbf": "the physical model and lattices"}[options.model]
    return (
        f"Picture styles: {', '.join(profile.styles)}. White balances: {', '.join(profile.white_balances)}. "
        f"Shots: {len(profile.shots)}. Model: {model}, preset {options.preset}."
    )
