"""Use case: a bracket of a camera without RAW, photographs or a film of it → its response, and a profile with it."""

from __future__ import annotations  # so that help() shows the names of types

import subprocess
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import OpenImageIO as oiio  # noqa: N813 - the name that its documentation uses

from lutforge import child_processes
from lutforge.arrays import Array
from lutforge.atomic_write import scratch_folder
from lutforge.calibration.physical.bracket import BracketFit, fit_bracket
from lutforge.calibration.physical.response_from_exposures import ExposurePairs, pairs_of_bracket
from lutforge.calibration.physical.unsaturated import BETA
from lutforge.child_processes import run_command
from lutforge.errors import CalibrationError, ShotError
from lutforge.images.read import Image, read_image
from lutforge.images.write import write_image
from lutforge.model.camera_profile import CameraProfile, profile_of_response
from lutforge.pipeline.inspection import PICTURE_SUFFIXES
from lutforge.pipeline.outputs import PROFILE_SUFFIXES, Paths, check_output, several
from lutforge.progress import Progress, silent
from lutforge.samples.sample_set import SampleSet
from lutforge.shots.metadata import UNKNOWN, read_picture_settings

VIDEO_SUFFIXES = frozenset({".mp4", ".mov", ".mkv", ".avi", ".mxf", ".mts", ".m2ts", ".webm"})

FRAMES = 8
"""Frames of a film that are averaged for an exposure."""


@dataclass(frozen=True, eq=False)
class FittedResponse:
    """A response. profile: which holds it; fit: what the exposures tell; exposure_s: relative, as stated, by shot."""

    profile: CameraProfile
    fit: BracketFit
    exposure_s: dict[str, float]


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
        bracket: pictures, a folder of them, or one film, of which each exposure takes the same share.
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
        ImageError, ShotError: a picture or film cannot be read.
        LutForgeError: nothing can be written there.
    """
    files = several(bracket)
    if output is not None:
        check_output(output, PROFILE_SUFFIXES, files)
    with open_bracket(files, exposure_s, camera) as opened:
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


@contextmanager
def open_bracket(bracket: Sequence[Path], exposure_s: Sequence[float] | None, camera: str) -> Iterator[Bracket]:
    """Give the pictures of a bracket; of a film a frame for each exposure, which is a file while the block runs.

    Raises CalibrationError where exposures are not stated, or are not one for each picture; ImageError, ShotError.
    """
    with scratch_folder() as folder:
        if len(bracket) == 1 and bracket[0].suffix.lower() in VIDEO_SUFFIXES:
            files = _frames(bracket[0], len(exposure_s or ()), folder)
        else:
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
        yield Bracket(tuple(files), tuple(times), camera or settings.camera or "camera", style, balance)


def _pairs(files: Sequence[Path], times: Sequence[float], progress: Progress) -> ExposurePairs:
    check_exposures(files, times)

    def pixels() -> Iterator[Array]:
        for index, file in enumerate(files):
            progress(file.name, 0.8 * index / len(files))
            image = read_image(file).pixels
            if image.shape[2] < 3:
                raise CalibrationError(f"{file.name}: a grey image; the response is fitted to red, green and blue")
            yield image[..., :3].astype(np.float64)
        progress("fitting", 0.8)

    return pairs_of_bracket([file.name for file in files], pixels(), times)


def bracket_samples(
    files: Sequence[Path], exposure_s: Sequence[float], camera: str, progress: Progress = silent
) -> tuple[SampleSet, ExposurePairs]:
    """The colours that two exposures of a bracket share, each once by shot, without RAW (NaN), and their pairs."""
    pairs = _pairs(files, exposure_s, progress)
    cells = int(max(pairs.first_row.max(), pairs.second_row.max())) + 1
    place = np.concatenate([pairs.first_shot * cells + pairs.first_row, pairs.second_shot * cells + pairs.second_row])
    _, kept, row = np.unique(place, return_index=True, return_inverse=True)
    inside = np.concatenate([pairs.first, pairs.second])[kept]
    srgb = np.clip(inside * (pairs.white - pairs.black) + pairs.black, 0.0, 1.0)
    shot, count = place[kept] // cells, len(kept)
    by_name = {file.name: time for file, time in zip(files, exposure_s, strict=True)}
    names, nothing = np.array(pairs.shots), np.full((count, 3), np.nan)
    cameras = np.full(count, camera or "camera")
    samples = SampleSet(
        cameras, np.full(count, "standard"), np.full(count, "auto"), names[shot], (place[kept] % cells).astype(np.str_),
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


def _frames(film: Path, count: int, folder: Path) -> list[Path]:
    """The mean of FRAMES frames, by ffmpeg, of the steady half in the middle of each of `count` equal parts of a film.

    Written in 16 bits: it has a third of the noise of one frame, and its levels lie between 8-bit codes.
    """
    if count < 2:
        raise CalibrationError(f"{film}: a film states no exposures; give those of its equal parts, in order (--times)")
    probe = ["ffprobe", "-v", "error", "-show_entries", "format=duration", "-of", "csv=p=0", str(film)]
    try:
        told = child_processes.run(probe, 60)
        seconds = float(told.stdout)
    except (OSError, subprocess.TimeoutExpired):
        raise ShotError("ffprobe, which comes with ffmpeg, cannot be run: install ffmpeg, or give frames") from None
    except ValueError:
        raise ShotError(f"{film}: ffmpeg cannot read it ({' '.join(told.stderr.split())[-120:]})") from None
    half = seconds / count / 2
    pictures = [folder / f"{film.stem}_{part + 1:03d}.tif" for part in range(count)]
    for part, picture in enumerate(pictures):
        frames = [folder / f"{number}.ppm" for number in range(1, FRAMES + 1)]
        take = ["-ss", f"{half * (2 * part + 0.5):.3f}", "-t", f"{half:.3f}", "-i", str(film)]
        even = ["-vf", f"fps={FRAMES / half:.6f},tpad=stop=-1:stop_mode=clone", "-frames:v", str(FRAMES)]
        command = ["ffmpeg", "-v", "error", "-nostdin", *take, *even, "-y", str(folder / "%d.ppm")]
        run_command(command, "ffmpeg", film, frames[-1])
        mean = np.asarray(np.mean([read_image(frame).pixels for frame in frames], axis=0), dtype=np.float32)
        write_image(picture, mean, Image(mean, oiio.ImageSpec(mean.shape[1], mean.shape[0], 3, "uint16")))
        for frame in frames:
            frame.unlink()
    return pictures
