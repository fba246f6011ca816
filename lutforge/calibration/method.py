"""A method of calibration, with its options: what fits a profile, and what refits it to a part of the shots."""

from dataclasses import dataclass, field
from typing import ClassVar, Protocol

from lutforge.calibration.calibrate import calibrate, calibrate_base
from lutforge.calibration.options import CalibrationOptions, LatticeOptions
from lutforge.calibration.style import StyleData, fit_lattices
from lutforge.model.camera_profile import CameraProfile
from lutforge.model.lattice import Lattice
from lutforge.model.profile import ByDirection, CameraModel
from lutforge.progress import Progress
from lutforge.samples.sample_set import SampleSet


class CalibrationMethod(Protocol):
    """What every method of calibration does. Its functions raise CalibrationError where samples do not suffice.

    bakes_camera_model: whether the lattices are baked from the camera model, which then predicts for both; else they
    are fitted to the samples, and predict by themselves.
    """

    bakes_camera_model: ClassVar[bool]

    @property
    def options(self) -> LatticeOptions:
        """The numbers that the method leaves open."""

    def calibrate(
        self, samples: SampleSet, progress: Progress, given: CameraProfile | None
    ) -> tuple[CameraProfile, dict[str, StyleData]]:
        """Fit a profile, without held-out errors; and return by style the data that these are measured with.

        given: a profile whose responses, matrices and white balances are taken as they are.
        """

    def calibrate_base(self, samples: SampleSet, progress: Progress) -> CameraProfile:
        """Fit the responses, the matrices and the white balances alone."""

    def fit_lattices(self, style: StyleData) -> ByDirection[Lattice]:
        """Fit the lattices of one style."""

    def fit_camera_model(self, style: StyleData) -> CameraModel:
        """Fit the camera model of one style."""


@dataclass(frozen=True)
class OwnMethod:
    """LutForge's own method."""

    bakes_camera_model: ClassVar[bool] = True

    options: CalibrationOptions = field(default_factory=CalibrationOptions)

    def calibrate(
        self, samples: SampleSet, progress: Progress, given: CameraProfile | None
    ) -> tuple[CameraProfile, dict[str, StyleData]]:
        """Fit a profile: see `calibrate`."""
        return calibrate(samples, self.options, progress, given)

    def calibrate_base(self, samples: SampleSet, progress: Progress) -> CameraProfile:
        """Fit the responses, the matrices and the white balances alone: see `calibrate_base`."""
        return calibrate_base(samples, self.options, progress)

    def fit_lattices(self, style: StyleData) -> ByDirection[Lattice]:
        """Bake the camera model of a style; black-and-white lattices are fitted to its samples."""
        return fit_lattices(style, self.options)

    def fit_camera_model(self, style: StyleData) -> CameraModel:
        """Return the camera model of a style, which is fitted when it is first asked for."""
        return style.model
