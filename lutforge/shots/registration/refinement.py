"""Refinement of a registration on one copy of the JPEG, or coarse to fine, by Gauss–Newton steps on structure."""

from dataclasses import dataclass, replace

import numpy as np

from lutforge.arrays import Array, Single
from lutforge.shots.geometry import Distortion, Registration, Unknowns
from lutforge.shots.registration.normal_equations import Blocks
from lutforge.shots.registration.reduced_copies import RawLevel, ReducedJpeg
from lutforge.shots.registration.structure_comparison import Planes, StraightRaw, Target, compared, luma_planes

HOPELESS = 0.3
"""The correlation below which a place after three steps is not near the true one, and is left."""
MOST_ITERATIONS = 8
"""Gauss–Newton steps on one copy; two to four suffice near the place."""
MOST_SHIFT = 12.0
"""Pixels of the copy by which a step may move the picture: beyond two DEVIATIONs it follows other structure."""
CONVERGED = 5e-3
"""Pixels of the copy: a step below this is the last."""
USUAL_DISTORTION = 0.3
"""Standard deviation of k1 and of k2 over lenses, a prior."""
USUAL_DECENTRING = 0.02
"""Standard deviation of the centre's offset, of half the diagonal, a prior."""


@dataclass(frozen=True, eq=False)
class Fit:
    """A registration after an iteration of its fit.

    values: how far its parameters from k1 on are from those of a straight picture, or would be, were they fitted;
    covariance: of the parameters, estimated from how much the parts of the picture disagree; residual: pixels
    by which these still deviate from their place, the mean weighted by structure.
    """

    registration: Registration
    values: Array
    covariance: Array
    residual: float

    def evidence(self, unknowns: Unknowns) -> float:
        """Wald's statistic of the last two of the unknowns; of chance alone it is 2 on average.

        Its covariance is that of the parts of the picture (White 1980, https://doi.org/10.2307/1912934).
        """
        two = slice(unknowns - 2, unknowns)
        return float(self.values[two] @ np.linalg.solve(self.covariance[two, two], self.values[two]))


def refined(finest_raw: RawLevel, jpeg: ReducedJpeg, start: Registration, unknowns: Unknowns = Unknowns.PLACE) -> Fit:
    """Refine a registration on ever finer copies of the JPEG."""
    fit = fit_on(jpeg.coarsest, finest_raw, start, unknowns)
    for times in range(jpeg.halvings - 1, -1, -1):
        fit = fit_on(jpeg.halved(times), finest_raw, fit.registration, unknowns)
    return fit


def fit_on(copy: ReducedJpeg, finest_raw: RawLevel, start: Registration, unknowns: Unknowns = Unknowns.PLACE) -> Fit:
    """Move a registration to where lumas fit best on one copy of the JPEG.

    The registrations are in coordinates of the whole JPEG. k1 and k2 are estimated even where they are not among the
    unknowns.
    """
    scaled = start.reduced(copy.factor)
    planes = luma_planes(finest_raw.for_scale(scaled.scale), copy)
    fit = _moved_to_fit(planes, scaled, unknowns, max(unknowns, Unknowns.DISTORTION))
    return replace(fit, registration=fit.registration.reduced(1 / copy.factor))


def fit_channel(raw: RawLevel, jpeg: ReducedJpeg, start: Registration, channel: tuple[Single, Single]) -> Fit:
    """Move scale and offset to where a plane of a straight RAW (h, w) fits one of the JPEG (H, W) best.

    The registrations are in the coordinates of the JPEG. channel: the two planes.
    """
    of_raw, of_jpeg = channel
    planes = Planes(
        of_jpeg,
        jpeg.weight,
        raw.pixel_size,
        raw.no_distortion,
        lambda registration: (of_raw, replace(registration, distortion=None)),
    )
    return _moved_to_fit(planes, start, Unknowns.PLACE, Unknowns.PLACE)


def _prior(registration: Registration, no_distortion: Distortion, noise: float) -> tuple[Array, Array]:
    """The weight of a prior of all parameters (7,), by the noise of a pixel, and how far they are from it (7,).

    The prior is a picture without distortion: lenses distort little, and about the middle. Scale and offset are free.
    """
    lens = registration.distortion or no_distortion
    decentring = USUAL_DECENTRING * lens.radius
    spread = np.array([np.inf, np.inf, np.inf, USUAL_DISTORTION, USUAL_DISTORTION, decentring, decentring])
    deviation = np.array([0.0, 0.0, 0.0, lens.k1, lens.k2, lens.x - no_distortion.x, lens.y - no_distortion.y])
    return noise / spread**2, deviation


def _moved_to_fit(planes: Planes, start: Registration, unknowns: Unknowns, tested: Unknowns) -> Fit:
    """Move to the registration near `start` for which the structures agree best; in the JPEG's coordinates.

    Gauss–Newton steps minimize the squared difference of the structures (Lucas & Kanade 1981,
    https://www.ijcai.org/Proceedings/81-2/Papers/017.pdf). unknowns: the parameters that are fitted. The values and the
    covariance of the fit are of the `tested` parameters, which include these: k1 and k2 as they would be, were they
    fitted.
    """
    # The JPEG's structure, and displacements by a unit of each parameter at the blocks of the picture.
    registration = replace(start, distortion=start.distortion or planes.no_distortion)
    target = Target.of(planes)
    blocks = Blocks.of(*target.shape)
    shifts = registration.shifts(blocks.centres, tested)
    raw = StraightRaw.of(planes, registration)

    for index in range(MOST_ITERATIONS):
        if index > 0 and unknowns > Unknowns.PLACE:  # the last step has changed the distortion
            raw = StraightRaw.of(planes, registration)
        comparison = compared(target, raw, registration)
        registration = replace(registration, correlation=comparison.correlation)

        # Products of gradients, and the step that they and the prior ask for.
        scaled_target = np.float32(comparison.gain) * target.structure
        sums = blocks.products(comparison.moving, scaled_target, comparison.gradient_weight)
        prior, deviation = _prior(registration, planes.no_distortion, comparison.noise)
        equations = blocks.equations(sums, shifts, prior[:tested], deviation[:tested])
        step, covariance = equations.first(unknowns).solved()

        # A step that is too large is not made; a small one is the last.
        change = np.abs(shifts[..., :unknowns] @ step).max()
        if not np.isfinite(change) or change > MOST_SHIFT:
            break
        registration = registration.moved(step)
        if change < CONVERGED or (index > 1 and registration.correlation < HOPELESS):
            break

    residual = blocks.residual(sums)
    if unknowns > Unknowns.PLACE:
        return Fit(registration, equations.deviation + step, covariance, residual)
    values, covariance = equations.solved()
    return Fit(replace(registration, distortion=start.distortion), values, covariance, residual)
