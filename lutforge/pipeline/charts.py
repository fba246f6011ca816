"""Use case: exposures of a chart by a camera without RAW → a profile, and with it an input transform.

The colours that the chart is known to have under the light, times the exposure, take the place of RAW; from there on
the camera is calibrated as any other. Errors of the exposures, and the level of white, come from the response that
the exposures alone tell (thesis 4.2.1).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from lutforge.arrays import Array, Pixels
from lutforge.calibration.physical.bracket import fit_bracket
from lutforge.calibration.physical.response_from_exposures import CLIPPED, pairs_of_samples
from lutforge.colour.rgb_spaces import matrix_between
from lutforge.colour.srgb import srgb_encode
from lutforge.errors import CalibrationError
from lutforge.images.read import read_image
from lutforge.pipeline.calibration import calibrate
from lutforge.pipeline.outputs import PROFILE_SUFFIXES, check_output
from lutforge.pipeline.response import Bracket, FittedResponse, open_bracket, parse_times, response
from lutforge.pipeline.sampling import CHART
from lutforge.progress import Progress, part, silent
from lutforge.samples.chart import (
    RESEMBLANCE,
    Chart,
    ChartKind,
    chart_kind,
    detector_note,
    find_chart,
    parse_corners,
    patch_codes,
    resemblance,
)
from lutforge.samples.sample_set import SampleSet

SPACE = "acescg"
"""The linear space of the chart's colours: no surface lies outside it, and its axes are near those of cameras."""


@dataclass(frozen=True, eq=False)
class FittedChart(FittedResponse):
    """A response with a whole rendering. samples: chart colours as RAW, JPEG values of what no shot clips.

    level: by shot, what a perfect diffuser beside the chart has in linear light of the profile, where 1 is the camera's
    white. found: shots in which the chart was detected; the others take its place in the shot of the nearest exposure.
    """

    samples: SampleSet
    level: dict[str, float]
    found: tuple[str, ...]


@dataclass(frozen=True)
class ResponseRequest:
    """The words of `lutforge response`, "" for what is not given. light, corners: of the chart."""

    files: tuple[Path, ...]
    times: str = ""
    camera: str = ""
    all_colours: bool = False
    chart: str = ""
    light: str = ""
    corners: str = ""

    def fit(self, output: Path | None, progress: Progress) -> FittedResponse:
        """Fit the response, and with a chart the whole rendering, as the words say. Raises LutForgeError."""
        files, times = list(self.files), parse_times(self.times) if self.times else None
        if self.chart:
            kind, corners = chart_kind(self.chart), parse_corners(self.corners) if self.corners else None
            chart = (kind, self.light or "D50", corners, times)
            return write_input_transform(files, output, *chart, camera=self.camera, progress=progress)
        for name, value in (("--light", self.light), ("--corners", self.corners)):
            if value:
                raise CalibrationError(f"{name} is of a colour chart: name the chart, too, such as --chart classic")
        return response(files, output, times, camera=self.camera, all_colours=self.all_colours, progress=progress)


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
) -> FittedChart:
    """Calibrate a camera without RAW on exposures of a chart under a light, and write the profile.

    corners: (4, 2), where the chart is in all shots, in pixels; None where it is searched for. The others: as for
    `response`. Raises CalibrationError where the chart is not found, and what `response` raises.
    """
    if output is not None:
        check_output(output, PROFILE_SUFFIXES, bracket)
    with open_bracket(bracket, exposure_s, camera) as opened:
        codes, found = _patches(opened, kind, light, corners, part(progress, 0.0, 0.2))
    names, times = opened.names, opened.exposure_s
    usable = np.asarray(np.isfinite(codes).all(axis=2))
    shot, patch = np.nonzero(usable)
    count = len(shot)
    camera_column, developer = np.full(count, opened.camera), f"{CHART}{kind.name} under {light}"
    samples = SampleSet(
        camera_column, np.full(count, opened.style), np.full(count, opened.white_balance), np.array(names)[shot],
        np.char.mod("chart_%03d", patch + 1), np.array(times, dtype=np.float64)[shot], raw=np.zeros((count, 3)),
        srgb=codes[usable], wb=np.full((count, 3), np.nan), raw_camera=camera_column,
        raw_space=np.full(count, SPACE), developer=np.full(count, developer),
    )  # fmt: skip
    try:
        fit = fit_bracket(pairs_of_samples(samples))
    except CalibrationError as error:
        help_ = "a chart's greys are unsaturated where the white balance is set to the light"
        raise CalibrationError(f"{error}; {help_}") from None
    true = np.array([fit.exposure_error.get(name, 1.0) for name in names]) * times
    colours = kind.linear_srgb(light) @ matrix_between("linear-srgb", SPACE).T
    # What the camera makes of the chart's greys tells its white balance beside the light, and where its white is.
    reflected = colours[patch] * true[shot, None]
    grey = 1.0 - reflected.min(axis=1) / reflected.max(axis=1) < 0.12
    if np.count_nonzero(grey) < 6:
        raise CalibrationError("too few unclipped grey patches: take steps of at most two stops, some of them darker")
    shown = fit.response.linearize(samples.srgb[grey]) @ matrix_between("linear-srgb", SPACE).T
    ratio = np.median(shown / reflected[grey], axis=0)
    multipliers, scale = ratio / ratio[1], float(ratio[1])
    # Colours with a channel below 0 or above the camera's white have no place in a table of RAW.
    raw = scale * true[shot, None] * colours[patch]
    held = np.all((raw > 0.0) & (raw < 1.0), axis=1)
    samples = replace(samples, raw=raw, wb=np.tile(multipliers, (count, 1))).select(held)
    profile = calibrate(samples, progress=part(progress, 0.2, 1.0))
    level = dict(zip(names, (scale * true).tolist(), strict=True))
    told = f"1 is the camera's white; white beside the chart has {max(level.values()):.3g} in the brightest shot"
    profile = replace(profile, notes=(f"of the {developer}: {kind.source}", told, *profile.notes))
    if output is not None:
        profile.save(output)
    return FittedChart(profile, fit, dict(zip(names, times, strict=True)), samples, level, found)


def _patches(
    bracket: Bracket, kind: ChartKind, light: str, corners: Array | None, progress: Progress
) -> tuple[Array, tuple[str, ...]]:
    """JPEG values (shots, n, 3) of the patches, NaN where clipped or outside, and the shots that show the chart."""
    files, times = bracket.files, bracket.exposure_s
    colours = np.clip(kind.linear_srgb(light), 0.0, 1.0)
    reference: Array = 255.0 * srgb_encode(colours)
    places: dict[int, Array] = {} if corners is None else dict.fromkeys(range(len(files)), corners)
    for index, file in enumerate(files if corners is None else ()):
        progress(f"{file.name}: looking for the chart", 0.5 * index / len(files))
        codes = np.rint(_codes(file)).astype(np.uint8)
        seen = find_chart(codes, kind, reference)
        if seen is not None:
            places[index] = seen.corners
    if not places:
        why = detector_note() if kind.detector else "OpenCV has no detector for it"
        raise CalibrationError(
            f"no picture shows a {kind.name} ({why or 'none was found'}): give its corners, clockwise from the "
            'first patch\'s, --corners "x,y x,y x,y x,y"'
        )
    values, likeness = np.full((len(files), len(reference), 3), np.nan), 0.0
    for index, file in enumerate(files):
        progress(file.name, 0.5 + 0.5 * index / len(files))
        nearest = min(places, key=lambda other: abs(np.log(times[other] / times[index])))
        patches = patch_codes(_codes(file), Chart(places[nearest], kind))
        clipped = np.any((patches.maximum >= 254) | (patches.minimum <= 1), axis=1)  # as JPEG pixels elsewhere
        values[index] = np.where(clipped[:, None], np.nan, patches.mean / 255.0)
        kept = np.isfinite(values[index]).all(axis=1)
        if kept.sum() > 4:  # as many as an affine map explains in any case
            likeness = max(likeness, resemblance(patches.mean[kept], reference[kept]))
    if likeness < RESEMBLANCE:
        raise CalibrationError(
            f"what lies between these corners is no {kind.name}: name them clockwise, the first patch's first"
        )
    # The camera's own white need not be 1. One patch may be the brightest by chance; several that are equally bright
    # follow the exposure no more.
    near = values > np.nanmax(values, axis=(0, 1)) - CLIPPED
    piled = near & (np.count_nonzero(near, axis=(0, 1)) >= 4)
    values[piled.any(axis=2)] = np.nan
    return values, tuple(files[index].name for index in sorted(places))


def _codes(file: Path) -> Pixels:
    """The picture (h, w, 3) in codes 0 … 255, of more than 8 bits with its fractions."""
    pixels = read_image(file).pixels
    if pixels.shape[2] < 3:
        raise CalibrationError(f"{file.name}: a grey image; a chart tells colours")
    return np.asarray(np.clip(255.0 * pixels[..., :3], 0.0, 255.0), dtype=np.float32)
