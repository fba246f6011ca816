"""Use case: a bracket of a camera without RAW → its response, and a profile with it.

With a chart in the pictures the whole rendering is calibrated: the colours that the chart is known to have under the
light, times the exposure, take the place of RAW. Errors of the exposures, and the level of white, come from the
response that the exposures alone tell (thesis 4.2.1).
"""

from __future__ import annotations  # so that help() shows the names of types

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from pathlib import Path

import numpy as np

from lutforge.arrays import Array, Mask, Pixels
from lutforge.calibration.bracket import BracketFit, fit_bracket
from lutforge.calibration.exposure_pairs import NEAR_AN_END, ExposurePairs, pairs_of_bracket, pairs_of_samples
from lutforge.calibration.one_exposure import fit_one_exposure
from lutforge.calibration.options import BETA
from lutforge.calibration.uneven_light import UnevenLight, fit_uneven_light
from lutforge.colour.rgb_spaces import matrix_between
from lutforge.colour.srgb import delta_e_2000, srgb_encode
from lutforge.errors import CalibrationError
from lutforge.images.read import read_image
from lutforge.model import provenance
from lutforge.model.camera_profile import CameraProfile
from lutforge.model.gamut_map import identity_gamut_map
from lutforge.model.profile import CameraModel, PictureStyle
from lutforge.model.response_profile import profile_of_response
from lutforge.model.white_balance import WhiteBalance
from lutforge.pipeline.calibration import calibrate
from lutforge.pipeline.inspection import PICTURE_SUFFIXES
from lutforge.pipeline.outputs import PROFILE_SUFFIXES, Paths, check_output, several
from lutforge.progress import Progress, part, silent
from lutforge.samples.chart import ChartKind, chart_kind, parse_corners
from lutforge.samples.chart_search import RESEMBLANCE, Chart, detector_note, find_chart, patch_codes, resemblance
from lutforge.samples.sample_set import SampleSet
from lutforge.shots.metadata import UNKNOWN, read_picture_settings


@dataclass(frozen=True, eq=False)
class FittedResponse:
    """A response. profile: which holds it; fit: what the exposures tell; exposure_s: relative, as stated, by shot.

    With a chart, of a whole rendering, samples: chart colours as RAW, JPEG values that no shot clips; level: by shot,
    what a perfect diffuser beside the chart has in linear light of the profile, where 1 is the camera's white; found:
    shots in which the chart was detected; the others take its place in the shot of the nearest exposure.
    """

    profile: CameraProfile
    fit: BracketFit
    exposure_s: dict[str, float]
    samples: SampleSet | None = None
    level: dict[str, float] = field(default_factory=dict)
    found: tuple[str, ...] = ()


def response(
    bracket: Paths,
    output: str | Path | None = None,
    exposure_s: Sequence[float] | None = None,
    *,
    camera: str = "",
    all_colours: bool = False,
    progress: Progress = silent,
) -> FittedResponse:
    """Fit the response of a camera without RAW to photographs of one still scene that differ in the exposure only.

    Args:
        bracket: pictures, or a folder of them.
        output: the profile to write (.npz).
        exposure_s: relative exposures in the order of the files; without, from their time, aperture and ISO.
        camera: its name, where the files do not tell it.
        all_colours: count saturated colours, too, for a scene with nothing near neutral: the curve then carries what
            the gamut map did.
        progress: called with what is being done, and the share that is done.

    Returns:
        `fit`, what the bracket tells, and `profile`, which holds the response.

    Raises:
        CalibrationError: the bracket does not determine a response; it says what to shoot.
        ImageError: a picture cannot be read.
        LutForgeError: nothing can be written there.
    """
    files = several(bracket)
    if output is not None:
        check_output(output, PROFILE_SUFFIXES, files)
    opened = open_bracket(files, exposure_s, camera)
    fit = fit_bracket(_pairs(opened.files, opened.exposure_s, progress), 1.0 if all_colours else BETA)
    profile = profile_of_response(fit.response, opened.camera, opened.style, opened.white_balance, opened.names)
    profile = replace(profile, notes=(*profile.notes, *fit.told))
    if output is not None:
        profile.save(output)
    return FittedResponse(profile, fit, dict(zip(opened.names, opened.exposure_s, strict=True)))


@dataclass(frozen=True)
class Bracket:
    """The pictures of a bracket.

    exposure_s: relative, NaN where not stated; camera: "" if unknown; style, white_balance: as the first picture tells,
    or usual.
    """

    files: tuple[Path, ...]
    exposure_s: tuple[float, ...]
    camera: str
    style: str = "standard"
    white_balance: str = "auto"

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the files."""
        return tuple(file.name for file in self.files)

    def __str__(self) -> str:
        count, known = len(self.files), np.array(self.exposure_s)
        seen = f"{count} pictures{f' of {self.camera}' if self.camera else ''} without RAW"
        if not np.isfinite(known).all():
            return f"{seen}; they do not state their exposures: write them under “Exposure times”"
        steps = len(np.unique(known))
        if steps < 2:
            return f"{seen}, all of one exposure: a response needs one scene at several"
        stops = np.log2(known.max() / known.min())
        return f"{seen}: a bracket of {steps} exposures over {stops:.1f} stops, if they show one scene"


def open_bracket(bracket: Sequence[Path], exposure_s: Sequence[float] | None, camera: str) -> Bracket:
    """Return the pictures of a bracket, those of its folders too.

    Raises CalibrationError where exposures are not stated, or are not one for each picture; ImageError.
    """
    files = []
    for path in bracket:
        entries = sorted(path.iterdir()) if path.is_dir() else ()
        pictures = [file for file in entries if file.suffix.lower() in PICTURE_SUFFIXES and file.is_file()]
        if path.is_dir() and not pictures:
            raise CalibrationError(f"{path}: no pictures in this folder")
        files += pictures or [path]
    times, of_files = exposure_s, [read_picture_settings(file) for file in files]
    if times is None:
        times = [settings.exposure for settings in of_files]
        for file, time in zip(files, times, strict=True):
            if not time > 0:
                raise CalibrationError(
                    f"{file.name}: the file states no exposure time; give those of the bracket (--times)"
                )
    check_exposures(files, times)
    settings, cameras = of_files[0], sorted({each.camera for each in of_files if each.camera})
    if len(cameras) > 1:
        raise CalibrationError(f"pictures of {len(cameras)} cameras ({', '.join(cameras[:4])}): give those of one")
    style = "standard" if settings.style == UNKNOWN else settings.style
    balance = "auto" if settings.white_balance == UNKNOWN else settings.white_balance
    return Bracket(tuple(files), tuple(times), camera or settings.camera or "camera", style, balance)


def _pairs(files: Sequence[Path], times: Sequence[float], progress: Progress) -> ExposurePairs:
    check_exposures(files, times)

    def pixels() -> Iterator[Array]:
        for index, file in enumerate(files):
            progress(file.name, 0.8 * index / len(files))
            yield colours_of(file).astype(np.float64)
        progress("fitting", 0.8)

    return pairs_of_bracket([file.name for file in files], pixels(), times)


def colours_of(file: Path) -> Pixels:
    """A picture (h, w, 3), 1 = full scale. Raises CalibrationError where it is grey."""
    pixels = read_image(file).pixels
    if pixels.shape[2] < 3:
        raise CalibrationError(f"{file.name}: a grey image; what is fitted is of red, green and blue")
    return pixels[..., :3]


def bracket_samples(
    files: Sequence[Path], exposure_s: Sequence[float], camera: str, progress: Progress = silent
) -> tuple[SampleSet, ExposurePairs]:
    """The colours that two exposures of a bracket share, each once by shot, without RAW (NaN), and their pairs."""
    pairs = _pairs(files, exposure_s, progress)
    cells = int(max(pairs.first_row.max(), pairs.second_row.max())) + 1
    place = np.concatenate([pairs.first_shot * cells + pairs.first_row, pairs.second_shot * cells + pairs.second_row])
    _, first, row = np.unique(place, return_index=True, return_inverse=True)
    inside = np.concatenate([pairs.first, pairs.second])[first]
    srgb = np.clip(inside * (pairs.white - pairs.black) + pairs.black, 0.0, 1.0)
    shot, count = place[first] // cells, len(first)
    by_name = {file.name: time for file, time in zip(files, exposure_s, strict=True)}
    names, nothing = np.array(pairs.shots), np.full((count, 3), np.nan)
    cameras = np.full(count, camera or "camera")
    samples = SampleSet(
        cameras, np.full(count, "standard"), np.full(count, "auto"), names[shot], (place[first] % cells).astype(str),
        np.array([by_name[name] for name in pairs.shots])[shot], nothing, srgb, np.ones((count, 3)), cameras,
    )  # fmt: skip
    return samples, replace(pairs, first_row=row[: len(pairs)], second_row=row[len(pairs) :])


def check_exposures(files: Sequence[Path], times: Sequence[float]) -> None:
    """Raise CalibrationError where pictures and exposure times differ in number, or a time is none."""
    if len(times) != len(files):
        raise CalibrationError(f"{len(times)} exposure times for {len(files)} pictures; give one for each, in order")
    if not all(0 < time < np.inf for time in times):
        raise CalibrationError("an exposure time is not above 0; give seconds, such as 1/60 or 0.5")


def parse_times(text: str) -> list[float]:
    """Exposure times of a text such as "1/60, 1/30, 0.5". Raises CalibrationError on a word that is none."""
    try:
        return [float(Fraction(word.strip())) for word in text.split(",")]
    except (ValueError, ZeroDivisionError):
        raise CalibrationError(f'exposure times "{text[:60]}": give seconds, such as 1/60,1/30,0.5') from None


# --- With a chart in the pictures -----------------------------------------------------------------------------------


SPACE = "acescg"
"""The linear space of the chart's colours: no surface lies outside it, and its axes are near those of cameras."""


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

    corners: (4, 2), where the chart is in all shots, in pixels; None where it is searched for. The others: as for
    `response`. Raises CalibrationError where the chart is not found, and what `response` raises.
    """
    if output is not None:
        check_output(output, PROFILE_SUFFIXES, bracket)
    opened = open_bracket(bracket, exposure_s, camera)
    codes, charted = _patches(opened, kind, light, corners, part(progress, 0.0, 0.2))
    names, times = opened.names, opened.exposure_s
    usable = np.asarray(np.isfinite(codes).all(axis=2))
    shot, patch = np.nonzero(usable)
    count = len(shot)
    camera_column = np.full(count, opened.camera)
    samples = SampleSet(
        camera_column, np.full(count, opened.style), np.full(count, opened.white_balance), np.array(names)[shot],
        np.char.mod("chart_%03d", patch + 1), np.array(times, dtype=np.float64)[shot], raw=np.zeros((count, 3)),
        srgb=codes[usable], wb=np.full((count, 3), np.nan), raw_camera=camera_column,
        raw_space=np.full(count, SPACE), chart=np.full(count, kind.name), chart_light=np.full(count, light),
    )  # fmt: skip
    try:
        fit = fit_bracket(pairs_of_samples(samples))
    except CalibrationError as error:
        reason = str(error).partition(";")[0]  # what else it says is of scenes without a chart
        advice = "a chart's greys are unsaturated where the white balance is set to the light"
        raise CalibrationError(f"{reason}; {advice}{_not_charted(names, charted, corners)}") from None
    true = np.array([fit.exposure_error.get(name, 1.0) for name in names]) * times
    colours = kind.linear_srgb(light) @ matrix_between("linear-srgb", SPACE).T
    uneven = _uneven_light(codes, true, fit, colours, kind)
    if uneven is not None:
        colours = colours * uneven.gain(kind.places)[:, None]
    # What the camera makes of the chart's greys tells its white balance beside the light, and where its white is.
    reflected = colours[patch] * true[shot, None]
    grey = _grey(reflected)
    if np.count_nonzero(grey) < 6:
        raise CalibrationError(
            "too few unclipped grey patches: take steps of at most two stops, some of them darker"
            + _not_charted(names, charted, corners)
        )
    shown = fit.response.linearize(samples.srgb[grey]) @ matrix_between("linear-srgb", SPACE).T
    ratio = np.median(shown / reflected[grey], axis=0)
    multipliers, scale = ratio / ratio[1], float(ratio[1])
    # Colours with a channel below 0 or above the camera's white have no place in a table of RAW.
    raw = scale * true[shot, None] * colours[patch]
    possible = np.all((raw > 0.0) & (raw < 1.0), axis=1)
    samples = replace(samples, raw=raw, wb=np.tile(multipliers, (count, 1))).select(possible)
    profile = calibrate(samples, progress=part(progress, 0.2, 1.0))
    level = dict(zip(names, (scale * true).tolist(), strict=True))
    light_notes = () if uneven is None else (uneven.note,)
    scale_note = f"1 is the camera's white; white beside the chart has {max(level.values()):.3g} in the brightest shot"
    profile = replace(
        profile, notes=(f"of the {profile.provenance}: {kind.source}", scale_note, *light_notes, *profile.notes)
    )
    if output is not None:
        profile.save(output)
    return FittedResponse(profile, fit, dict(zip(names, times, strict=True)), samples, level, charted)


def _grey(colours: Array) -> Mask:
    """Which colours (n, 3) of a chart are near neutral."""
    neutral: Mask = 1.0 - colours.min(axis=1) / colours.max(axis=1) < 0.12
    return neutral


@dataclass(frozen=True, eq=False)
class ApproximateTransform:
    """What one exposure of a chart gives: a profile, and in words what it rests on and how near it is to the chart."""

    profile: CameraProfile
    told: tuple[str, ...]


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

    The curve is sRGB's or EMoR's mean; the chart's greys decide. corners: (4, 2), where the chart is,
    in pixels; None where it is searched for. Raises CalibrationError where the chart is not found, and ImageError.
    """
    if output is not None:
        check_output(output, PROFILE_SUFFIXES, [picture])
    opened = open_bracket([picture], [1.0], camera)
    codes, _ = _patches(opened, kind, light, corners, progress)
    usable = np.isfinite(codes[0]).all(axis=1)
    colours = (kind.linear_srgb(light) @ matrix_between("linear-srgb", SPACE).T)[usable]
    encoded, nominal = codes[0][usable], matrix_between(SPACE, "linear-srgb")
    fit = fit_one_exposure(encoded, colours, _grey(colours), nominal)

    nothing = identity_gamut_map()
    model = CameraModel((opened.white_balance,), fit.matrix, fit.response, nothing, nothing)
    linear = model.linearize(encoded) / fit.multipliers / fit.scale
    shown, known = (srgb_encode(np.clip(each @ nominal.T, 0.0, 1.0)) for each in (linear, colours))
    told = (
        f"approximate, of the {kind.name} under {light}: one exposure does not show the camera's curve",
        f"assumed is {fit.curve}: the greys keep their ratios within {fit.spread:.0%}",
        f"the chart itself comes back to a mean ΔE00 of {delta_e_2000(shown, known).mean():.1f}; five exposures in "
        "steps of one stop give a transform that is measured",
    )
    profile = CameraProfile(
        camera=opened.camera,
        matrix=nominal,
        white_balances={opened.white_balance: WhiteBalance(tuple(fit.multipliers.tolist()))},
        styles={opened.style: PictureStyle(models=(model,))},
        shots=opened.names,
        provenance=provenance.Chart(kind.name, light, SPACE),
        notes=told,
    )
    if output is not None:
        profile.save(output)
    return ApproximateTransform(profile, told)


def _uneven_light(
    codes: Array, exposures: Array, fit: BracketFit, colours: Array, kind: ChartKind
) -> UnevenLight | None:
    """The field of light over a chart, of JPEG values (shots, n, 3) at exposures (shots,) and its colours (n, 3)."""
    usable = np.asarray(np.isfinite(codes).all(axis=2))
    linear = fit.response.linearize(np.nan_to_num(codes)) / exposures[:, None, None]
    count = usable.sum(axis=0)[:, None]
    with np.errstate(invalid="ignore"):
        mean = np.where(usable[..., None], linear, 0.0).sum(axis=0) / count
    return fit_uneven_light(mean, colours, kind.places)


def _some(names: Sequence[str]) -> str:
    """The first names of a list, and the number of the others."""
    shown = ", ".join(names[:4])
    return f"{shown} and {len(names) - 4} others" if len(names) > 4 else shown


def _not_charted(names: Sequence[str], charted: Sequence[str], corners: Array | None) -> str:
    """What an error adds about pictures in which no chart was found; "" where it was in all, or its corners given."""
    missing = [name for name in names if name not in charted] if corners is None else []
    return f"; no chart was found in {_some(missing)}" if missing else ""


def _patches(
    bracket: Bracket, kind: ChartKind, light: str, corners: Array | None, progress: Progress
) -> tuple[Array, tuple[str, ...]]:
    """JPEG values (shots, n, 3) of the patches, NaN where clipped or outside, and the shots that show the chart."""
    files, times = bracket.files, bracket.exposure_s

    def codes_of(file: Path) -> Pixels:
        """The picture (h, w, 3) in codes 0 … 255, of more than 8 bits with its fractions."""
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
        why = detector_note() if kind.detector else "OpenCV has no detector for it"
        raise CalibrationError(
            f"{_some(bracket.names)}: no {kind.name} ({why or 'none was found'}); give its corners, clockwise from the "
            'first patch\'s, --corners "x,y x,y x,y x,y"'
        )
    values, likeness = np.full((len(files), len(reference), 3), np.nan), 0.0
    for index, file in enumerate(files):
        progress(file.name, 0.5 + 0.5 * index / len(files))
        nearest = min(places, key=lambda other: abs(np.log(times[other] / times[index])))
        patches = patch_codes(codes_of(file), Chart(places[nearest], kind))
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
    near = values > np.nanmax(values, axis=(0, 1)) - NEAR_AN_END
    piled = near & (np.count_nonzero(near, axis=(0, 1)) >= 4)
    values[piled.any(axis=2)] = np.nan
    return values, tuple(files[index].name for index in sorted(places))


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

    @property
    def is_one_picture(self) -> bool:
        """Whether it is one picture of a chart, which gives an approximate transform only."""
        return bool(self.chart) and len(self.files) == 1 and not self.files[0].is_dir()

    def approximate(self, output: Path | None, progress: Progress) -> ApproximateTransform:
        """Fit an approximate transform to one picture of a chart. Raises LutForgeError."""
        kind, corners = chart_kind(self.chart), parse_corners(self.corners) if self.corners else None
        chart = (kind, self.light or "D50", corners)
        return write_approximate_transform(self.files[0], output, *chart, camera=self.camera, progress=progress)

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
