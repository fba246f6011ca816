"""How near one camera's photographs come to another's look, by the form of the RAW transfer between them.

    python -m tests.benchmarks.raw_transfer_table

Two simulated cameras with measured sensitivities, fitted to the patches of a colour chart and 99 surfaces with a little
noise, tried on 600 other surfaces: RMSE of the other camera's rendering (standard style), by light. The floor of one
matrix is the matrix that is fitted to the rendered values of the 600 themselves. A few seconds.
"""

import numpy as np
from scipy.optimize import least_squares

from lutforge.calibration.physical.raw_to_raw import fit_raw_transfer
from lutforge.colour.spectra import chart_reflectances, surface_reflectances
from lutforge.simulate.camera import SimulatedCamera, nikon_d5100, sigma_sd_merrill
from lutforge.simulate.scene import palette
from tests.benchmarks.common import Array, heading, row

FORMS = ("matrix", "root polynomial")
NOISE = 0.002


def rendered(camera: SimulatedCamera, raw: Array, truth: Array, light: str) -> Array:
    """Differences of the colours that are not clipped."""
    got, wanted = (camera.render(values, "standard", light) for values in (raw, truth))
    return np.asarray((got - wanted)[np.all((wanted > 0.004) & (wanted < 0.996), axis=1)])


def rmse(difference: Array) -> float:
    return float(np.sqrt(np.mean(difference**2)))


def errors(source: SimulatedCamera, target: SimulatedCamera, light: str) -> list[float]:
    """Of the forms, then the floor of one matrix."""
    rng = np.random.default_rng(0)
    surfaces, unseen = np.vstack([chart_reflectances(), surface_reflectances()]), palette(600, np.random.default_rng(9))
    x, y = (camera.expose(surfaces, light) + rng.normal(0, NOISE, (len(surfaces), 3)) for camera in (source, target))
    raw, truth = (camera.expose(unseen, light) for camera in (source, target))
    neutral = 1 / source.multipliers(light)
    fit, _ = fit_raw_transfer(source.name, target.name, x, y, neutral)

    def residual(entries: Array) -> Array:
        return rendered(target, raw @ entries.reshape(3, 3).T, truth, light).ravel()

    best = least_squares(residual, fit.matrix.ravel(), x_scale=0.1).fun
    forms = (raw @ fit.matrix.T, fit(raw))
    return [*(rmse(rendered(target, values, truth, light)) for values in forms), rmse(best)]


def main() -> None:
    cameras = (nikon_d5100(), sigma_sd_merrill())
    for source, target in (cameras, cameras[::-1]):
        heading(f"{source.name} to {target.name}", *FORMS, "best one matrix")
        for light in source.white_balances:
            row(light, *errors(source, target, light))


if __name__ == "__main__":
    main()
