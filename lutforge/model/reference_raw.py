"""Samples of a camera without RAW, by its profile: the reference camera's RAW as the camera's own (thesis 4.2.4)."""

from dataclasses import replace

import numpy as np

from lutforge.errors import CalibrationError
from lutforge.model.camera_profile import CameraProfile
from lutforge.model.provenance import ReferenceRaw
from lutforge.samples.clipping import unclipped_colours
from lutforge.samples.sample_set import SampleSet


def with_own_raw(profile: CameraProfile, samples: SampleSet) -> SampleSet:
    """Transform the reference's RAW to the camera's own, with the profile's multipliers; samples of own RAW stay.

    Samples that the JPEG or the reference's RAW clips are left out.

    Each shot gets the gain that brings it to the level of its JPEG, as in the calibration: what the exposures of two
    cameras differ by is no error of the profile. Raises CalibrationError where the RAW is of another camera than the
    profile was calibrated with.
    """
    through_reference = isinstance(profile.provenance, ReferenceRaw)
    foreign = samples.raw_camera[(samples.raw_camera != samples.camera) | through_reference]
    if len(foreign) and np.any(foreign != profile.raw_camera):
        raise CalibrationError(
            f"the profile of {profile.camera} is of RAW of the {profile.raw_camera}, the samples hold RAW of "
            f"{', '.join(np.unique(foreign)[:4])}: sample what the profile is of"
        )
    if not through_reference:
        return samples

    samples = samples.select(unclipped_colours(samples.srgb, samples.raw))
    raw = samples.raw @ profile.from_reference.T
    wb = np.full_like(samples.raw, np.nan)
    for style, setting in sorted(set(zip(samples.style.tolist(), samples.white_balance.tolist(), strict=True))):
        if style not in profile.styles or setting not in profile.white_balances:
            continue
        rows = (samples.style == style) & (samples.white_balance == setting)
        wb[rows] = profile.white_balances[setting].multipliers

        linearized = profile.linearize_to_own_raw(f"{style}/{setting}")(samples.srgb[rows])
        bright = samples.srgb[rows].max(axis=1) > 0.2
        ratio = np.maximum(linearized.sum(axis=1), 1e-6) / np.maximum(raw[rows].sum(axis=1), 1e-6)
        for shot in np.unique(samples.shot[rows][bright]):
            of_shot = samples.shot[rows] == shot
            raw[np.flatnonzero(rows)[of_shot]] *= float(np.median(ratio[bright & of_shot]))
    return replace(samples, raw=raw, wb=wb, raw_camera=samples.camera.copy())
