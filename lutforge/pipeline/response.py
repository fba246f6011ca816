"""Use case: a bracket of a camera without RAW → its response, and a profile with it."""

from __future__ import annotations  # so that help() shows the names of types

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from pathlib import Path

import numpy as np

from lutforge.arrays import Array, Single
from lutforge.calibration.bracket import BracketFit, fit_bracket
from lutforge.calibration.exposure_pairs import ExposurePairs
from lutforge.calibration.options import BETA
from lutforge.calibration.pairs_of_bracket import pairs_of_bracket
from lutforge.errors import CalibrationError
from lutforge.images.read import read_image
from lutforge.model.camera_profile import CameraProfile
from lutforge.model.response_profile import profile_of_response
from lutforge.pipeline.file_kinds import PICTURE_SUFFIXES, PROFILE_SUFFIXES
from lutforge.pipeline.outputs import Paths, check_output, several
from lutforge.progress import Progress, silent
from lutforge.samples.sample_set import SampleSet
from lutforge.shots.metadata import UNKNOWN, read_picture_settings


@dataclass(frozen=True, eq=False)
class FittedResponse:
    """A response that was fitted, and the profile that holds it. exposure_s: relative exposures as stated, by shot.

    With a chart the profile holds a whole rendering. samples: colours of the chart in place of RAW, and unclipped JPEG
    values. level: by shot, the linear value of a perfect diffuser beside the chart, where 1 is the camera's white.
    found: the shots in which the chart was detected. In each other shot the chart is taken to be where it is in the
    shot of the nearest exposure.
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
        exposure_s: relative exposures in the order of the files; by default from their time, aperture and ISO.
        camera: its name, where the files do not state it.
        all_colours: use saturated colours, too, for a scene without neutral ones: the curve then also contains the
            effect of the gamut map.
        progress: called with the name of the present step, and the share that is done.

    Returns:
        `fit`, the result of the fit to the bracket, and `profile`, which holds the response.

    Raises:
        CalibrationError: the bracket does not determine a response; the message states what to photograph.
        ImageError: a picture cannot be read.
        LutForgeError: nothing can be written there.
    """
    files = several(bracket)
    if output is not None:
        check_output(output, PROFILE_SUFFIXES, files)
    opened = open_bracket(files, exposure_s, camera)
    fit = fit_bracket(_pairs(opened.files, opened.exposure_s, progress), 1.0 if all_colours else BETA)
    profile = profile_of_response(fit.response, opened.camera, opened.style, opened.white_balance, opened.names)
    profile = replace(profile, notes=(*profile.notes, *fit.statements))
    if output is not None:
        profile.save(output)
    return FittedResponse(profile, fit, dict(zip(opened.names, opened.exposure_s, strict=True)))


@dataclass(frozen=True)
class Bracket:
    """The pictures of a bracket.

    exposure_s: relative, NaN where not stated; camera: "" if unknown; style, white_balance: as the first picture states
    them, or by default "standard" and "auto".
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
        exposures = np.array(self.exposure_s)
        pictures = f"{len(self.files)} pictures{f' of {self.camera}' if self.camera else ''} without RAW"
        if not np.isfinite(exposures).all():
            return f"{pictures}; they do not state their exposures: write them under “Exposure times”"
        steps = len(np.unique(exposures))
        if steps < 2:
            return f"{pictures}, all of one exposure: a response needs one scene at several"
        stops = np.log2(exposures.max() / exposures.min())
        return f"{pictures}: a bracket of {steps} exposures over {stops:.1f} stops, if they show one scene"


def open_bracket(bracket: Sequence[Path], exposure_s: Sequence[float] | None, camera: str) -> Bracket:
    """Return the pictures of a bracket, including those of folders.

    Raises CalibrationError where an exposure is neither given nor stated, or their number is wrong; ImageError.
    """
    files = []
    for path in bracket:
        entries = sorted(path.iterdir()) if path.is_dir() else ()
        pictures = [file for file in entries if file.suffix.lower() in PICTURE_SUFFIXES and file.is_file()]
        if path.is_dir() and not pictures:
            raise CalibrationError(f"{path}: no pictures in this folder")
        files += pictures or [path]

    of_files = [read_picture_settings(file) for file in files]
    times = exposure_s
    if times is None:
        times = [settings.exposure for settings in of_files]
        for file, time in zip(files, times, strict=True):
            if not time > 0:
                raise CalibrationError(
                    f"{file.name}: the file states no exposure time; give those of the bracket (--times)"
                )
    check_exposures(files, times)

    cameras = sorted({settings.camera for settings in of_files if settings.camera})
    if len(cameras) > 1:
        raise CalibrationError(f"pictures of {len(cameras)} cameras ({', '.join(cameras[:4])}): give those of one")
    settings = of_files[0]
    style = "standard" if settings.style == UNKNOWN else settings.style
    balance = "auto" if settings.white_balance == UNKNOWN else settings.white_balance
    return Bracket(tuple(files), tuple(times), camera or settings.camera or "camera", style, balance)


def _pairs(files: Sequence[Path], times: Sequence[float], progress: Progress) -> ExposurePairs:
    """The pairs of colours in pictures of one scene at several exposures."""
    check_exposures(files, times)

    def pixels() -> Iterator[Array]:
        for index, file in enumerate(files):
            progress(file.name, 0.8 * index / len(files))
            yield colours_of(file).astype(np.float64)
        progress("fitting", 0.8)

    return pairs_of_bracket([file.name for file in files], pixels(), times)


def colours_of(file: Path) -> Single:
    """A picture (h, w, 3), 1 = full scale. Raises CalibrationError where it is grey."""
    pixels = read_image(file).pixels
    if pixels.shape[2] < 3:
        raise CalibrationError(f"{file.name}: a grey image; what is fitted is of red, green and blue")
    return pixels[..., :3]


def bracket_samples(
    files: Sequence[Path], exposure_s: Sequence[float], camera: str, progress: Progress = silent
) -> tuple[SampleSet, ExposurePairs]:
    """The colours of pairs in a bracket as samples without RAW (NaN), each colour of a shot once, and the pairs.

    The rows of the pairs are those of the samples.
    """
    pairs = _pairs(files, exposure_s, progress)
    cells = int(max(pairs.first_row.max(), pairs.second_row.max())) + 1
    place = np.concatenate([pairs.first_shot * cells + pairs.first_row, pairs.second_shot * cells + pairs.second_row])
    _, first, row = np.unique(place, return_index=True, return_inverse=True)
    scaled = np.concatenate([pairs.first, pairs.second])[first]
    srgb = np.clip(scaled * (pairs.white - pairs.black) + pairs.black, 0.0, 1.0)

    count = len(first)
    shot = place[first] // cells
    by_name = {file.name: time for file, time in zip(files, exposure_s, strict=True)}
    cameras = np.full(count, camera or "camera")
    samples = SampleSet(
        camera=cameras,
        style=np.full(count, "standard"),
        white_balance=np.full(count, "auto"),
        shot=np.array(pairs.shots)[shot],
        patch=(place[first] % cells).astype(str),
        exposure_s=np.array([by_name[name] for name in pairs.shots])[shot],
        raw=np.full((count, 3), np.nan),
        srgb=srgb,
        wb=np.ones((count, 3)),
        raw_camera=cameras,
    )
    return samples, replace(pairs, first_row=row[: len(pairs)], second_row=row[len(pairs) :])


def check_exposures(files: Sequence[Path], times: Sequence[float]) -> None:
    """Raise CalibrationError where pictures and exposure times differ in number, or a time is not above 0."""
    if len(times) != len(files):
        raise CalibrationError(f"{len(times)} exposure times for {len(files)} pictures; give one for each, in order")
    if not all(0 < time < np.inf for time in times):
        raise CalibrationError("an exposure time is not above 0; give seconds, such as 1/60 or 0.5")


def parse_times(text: str) -> list[float]:
    """The exposure times in a text such as "1/60, 1/30, 0.5". Raises CalibrationError on another word."""
    try:
        return [float(Fraction(word.strip())) for word in text.split(",")]
    except (ValueError, ZeroDivisionError):
        raise CalibrationError(f'exposure times "{text[:60]}": give seconds, such as 1/60,1/30,0.5') from None
