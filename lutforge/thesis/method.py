"""The thesis's method of calibration with its options, and the method of any options."""

from dataclasses import dataclass, field
from typing import ClassVar

from lutforge.calibration.method import CalibrationMethod, OwnMethod
from lutforge.calibration.style import StyleData
from lutforge.model.camera_profile import CameraProfile
from lutforge.model.lattice import Lattice
from lutforge.model.profile import ByDirection, CameraModel
from lutforge.progress import Progress
from lutforge.samples.sample_set import SampleSet
from lutforge.thesis.calibrate import calibrate, calibrate_base, fit_camera_model, fit_lattices
from lutforge.thesis.options import Options, ThesisOptions


@dataclass(frozen=True)
class ThesisMethod:
    """The thesis's method."""

    bakes_camera_model: ClassVar[bool] = False

    options: ThesisOptions = field(default_factory=ThesisOptions)

    def calibrate(
        self, samples: SampleSet, progress: Progress, given: CameraProfile | None
    ) -> tuple[CameraProfile, dict[str, StyleData]]:
        """Fit a profile: see `calibrate`."""
        return calibrate(samples, self.options, progress, given)

    def calibrate_base(self, samples: SampleSet, progress: Progress) -> CameraProfile:
        """Fit f, Ts and Tw alone: see `calibrate_base`."""
        return calibrate_base(samples, self.options, progress)

    def fit_lattices(self, style: StyleData) -> ByDirection[Lattice]:
        """Fit the lattices of both directions to the samples of a style."""
        return fit_lattices(style, self.options)

    def fit_camera_model(self, style: StyleData) -> CameraModel:
        """Fit f, Ts, h and h⁻¹ to the samples of a style."""
        return fit_camera_model(style, self.options)


def method_of(options: Options) -> CalibrationMethod:
    """The method that these options are of."""
    return ThesisMethod(options) if isinstance(options, ThesisOptions) else OwnMethod(options)


def thesis_method_beside(method: CalibrationMethod) -> ThesisMethod:
    """The thesis's method that another is compared with: the same one where that is the thesis's, else its defaults."""
    return method if isinstance(method, ThesisMethod) else ThesisMethod()
