"""Refinement of a registration on one copy of the JPEG, or coarse to fine, by Gauss–Newton steps on structure."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import scipy

from lutforge.arrays import Array, Index, Single
from lutforge.compiled import REASSOCIATED, compiled
from lutforge.shots.geometry import Distortion, Registration, Unknowns
from lutforge.shots.registration.colour_prediction import predicted_luma
from lutforge.shots.registration.local_structure import DEVIATION, local_weight, structure
from lutforge.shots.registration.reduced_copies import RawLevel, ReducedJpeg, on_jpeg_pixels

HOPELESS = 0.3
"""The correlation below which a place after three steps is not near the true one, and is left."""
MOST_ITERATIONS = 8
"""Gauss–Newton steps on one copy; two to four suffice near the place."""
MOST_SHIFT = 12.0
"""Pixels of the copy by which a step may move the picture: beyond two DEVIATIONs it follows other structure."""
CONVERGED = 5e-3
"""Pixels of the copy: a step below this is the last."""
BLOCKS = 32
"""Blocks along the longer side, over which gradients are summed up: a displacement is the same all over one."""
PARTS = 6
"""Parts a side of the picture from whose agreement the covariance of a fit is estimated: their structure is hardly
correlated."""
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


@dataclass(frozen=True, eq=False)
class Planes:
    """The planes that a fit compares: that of the JPEG (h, w), with its weights, and that of the RAW, straightened.

    of_raw: a registration → the RAW's plane (H, W) without the distortion, and the registration on that. pixel_size: a
    side of its pixels in full-resolution ones.
    """

    of_jpeg: Single
    weight: Single
    pixel_size: float
    no_distortion: Distortion
    of_raw: Callable[[Registration], tuple[Single, Registration]]


def luma_planes(raw: RawLevel, jpeg: ReducedJpeg) -> Planes:
    """The luma of a JPEG, and its prediction from RAW for a registration."""

    def of_raw(registration: Registration) -> tuple[Single, Registration]:
        straight, local = raw.straightened(registration, jpeg)
        return predicted_luma(straight, jpeg, local), local

    return Planes(jpeg.luma, jpeg.weight, raw.pixel_size, raw.no_distortion, of_raw)


@dataclass(frozen=True, eq=False)
class _Target:
    """The structure of the JPEG (h, w), onto which that of the RAW is moved.

    weight: (h, w), of the pixels; neighbourhood: `local_weight` of it; gradient_weight: the weight where no pixel
    around is masked, so that a gradient can be computed.
    """

    structure: Single
    weight: Single
    neighbourhood: Single
    gradient_weight: Single

    @classmethod
    def of(cls, planes: Planes) -> "_Target":
        neighbourhood = local_weight(planes.weight)
        gradient_weight = scipy.ndimage.minimum_filter(planes.weight, 3)
        return cls(
            structure(planes.of_jpeg, planes.weight, neighbourhood), planes.weight, neighbourhood, gradient_weight
        )

    @property
    def shape(self) -> tuple[int, int]:
        """The height and width of the picture."""
        return (self.weight.shape[0], self.weight.shape[1])


@dataclass(frozen=True, eq=False)
class _Comparison:
    """The structure of the RAW for a registration, `moving` (h, w), compared with the target.

    gradient_weight: as in `_Target`, where the RAW covers the JPEG; correlation: of the two; gain: the factor by which
    the target is closest to the RAW; noise: the variance of their difference.
    """

    moving: Single
    gradient_weight: Single
    correlation: float
    gain: float
    noise: float


def _compared(target: _Target, plane: Single, pixel_size: float, registration: Registration) -> _Comparison:
    """Compare a plane of the RAW (H, W), straight and with pixels of this size, with the target."""
    # The RAW's structure on the JPEG's pixels, where both have any.
    sampled, cover = on_jpeg_pixels(plane, pixel_size, registration, target.shape)
    is_covered = bool(cover.all())
    mask = target.weight if is_covered else target.weight * cover
    moving = structure(sampled, mask, target.neighbourhood if is_covered else local_weight(mask))
    gradient_weight = target.gradient_weight if is_covered else scipy.ndimage.minimum_filter(mask, 3)

    # How much the two agree, and by what factor the target is closest to it.
    masked = target.structure * mask
    target_energy = float(np.vdot(masked, target.structure))
    product = float(np.vdot(masked, moving))
    moving_energy = float(np.vdot(moving, moving))
    correlation = product / (math.sqrt(moving_energy * target_energy) + 1e-12)
    gain = product / (target_energy + 1e-12)

    # The noise of a pixel counts for all pixels that are correlated with it, over DEVIATION.
    noise = DEVIATION**2 * max(moving_energy - gain * product, 0.0) / (float(mask.sum()) + 1e-12)
    return _Comparison(moving, gradient_weight, correlation, gain, noise)


def _prior_spread(lens: Distortion) -> Array:
    """The standard deviation of all parameters, a prior: lenses distort little, and about the middle.

    Scale and offset are free.
    """
    decentring = USUAL_DECENTRING * lens.radius
    return np.array([np.inf, np.inf, np.inf, USUAL_DISTORTION, USUAL_DISTORTION, decentring, decentring])


def _deviation_from_prior(lens: Distortion, no_distortion: Distortion) -> Array:
    """How far all parameters are from their prior, which is a picture without distortion."""
    return np.array([0.0, 0.0, 0.0, lens.k1, lens.k2, lens.x - no_distortion.x, lens.y - no_distortion.y])


def _moved_to_fit(planes: Planes, start: Registration, unknowns: Unknowns, tested: Unknowns) -> Fit:
    """Move to the registration near `start` for which the structures agree best; in the JPEG's coordinates.

    Gauss–Newton steps minimize the squared difference of the structures (Lucas & Kanade 1981,
    https://www.ijcai.org/Proceedings/81-2/Papers/017.pdf). unknowns: the parameters that are fitted. The values and the
    covariance of the fit are of the `tested` parameters, which include these: k1 and k2 as they would be, were they
    fitted.
    """
    lens = start.distortion or planes.no_distortion
    registration = replace(start, distortion=lens)
    target = _Target.of(planes)
    spread = _prior_spread(lens)[:tested]

    # Displacements by a unit of each parameter, at the blocks of the picture, over which gradients are summed.
    blocks = _Blocks.of(*target.shape)
    shifts = registration.shifts(blocks.centres, tested)

    for index in range(MOST_ITERATIONS):
        # The RAW as a picture without distortion: the same for all steps, unless they change the distortion.
        if index == 0 or unknowns > Unknowns.PLACE:
            plane, straight = planes.of_raw(registration)
            corner = registration.offset_x - straight.offset_x, registration.offset_y - straight.offset_y
        offset_x, offset_y = registration.offset_x - corner[0], registration.offset_y - corner[1]
        local = Registration(registration.scale, offset_x, offset_y, 0.0)
        comparison = _compared(target, plane, planes.pixel_size, local)
        registration = replace(registration, correlation=comparison.correlation)

        # Normal equations of the displacement of each block, and by the chain rule of the parameters, in each part.
        scaled_target = np.float32(comparison.gain) * target.structure
        sums = blocks.products(comparison.moving, scaled_target, comparison.gradient_weight)
        normal, pull = blocks.normal_equations(sums, shifts)

        # The prior weighs by the noise.
        lens = registration.distortion or lens
        prior = comparison.noise / spread**2
        deviation = _deviation_from_prior(lens, planes.no_distortion)[:tested]
        step, covariance = _solved(
            normal[:, :unknowns, :unknowns], pull[:, :unknowns], prior[:unknowns], deviation[:unknowns]
        )

        change = np.abs(shifts[..., :unknowns] @ step).max()
        if not np.isfinite(change) or change > MOST_SHIFT:
            break
        registration = registration.moved(step)
        if change < CONVERGED or (index > 1 and registration.correlation < HOPELESS):
            break

    residual = blocks.residual(sums)
    if unknowns > Unknowns.PLACE:
        return Fit(registration, deviation + step, covariance, residual)
    values, covariance = _solved(normal, pull, prior, deviation)
    return Fit(replace(registration, distortion=start.distortion), values, covariance, residual)


@dataclass(frozen=True, eq=False)
class _Blocks:
    """Blocks of `side` × `side` pixels, (H, W) of them, a rest at the right and bottom left out.

    centres: (H W, 2) x and y of them; part: (H W,) which of the PARTS² parts of the picture each belongs to.
    """

    side: int
    shape: tuple[int, int]
    centres: Array
    part: Index

    @classmethod
    def of(cls, height: int, width: int) -> "_Blocks":
        side = max(8, max(height, width) // BLOCKS)
        down, across = (np.arange(length // side) * side + side / 2 for length in (height, width))
        centres = np.stack(np.meshgrid(across, down), axis=-1).reshape(-1, 2)
        part = (PARTS * centres / (width, height)).astype(np.int64) @ np.array([1, PARTS])
        return cls(side, (len(down), len(across)), centres, part)

    def products(self, moving: Single, target: Single, weight: Single) -> Array:
        """Products (H, W, 5) of gradients: with themselves xx, xy, yy, and with the difference of the two, x, y."""
        sums = np.zeros((*self.shape, 5))
        _add_products(moving, target, weight, self.side, sums)
        return sums

    def normal_equations(self, sums: Array, shifts: Array) -> tuple[Array, Array]:
        """Normal matrices (PARTS², n, n) and right sides (PARTS², n) of n parameters.

        shifts: (H W, 2, n) displacements by a unit of each parameter.
        """
        count = shifts.shape[2]
        gradients = sums[..., [0, 1, 1, 2]].reshape(-1, 2, 2) @ shifts
        normal, pull = np.zeros((PARTS**2, count, count)), np.zeros((PARTS**2, count))
        np.add.at(normal, self.part, shifts.swapaxes(1, 2) @ gradients)
        np.add.at(pull, self.part, (shifts.swapaxes(1, 2) @ sums[..., 3:].reshape(-1, 2, 1))[..., 0])
        return normal, pull

    def residual(self, sums: Array) -> float:
        """Root mean square displacement of the parts, each fitted by itself, weighted by its structure, in pixels."""
        total = np.zeros((PARTS**2, 5))
        np.add.at(total, self.part, sums.reshape(-1, 5))
        strength = total[:, [0, 2]].sum(axis=1) + 1e-12
        # A little of the mean keeps a part without structure where it is.
        matrix = total[:, [0, 1, 1, 2]].reshape(-1, 2, 2) + 0.01 * strength.mean() * np.eye(2)
        square = np.square(np.linalg.solve(matrix, total[:, 3:, None])).sum(axis=(1, 2))
        return math.sqrt(np.average(square, weights=strength))


def _solved(normal: Array, pull: Array, prior: Array, deviation: Array) -> tuple[Array, Array]:
    """A Gauss–Newton step (n,), and its covariance by the parts of the picture (White 1980, a sandwich).

    normal: (parts, n, n) normal matrices; pull: (parts, n) right sides; prior, deviation: (n,) weight of a prior of
    the parameters, and how far they are from it.
    """
    # Parameters have different units: the matrix is scaled to a diagonal of ones before it is inverted.
    total = normal.sum(axis=0) + np.diag(prior)
    unit = 1 / np.sqrt(np.diag(total) + 1e-30)
    inverse = unit[:, None] * np.linalg.pinv(total * np.outer(unit, unit)) * unit
    step = inverse @ (pull.sum(axis=0) - prior * deviation)
    scores = pull - normal @ step
    return step, inverse @ (scores.T @ scores) @ inverse * len(pull) / (len(pull) - len(step))


@compiled(fastmath=REASSOCIATED)
def _add_products(moving: Single, target: Single, weight: Single, side: int, sums: Array) -> None:
    """Fill the products (H, W, 5) of the gradient with itself, xx, xy, yy, and with what is to change, x, y, by blocks.

    The gradient is of the mean of both pictures (h, w): an unbiased, faster converging step (Benhimane & Malis 2004,
    https://doi.org/10.1109/IROS.2004.1389474).
    """
    down, across = sums.shape[:2]
    width = across * side
    terms, quarter = np.zeros((3, width), np.float32), np.float32(0.25)
    for row in range(1, min(down * side, moving.shape[0] - 1)):
        above, here, below = moving[row - 1], moving[row], moving[row + 1]
        target_above, target_here, target_below = target[row - 1], target[row], target[row + 1]
        for x in range(1, min(width, moving.shape[1] - 1)):
            share = quarter * weight[row, x]
            terms[0, x] = share * (here[x + 1] - here[x - 1] + target_here[x + 1] - target_here[x - 1])
            terms[1, x] = share * (below[x] - above[x] + target_below[x] - target_above[x])
            terms[2, x] = weight[row, x] * (target_here[x] - here[x])

        for block in range(across):
            xx = xy = yy = by_x = by_y = np.float32(0)
            for x in range(block * side, (block + 1) * side):
                xx += terms[0, x] * terms[0, x]
                xy += terms[0, x] * terms[1, x]
                yy += terms[1, x] * terms[1, x]
                by_x += terms[0, x] * terms[2, x]
                by_y += terms[1, x] * terms[2, x]
            to = sums[row // side, block]
            to[0] += xx
            to[1] += xy
            to[2] += yy
            to[3] += by_x
            to[4] += by_y
