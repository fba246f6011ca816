"""What a profile was calibrated on: RAW, or pictures in its place; asked before samples of the other are used."""

from lutforge.errors import CalibrationError
from lutforge.model.camera_profile import CameraProfile
from lutforge.samples.sample_set import SampleSet

CHART = "chart "
"""What the developer of samples begins with whose RAW is the known colours of a chart."""


def origin_of(samples: SampleSet) -> dict[str, str]:
    """Name the space and the program of pictures that stand in the place of RAW; empty for RAW.

    Raises CalibrationError where samples of several spaces or programs are mixed.
    """
    pairs = sorted(set(zip(samples.raw_space.tolist(), samples.developer.tolist(), strict=True)))
    if len(pairs) > 1:
        kinds = ", ".join(f"{developer} ({space})" if space else "RAW" for space, developer in pairs[:4])
        raise CalibrationError(f"the samples are of several kinds: {kinds}; calibrate each by itself")
    space, developer = pairs[0] if pairs else ("", "")
    return {"raw_space": space, "developer": developer} if space else {}


def is_of_chart(profile: CameraProfile) -> bool:
    """True where the known colours of a chart stood in the place of RAW: an input transform of a camera without RAW."""
    return profile.developer.startswith(CHART)


def require_same_origin(profile: CameraProfile, samples: SampleSet) -> None:
    """Raise CalibrationError, with what helps, where samples are not of what a profile was calibrated on."""
    given = origin_of(samples)
    if (profile.options.get("raw_space") or "raw") != given.get("raw_space", "raw"):
        option = "--developed DIR --developed-space SPACE " if profile.developer else ""
        raise CalibrationError(
            f"the profile is of {profile.developer or 'RAW files'}, the samples are of "
            f"{given.get('developer', 'RAW files')}: sample what the profile is of, lutforge sample SHOT… {option}"
            "-o samples.csv"
        )
