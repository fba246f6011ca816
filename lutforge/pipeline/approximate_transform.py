"""Use case: one picture of a chart, of a camera without RAW → an approximate profile with its whole rendering."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lutforge.arrays import Array
from lutforge.calibration.one_exposure import fit_one_exposure
from lutforge.colour.rgb_spaces import matrix_between
from lutforge.colour.srgb import delta_e_2000, srgb_encode
from lutforge.model import provenance
from lutforge.model.camera_profile import CameraProfile
from lutforge.model.gamut_map import identity_gamut_map
from lutforge.model.profile import CameraModel, PictureStyle
from lutforge.model.white_balance import WhiteBalance
from lutforge.pipeline.chart_patches import SPACE, measured_patches, near_neutral
from lutforge.pipeline.file_kinds import PROFILE_SUFFIXES
from lutforge.pipeline.outputs import check_output
from lutforge.pipeline.response import open_bracket
from lutforge.progress import Progress, silent
from lutforge.samples.chart import ChartKind


@dataclass(frozen=True, eq=False)
class ApproximateTransform:
    """The result of one exposure of a chart: a profile, and notes on what it assumes and on its error on the chart."""

    profile: CameraProfile
    notes: tuple[str, ...]


def write_approximate_transform(
    picture: Path,
    output: Path | None,
    kind: ChartKind,
    light: str,
    corners: Array | None = None,
    *,
    camera: str = "",
    progress: Progress = silent,
) -> ApproximateTransform:
    """Calibrate a camera without RAW on one picture of a chart, approximately, and write the profile.

    The response is sRGB's curve or EMoR's mean, whichever fits the chart's greys better. corners: (4, 2), of the chart,
    in pixels; None where it is searched for. Raises CalibrationError where the chart is not found, and ImageError.
    """
    if output is not None:
        check_output(output, PROFILE_SUFFIXES, [picture])
    opened = open_bracket([picture], [1.0], camera)
    codes, _ = measured_patches(opened, kind, light, corners, progress)
    usable = np.isfinite(codes[0]).all(axis=1)
    colours = (kind.linear_srgb(light) @ matrix_between("linear-srgb", SPACE).T)[usable]
    encoded = codes[0][usable]
    nominal = matrix_between(SPACE, "linear-srgb")
    fit = fit_one_exposure(encoded, colours, near_neutral(colours), nominal)

    identity = identity_gamut_map()
    model = CameraModel((opened.white_balance,), fit.matrix, fit.response, identity, identity)
    linear = model.linearize(encoded) / fit.multipliers / fit.scale
    predicted, true = (srgb_encode(np.clip(values @ nominal.T, 0.0, 1.0)) for values in (linear, colours))
    notes = (
        f"approximate, of the {kind.name} under {light}: one exposure does not show the camera's curve",
        f"assumed is {fit.curve}: the greys keep their ratios within {fit.spread:.0%}",
        f"the chart itself comes back to a mean ΔE00 of {delta_e_2000(predicted, true).mean():.1f}; five exposures in "
        "steps of one stop give a transform that is measured",
    )
    profile = CameraProfile(
        camera=opened.camera,
        matrix=nominal,
        white_balances={opened.white_balance: WhiteBalance(tuple(fit.multipliers.tolist()))},
        styles={opened.style: PictureStyle(models=(model,))},
        shots=opened.names,
        provenance=provenance.Chart(kind.name, light, SPACE),
        notes=notes,
    )
    if output is not None:
        profile.save(output)
    return ApproximateTransform(profile, notes)
