"""Use case: photographs of the same scenes by two cameras → the transfer of one's RAW to the other's."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import get_args

from lutforge.calibration.physical.raw_to_raw import Form, fit_raw_transfer, pair_samples
from lutforge.errors import CalibrationError, SampleError
from lutforge.pipeline.outputs import check_output
from lutforge.pipeline.sampling import SampledShots, gather_samples
from lutforge.progress import Progress, part, silent
from lutforge.samples.sample_set import SampleSet


@dataclass(frozen=True)
class FittedTransfer:
    """A transfer that was written. errors: relative error of each form on held-out colours; None where too few."""

    source: str
    target: str
    common: int
    errors: Mapping[Form, float | None]


def write_transfer(
    source: Path,
    target: Path,
    output: Path,
    form: Form = "matrix",
    progress: Progress = silent,
    tell: Callable[[SampledShots], None] = lambda sampled: None,
) -> FittedTransfer:
    """Fit the transfer from the RAW of one camera to another's, and write it (.json).

    source, target: samples, RAW files or folders of one camera each. Raises SampleError where one holds several
    cameras, CalibrationError where the two did not see the same colours.
    """
    check_output(output, (".json",), (source, target))
    first = _of_one_camera(source, part(progress, 0.0, 0.5), tell)
    second = _of_one_camera(target, part(progress, 0.5, 1.0), tell)
    names = (str(first.camera[0]), str(second.camera[0]))
    x, y, neutral = pair_samples(first, second)
    fitted = {kind: fit_raw_transfer(*names, x, y, neutral, kind) for kind in get_args(Form)}
    error = fitted[form].error
    if error is not None and error > 0.3:  # of the value: then the two cameras did not see the same colours
        raise CalibrationError(
            f"{len(x)} colours that should be common differ by {error:.0%} after the best transfer: the "
            "shots are not of the same scenes; photograph the same charts with both cameras"
        )
    fitted[form].save(output)
    return FittedTransfer(*names, len(x), {kind: transfer.error for kind, transfer in fitted.items()})


def _of_one_camera(path: Path, progress: Progress, tell: Callable[[SampledShots], None]) -> SampleSet:
    samples = gather_samples(path, progress, tell).samples
    if len(set(samples.camera.tolist())) != 1:
        raise SampleError(f"{path}: samples of several cameras; give those of one")
    return samples
