"""Use case: the options of `lutforge response` as text → a response, or the whole rendering from a chart."""

from __future__ import annotations  # so that help() shows the names of types

from dataclasses import dataclass
from pathlib import Path

from lutforge.errors import CalibrationError
from lutforge.pipeline.approximate_transform import ApproximateTransform, write_approximate_transform
from lutforge.pipeline.input_transform import write_input_transform
from lutforge.pipeline.response import FittedResponse, parse_times, response
from lutforge.progress import Progress
from lutforge.samples.chart import chart_kind, parse_corners


@dataclass(frozen=True)
class ResponseRequest:
    """The options of `lutforge response` as text, "" where not given. light, corners: of the chart."""

    files: tuple[Path, ...]
    times: str = ""
    camera: str = ""
    all_colours: bool = False
    chart: str = ""
    light: str = ""
    corners: str = ""

    @property
    def is_one_picture(self) -> bool:
        """True of one picture of a chart, which gives an approximate transform only."""
        return bool(self.chart) and len(self.files) == 1 and not self.files[0].is_dir()

    def approximate(self, output: Path | None, progress: Progress) -> ApproximateTransform:
        """Fit an approximate transform to one picture of a chart. Raises LutForgeError."""
        kind = chart_kind(self.chart)
        corners = parse_corners(self.corners) if self.corners else None
        return write_approximate_transform(
            self.files[0], output, kind, self.light or "D50", corners, camera=self.camera, progress=progress
        )

    def fit(self, output: Path | None, progress: Progress) -> FittedResponse:
        """Fit the response, and with a chart the whole rendering. Raises LutForgeError."""
        files = list(self.files)
        times = parse_times(self.times) if self.times else None
        if self.chart:
            kind = chart_kind(self.chart)
            corners = parse_corners(self.corners) if self.corners else None
            return write_input_transform(
                files, output, kind, self.light or "D50", corners, times, camera=self.camera, progress=progress
            )
        for name, value in (("--light", self.light), ("--corners", self.corners)):
            if value:
                raise CalibrationError(f"{name} is of a colour chart: name the chart, too, such as --chart classic")
        return response(files, output, times, camera=self.camera, all_colours=self.all_colours, progress=progress)
