"""The physical model on cameras that it was not made on: a seeded family of simulated ones, each with its own sensor,
tone curve, gamut map, lights and chart, photographed with noise, 8-bit JPEGs and exposures off by up to 3 %.

    python -m tests.benchmarks.unseen_cameras [number of cameras] [thesis]

Printed per camera and as median and worst: the largest error of f in the range that the samples span, ‖ΔTs‖/‖Ts‖ and
the largest relative error of Tw with the multipliers unknown, ‖ΔTs‖/‖Ts‖ with them known, and on other surfaces, with
them known, the RMSE of JPEG → RAW and the mean pixel error of RAW → JPEG. The simulated D5100 and SD Merrill come
first, each style with charts of 24 and 140 patches.

What bounds them: f below the darkest grey of the shots and above the brightest is continued by EMoR, which a pure power
bends most; Tw's common factor is told by f⁻¹ of neutral values, so by as much as the channels' curves really differ
(0.4 % of a code there), it is off.
"""

import sys
from dataclasses import astuple, dataclass

import numpy as np
from numpy.typing import NDArray

from lutforge.calibration.options import PhysicalOptions, Preset
from lutforge.calibration.physical.kriging import fit_camera_model
from lutforge.calibration.physical.matrix_and_response import MatrixAndResponse
from lutforge.calibration.physical.physical_model import fit_gamut_maps, fit_stages
from lutforge.calibration.physical.white_balance import complete_multipliers
from lutforge.calibration.style import unclipped
from lutforge.model.response import Response
from lutforge.simulate.camera import nikon_d5100, sigma_sd_merrill
from tests.cases.cameras import UnseenCamera, one_style, photographed, true_multipliers, unseen_camera
from tests.cases.samples import photograph_patches, surfaces

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Errors:
    """What is printed, in that order."""

    f: float
    ts_unknown: float
    tw: float
    ts: float
    raw: float
    render: float


def response_error(camera: UnseenCamera, response: Response, encoded: Array) -> float:
    """Largest error of f in the range of the samples."""
    worst = 0.0
    for c in range(3):
        codes = np.tile(np.linspace(encoded[:, c].min(), encoded[:, c].max(), 500)[:, None], 3)
        linear = camera.styles["standard"].response.inverse(codes)
        worst = max(worst, float(np.abs(response.encode(linear) - codes)[:, c].max()))
    return worst


def measure(camera: UnseenCamera, preset: Preset = "lutforge", seed: int = 0) -> Errors:
    """All errors of one camera."""
    samples = photographed(camera, known=False, seed=seed)
    start, _ = complete_multipliers(samples)
    stages = fit_stages(samples, start, np.zeros(len(samples), dtype=np.bool_), preset)
    ts_unknown = _matrix_error(camera, stages.matrix)
    tw = float(np.abs(stages.multipliers / true_multipliers(camera, samples) - 1).max())
    samples = photographed(camera, known=True, seed=seed)
    stages = fit_stages(samples, samples.wb, np.ones(len(samples), dtype=np.bool_), preset)
    response, balanced = stages.responses["standard"], samples.raw * samples.wb
    lights = tuple(camera.lights)
    if preset == "thesis":
        physical = PhysicalOptions()
        model = fit_gamut_maps(balanced, samples.srgb, samples.shot, stages.matrix, response, lights, physical)
    else:
        model = fit_camera_model(MatrixAndResponse(stages.matrix, response), balanced, samples.srgb, lights)
    others = photograph_patches(camera, surfaces(300, 99), balances=tuple(camera.lights), exposure_error=0.0, seed=5)
    others = others.select(unclipped(others, others.wb))
    back = model.linearize(others.srgb) / others.wb - others.raw
    rendered = model.render(others.raw * others.wb)
    return Errors(
        response_error(camera, response, samples.srgb),
        ts_unknown,
        tw,
        _matrix_error(camera, stages.matrix),
        float(np.sqrt(np.mean(back**2))),
        float(np.linalg.norm(rendered - others.srgb, axis=1).mean()),
    )


def _matrix_error(camera: UnseenCamera, matrix: Array) -> float:
    return float(np.linalg.norm(matrix - camera.matrix) / np.linalg.norm(camera.matrix))


def _line(name: str, values: tuple[float, ...]) -> str:
    f, ts_unknown, tw, ts, raw, rendered = values
    percent = "".join(f"{100 * value:10.2f}" for value in (ts_unknown, tw, ts))
    return f"{name:44s}{f:8.4f}{percent}{raw:10.4f}{rendered:10.4f}"


def main() -> None:
    """Print the table."""
    words = sys.argv[1:]
    preset: Preset = "thesis" if "thesis" in words else "lutforge"
    count = next((int(word) for word in words if word.isdigit()), 12)
    cameras = [
        one_style(base, style, patches)
        for base in (nikon_d5100(), sigma_sd_merrill())
        for style in ("standard", "vivid", "landscape")
        for patches in (24, 140)
    ]
    cameras += [unseen_camera(seed) for seed in range(count)]
    print(f"{'':44s}{'f':>8s}{'Ts %':>10s}{'Tw %':>10s}{'Ts known':>10s}{'RAW':>10s}{'render':>10s}")
    rows = []
    for camera in cameras:
        rows.append(astuple(measure(camera, preset)))
        style = camera.styles["standard"]
        kind = f"{type(style.response).__name__}, {type(style.gamut_map).__name__}, {camera.patches}"
        print(_line(f"{camera.model}: {kind}", rows[-1]), flush=True)
    for name, values in (("median", np.median(rows, axis=0)), ("worst", np.max(rows, axis=0))):
        print(_line(name, tuple(values)))


if __name__ == "__main__":
    main()
