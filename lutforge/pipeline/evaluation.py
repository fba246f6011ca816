"""Use case: a profile and samples → its errors, and its prediction of each sample."""

from __future__ import annotations  # so that help() shows the names of types

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lutforge.arrays import Array
from lutforge.calibration.deviations import COLUMNS
from lutforge.calibration.vignetting import at_the_centre
from lutforge.calibration.white_balance import fill_in_known_multipliers
from lutforge.evaluation.evaluation import Evaluation, known_styles, scene_deviations
from lutforge.evaluation.evaluation import evaluate as evaluate_profile
from lutforge.model.camera_profile import CameraProfile, as_profile
from lutforge.model.provenance import ReferenceRaw
from lutforge.model.vignetting import vignetting_of
from lutforge.pipeline.outputs import Paths
from lutforge.pipeline.provenance import require_same_provenance
from lutforge.pipeline.sampling import as_samples, gather_samples
from lutforge.progress import Progress, silent, with_compilation
from lutforge.reports.tables import Table
from lutforge.samples.sample_set import SampleSet, with_setting_names
from lutforge.settings import Multipliers, Selector


def evaluate(
    profile: CameraProfile | str | Path,
    samples: SampleSet | Paths,
    progress: Progress = silent,
    *,
    tables: bool = False,
    sizes: Sequence[int] = (13, 17, 24),
) -> Evaluation:
    """Measure the errors of a profile on samples, and compare them with plain baselines.

    A shot that the profile was calibrated from is held out: it is predicted by a refit without it. Any other shot is
    predicted by the profile itself.

    Args:
        profile: a profile, or the path of its file.
        samples: a SampleSet, or what `sample` takes.
        progress: called with the name of the present step, and the share that is done.
        tables: measure every method of the thesis's error tables, with times.
        sizes: nodes per axis of the lattices of these tables.

    Returns:
        The errors as records; `evaluation.as_json()` is one document of them.

    Raises:
        CalibrationError: the samples hold none of the profile's styles, or are of RAW where it is not.
        ProfileError, SampleError, ShotError: a file cannot be read.
    """
    camera = as_profile(profile)
    samples = as_samples(samples)
    require_same_provenance(camera, samples)
    with with_compilation(progress) as reporting:
        return evaluate_profile(camera, with_setting_names(samples), reporting, tables=tables, sizes=sizes)


def inspect_scene(
    profile: CameraProfile | str | Path, shots: Paths, progress: Progress = silent
) -> tuple[Table, tuple[str, ...]]:
    """Compare three shots or more with a profile's rendering: vignetting, tone, saturation, white balance.

    shots: RAW files, folders, or sample tables. Only significant deviations are reported. Returned are a table with a
    row for each shot, and a line for each shot that was left out.
    """
    camera = as_profile(profile)
    gathered = gather_samples(shots, progress)
    samples = with_setting_names(gathered.samples)
    samples = samples.select(known_styles(camera, samples)[0])
    deviations = {deviation.shot: deviation.cells for deviation in scene_deviations(camera, samples)}
    rows = []
    for name, shot in samples.by_shot():
        vignetting = vignetting_of(
            camera.vignettings, str(shot.lens[0]), float(shot.focal_mm[0]), float(shot.aperture[0])
        )
        corners = "–" if vignetting is None else f"{vignetting.corner_ev:+.2f} EV"
        rows.append((name, corners, *deviations.get(name, ("–",) * len(COLUMNS))))
    header = ("shot", "corners", *COLUMNS)
    return Table(f"Beyond the rendering of {profile}", header, rows), gathered.left_out


@dataclass(frozen=True, eq=False)
class Predicted:
    """The predictions of a profile for samples, all (n, 3); NaN where it lacks their style or white balance.

    scene: Ts Tw E, linear sRGB, from RAW; linearized: the same, predicted from the JPEG value. rendered: the JPEG value
    predicted from RAW. transformed: h(Ts Tw E), which is the rendered value through the inverse of the response;
    decoded: the measured JPEG value through the same inverse. A lattice has its grey axis in place of the response.
    """

    scene: Array
    linearized: Array
    rendered: Array
    transformed: Array
    decoded: Array


def predict(profile: CameraProfile, samples: SampleSet) -> Predicted:
    """Render the RAW values of samples and linearize their JPEG values by a profile, each under its own settings."""
    samples = at_the_centre(with_setting_names(samples), profile.vignettings)
    scene, linearized, rendered, transformed, decoded = (np.full_like(samples.raw, np.nan) for _ in range(5))
    multipliers = fill_in_known_multipliers(samples, profile.white_balances).wb
    uses_reference = isinstance(profile.provenance, ReferenceRaw)

    # Samples with the same settings are predicted together.
    columns = [samples.style, samples.white_balance, *np.char.mod("%.9g", multipliers.T)]
    _, first, group = np.unique(np.stack(columns), axis=1, return_index=True, return_inverse=True)
    for index, row in enumerate(first):
        style = str(samples.style[row])
        name = str(samples.white_balance[row])
        of_group = multipliers[row]
        balance = profile.white_balances.get(name)
        if style not in profile.styles:
            continue
        if balance is not None and (uses_reference or np.allclose(balance.multipliers, of_group, rtol=1e-6)):
            # The setting of the profile has its gain, and its own camera model where there are several.
            selector = Selector(style, name)
            gain = 1.0
        elif uses_reference or not np.all(np.isfinite(of_group)):
            continue
        else:
            r, g, b = of_group.tolist()
            selector = Selector(style, Multipliers((r / g, 1.0, b / g)))
            gain = 1.0 if balance is None else balance.gain

        rows = group.ravel() == index
        raw = gain * samples.raw[rows]
        encoded = samples.srgb[rows]
        scene[rows] = raw @ profile.raw_to_linear_srgb(selector).T
        linearized[rows] = profile.linearize(selector, "linear-srgb")(encoded)
        rendered[rows] = np.where(np.isfinite(raw), profile.render(selector)(np.nan_to_num(raw)), np.nan)
        even = np.linspace(0.0, 1.0, 1025)
        tones = np.maximum.accumulate(profile.styles[selector.style].tones(even), axis=0)
        for channel in range(3):
            transformed[rows, channel] = np.interp(rendered[rows, channel], tones[:, channel], even)
            decoded[rows, channel] = np.interp(encoded[:, channel], tones[:, channel], even)
    return Predicted(scene, linearized, rendered, transformed, decoded)
