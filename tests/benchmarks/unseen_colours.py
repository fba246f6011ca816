"""Where the largest errors of unseen colours lie: ΔE00 of simulated cameras, beside those of a guess that is true.

    python -m tests.benchmarks.unseen_colours [SAMPLES]

33³ lattices with a curve from 5,000 samples in 8 bits predict 10,000 other colours drawn alike, spread evenly over the
encoded colours that a camera can make, or over its RAW, of which hardly any are dark. Per sensor, style and spread, the
median and the worst of DRAWS draws of mean, 95th percentile and maximum; then the medians of the same lattice fitted
around the camera's own rendering in place of the guess, which no method that has the same samples can be below by much;
then, of the worst draw, the largest error of the grey axis, in codes, and how far its channels part. A few minutes.
"""

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lutforge.calibration.lattice.continuation import Continuation, continuation
from lutforge.calibration.lattice.lattice_fit import fit_samples
from lutforge.calibration.lattice.output_curve import output_curve
from lutforge.calibration.options import CalibrationOptions
from lutforge.calibration.physical.matrix_and_response import fit_matrix_and_response
from lutforge.colour.colour_difference import delta_e_2000
from lutforge.model.lattice import Lattice
from lutforge.simulate.camera import SimulatedCamera, nikon_d5100, sigma_sd_merrill

Array = NDArray[np.float64]

SAMPLES, UNSEEN, DRAWS, SIZE = 5_000, 10_000, 5, 33
HALF_CODE = 0.5 / 255.0
GREYS = np.geomspace(0.003, 0.9, 60)[:, None].repeat(3, axis=1)


@dataclass(frozen=True)
class Rendering:
    """One style under daylight, of white-balanced RAW (n, 3)."""

    camera: SimulatedCamera
    style: str

    def __call__(self, x: Array) -> Array:
        return np.asarray(self.camera.render(x / self.camera.multipliers("daylight"), self.style, "daylight"))

    def colours(self, spread: str, count: int, seed: int) -> tuple[Array, Array]:
        """White-balanced RAW of colours that the camera does not clip, and those encoded, (count, 3)."""
        drawn = np.random.default_rng(seed).random((8 * count, 3))
        if spread == "encoded":
            drawn = 0.01 + 0.98 * drawn
            drawn = self.camera.linearize(drawn, self.style, "daylight") * self.camera.multipliers("daylight")
        x = drawn[np.all((drawn > 0) & (drawn < 1), axis=1)]
        y = self(x)
        inside = np.all((y > HALF_CODE) & (y < 1 - HALF_CODE), axis=1)
        return x[inside][:count], y[inside][:count]


@dataclass(frozen=True, eq=False)
class Known(Continuation):
    """A guess that is the camera's own rendering; where that clips, it runs on as the guess does."""

    rendering: Callable[[Array], Array] = np.asarray

    def values(self, x: Array) -> Array:
        assert self.curve is not None
        own, y = super().values(x), self.rendering(x)
        known = self.curve.enter(y)
        above = np.where(y >= 1 - HALF_CODE, np.maximum(own, known), known)
        return np.where(y <= HALF_CODE, np.minimum(own, known), above)

    def leave_out(self, x: Array, y: Array, held: Sequence[NDArray[np.bool_]]) -> list[Continuation]:
        return [self] * len(held)


def errors(lattice: Lattice, x: Array, y: Array) -> tuple[float, float, float]:
    """Mean, 95th percentile and maximum of ΔE00."""
    difference = delta_e_2000(np.clip(lattice(x), 0.0, 1.0), y)
    return float(difference.mean()), float(np.quantile(difference, 0.95)), float(difference.max())


def figures(rendering: Rendering, spread: str, count: int, draw: int) -> tuple[float, ...]:
    """The errors of the fit, those of one with the true guess, and the grey axis's error and tint in codes."""
    x, y = rendering.colours(spread, count, 10 * draw + 1)
    unseen, wanted = rendering.colours(spread, UNSEEN, 10 * draw + 2)
    y = np.rint(255.0 * y) / 255.0
    shots = np.array([f"shot {row % 10}" for row in range(len(x))])
    base = fit_matrix_and_response(x, y)
    options, curve = CalibrationOptions(size=SIZE), output_curve(base.response)
    guess = continuation(base, x, y, inverse=False, size=SIZE)
    known = Known(guess.base, curve, guess.bend, guess.half, rendering=rendering)
    fit, floor = (fit_samples(x, y, shots, each, options, clips=True, curve=curve).lattice for each in (guess, known))
    off = 255.0 * (np.clip(fit(GREYS), 0.0, 1.0) - rendering(GREYS))
    return *errors(fit, unseen, wanted), *errors(floor, unseen, wanted), np.abs(off).max(), np.ptp(off, axis=1).max()


def main(count: int) -> None:
    titles = ["camera", "style", "spread over", "mean", "95 %", "max", "worst draw: mean", "95 %", "max"]
    titles += ["true guess: mean", "95 %", "max", "greys off by", "tinted by"]
    print("| " + " | ".join(titles) + " |\n" + "|---" * len(titles) + "|")
    for camera in (nikon_d5100(), sigma_sd_merrill()):
        for style in camera.styles:
            for spread in ("encoded", "RAW"):
                rows = [figures(Rendering(camera, style), spread, count, draw) for draw in range(DRAWS)]
                middle, worst = np.median(rows, axis=0), np.max(rows, axis=0)
                cells = [*middle[:3], *worst[:3], *middle[3:6], *worst[6:]]
                print(f"| {camera.name} | {style} | {spread} | " + " | ".join(f"{cell:.2f}" for cell in cells) + " |")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else SAMPLES)
