"""Use case: a chart at several exposures, or at one, of a camera without RAW → a profile with its whole rendering."""

from __future__ import annotations  # so that help() shows the names of types

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lutforge.arrays import Array, Mask, Pixels
from lutforge.calibration.bracket import BracketFit, fit_bracket
from lutforge.calibration.exposure_pairs import NEAR_AN_END
from lutforge.calibration.one_exposure import fit_one_exposure
from lutforge.calibration.pairs_of_samples import pairs_of_samples
from lutforge.calibration.uneven_light import UnevenLight, fit_uneven_light
from lutforge.colour.rgb_spaces import matrix_between
from lutforge.colour.srgb import delta_e_2000, srgb_encode
from lutforge.errors import CalibrationError
from lutforge.model import provenance
from lutforge.model.camera_profile import CameraProfile
from lutforge.model.gamut_map import identity_gamut_map
from lutforge.model.profile import CameraModel, PictureStyle
from lutforge.model.white_balance import WhiteBalance
from lutforge.pipeline.calibration import calibrate
from lutforge.pipeline.outputs import PROFILE_SUFFIXES, check_output
from lutforge.pipeline.response import Bracket, FittedResponse, colours_of, open_bracket
from lutforge.progress import Progress, part, silent
from lutforge.samples.chart import ChartKind
from lutforge.samples.chart_search import RESEMBLANCE, Chart, detector_note, find_chart, patch_codes, resemblance
from lutforge.samples.sample_set import SampleSet

SPACE = "acescg"
"""The linear space of the chart's colours: it contains the colours of all surfaces, and is near those of cameras."""


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
    codes, charted = _patches(opened, kind, light, corners, part(progress, 0.0, 0.2))
    names = opened.names
    times = opened.exposure_s
    samples, shot, patch = _chart_samples(opened, kind, light, codes)

    try:
        fit = fit_bracket(pairs_of_samples(samples))
    except CalibrationError as error:
        reason = str(error).partition(";")[0]  # the rest of the message is on scenes without a chart
        advice = "a chart's greys are unsaturated where the white balance is set to the light"
        raise CalibrationError(f"{reason}; {advice}{_not_charted(names, charted, corners)}") from None
    true_times = np.array([fit.exposure_error.get(name, 1.0) for name in names]) * times

    colours = kind.linear_srgb(light) @ matrix_between("linear-srgb", SPACE).T
    uneven = _uneven_light(codes, true_times, fit, colours, kind)
    if uneven is not None:
        colours = colours * uneven.gain(kind.places)[:, None]
    scene = colours[patch] * true_times[shot, None]

    # The camera's rendering of the greys gives its white balance relative to the light, and the level of its white.
    grey = _grey(scene)
    if np.count_nonzero(grey) < 6:
        raise CalibrationError(
            "too few unclipped grey patches: take steps of at most two stops, some of them darker"
            + _not_charted(names, charted, corners)
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


def _grey(colours: Array) -> Mask:
    """Mask (n,) of the colours (n, 3) of a chart that are near neutral."""
    neutral: Mask = 1.0 - colours.min(axis=1) / colours.max(axis=1) < 0.12
    return neutral


@dataclass(frozen=True, eq=False)
class ApproximateTransform:
    """The result of one exposure of a chart: a profile, and notes on what it assumes and on its error on the chart."""

    profile: CameraProfile
    notes: tuple[str, ...]


def write_approximate_transform(
    picture: Path,
    output: Path | None,
    kind: ChartKind,
    light: str,
    corners: Array | None = None,
    *,
    camera: str = "",
    progress: Progress = silent,
) -> ApproximateTransform:
    """Calibrate a camera without RAW on one picture of a chart, approximately, and write the profile.

    The response is sRGB's curve or EMoR's mean, whichever fits the chart's greys better. corners: (4, 2), of the chart,
    in pixels; None where it is searched for. Raises CalibrationError where the chart is not found, and ImageError.
    """
    if output is not None:
        check_output(output, PROFILE_SUFFIXES, [picture])
    opened = open_bracket([picture], [1.0], camera)
    codes, _ = _patches(opened, kind, light, corners, progress)
    usable = np.isfinite(codes[0]).all(axis=1)
    colours = (kind.linear_srgb(light) @ matrix_between("linear-srgb", SPACE).T)[usable]
    encoded = codes[0][usable]
    nominal = matrix_between(SPACE, "linear-srgb")
    fit = fit_one_exposure(encoded, colours, _grey(colours), nominal)

    identity = identity_gamut_map()
    model = CameraModel((opened.white_balance,), fit.matrix, fit.response, identity, identity)
    linear = model.linearize(encoded) / fit.multipliers / fit.scale
    predicted, true = (srgb_encode(np.clip(values @ nominal.T, 0.0, 1.0)) for values in (linear, colours))
    notes = (
        f"approximate, of the {kind.name} under {light}: one exposure does not show the camera's curve",
        f"assumed is {fit.curve}: the greys keep their ratios within {fit.spread:.0%}",
        f"the chart itself comes back to a mean ΔE00 of {delta_e_2000(predicted, true).mean():.1f}; five exposures in "
        "steps of one stop give a transform that is measured",
    )
    profile = CameraProfile(
        camera=opened.camera,
        matrix=nominal,
        white_balances={opened.white_balance: WhiteBalance(tuple(fit.multipliers.tolist()))},
        styles={opened.style: PictureStyle(models=(model,))},
        shots=opened.names,
        provenance=provenance.Chart(kind.name, light, SPACE),
        notes=notes,
    )
    if output is not None:
        profile.save(output)
    return ApproximateTransform(profile, notes)


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


def _some(names: Sequence[str]) -> str:
    """The first names of a list, and the number of the others."""
    listed = ", ".join(names[:4])
    return f"{listed} and {len(names) - 4} others" if len(names) > 4 else listed


def _not_charted(names: Sequence[str], charted: Sequence[str], corners: Array | None) -> str:
    """The end of a message, on pictures in which no chart was found; "" where it was in all, or corners are given."""
    missing = [name for name in names if name not in charted] if corners is None else []
    return f"; no chart was found in {_some(missing)}" if missing else ""


def _patches(
    bracket: Bracket, kind: ChartKind, light: str, corners: Array | None, progress: Progress
) -> tuple[Array, tuple[str, ...]]:
    """JPEG values (shots, n, 3) of the patches, NaN where clipped or outside, and the shots in which it was found."""
    files = bracket.files
    times = bracket.exposure_s

    def codes_of(file: Path) -> Pixels:
        """The picture (h, w, 3) in codes 0 … 255; more than 8 bits give fractions."""
        return np.asarray(np.clip(255.0 * colours_of(file), 0.0, 255.0), dtype=np.float32)

    colours = np.clip(kind.linear_srgb(light), 0.0, 1.0)
    reference: Array = 255.0 * srgb_encode(colours)
    places: dict[int, Array] = {} if corners is None else dict.fromkeys(range(len(files)), corners)
    for index, file in enumerate(files if corners is None else ()):
        progress(f"{file.name}: looking for the chart", 0.5 * index / len(files))
        chart = find_chart(np.rint(codes_of(file)).astype(np.uint8), kind, reference)
        if chart is not None:
            places[index] = chart.corners
    if not places:
        reason = detector_note() if kind.detector else "OpenCV has no detector for it"
        raise CalibrationError(
            f"{_some(bracket.names)}: no {kind.name} ({reason or 'none was found'}); give its corners, clockwise from "
            'the first patch\'s, --corners "x,y x,y x,y x,y"'
        )

    values = np.full((len(files), len(reference), 3), np.nan)
    likeness = 0.0
    for index, file in enumerate(files):
        progress(file.name, 0.5 + 0.5 * index / len(files))
        nearest = min(places, key=lambda shot: abs(np.log(times[shot] / times[index])))
        patches = patch_codes(codes_of(file), Chart(places[nearest], kind))
        clipped = np.any((patches.maximum >= 254) | (patches.minimum <= 1), axis=1)  # the limits of JPEG pixels
        values[index] = np.where(clipped[:, None], np.nan, patches.mean / 255.0)
        unclipped = np.isfinite(values[index]).all(axis=1)
        if unclipped.sum() > 4:  # an affine map explains any four colours
            likeness = max(likeness, resemblance(patches.mean[unclipped], reference[unclipped]))
    if likeness < RESEMBLANCE:
        raise CalibrationError(
            f"what lies between these corners is no {kind.name}: name them clockwise, the first patch's first"
        )

    # The camera may clip below 1: values near the highest one are clipped where there are four or more of them. A
    # single patch may be the brightest without being clipped.
    near_highest = values > np.nanmax(values, axis=(0, 1)) - NEAR_AN_END
    clipped_values = near_highest & (np.count_nonzero(near_highest, axis=(0, 1)) >= 4)
    values[clipped_values.any(axis=2)] = np.nan
    return values, tuple(files[index].name for index in sorted(places))
