"""Where the largest errors of unseen colours lie: ΔE00 of simulated cameras, and how far from samples the worst are.

    python tests/benchmarks/unseen_colours.py [SAMPLES]

33³ lattices with a curve from 5,000 samples, spread evenly over the encoded colours that a camera can make, predict
10,000 others drawn alike: per sensor and style the medians over three draws of mean, 95th percentile and maximum, how
many are above ΔE00 4, and the maximum of those no farther from the nearest sample than NEAR times the usual distance,
on the square root of linear light. A minute or two.
"""

import sys

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from lutforge.calibration.continuation import continuation
from lutforge.calibration.lattice import fit_samples
from lutforge.calibration.matrix_and_response import fit_matrix_and_response
from lutforge.calibration.options import CalibrationOptions
from lutforge.calibration.output_curve import output_curve
from lutforge.model.colour_difference import delta_e_2000
from lutforge.simulate.camera import SimulatedCamera, nikon_d5100, sigma_sd_merrill

Array = NDArray[np.float64]

SAMPLES, UNSEEN, DRAWS, SIZE, NEAR = 5_000, 10_000, 3, 33, 4.0


def colours(camera: SimulatedCamera, style: str, count: int, seed: int) -> tuple[Array, Array]:
    """White-balanced RAW of colours spread evenly over all that the camera can make, and those, encoded."""
    gain = camera.multipliers("daylight")
    encoded = np.random.default_rng(seed).uniform(0.01, 0.99, (4 * count, 3))
    x = camera.linearize(encoded, style, "daylight") * gain
    x = x[np.all((x > 0) & (x < 1), axis=1)][:count]
    return x, np.asarray(camera.render(x / gain, style, "daylight"))


def figures(camera: SimulatedCamera, style: str, count: int, draw: int) -> tuple[float, ...]:
    """Mean, 95th percentile, maximum, the number above 4, and the maximum near samples."""
    x, y = colours(camera, style, count, 10 * draw + 1)
    unseen, wanted = colours(camera, style, UNSEEN, 10 * draw + 2)
    shots = np.array([f"shot {row % 10}" for row in range(len(x))])
    base = fit_matrix_and_response(x, y)
    guess = continuation(base, x, y, inverse=False, size=SIZE)
    options, curve = CalibrationOptions(size=SIZE), output_curve(base.response)
    lattice = fit_samples(x, y, shots, guess, options, clips=True, curve=curve).lattice
    difference = delta_e_2000(np.clip(lattice(unseen), 0.0, 1.0), wanted)
    distance = cKDTree(np.sqrt(x)).query(np.sqrt(unseen))[0]
    near = distance <= NEAR * np.median(distance)
    return (
        float(difference.mean()),
        float(np.quantile(difference, 0.95)),
        float(difference.max()),
        float(np.sum(difference > 4.0)),
        float(difference[near].max()),
    )


def main(count: int) -> None:
    print(f"| camera | style | mean | 95 % | max | above 4, of {UNSEEN} | max near samples |\n" + "|---" * 7 + "|")
    for camera in (nikon_d5100(), sigma_sd_merrill()):
        for style in camera.styles:
            rows = [figures(camera, style, count, draw) for draw in range(DRAWS)]
            mean, most, largest, above, near = np.median(rows, axis=0)
            print(f"| {camera.name} | {style} | {mean:.2f} | {most:.2f} | {largest:.1f} | {above:.0f} | {near:.1f} |")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else SAMPLES)
