"""Use case: a chart at several exposures, of a camera without RAW → a profile with its whole rendering."""

from __future__ import annotations  # so that help() shows the names of types

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lutforge.arrays import Array
from lutforge.calibration.bracket import BracketFit, fit_bracket
from lutforge.calibration.pairs_of_samples import pairs_of_samples
from lutforge.calibration.uneven_light import UnevenLight, fit_uneven_light
from lutforge.colour.rgb_spaces import matrix_between
from lutforge.errors import CalibrationError
from lutforge.pipeline.calibration import calibrate
from lutforge.pipeline.chart_patches import SPACE, measured_patches, near_neutral, not_charted
from lutforge.pipeline.file_kinds import PROFILE_SUFFIXES
from lutforge.pipeline.outputs import check_output
from lutforge.pipeline.response import Bracket, FittedResponse, open_bracket
from lutforge.progress import Progress, part, silent
from lutforge.samples.chart import ChartKind
from lutforge.samples.sample_set import SampleSet


def write_input_transform(
    bracket: Sequence[Path],
    output: Path | None,
    kind: ChartKind,
    light: str,
    corners: Array | None = None,
    exposure_s: Sequence[float] | None = None,
    *,
    camera: str = "",
    progress: Progress = silent,
) -> FittedResponse:
    """Calibrate a camera without RAW on exposures of a chart under a light, and write the profile.

    The known colours of the chart, times the exposure, are used in place of RAW. The errors of the exposures, and the
    level of white, come from the response that is fitted to the exposures alone (thesis 4.2.1).

    corners: (4, 2), of the chart in all shots, in pixels; None where it is searched for. The other arguments: as for
    `response`. Raises CalibrationError where the chart is not found, and the errors of `response`.
    """
    if output is not None:
        check_output(output, PROFILE_SUFFIXES, bracket)
    opened = open_bracket(bracket, exposure_s, camera)
    codes, charted = measured_patches(opened, kind, light, corners, part(progress, 0.0, 0.2))
    names = opened.names
    times = opened.exposure_s
    samples, shot, patch = _chart_samples(opened, kind, light, codes)

    try:
        fit = fit_bracket(pairs_of_samples(samples))
    except CalibrationError as error:
        reason = str(error).partition(";")[0]  # the rest of the message is on scenes without a chart
        advice = "a chart's greys are unsaturated where the white balance is set to the light"
        raise CalibrationError(f"{reason}; {advice}{not_charted(names, charted, corners)}") from None
    true_times = np.array([fit.exposure_error.get(name, 1.0) for name in names]) * times

    colours = kind.linear_srgb(light) @ matrix_between("linear-srgb", SPACE).T
    uneven = _uneven_light(codes, true_times, fit, colours, kind)
    if uneven is not None:
        colours = colours * uneven.gain(kind.places)[:, None]
    scene = colours[patch] * true_times[shot, None]

    # The camera's rendering of the greys gives its level of white, and its white balance relative to the illuminant.
    grey = near_neutral(scene)
    if np.count_nonzero(grey) < 6:
        raise CalibrationError(
            "too few unclipped grey patches: take steps of at most two stops, some of them darker"
            + not_charted(names, charted, corners)
        )
    rendered = fit.response.linearize(samples.srgb[grey]) @ matrix_between("linear-srgb", SPACE).T
    ratio = np.median(rendered / scene[grey], axis=0)
    multipliers = ratio / ratio[1]
    scale = float(ratio[1])

    # Samples must lie in [0, 1]: colours with a channel below 0 or above the camera's white are left out.
    raw = scale * true_times[shot, None] * colours[patch]
    possible = np.all((raw > 0.0) & (raw < 1.0), axis=1)
    samples = replace(samples, raw=raw, wb=np.tile(multipliers, (len(samples), 1))).select(possible)
    profile = calibrate(samples, progress=part(progress, 0.2, 1.0))

    level = dict(zip(names, (scale * true_times).tolist(), strict=True))
    light_notes = () if uneven is None else (uneven.note,)
    scale_note = f"1 is the camera's white; white beside the chart has {max(level.values()):.3g} in the brightest shot"
    profile = replace(
        profile, notes=(f"of the {profile.provenance}: {kind.source}", scale_note, *light_notes, *profile.notes)
    )
    if output is not None:
        profile.save(output)
    return FittedResponse(profile, fit, dict(zip(names, times, strict=True)), samples, level, charted)


def _chart_samples(
    bracket: Bracket, kind: ChartKind, light: str, codes: Array
) -> tuple[SampleSet, NDArray[np.intp], NDArray[np.intp]]:
    """Samples of the patches with JPEG values (shots, n, 3), RAW still 0, and the shot and patch of each, by index."""
    usable = np.asarray(np.isfinite(codes).all(axis=2))
    shot, patch = np.nonzero(usable)
    count = len(shot)
    cameras = np.full(count, bracket.camera)
    samples = SampleSet(
        camera=cameras,
        style=np.full(count, bracket.style),
        white_balance=np.full(count, bracket.white_balance),
        shot=np.array(bracket.names)[shot],
        patch=np.char.mod("chart_%03d", patch + 1),
        exposure_s=np.array(bracket.exposure_s, dtype=np.float64)[shot],
        raw=np.zeros((count, 3)),
        srgb=codes[usable],
        wb=np.full((count, 3), np.nan),
        raw_camera=cameras,
        raw_space=np.full(count, SPACE),
        chart=np.full(count, kind.name),
        chart_light=np.full(count, light),
    )
    return samples, shot, patch


def _uneven_light(
    codes: Array, exposures: Array, fit: BracketFit, colours: Array, kind: ChartKind
) -> UnevenLight | None:
    """The uneven illumination of a chart, if it is significant.

    codes: JPEG values (shots, n, 3); exposures: (shots,); colours: of the patches (n, 3).
    """
    usable = np.asarray(np.isfinite(codes).all(axis=2))
    linear = fit.response.linearize(np.nan_to_num(codes)) / exposures[:, None, None]
    count = usable.sum(axis=0)[:, None]
    with np.errstate(invalid="ignore"):
        mean = np.where(usable[..., None], linear, 0.0).sum(axis=0) / count
    return fit_uneven_light(mean, colours, kind.places)
