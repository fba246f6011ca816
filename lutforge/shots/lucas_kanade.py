"""Refinement of a registration below a tenth of a pixel: Gauss–Newton steps on scale and offset.

They minimize the squared difference of the two pictures' local structure (Lucas & Kanade 1981,
https://www.ijcai.org/Proceedings/81-2/Papers/017.pdf).
"""

import math

import numpy as np
import scipy

from lutforge.arrays import Array, Single
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
    y = np.arange(height, dtype=np.float32)[:, None] - (height - 1) / 2
    x = np.arange(width, dtype=np.float32)[None, :] - (width - 1) / 2
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
        gain = np.float32(product / (own + 1e-12))
        # gradient of the mean of both pictures: an unbiased, faster converging step (Benhimane & Malis 2004)
        gradient_y, gradient_x = np.gradient((moving + gain * target) / 2)
        inner = within if inside else _eroded(mask)
        columns = np.stack([gradient_x * x + gradient_y * y, gradient_x, gradient_y])
        flat = (columns * inner).reshape(3, -1)
        residual = ((gain * target - moving) * inner).ravel()
        try:
            step = np.linalg.solve(flat @ flat.T + 1e-9 * np.eye(3), flat @ residual).astype(np.float64)
        except np.linalg.LinAlgError:
            break
        if not np.all(np.isfinite(step)) or abs(step[0]) > 0.05 or np.abs(step[1:]).max() > 8:
            break
        found = _moved(found, step, height, width)
        if abs(step[0]) * width < 2e-3 and np.abs(step[1:]).max() < 2e-3:
            break
    return found


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
