"""Use case: samples → their provenance: RAW, developed pictures, or a chart's known colours."""

from __future__ import annotations  # so that help() shows the names of types

from typing import TYPE_CHECKING

from lutforge.errors import CalibrationError
from lutforge.model.provenance import Chart, Developed, OwnRaw, Pictures
from lutforge.samples.sample_set import SampleSet

if TYPE_CHECKING:  # imported in functions: tables are read without the decoders of RAW files
    from lutforge.model.camera_profile import CameraProfile


def provenance_of(samples: SampleSet) -> OwnRaw | Developed | Chart:
    """The provenance of samples' linear values: RAW of any camera, developed pictures, or a chart's known colours.

    Raises CalibrationError where samples differ in it.
    """
    columns = (samples.raw_space, samples.developer, samples.chart, samples.chart_light)
    rows = sorted(set(zip(*(column.tolist() for column in columns), strict=True)))
    kinds = list(dict.fromkeys(_provenance(*row) for row in rows)) or [OwnRaw()]
    if len(kinds) > 1:
        names = ", ".join(f"{kind} ({kind.space})" if isinstance(kind, Pictures) else "RAW" for kind in kinds[:4])
        raise CalibrationError(f"the samples are of several kinds: {names}; calibrate each by itself")
    return kinds[0]


def _provenance(space: str, developer: str, chart: str, light: str) -> OwnRaw | Developed | Chart:
    """The provenance of samples with these columns."""
    if not space:
        return OwnRaw()
    return Chart(chart, light, space) if chart else Developed(developer, space)


def require_same_provenance(profile: CameraProfile, samples: SampleSet) -> None:
    """Raise CalibrationError, with advice, where samples are of another provenance than a profile."""
    of_samples = provenance_of(samples)
    if profile.provenance.space != of_samples.space:
        option = "--developed DIR --developed-space SPACE " if isinstance(profile.provenance, Pictures) else ""
        raise CalibrationError(
            f"the profile is of {profile.provenance}, the samples are of {of_samples}: sample what the profile is of, "
            f"lutforge sample SHOT… {option}-o samples.csv"
        )
