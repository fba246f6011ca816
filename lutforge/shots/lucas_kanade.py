"""Refinement of a registration below a tenth of a pixel: Gauss–Newton steps on scale and offset.

They minimize the squared difference of the two pictures' local structure (Lucas & Kanade 1981,
https://www.ijcai.org/Proceedings/81-2/Papers/017.pdf).
"""

import math

import numpy as np
import scipy

from lutforge.arrays import Array, Single
from lutforge.compiled import REASSOCIATED, compiled
from lutforge.shots.area_means import on_jpeg_pixels
from lutforge.shots.local_structure import share, structure
from lutforge.shots.pyramid import ReducedJpeg
from lutforge.shots.shot import Registration


def moved_to_fit(raw_luma: Single, pixel_size: float, jpeg: ReducedJpeg, start: Registration) -> Registration:
    """Return the place near `start` where the structures of RAW and JPEG agree best; in the JPEG's coordinates.

    raw_luma: the luma that the camera would make of the RAW, (h, w); pixel_size: of its pixels.
    """
    weight = jpeg.weight
    height, width = weight.shape
    whole, within = share(weight), _eroded(weight)
    target = structure(jpeg.luma, weight, whole)
    found = start
    for _ in range(8):
        plane, cover = on_jpeg_pixels(raw_luma, pixel_size, found, (height, width))
        inside = bool(cover.all())
        mask = weight if inside else weight * cover
        moving = structure(plane, mask, whole if inside else share(mask))
        own = float(np.vdot(target * mask, target))
        product = float(np.vdot(moving * mask, target))
        norm = math.sqrt(float(np.vdot(moving * mask, moving)) * own) + 1e-12
        found = Registration(found.scale, found.offset_x, found.offset_y, product / norm)
        sums, gain = np.zeros((4, 4)), np.float32(product / (own + 1e-12))
        _add_products(moving, gain * target, within if inside else _eroded(mask), sums)
        normal = sums + np.triu(sums, 1).T + 1e-9 * np.eye(4)
        try:
            step = np.linalg.solve(normal[:3, :3], normal[:3, 3]).astype(np.float64)
        except np.linalg.LinAlgError:
            break
        if not np.all(np.isfinite(step)) or abs(step[0]) > 0.05 or np.abs(step[1:]).max() > 8:
            break
        found = _moved(found, step, height, width)
        if abs(step[0]) * width < 2e-3 and np.abs(step[1:]).max() < 2e-3:
            break
    return found


@compiled(fastmath=REASSOCIATED)
def _add_products(moving: Single, target: Single, weight: Single, sums: Array) -> None:
    """Add up the products (4, 4) of the changes by scale, by x and by y with each other and with what is to change.

    The gradient is of the mean of both pictures (h, w): an unbiased, faster converging step (Benhimane & Malis 2004,
    https://doi.org/10.1109/IROS.2004.1389474).
    """
    height, width = moving.shape
    terms = np.empty((4, width - 2), np.float32)
    y, middle, quarter = np.float32((1 - height) / 2), np.float32((width - 3) / 2), np.float32(0.25)
    for row in range(1, height - 1):
        y += np.float32(1)
        above, here, below = moving[row - 1], moving[row], moving[row + 1]
        over, wanted, under = target[row - 1], target[row], target[row + 1]
        for x in range(width - 2):
            share = weight[row, x + 1]
            by_x = quarter * share * (here[x + 2] - here[x] + wanted[x + 2] - wanted[x])
            by_y = quarter * share * (below[x + 1] - above[x + 1] + under[x + 1] - over[x + 1])
            terms[0, x] = by_x * (np.float32(x) - middle) + by_y * y
            terms[1, x], terms[2, x], terms[3, x] = by_x, by_y, share * (wanted[x + 1] - here[x + 1])
        for one in range(3):
            for other in range(one, 4):
                total = np.float32(0)
                for x in range(width - 2):
                    total += terms[one, x] * terms[other, x]
                sums[one, other] += total


def _eroded(mask: Single) -> Single:
    """The least of each pixel's mask and of its eight neighbours': where a gradient is of the picture alone."""
    return np.asarray(scipy.ndimage.minimum_filter(mask, 3))


def _moved(found: Registration, step: Array, height: int, width: int) -> Registration:
    """Apply a step (relative scale, x, y in JPEG pixels) taken about the JPEG's centre."""
    cx, cy = width / 2, height / 2
    scale = found.scale * (1 + float(step[0]))
    return Registration(
        scale,
        found.offset_x + found.scale * (cx + float(step[1])) - scale * cx,
        found.offset_y + found.scale * (cy + float(step[2])) - scale * cy,
        found.correlation,
    )
