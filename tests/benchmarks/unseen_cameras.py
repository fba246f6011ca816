"""The physical model on cameras that it was not made on, photographed with noise, JPEGs and exposures off by up to 3 %.

    python -m tests.benchmarks.unseen_cameras [number of cameras]

Printed per camera and as median and worst: the largest error of f in the range that the samples span, ‖ΔTs‖/‖Ts‖ and
the largest relative error of Tw with the multipliers unknown, ‖ΔTs‖/‖Ts‖ with them known, and on other surfaces, with
them known, the RMSE of JPEG → RAW and the mean pixel error of RAW → JPEG. The simulated D5100 and SD Merrill come
first, each style with charts of 24 and 140 patches.

What bounds them: f below the darkest grey of the shots and above the brightest is continued by EMoR, which a pure power
bends most; Tw's common factor is told by f⁻¹ of neutral values, so by as much as the channels' curves really differ
(0.4 % of a code there), it is off.
"""

import sys

import numpy as np

from lutforge.calibration.physical.kriging import fit_camera_model
from lutforge.calibration.physical.matrix_and_response import MatrixAndResponse
from lutforge.calibration.physical.physical_model import fit_stages
from lutforge.calibration.physical.white_balance import complete_multipliers
from lutforge.calibration.style import unclipped
from lutforge.simulate.camera import nikon_d5100, sigma_sd_merrill
from tests.benchmarks.common import heading, row
from tests.cases.cameras import UnseenCamera, one_style, photographed, true_multipliers, unseen_camera
from tests.cases.samples import photograph_patches, surfaces


def measure(camera: UnseenCamera) -> list[float]:
    """All errors of one camera, in the order in which they are printed."""
    samples = photographed(camera, known=False, seed=0)
    start, _ = complete_multipliers(samples)
    stages = fit_stages(samples, start, np.zeros(len(samples), dtype=np.bool_), "lutforge")
    unknown = [
        float(np.linalg.norm(stages.matrix - camera.matrix) / np.linalg.norm(camera.matrix)),
        float(np.abs(stages.multipliers / true_multipliers(camera, samples) - 1).max()),
    ]
    samples = photographed(camera, known=True, seed=0)
    stages = fit_stages(samples, samples.wb, np.ones(len(samples), dtype=np.bool_), "lutforge")
    response, balanced = stages.responses["standard"], samples.raw * samples.wb
    codes = np.linspace(samples.srgb.min(axis=0), samples.srgb.max(axis=0), 500)
    linear = camera.styles["standard"][1].inverse(codes)
    lights = tuple(camera.lights)
    model = fit_camera_model(MatrixAndResponse(stages.matrix, response), balanced, samples.srgb, lights)
    others = photograph_patches(camera, surfaces(300, 99), balances=lights, exposure_error=0.0, seed=5)
    others = others.select(unclipped(others, others.wb))
    return [
        float(np.abs(response.encode(linear) - codes).max()),
        *(100 * error for error in unknown),
        100 * float(np.linalg.norm(stages.matrix - camera.matrix) / np.linalg.norm(camera.matrix)),
        float(np.sqrt(np.mean((model.linearize(others.srgb) / others.wb - others.raw) ** 2))),
        float(np.linalg.norm(model.render(others.raw * others.wb) - others.srgb, axis=1).mean()),
    ]


def main() -> None:
    """Print the table."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 12
    cameras = [
        one_style(base, style, patches)
        for base in (nikon_d5100(), sigma_sd_merrill())
        for style in ("standard", "vivid", "landscape")
        for patches in (24, 140)
    ]
    cameras += [unseen_camera(seed) for seed in range(count)]
    heading("camera", "f", "Ts, %", "Tw, %", "Ts known, %", "RAW", "render")
    rows = []
    for camera in cameras:
        rows.append(measure(camera))
        gamut_map, response = camera.styles["standard"]
        kind = f"{type(response).__name__}, {type(gamut_map).__name__}, {camera.patches}"
        row(f"{camera.model}: {kind}", *rows[-1])
    row("median", *np.median(rows, axis=0))
    row("worst", *np.max(rows, axis=0))


if __name__ == "__main__":
    main()
