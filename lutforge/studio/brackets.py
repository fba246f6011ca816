"""Brackets of a camera without RAW: what a folder of pictures shows, and the fit that the command line makes of it."""

import shlex
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lutforge.atomic_write import scratch_folder
from lutforge.boundary import reading
from lutforge.calibration.physical.exposure_pairs import ExposurePairs
from lutforge.errors import CalibrationError, ImageError, ShotError
from lutforge.pipeline.charts import FittedChart, KnownChart, write_input_transform
from lutforge.pipeline.inspection import PICTURE_SUFFIXES
from lutforge.pipeline.response import FittedResponse, bracket_samples, parse_times, response
from lutforge.progress import Progress
from lutforge.samples.chart_kinds import chart_kind, parse_corners
from lutforge.samples.sample_set import SampleSet
from lutforge.shots.discover import discover, raw_beside
from lutforge.shots.picture_settings import read_picture_settings, stated_exposure
from lutforge.studio.pictures import picture_bytes, thumbnail


@dataclass(frozen=True, eq=False)
class Bracket:
    """Pictures without RAW. exposure_s: relative, NaN where not stated; small: JPEGs of them; camera: "" if unknown.

    samples, pairs: the JPEG colours that two exposures share, None where the exposures are not stated or nothing is.
    """

    files: tuple[Path, ...]
    exposure_s: tuple[float, ...]
    small: tuple[bytes, ...]
    camera: str
    samples: SampleSet | None = None
    pairs: ExposurePairs | None = None

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


def bracket_in(sources: Sequence[Path], progress: Progress) -> Bracket | None:
    """Return the pictures that files and folders hold; None where there is anything else, such as RAW files, or one.

    Raises ImageError.
    """
    folders = [path for path in sources if path.is_dir()]
    with suppress(ShotError):
        if folders and discover(folders):
            return None
    files = [file for path in sources for file in (sorted(path.iterdir()) if path.is_dir() else [path])]
    if any(file in sources and file.suffix.lower() not in PICTURE_SUFFIXES for file in files):
        return None
    files = [file for file in files if file.suffix.lower() in PICTURE_SUFFIXES and raw_beside(file) is None]
    if len(files) < 2:
        return None
    small = []
    for index, file in enumerate(files):
        progress(file.name, index / len(files))
        with reading(file.name, "a picture", ImageError):
            small.append(thumbnail(picture_bytes(file)))
    times, camera = tuple(map(stated_exposure, files)), read_picture_settings(files[0]).camera
    found: tuple[SampleSet | None, ExposurePairs | None] = (None, None)
    with suppress(CalibrationError):  # which Fit response then tells, with what to do
        found = bracket_samples(files, times, camera, progress)
    return Bracket(tuple(files), times, tuple(small), camera, *found)


@dataclass(frozen=True)
class BracketRequest:
    """What `lutforge response` is asked for. times, chart, light, corners: as typed there, "" where not."""

    files: tuple[Path, ...]
    times: str = ""
    all_colours: bool = False
    chart: str = ""
    light: str = ""
    corners: str = ""

    def command(self, profile: Path) -> str:
        """The command that makes the same profile."""
        words = ["lutforge", "response", *map(str, self.files)]
        for option, value in (("--times", self.times), ("--chart", self.chart)):
            words += [option, value] if value else []
        for option, value in (("--light", self.light), ("--corners", self.corners)):
            words += [option, value] if value and self.chart else []
        words += ["--all-colours"] if self.all_colours and not self.chart else []
        return shlex.join([*words, "-o", str(profile)])


def fit_request(request: BracketRequest, progress: Progress) -> FittedResponse | FittedChart:
    """Fit the response of a bracket, and with a chart the whole rendering. Raises LutForgeError."""
    times = parse_times(request.times) if request.times else None
    with scratch_folder() as folder:
        output, files = folder / "camera.npz", list(request.files)
        if not request.chart:
            return response(files, output, times, all_colours=request.all_colours, progress=progress)
        corners = parse_corners(request.corners) if request.corners else None
        known = KnownChart(chart_kind(request.chart), request.light or "D50", corners)
        return write_input_transform(files, output, known, times, progress=progress)
