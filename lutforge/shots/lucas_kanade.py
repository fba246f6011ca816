"""Refinement of a registration below a tenth of a pixel: Gauss–Newton steps on scale, offset and distortion.

They minimize the squared difference of the two pictures' local structure (Lucas & Kanade 1981,
https://www.ijcai.org/Proceedings/81-2/Papers/017.pdf).
"""

from dataclasses import dataclass, replace

import numpy as np
import scipy

from lutforge.arrays import Array, Single
from lutforge.compiled import REASSOCIATED, compiled
from lutforge.shots.area_means import on_jpeg_pixels
from lutforge.shots.geometry import Registration
from lutforge.shots.local_structure import DEVIATION, blurred, share, structure
from lutforge.shots.predicted_colours import ENOUGH, least_squares, predicted_luma, quadratic_terms
from lutforge.shots.pyramid import RawLevel, ReducedJpeg

HOPELESS = 0.3
"""A place that correlates less after three steps is none to be near of: where the JPEG lies, two steps suffice."""

BLOCKS = 32
"""Blocks along the longer side, over which gradients are summed up: a displacement is the same all over one."""

PARTS = 6
"""Parts a side of the picture whose pulls tell how sure a fit is: structure of one part is hardly that of another."""


@dataclass(frozen=True, eq=False)
class Fit:
    """A registration after an iteration of its fit.

    place: the new registration; step: the last change of its parameters; covariance: of the parameters, estimated from
    how much the parts of the picture disagree.
    """

    place: Registration
    step: Array
    covariance: Array

    def evidence(self, values: Array, first: int) -> float:
        """How much two values, of the parameters from `first` on, are beyond chance: of chance alone, 2 on average.

        Wald's statistic, of a covariance that the parts of the picture tell (White 1980,
        https://doi.org/10.2307/1912934).
        """
        return float(values @ np.linalg.solve(self.covariance[first : first + 2, first : first + 2], values))


def moved_to_fit(raw: RawLevel, jpeg: ReducedJpeg, start: Registration, count: int = 3) -> Fit:
    """Move to the place near `start` where the structures of RAW and JPEG agree best; in the JPEG's coordinates.

    start: with a distortion; count: how many parameters of `Registration.moved` are fitted: 3, 5 or 7. The step and the
    covariance that are returned are of five or seven: of k1 and k2 as they would be, were they fitted.
    """
    weight, place = jpeg.weight, start
    middle = raw.pixel_size * np.array(raw.pixels.shape[1::-1]) / 2
    whole, within = share(weight), _eroded(weight)
    target = structure(jpeg.luma, weight, whole)
    block = max(8, max(weight.shape) // BLOCKS)
    down, across = (np.arange(side // block) * block + block / 2 for side in weight.shape)
    centres = np.stack(np.meshgrid(across, down), axis=-1).reshape(-1, 2)
    part = (PARTS * centres / weight.shape[::-1]).astype(int) @ (1, PARTS)
    parts = (np.arange(PARTS**2)[:, None] == part).astype(np.float64)
    lens = place.distortion
    assert lens is not None
    size = max(count, 5)
    spread = np.array([0.3, 0.3, 0.02 * lens.radius, 0.02 * lens.radius])[: size - 3]
    for index in range(8):
        if index == 0 or count > 3:
            pixels, local = place.straightened(raw.pixels, raw.pixel_size, weight.shape)
            luma = predicted_luma(replace(raw, pixels=pixels), jpeg, local)
            corner = place.offset_x - local.offset_x, place.offset_y - local.offset_y
        local = Registration(place.scale, place.offset_x - corner[0], place.offset_y - corner[1], 0.0)
        plane, cover = on_jpeg_pixels(luma, raw.pixel_size, local, (weight.shape[0], weight.shape[1]))
        inside = bool(cover.all())
        mask = weight if inside else weight * cover
        moving = structure(plane, mask, whole if inside else share(mask))
        own = float(np.vdot(target * mask, target))
        product = float(np.vdot(moving * mask, target))
        norm = float(np.sqrt(float(np.vdot(moving * mask, moving)) * own)) + 1e-12
        place = replace(place, correlation=product / norm)
        sums = np.zeros((len(down), len(across), 5))
        wanted = np.float32(product / (own + 1e-12)) * target
        _add_products(moving, wanted, within if inside else _eroded(mask), block, sums)
        shifts = place.shifts(centres, size)
        gradients = sums[..., [0, 1, 1, 2]].reshape(-1, 2, 2) @ shifts
        normal = (parts @ (shifts.swapaxes(1, 2) @ gradients).reshape(-1, size * size)).reshape(-1, size, size)
        pull = parts @ (shifts.swapaxes(1, 2) @ sums[..., 3:].reshape(-1, 2, 1))[..., 0]
        variance = DEVIATION**2 * float(np.square((moving - wanted) * mask).sum()) / (float(mask.sum()) + 1e-12)
        prior = np.concatenate([np.zeros(3), variance / spread**2])
        lens = place.distortion or lens
        away = np.array([0.0, 0.0, 0.0, lens.k1, lens.k2, lens.x - middle[0], lens.y - middle[1]])[:size]
        step, covariance = _solved(normal[:, :count, :count], pull[:, :count], prior[:count], (prior * away)[:count])
        change = np.abs(shifts[..., :count] @ step).max()
        if not np.isfinite(change) or change > 12:
            break
        place = place.moved(step)
        if change < 2e-3 or (index > 1 and place.correlation < HOPELESS):
            break
    return Fit(place, *(_solved(normal, pull, prior, prior * away) if count < size else (step, covariance)))


def fringes(raw: RawLevel, jpeg: ReducedJpeg, place: Registration) -> Fit:
    """A step of the shares by which red and blue are drawn larger than green where the JPEG shows them of one size.

    The JPEG's codes are compared with what the RAW's channels make of them: what moves with one channel is its own.
    """
    lens, shape = place.distortion, jpeg.weight.shape
    assert lens is not None
    pixels, local = place.straightened(raw.pixels, raw.pixel_size, shape)
    roots = np.sqrt(np.maximum(pixels, 0) * raw.gains)
    under = [
        on_jpeg_pixels(np.ascontiguousarray(root), raw.pixel_size, local, shape) for root in np.moveaxis(roots, -1, 0)
    ]
    planes, mask = np.stack([plane for plane, _ in under]), jpeg.weight * under[0][1]
    codes = np.ascontiguousarray(np.moveaxis(jpeg.codes, -1, 0))
    some = np.flatnonzero(mask.ravel() > 0.5)
    some = some[:: max(1, len(some) // ENOUGH)]

    def terms(channels: Single) -> Single:
        return np.stack(list(quadratic_terms(*channels.reshape(3, -1))))

    known = terms(planes)
    weights = least_squares(known[:, some].T.astype(np.float64), codes.reshape(3, -1)[:, some].T.astype(np.float64))
    weights = weights.T.astype(np.float32)
    predicted = (weights @ known).reshape(codes.shape)
    y, x = (np.arange(side, dtype=np.float32) + 0.5 for side in shape)
    x, y = x - (lens.x - place.offset_x) / place.scale, y[:, None] - (lens.y - place.offset_y) / place.scale
    (down, across), (falling, rising) = (np.gradient(planes, axis=(1, 2)) for planes in (planes, predicted))
    small, larger = np.float32(1e-3), across * x + down * y
    moves = []
    for channel in (0, 2):
        moved = planes.copy()
        moved[channel] += small * larger[channel]
        moves.append((weights @ terms(moved)).reshape(codes.shape) / small - predicted / small)
    residual, near = codes - predicted, share(mask)
    residual -= np.stack([blurred(plane * mask) / near for plane in residual])
    columns = np.stack([*moves, rising * x + falling * y, rising, falling, residual]) * mask
    tall, wide = (side // PARTS for side in shape)
    blocks = columns[..., : PARTS * tall, : PARTS * wide].reshape(6, 3, PARTS, tall, PARTS, wide)
    each = blocks.transpose(2, 4, 0, 1, 3, 5).reshape(PARTS**2, 6, -1)
    products = (each @ each.swapaxes(1, 2)).astype(np.float64)
    return Fit(place, *_solved(products[:, :5, :5], products[:, :5, 5], np.zeros(5), np.zeros(5)))


def _solved(normal: Array, pull: Array, prior: Array, drawn: Array) -> tuple[Array, Array]:
    """A Gauss–Newton step (n,), and its covariance by the parts of the picture (White 1980, a sandwich).

    normal: (parts, n, n) normal matrices; pull: (parts, n) right sides; prior, drawn: (n,) weight of a prior of the
    parameters, and that times how far they are from it.
    """
    total = normal.sum(axis=0) + np.diag(prior)
    unit = 1 / np.sqrt(np.diag(total) + 1e-30)
    inverse = unit[:, None] * np.linalg.pinv(total * np.outer(unit, unit)) * unit
    step = inverse @ (pull.sum(axis=0) - drawn)
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
        over, wanted, under = target[row - 1], target[row], target[row + 1]
        for x in range(1, min(width, moving.shape[1] - 1)):
            share = quarter * weight[row, x]
            terms[0, x] = share * (here[x + 1] - here[x - 1] + wanted[x + 1] - wanted[x - 1])
            terms[1, x] = share * (below[x] - above[x] + under[x] - over[x])
            terms[2, x] = weight[row, x] * (wanted[x] - here[x])
        for block in range(across):
            xx = xy = yy = by_x = by_y = np.float32(0)
            for x in range(block * side, (block + 1) * side):
                xx += terms[0, x] * terms[0, x]
                xy += terms[0, x] * terms[1, x]
                yy += terms[1, x] * terms[1, x]
                by_x += terms[0, x] * terms[2, x]
                by_y += terms[1, x] * terms[2, x]
            own = sums[row // side, block]
            own[0], own[1], own[2], own[3], own[4] = own[0] + xx, own[1] + xy, own[2] + yy, own[3] + by_x, own[4] + by_y


def _eroded(mask: Single) -> Single:
    """The least of each pixel's mask and of its eight neighbours': where a gradient is of the picture alone."""
    return np.asarray(scipy.ndimage.minimum_filter(mask, 3))
