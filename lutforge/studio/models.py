"""The models that a workspace holds: their kinds, and the fit of one, which runs in another process."""

from dataclasses import dataclass
from typing import Final, Literal

from lutforge.arrays import Mask
from lutforge.errors import CalibrationError
from lutforge.model.camera_profile import CameraProfile
from lutforge.pipeline.calibration import calibrate, calibrate_base
from lutforge.pipeline.evaluation import Predicted, predict
from lutforge.progress import Progress
from lutforge.samples.sample_set import SampleSet
from lutforge.thesis.options import Options

ModelKind = Literal["matrix", "lattice"]
"""The kinds of models that are fitted, each kept as a camera profile."""
BASE_MODEL: Final = "matrix"
"""Response, matrix and white balances: the stages before the gamut map."""
LATTICE_MODEL: Final = "lattice"
"""The whole camera model with its gamut map, baked to lattices."""
NO_MODEL: Final = ""
"""The model in use before the first fit."""
MODEL_TITLES: dict[ModelKind, str] = {BASE_MODEL: "Response, matrix and white balance", LATTICE_MODEL: "Lattice"}
"""In the order of the calibration."""


@dataclass(frozen=True, eq=False)
class FitTask:
    """The inputs of a fit: samples (n,), options, and the stages, fitted before, that it stands on.

    stages: a BASE_MODEL, whose response, matrix and white balances are taken; None fits them anew.
    """

    kind: ModelKind
    rows: Mask
    options: Options
    stages: "FittedModel | None" = None


@dataclass(frozen=True, eq=False)
class FittedModel:
    """A profile, and what it predicts of every sample.

    task: what it was fitted to; None where it comes from a file.
    """

    profile: CameraProfile
    predicted: Predicted
    task: FitTask | None = None


def fit_model(task: FitTask, samples: SampleSet, progress: Progress) -> FittedModel:
    """Fit a model to some samples, and let it predict all. Raises CalibrationError where they do not determine it."""
    if task.rows.sum() < 10:
        raise CalibrationError(f"{int(task.rows.sum())} samples are left to fit; at least 10 are needed: filter less")
    chosen = samples.select(task.rows)
    if task.kind == BASE_MODEL:
        profile = calibrate_base(chosen, task.options, progress)
    else:
        stages = None if task.stages is None else task.stages.profile
        profile = calibrate(chosen, task.options, progress, given=stages)
    progress("predicting all samples", 0.9)
    return FittedModel(profile, predict(profile, samples))
