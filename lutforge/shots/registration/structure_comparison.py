"""The structure of a JPEG compared with that of the RAW at its place: how much they agree, by what gain and noise."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy

from lutforge.arrays import Single
from lutforge.shots.geometry import Distortion, Registration
from lutforge.shots.registration.colour_prediction import predicted_luma
from lutforge.shots.registration.local_structure import DEVIATION, local_weight, structure
from lutforge.shots.registration.reduced_copies import RawLevel, ReducedJpeg, on_jpeg_pixels


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
class StraightRaw:
    """A plane (H, W) of the RAW as a picture without distortion, for registrations near the one that it was made for.

    pixel_size: a side of its pixels in full-resolution ones; corner: x and y of the plane's origin in the RAW.
    """

    plane: Single
    pixel_size: float
    corner: tuple[float, float]

    @classmethod
    def of(cls, planes: Planes, registration: Registration) -> "StraightRaw":
        """The RAW for registrations with the distortion of this one."""
        plane, local = planes.of_raw(registration)
        corner = registration.offset_x - local.offset_x, registration.offset_y - local.offset_y
        return cls(plane, planes.pixel_size, corner)

    def local(self, registration: Registration) -> Registration:
        """A registration on the RAW as one on this plane."""
        x, y = self.corner
        return Registration(registration.scale, registration.offset_x - x, registration.offset_y - y, 0.0)


@dataclass(frozen=True, eq=False)
class Target:
    """The structure of the JPEG (h, w), onto which that of the RAW is moved.

    weight: (h, w), of the pixels; neighbourhood: `local_weight` of it; gradient_weight: the weight where no pixel
    around is masked, so that a gradient can be computed.
    """

    structure: Single
    weight: Single
    neighbourhood: Single
    gradient_weight: Single

    @classmethod
    def of(cls, planes: Planes) -> "Target":
        """The target of a fit of these planes."""
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
class Comparison:
    """The structure of the RAW for a registration, `moving` (h, w), compared with the target.

    gradient_weight: as in `Target`, where the RAW covers the JPEG; correlation: of the two; gain: the factor by which
    the target is closest to the RAW; noise: the variance of their difference.
    """

    moving: Single
    gradient_weight: Single
    correlation: float
    gain: float
    noise: float


def compared(target: Target, raw: StraightRaw, registration: Registration) -> Comparison:
    """Compare the RAW with the target, for a registration in coordinates of the JPEG."""
    # The RAW's structure on the JPEG's pixels, where both have any.
    sampled, cover = on_jpeg_pixels(raw.plane, raw.pixel_size, raw.local(registration), target.shape)
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
    return Comparison(moving, gradient_weight, correlation, gain, noise)
